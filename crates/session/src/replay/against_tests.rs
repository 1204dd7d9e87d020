//! A recorded plant against the exciter's node, with nothing but calls between them.

use core::time::Duration;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::*;
use crate::run::{Mode, Session, Signals};
use resonarm_bench::node::{self, ExciterNode};
use resonarm_bench::rig::Load;
use resonarm_bus::{Bus, BusError, Filter, Received, Sent, Statistics};
use resonarm_files::recording::{Direction, FrameRecord, Options, Record, Recorder, Recording};
use resonarm_protocol::{ForceCommand, Frame, Message, Node, OperatorCommand, OperatorRequest, Transmitter};
use resonarm_realtime::Clock;
use resonarm_scenario::Scenario;

const SCENARIO: &str = "
    [excitation]
    amplitude = { exciter_x = 50.0 }
    profile = { waveform = 'dwell', frequency_hz = 15.0, duration_s = 0.4, settle_s = 0.1 }
";
const EXACT: Regression = Regression { speed: 0.0, limit_n: 0.0, limit_nm: 0.0, patience: Duration::from_secs(1) };

/// Time that passes by waiting alone.
#[derive(Clone, Default)]
struct Time(Arc<AtomicU64>);

impl Clock for Time {
    fn now_ns(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    fn sleep_until_ns(&self, deadline_ns: u64) {
        self.0.fetch_max(deadline_ns, Ordering::Relaxed);
    }
}

/// The end of a bus with a controller at the other, which answers at once.
struct Beside {
    exciter: ExciterNode,
    time: Time,
}

impl Beside {
    fn new(scenario: &str, time: &Time) -> Beside {
        let scenario = Scenario::parse(scenario, "test").unwrap();
        let (rate_hz, timing) = (scenario.wire_rate_hz().unwrap(), scenario.lockstep_timing().unwrap());
        let mut exciter = node::carry(scenario.network().unwrap(), rate_hz, timing, scenario.controller().unwrap());
        exciter.start(time.now_ns());
        Beside { exciter, time: time.clone() }
    }
}

impl Bus for Beside {
    fn name(&self) -> String {
        String::from("beside")
    }

    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        self.exciter.handle_frame(self.time.now_ns(), frame);
        Ok(Sent::Queued)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        Ok(self.exciter.poll_transmit().map(|frame| Received { frame, timestamp_ns: None }))
    }

    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError> {
        self.time.sleep_until_ns(self.time.now_ns() + timeout.as_nanos() as u64);
        self.exciter.handle_deadline(self.time.now_ns());
        Ok(self.exciter.next_frame().is_some())
    }

    fn set_filters(&mut self, _filters: &[Filter]) -> Result<(), BusError> {
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        Statistics::default()
    }

