//! Drives as a master sees them, in virtual time.

mod exciter;
mod faults;
mod hostile;
mod lockstep;
mod masters;
mod torques;

use super::*;
use crate::node::NodeEvent;
use crate::rig::Measurement;
use resonarm_protocol::FrameFormat;
use resonarm_protocol::Id;

const RATE_HZ: u16 = 1000;
const TICK_NS: u64 = 1_000_000;
const TIMEOUT_NS: u64 = 50 * TICK_NS;
const NODES: [u8; 2] = [1, 2];

/// 1 N·m at the motor is 100 N·m at the joint: a target of 10 is 1 N·m.
fn spec(drives: usize) -> Cia402Spec {
    let drive = |(node_id, joint)| DriveSpec {
        node_id,
        joint,
        gear_ratio: 100.0,
        rated_torque_mnm: 1000,
        encoder_counts_per_turn: 65536,
    };
    let all = [(1, 0), (2, 1)];
    Cia402Spec { drives: all.into_iter().take(drives).map(drive).collect(), timeout_ns: TIMEOUT_NS }
}

struct Bench {
    node: Cia402Node,
    now_ns: u64,
    sample: u64,
    states: Vec<f64>,
    events: Vec<NodeEvent>,
    load: Load,
    /// Frames that the bus has taken, until they are looked at.
    taken: Vec<Frame>,
    is_jammed: bool,
}

impl Bench {
    fn new(drives: usize, time_base: TimeBase) -> Bench {
        Bench::of(&spec(drives), time_base)
    }

    fn of(spec: &Cia402Spec, time_base: TimeBase) -> Bench {
        let timing = match time_base {
            TimeBase::Clock => Timing::real_time(RATE_HZ),
            TimeBase::Lockstep => Timing::lockstep(1_000_000_000),
        };
        let (exciter, limits) = (Exciter::default(), GateSpec::default());
        let mut node = Cia402Node::new(spec, (RATE_HZ, time_base), timing, exciter, limits);
        node.start(0);
        let (states, events) = (alloc::vec![0.0; 4], Vec::new());
        let mut bench = Bench {
            node,
            now_ns: 0,
            sample: 0,
            states,
            events,
            load: Load::default(),
            taken: Vec::new(),
            is_jammed: false,
        };
        bench.frames();
        bench
    }

    /// Makes a tick as the loop in real time does: what came acts, the plant advances, the next sample is published.
    fn tick(&mut self) {
        self.now_ns += TICK_NS;
        self.node.handle_deadline(self.now_ns);
        self.load = self.node.load();
        self.publish();
    }

    fn publish(&mut self) {
        self.sample += 1;
        let measurement = Measurement { sample: self.sample, ..Measurement::default() };
        let sample = PublishedSample {
            measurement: &measurement,
            states: &States::new(&self.states, &[]).unwrap(),
            travel_m: None,
        };
        self.node.publish(&sample).unwrap();
        self.events.extend(core::iter::from_fn(|| self.node.poll_event()));
        self.transmit();
    }

    fn transmit(&mut self) {
        if self.is_jammed {
            return;
        }
        let mut frames = Vec::new();
        self.node.waiting_frames(100, &mut frames);
        frames.iter().for_each(|_| self.node.frame_sent());
        self.taken.append(&mut frames);
    }

    fn torques_nm(&self) -> [f64; 2] {
        [self.load.torque_nm[0], self.load.torque_nm[1]]
    }

    fn send(&mut self, id: u16, data: &[u8]) {
        self.node.handle_frame(self.now_ns, &Frame::classic(Id::Standard(id), data).unwrap());
    }

    fn frames(&mut self) -> Vec<Frame> {
        self.transmit();
        core::mem::take(&mut self.taken)
    }

    fn sent(&mut self) -> Vec<alloc::string::String> {
        self.frames().iter().map(alloc::string::ToString::to_string).collect()
    }

    /// Writes expedited; the abort code if it is rejected.
    fn write(&mut self, node: u8, index: u16, bytes: &[u8]) -> Result<(), u32> {
        let [low, high] = index.to_le_bytes();
        let mut request = [0x23 | ((4 - bytes.len()) as u8) << 2, low, high, 0, 0, 0, 0, 0];
        // An expedited download states in bits 2 and 3 how many of its four bytes are empty.
        request[4..4 + bytes.len()].copy_from_slice(bytes);
        let answer = self.sdo(node, request);
        if answer[0] == 0x60 { Ok(()) } else { Err(number(&answer)) }
    }

    fn read(&mut self, node: u8, index: u16) -> u32 {
        let [low, high] = index.to_le_bytes();
        number(&self.sdo(node, [0x40, low, high, 0, 0, 0, 0, 0]))
    }

    fn sdo(&mut self, node: u8, request: [u8; 8]) -> Vec<u8> {
        self.send(0x600 + u16::from(node), &request);
        let id = Id::Standard(0x580 + u16::from(node));
        self.frames().iter().find(|frame| frame.id() == id).unwrap().data().to_vec()
    }

    fn statusword(&mut self, node: u8) -> u16 {
        self.read(node, 0x6041) as u16
    }

    fn control(&mut self, node: u8, controlword: u16) {
        self.write(node, 0x6040, &controlword.to_le_bytes()).unwrap();
    }

    /// Starts the nodes, and enables those of `nodes`.
    fn enable(&mut self, nodes: &[u8]) {
        self.send(0, &[1, 0]);
        for node in nodes {
            self.write(*node, 0x6060, &[10]).unwrap();
            [0x06, 0x07, 0x0F].iter().for_each(|controlword| self.control(*node, *controlword));
            assert_eq!(self.statusword(*node) & 0x6F, 0x27);
        }
        assert_eq!(self.node.state(), NodeState::Operational);
    }

    /// Controlword and target by RPDO 1.
    fn command(&mut self, node: u8, controlword: u16, target: i16) {
        let ([a, b], [c, d]) = (controlword.to_le_bytes(), target.to_le_bytes());
        self.send(0x200 + u16::from(node), &[a, b, c, d]);
    }

    fn target(&mut self, node: u8, target: i16) {
        self.command(node, 0x0F, target);
    }
}

fn number(answer: &[u8]) -> u32 {
    u32::from_le_bytes(answer[4..8].try_into().unwrap())
}
