//! A controller in Rust: a sine of force at the tip for some seconds, in answer to the plant's samples.
//!
//! `cargo run --release --manifest-path rust/Cargo.toml -- vcan0`
//!
//! `Sine::answer` is what to change. The node of the crate arms the plant, keeps the deadlines and disarms; `main`
//! passes it frames and the time, here by SocketCAN, on a microcontroller by its CAN peripheral.

use std::convert::Infallible;
use std::error::Error;
use std::f64::consts::TAU;
use std::io::ErrorKind;
use std::time::{Duration, Instant};

use resonarm_protocol::node::{Answer, Answering, ExciterNode, ExciterOutcome, Timing};
use resonarm_protocol::{Capabilities, Frame, Id, Network, Node, SamplesPerFrame, SensorValues, timing};
use socketcan::{CanFrame, CanSocket, EmbeddedFrame, Socket, StandardId};

const RATE_HZ: u16 = 1000;
const FREQUENCY_HZ: f64 = 14.0;
const AMPLITUDE_N: f64 = 20.0;
const RAMP_S: f64 = 0.5;
const LENGTH_S: f64 = 3.0;
const PATIENCE_S: u64 = 30;

/// What answers the samples.
struct Sine {
    /// The tip's largest acceleration along x so far.
    largest_m_s2: f64,
}

impl Answering for Sine {
    type Abort = Infallible;

    fn restart(&mut self) {
        self.largest_m_s2 = 0.0;
    }

    fn answer(&mut self, sample: u64, values: &SensorValues) -> Answer<Infallible> {
        self.largest_m_s2 = self.largest_m_s2.max(values.acceleration_c_m_s2[0].value.abs());
        let t_s = sample as f64 / f64::from(RATE_HZ);
        if t_s >= LENGTH_S {
            return Answer::Finished;
        }
        // It grows at the beginning and falls at the end, so that nothing jumps.
        let ramp = t_s.min(LENGTH_S - t_s).min(RAMP_S) / RAMP_S;
        Answer::HoldForce { force_x_n: AMPLITUDE_N * ramp * (TAU * FREQUENCY_HZ * t_s).sin(), force_y_n: 0.0 }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let socket = CanSocket::open(&std::env::args().nth(1).unwrap_or_else(|| String::from("vcan0")))?;
    let capabilities = Capabilities {
        node: Node::Exciter,
        samples_per_frame: SamplesPerFrame::One,
        force_limit_n: AMPLITUDE_N,
        torque_limit_nm: 0.0,
    };
    let timing = Timing::lockstep(timing::LOCKSTEP_TIMEOUT_NS);
    let sine = Sine { largest_m_s2: 0.0 };
    let mut node = ExciterNode::new(Network::default(), RATE_HZ, timing, capabilities, sine);
    let start = Instant::now();
    let now_ns = || start.elapsed().as_nanos() as u64;
    node.start(0);
    while !node.is_quiet() {
        send(&socket, &mut node)?;
        let wait = Duration::from_nanos(node.next_deadline_ns().saturating_sub(now_ns()));
        match socket.read_frame_timeout(wait.clamp(Duration::from_millis(1), Duration::from_millis(20))) {
            Ok(frame) => {
                if let Some(frame) = received(&frame) {
                    node.handle_frame(now_ns(), &frame);
                }
                continue;
            }
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {}
            Err(error) => return Err(error.into()),
        }
        node.handle_deadline(now_ns());
        if node.outcome().is_some() {
            node.leave(now_ns());
        } else if node.samples_played() == 0 && start.elapsed() > Duration::from_secs(PATIENCE_S) {
            return Err("no plant was armed in time".into());
        }
    }
    match node.outcome() {
        Some(ExciterOutcome::Finished) => {
            println!("the tip's largest acceleration along x: {:.3} m/s²", node.controller().largest_m_s2);
            Ok(())
        }
        outcome => Err(format!("the run did not finish: {outcome:?}").into()),
    }
}

/// A frame that can be one of the protocol's, of its classic profile.
fn received(frame: &CanFrame) -> Option<Frame> {
    let socketcan::Id::Standard(id) = frame.id() else { return None };
    Frame::classic(Id::Standard(id.as_raw()), frame.data()).ok()
}

/// Sends the frames that wait.
fn send(socket: &CanSocket, node: &mut ExciterNode<Sine>) -> Result<(), Box<dyn Error>> {
    while let Some(frame) = node.next_frame() {
        let Id::Standard(id) = frame.id() else { return Err("the network has extended identifiers".into()) };
        let frame = StandardId::new(id).and_then(|id| CanFrame::new(id, frame.data()));
        socket.write_frame_insist(&frame.ok_or("a frame of more than 8 bytes")?)?;
        node.frame_sent();
    }
    Ok(())
}