    fn close(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

fn record(path: &Path) -> Recording {
    let scenario = Scenario::parse(SCENARIO, "test").unwrap();
    let recorder =
        Recorder::create(path, &scenario.configuration("free").unwrap(), Options::virtual_time(1e-3, "none")).unwrap();
    let options = crate::run::Options { end_on_disarm: true, ..Default::default() };
    let session = Session::new(scenario, Mode::Free, options).unwrap();
    session.free(Some(recorder), &Signals::default(), &mut |_| {}).unwrap();
    Recording::open(path).unwrap()
}

/// Returns the result of the test of `scenario`'s controller, and the number of frames that the plant has sent.
fn tested(scenario: &str, regression: Regression) -> (Compared, u64) {
    let folder = tempfile::tempdir().unwrap();
    let recording = record(&folder.path().join("run.mcap"));
    let time = Time::default();
    let mut bus = Beside::new(scenario, &time);
    let compared = play_against(&recording, &mut bus, &time, regression, &Signals::default()).unwrap();
    let frames = recording.frames().unwrap().map(Result::unwrap);
    (compared, frames.filter(|frame| frame.direction == Direction::Sent).count() as u64)
}

fn said(compared: &Compared) -> String {
    let Difference { sample, kind } = compared.first_difference.as_ref().unwrap();
    format!("{sample}: {kind}")
}

#[test]
fn the_same_controller_passes() {
    let (compared, frames) = tested(SCENARIO, EXACT);
    // A command for each sample of 0.4 s at 1 kHz.
    assert_eq!(compared, Compared { frames, commands: 400, ..Compared::default() });
}

#[test]
fn an_amplitude_that_is_off_is_reported_with_its_sample_and_passes_within_limits() {
    let other = SCENARIO.replace("50.0", "51.0");
    let (compared, _) = tested(&other, EXACT);
    insta::assert_snapshot!(said(&compared), @"1: the controller commands exciter_x = 4.8 N; the recorded command is exciter_x = 4.7 N");
    assert_eq!(compared.commands, 400);
    // The amplitudes are 1 N apart, and the samples of the sine and the counts of the frames take a little of it.
    assert!((0.9..=1.0).contains(&compared.largest_force_difference_n), "{compared:?}");
    let within = Regression { limit_n: compared.largest_force_difference_n, ..EXACT };
    assert_eq!(tested(&other, within).0.first_difference, None);
    let beyond = Regression { limit_n: compared.largest_force_difference_n - 0.01, ..EXACT };
    assert!(matches!(tested(&other, beyond).0.first_difference.unwrap().kind, DifferenceKind::Command { .. }));
}

#[test]
fn a_controller_that_ends_early_or_late_is_reported() {
    let (compared, _) = tested(&SCENARIO.replace("duration_s = 0.4", "duration_s = 0.2"), EXACT);
    insta::assert_snapshot!(said(&compared), @"200: the controller does not answer the sample; the recorded one did");
    let (compared, _) = tested(&SCENARIO.replace("duration_s = 0.4", "duration_s = 0.6"), EXACT);
    insta::assert_snapshot!(said(&compared), @"400: the controller faults: exciter, code 2: no sensor data in time, at sample 400; the recorded one continues with: disarm");
}

#[test]
fn a_controller_that_faults_is_reported() {
    // It expects other samples a second than the plant says hello with.
    let (compared, _) = tested(&format!("{SCENARIO}\n[simulation]\nrate_hz = 500.0"), EXACT);
    insta::assert_snapshot!(said(&compared), @"0: the controller faults: exciter, code 5: the partner is incompatible (another sample rate), at sample 0; the recorded one continues with: arm");
}

/// A bus on which all that a controller ever says is there at once.
struct Said(std::collections::VecDeque<Frame>, Time);

impl Bus for Said {
    fn name(&self) -> String {
        String::from("said")
    }

    fn send(&mut self, _frame: &Frame) -> Result<Sent, BusError> {
        Ok(Sent::Queued)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        Ok(self.0.pop_front().map(|frame| Received { frame, timestamp_ns: None }))
    }

    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError> {
        self.1.sleep_until_ns(self.1.now_ns() + timeout.as_nanos() as u64);
        Ok(!self.0.is_empty())
    }

    fn set_filters(&mut self, _filters: &[Filter]) -> Result<(), BusError> {
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        Statistics::default()
    }

    fn close(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

/// What becomes of a controller that asks for `live`, all of it before it is looked at, where `recorded` was asked for
/// and then a sample answered.
fn asked(recorded: &[OperatorRequest], live: &[OperatorRequest]) -> Compared {
    let network = Scenario::parse(SCENARIO, "test").unwrap().network().unwrap();
    let frames = |requests: &[OperatorRequest]| {
        let mut transmitter = Transmitter::new(network);
        let request =
            |request: &OperatorRequest| Message::Operator(OperatorCommand { request: *request, target: Node::Plant });
        let answer = Message::Force(ForceCommand { force_x_n: 1.0, force_y_n: 0.0, sample: 0 });
        let messages: Vec<_> = requests.iter().map(request).chain([answer]).collect();
        messages.iter().map(|message| transmitter.frame(message).unwrap()).collect::<Vec<_>>()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let configuration = Scenario::parse(SCENARIO, "test").unwrap().configuration("free").unwrap();
    let recorder = Recorder::create(&path, &configuration, Options::virtual_time(1e-3, "none")).unwrap();
    let mut channel = recorder.channel("plant", 64).unwrap();
    for frame in frames(recorded) {
        let (direction, bus_timestamp_ns) = (Direction::Received, None);
        let record = FrameRecord { sample: 0, direction, time_ns: 0, bus_timestamp_ns, frame };
        channel.push_blocking(&Record::Frame(record)).unwrap();
    }
    recorder.finish(&[]).unwrap();
    let time = Time::default();
    let mut bus = Said(frames(live).into(), time.clone());
    play_against(&Recording::open(&path).unwrap(), &mut bus, &time, EXACT, &Signals::default()).unwrap()
}

#[test]
fn requests_that_come_together_count_one_by_one() {
    use OperatorRequest::{Arm, Disarm, Reset};
    let passed = Compared { commands: 1, ..Compared::default() };
    assert_eq!(asked(&[Reset, Arm], &[Reset, Arm]), passed);
    assert_eq!(asked(&[Arm, Disarm, Reset, Arm], &[Arm, Disarm, Reset, Arm]), passed);
    // Repeated as long as the plant has not done it: how often depends on the bus.
    assert_eq!(asked(&[Reset, Reset, Arm, Arm], &[Reset, Arm]), passed);
    assert_eq!(asked(&[Reset, Arm], &[Reset, Reset, Arm, Arm, Arm]), passed);
    insta::assert_snapshot!(said(&asked(&[Reset, Arm], &[Arm])), @"0: the controller does not ask the plant to reset; the recorded one did");
    insta::assert_snapshot!(said(&asked(&[Reset, Arm], &[Arm, Reset])), @"0: the controller does not ask the plant to arm; the recorded one did");
}

/// The load was printed in the form of Rust's debugging.
#[test]
fn a_missing_command_is_told_with_its_load() {
    let missing = DifferenceKind::NoCommand { expected: Load::force_n(3.0, 0.0) };
    insta::assert_snapshot!(missing, @"the controller sends no further command; the recorded command is exciter_x = 3 N");
}
