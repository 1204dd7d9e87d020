//! A custom controller: it answers the plant's samples on a memory bus with a force against the velocity at the
//! tip, which it integrates from the accelerometer, and so damps a free vibration.
//!
//! `cargo run --example controller` prints how far the vibration has died away with it and without it. With
//! `bus::open(…)` in place of the memory bus the same controller works with `resonarm run --mode lockstep` in another
//! process.

use std::error::Error;
use std::io::Write;
use std::thread;

use resonarm::bus::{Bus, memory};
use resonarm::protocol::{
    ForceCommand, Hello, Message, Network, Node, NodeState, OperatorCommand, OperatorRequest, Profile, Receiver,
    Transmitter,
};
use resonarm::run::{Mode, Options, Session, Signals};
use resonarm::scenario::Scenario;

const RATE_HZ: u16 = 1000;
const DURATION_S: f64 = 2.0;

fn main() -> Result<(), Box<dyn Error>> {
    let [without, with] = [vibration_rad(0.0)?, vibration_rad(400.0)?];
    writeln!(
        std::io::stdout(),
        "after {DURATION_S} s: {without:.2e} rad/s without, {with:.2e} rad/s with the controller"
    )?;
    if with < 0.5 * without { Ok(()) } else { Err("the controller did not damp the vibration".into()) }
}

/// The largest angular velocity left after a run with a controller of this gain, N per m/s.
fn vibration_rad(gain_n_s_m: f64) -> Result<f64, Box<dyn Error>> {
    let text = format!("structure = {{ initial = [1e-4, 0, 0, 0] }}\nsimulation = {{ duration_s = {DURATION_S} }}");
    let scenario = Scenario::parse(&text, "example")?;
    let [mut near, mut far] = memory::pair(1024);
    thread::scope(|scope| {
        let controller = scope.spawn(move || control(&mut far, gain_n_s_m).map_err(|error| error.to_string()));
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("run.mcap");
        let record =
            Some(resonarm::run::RecordTo { path: path.clone(), existing: resonarm::recording::Existing::Refuse });
        let session = Session::new(scenario, Mode::Lockstep, Options { record, ..Options::default() })?;
        let report = session.plant(&mut near, &Signals::default(), &mut |_event| {})?;
        controller.join().map_err(|_panic| "the controller panicked")??;
        assert_eq!(report.bus.refused, 0);
        let recording = resonarm::recording::Recording::open(&path)?;
        let states: Vec<_> = recording.states()?.collect::<Result<_, _>>()?;
        // The last 0.2 s: more than four periods of the slowest mode, so that a zero of the sine is not taken for the
        // end.
        let last = &states[states.len() - 200..];
        Ok(last.iter().map(|state| state.states.rates()[0].abs()).fold(0.0, f64::max))
    })
}

/// Arms the plant, answers every sample, and ends when the plant leaves.
fn control(bus: &mut dyn Bus, gain_n_s_m: f64) -> Result<(), Box<dyn Error>> {
    let (mut transmitter, mut receiver) = (Transmitter::new(Network::default()), Receiver::new(Network::default()));
    let arm = OperatorCommand { request: OperatorRequest::Arm, target: Node::Plant };
    let mut velocity_m_s = [0.0; 2];
    loop {
        bus.wait(core::time::Duration::from_secs(1))?;
        while let Some(received) = bus.receive()? {
            match receiver.accept(&received.frame)? {
                // The plant is there: it must know the exciter that arms it.
                Some(Message::PlantHello(_)) => {
                    bus.send(&transmitter.frame(&Message::ExciterHello(Hello::new(Profile::Classic, RATE_HZ)))?)?;
                    bus.send(&transmitter.frame(&Message::Operator(arm))?)?;
                }
                // The last message of a sample: answer it.
                Some(Message::AccelerometerC(c)) => {
                    // Forgets with a time constant of 0.2 s, some four periods of the vibration that it is to see.
                    let leak = 1.0 - 5.0 / f64::from(RATE_HZ); // no drift by an offset
                    for (velocity, acceleration) in
                        velocity_m_s.iter_mut().zip([c.acceleration_x_m_s2, c.acceleration_y_m_s2])
                    {
                        *velocity = leak * *velocity + acceleration / f64::from(RATE_HZ);
                    }
                    let [force_x_n, force_y_n] = velocity_m_s.map(|velocity| -gain_n_s_m * velocity);
                    let command = ForceCommand { force_x_n, force_y_n, sample: c.sample };
                    bus.send(&transmitter.frame(&Message::Force(command))?)?;
                }
                Some(Message::Emergency(_)) => return Ok(()),
                Some(Message::Heartbeat(heartbeat)) if heartbeat.state == NodeState::Fault => return Ok(()),
                _ => {}
            }
        }
    }
}
