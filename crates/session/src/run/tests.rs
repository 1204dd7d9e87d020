//! The run loops on a scripted clock, with the exciter's node at the other end of the bus: nothing depends on the
//! machine.

use core::time::Duration;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::ending::Ending;
use super::lockstep::lockstep;
use super::real_time::real_time;
use super::*;
use resonarm_bench::node::{self, ExciterNode, ExciterOutcome};
use resonarm_bus::{Bus, BusError, Filter, Received, Sent, Statistics, memory};
use resonarm_files::recording::{Existing, Record, Recording};
use resonarm_protocol::{EmergencyCode, Frame};
use resonarm_realtime::{Clock, OverrunPolicy, SampleRate, Spin};
use resonarm_scenario::Scenario;

mod both_ends;
mod flooded_bus;
mod jammed_bus;
mod lost_bus;
mod mistakes;
mod network;
mod not_begun;
mod other_loads;
mod other_sensors;
mod watched;

use jammed_bus::JammedBus;

const MS: u64 = 1_000_000;

const SCENARIO: &str = "
    structure = { angles_deg = [0.0, 60.0] }
    simulation = { seed = 3 }
    [excitation]
    amplitude = { exciter_x = 40.0 }
    ramp_s = 0.2
    profile = { waveform = 'stepped-sine', from_hz = 18, to_hz = 20, steps = 3, dwell_s = 0.5, settle_s = 0.1 }
";

fn scenario() -> Scenario {
    Scenario::parse(SCENARIO, "test").unwrap()
}

/// Time passes only by sleeping, by waiting for the bus, and by stalls: at or after `at_ns` the next look at the clock
/// finds it `for_ns` later.
#[derive(Clone, Debug, Default)]
struct ScriptedClock {
    now_ns: Arc<AtomicU64>,
    stall: Arc<[AtomicU64; 2]>,
}

impl ScriptedClock {
    fn stall(&self, at_ns: u64, for_ns: u64) {
        self.stall[0].store(at_ns, Ordering::Relaxed);
        self.stall[1].store(for_ns, Ordering::Relaxed);
    }

    fn pass(&self, ns: u64) {
        self.now_ns.fetch_add(ns, Ordering::Relaxed);
    }
}

impl Clock for ScriptedClock {
    fn now_ns(&self) -> u64 {
        let now_ns = self.now_ns.load(Ordering::Relaxed);
        let for_ns = self.stall[1].load(Ordering::Relaxed);
        if for_ns > 0 && now_ns >= self.stall[0].load(Ordering::Relaxed) {
            self.stall[1].store(0, Ordering::Relaxed);
            self.pass(for_ns);
        }
        self.now_ns.load(Ordering::Relaxed)
    }

    fn sleep_until_ns(&self, deadline_ns: u64) {
        let left_ns = deadline_ns.saturating_sub(self.now_ns.load(Ordering::Relaxed));
        self.pass(left_ns);
    }
}

fn down(interface: String) -> BusError {
    BusError::InterfaceDown { interface }
}

/// A bus with an exciter's node at its other end, down for a while if asked to be.
struct NodeBus {
    exciter: ExciterNode,
    clock: ScriptedClock,
    down_ns: core::ops::Range<u64>,
    /// How it is down.
    loss: fn(String) -> BusError,
    statistics: Statistics,
    /// What the plant sent.
    heard: Vec<Frame>,
}

impl NodeBus {
    fn new(scenario: &Scenario, mode: Mode, clock: &ScriptedClock) -> NodeBus {
        let timing = match mode {
            Mode::RealTime => scenario.real_time_timing().unwrap(),
            Mode::Lockstep | Mode::Free => scenario.lockstep_timing().unwrap(),
        };
        let (network, rate_hz) = (scenario.network().unwrap(), scenario.wire_rate_hz().unwrap());
        let mut exciter = node::carry(network, rate_hz, timing, scenario.controller().unwrap());
        exciter.start(clock.now_ns());
        let statistics = Statistics::default();
        NodeBus { exciter, clock: clock.clone(), down_ns: 0..0, loss: down, statistics, heard: Vec::new() }
    }

    fn check(&self) -> Result<(), BusError> {
        let down = self.down_ns.contains(&self.clock.now_ns());
        if down { Err((self.loss)(String::from("can0"))) } else { Ok(()) }
    }
}

impl Bus for NodeBus {
    fn name(&self) -> String {
        String::from("node")
    }

    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        self.check()?;
        self.heard.push(*frame);
        self.statistics.sent += 1;
        self.exciter.handle_frame(self.clock.now_ns(), frame);
        Ok(Sent::Queued)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        self.check()?;
        self.exciter.handle_deadline(self.clock.now_ns());
        let frame = self.exciter.poll_transmit();
        self.statistics.received += u64::from(frame.is_some());
        Ok(frame.map(|frame| Received { frame, timestamp_ns: None }))
    }

    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError> {
        let ready = self.exciter.next_frame().is_some();
        if !ready {
            self.clock.pass(u64::try_from(timeout.as_nanos()).unwrap().max(1000));
        }
        Ok(ready)
    }

    fn set_filters(&mut self, _filters: &[Filter]) -> Result<(), BusError> {
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        self.statistics
    }

    fn close(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

/// One run on a scripted clock, and everything to look at afterwards.
struct Rig {
    scenario: Scenario,
    clock: ScriptedClock,
    overrun: OverrunPolicy,
    speed: Speed,
    ending: Ending,
    down_ns: core::ops::Range<u64>,
    loss: fn(String) -> BusError,
}

struct Ran {
    report: PlantReport,
    exciter: ExciterNode,
    events: Vec<RunEvent>,
    recording: Recording,
    _folder: tempfile::TempDir,
    /// When it ended on the clock, ns.
    ended_ns: u64,
}

impl Rig {
    fn new() -> Rig {
        let ending = Ending { on_disarm: true, ..Ending::default() };
        let (clock, overrun, speed) = (ScriptedClock::default(), OverrunPolicy::default(), Speed::UNPACED);
        Rig { scenario: scenario(), clock, overrun, speed, ending, down_ns: 0..0, loss: down }
    }

    fn run(self, mode: Mode, signals: &Signals) -> Ran {
        let folder = tempfile::tempdir().unwrap();
        let Rig { scenario, clock, overrun, speed, ending, down_ns, loss } = self;
        let path = folder.path().join("run.mcap");
        let record = Some(RecordTo { path: path.clone(), existing: Existing::Refuse });
        let session = Session::new(scenario.clone(), mode, Options { record, ..Options::default() }).unwrap();
        let recorder = session.recorder("node").unwrap();
        let mut bus = NodeBus::new(&scenario, mode, &clock);
        (bus.down_ns, bus.loss) = (down_ns, loss);
        let mut events = Vec::new();
        let mut on_event = |event| events.push(event);
        let mut bench = session.bench(recorder.as_ref(), &mut on_event).unwrap();
        let rate = SampleRate::new(scenario.simulation.rate_hz).unwrap();
        let report = match mode {
            Mode::RealTime => real_time(
                &mut bench,
                &mut bus,
                &clock,
                (rate, overrun, Spin::Off),
                ending,
                (signals, &mut |_overrun| {}),
            ),
            Mode::Lockstep | Mode::Free => {
                lockstep(&mut bench, &mut bus, &clock, (rate, speed), (ending, None), signals).map_err(RunError::from)
            }
        };
        drop(bench);
        recorder.map(|recorder| recorder.finish(&[]).unwrap());
        let (exciter, ended_ns) = (bus.exciter, clock.now_ns());
        let recording = Recording::open(&path).unwrap();
        Ran { report: report.unwrap(), exciter, events, recording, _folder: folder, ended_ns }
    }
}

/// Every state and the load held from there on, as bits.
fn states_of(recording: &Recording) -> Vec<Vec<u64>> {
    let bits = |record: resonarm_files::recording::StateRecord| {
        let numbers = record.states.moving().iter().copied().chain(record.load.native_parts());
        numbers.map(f64::to_bits).collect()
    };
    recording.states().unwrap().map(|record| bits(record.unwrap())).collect()
}

impl Ran {
    fn states(&self) -> Vec<Vec<u64>> {
        states_of(&self.recording)
    }

    fn faults(&self) -> Vec<u16> {
        let code = |event: &RunEvent| match event {
            RunEvent::Faulted { fault, .. } => Some(fault.code),
            _ => None,
        };
        self.events.iter().filter_map(code).collect()
    }
}

#[test]
fn all_loops_give_the_same_states() {
    let lockstep = Rig::new().run(Mode::Lockstep, &Signals::default());
    let real_time = Rig::new().run(Mode::RealTime, &Signals::default());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("free.mcap");
    let record = Some(RecordTo { path: path.clone(), existing: Existing::Refuse });
    let session = Session::new(scenario(), Mode::Free, Options { record, ..Options::default() }).unwrap();
    let free = session.both(&Signals::default(), &mut |_| {}).unwrap();
    assert_eq!(free.exciter.outcome, Some(ExciterOutcome::Finished));
    assert_eq!(lockstep.exciter.outcome(), Some(ExciterOutcome::Finished));
    assert_eq!((free.plant.outcome, lockstep.report.outcome), (PlantOutcome::Disarmed, PlantOutcome::Disarmed));
    assert_eq!((free.plant.samples, free.plant.steps), (lockstep.report.samples, lockstep.report.steps));
    // One for each of the three frequencies.
    assert_eq!(free.exciter.responses.len(), 3);
    let states = lockstep.states();
    assert_eq!(states.len() as u64, lockstep.report.samples);
    // Two steps a sample, by default, and none from the last sample on.
    assert_eq!(lockstep.report.steps, (lockstep.report.samples - 1) * 2);
    assert!(states_of(&Recording::open(&path).unwrap()) == states);
    // In real time the plant is armed some samples later, and moves in the same way from there.
    // Eight zeros are four angles and rates, and four loads: the arm at rest.
    let moving = |states: &[Vec<u64>]| states.iter().skip_while(|state| **state == [0; 8]).cloned().collect::<Vec<_>>();
    let (late, prompt) = (moving(&real_time.states()), moving(&states));
    assert_eq!(late.iter().zip(&prompt).position(|(one, other)| one != other), None);
    // There the disarm is taken in with the sample after, so that there is one more at rest.
    assert_eq!(late.len(), prompt.len() + 1);
    // Three dwells of half a second at 1 kHz.
    assert!(moving(&states).len() > 1500);
}

#[test]
fn both_ends_on_a_memory_bus_give_those_states_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("both.mcap");
    let record = Some(RecordTo { path: path.clone(), existing: Existing::Refuse });
    let session = Session::new(scenario(), Mode::Lockstep, Options { record, ..Options::default() }).unwrap();
    let report = session.both(&Signals::default(), &mut |_| {}).unwrap();
    assert_eq!(report.exciter.outcome, Some(ExciterOutcome::Finished));
    assert_eq!((report.plant.outcome, report.plant.bus.refused), (PlantOutcome::Disarmed, 0));
    let expected = Rig::new().run(Mode::Lockstep, &Signals::default());
    assert!(states_of(&Recording::open(&path).unwrap()) == expected.states());
}

#[test]
fn pacing_holds_simulated_time_to_the_clock_and_changes_no_state() {
    let unpaced = Rig::new().run(Mode::Lockstep, &Signals::default());
    assert_eq!(unpaced.report.pacing, None);
    for times in [1.0, 4.0] {
        let speed = Speed::new(times).unwrap();
        let paced = Rig { speed, ..Rig::new() }.run(Mode::Lockstep, &Signals::default());
        assert!(paced.states() == unpaced.states());
        let simulated_s = (paced.report.samples - 1) as f64 * 1e-3;
        let took_s = paced.ended_ns as f64 * 1e-9;
        assert!((took_s - simulated_s / times).abs() < 0.1 / times, "{took_s} s for {simulated_s} s at {times}");
        let pacing = paced.report.pacing.unwrap();
        assert!((pacing.speed, pacing.lag_s) == (times, 0.0) && pacing.longest_lag_s < 1e-3, "{pacing:?}");
    }
}

#[test]
fn a_stall_in_paced_lockstep_is_a_lag_and_changes_no_state() {
    let undisturbed = Rig::new().run(Mode::Lockstep, &Signals::default());
    let rig = Rig { speed: Speed::ACTUAL, ..Rig::new() };
    rig.clock.stall(500 * MS, 300 * MS);
    let stalled = rig.run(Mode::Lockstep, &Signals::default());
    assert!(stalled.states() == undisturbed.states());
    assert!(stalled.faults().is_empty());
    let pacing = stalled.report.pacing.unwrap();
    // The stall, up to a few sample periods, and nothing of it at the end: the run has caught up.
    assert!((0.29..0.31).contains(&pacing.longest_lag_s) && pacing.lag_s < 1e-3, "{pacing:?}");
    assert!(stalled.report.wakeup_us.unwrap().max > 290e3);
}

#[test]
fn a_speed_at_which_the_ends_would_lose_each_other_is_refused() {
    let refuse = |mode, times| {
        let options = Options { speed: Speed::new(times).unwrap(), ..Options::default() };
        Session::new(scenario(), mode, options).unwrap_err().to_string()
    };
    insta::assert_snapshot!(refuse(Mode::Lockstep, 1e-12), @"the speed is 1e-12: a sample would take 1000000000.000 s, but may take at most half of `network.lockstep_timeout_s` (1 s), or each end considers the other lost; the speed must be at least 2.0e-3");
    insta::assert_snapshot!(refuse(Mode::RealTime, 1.0), @"the speed is 1, but a run in real time has the speed of the clock; use the mode lockstep or free");
    insta::assert_snapshot!(Speed::new(f64::NAN).unwrap_err(), @"the speed is NaN: it must be a positive number of simulated seconds a second, or 0 for as fast as possible");
    assert!(Speed::new(-1.0).is_err() && Speed::new(f64::INFINITY).is_err());
}

#[test]
fn a_stall_of_the_plant_is_no_fault_of_the_controller() {
    let undisturbed = Rig::new().run(Mode::RealTime, &Signals::default());
    let rig = Rig::new();
    rig.clock.stall(500 * MS + MS / 2, 300 * MS);
    let stalled = rig.run(Mode::RealTime, &Signals::default());
    assert_eq!((stalled.faults(), stalled.report.outcome), (vec![], PlantOutcome::Disarmed));
    assert_eq!(stalled.exciter.outcome(), Some(ExciterOutcome::Finished));
    // The slip is passed to watchers and the exciter, and is in the report and the recording; the states are those of a
    // run without it.
    let slipped = stalled.report.slipped;
    assert!((295..=301).contains(&slipped) && stalled.report.overruns >= slipped, "{:?}", stalled.report);
    assert_eq!(stalled.exciter.slipped_periods(), slipped);
    assert!(
        stalled
            .events
            .iter()
            .any(|event| matches!(event, RunEvent::Slipped { periods, .. } if u64::from(*periods) == slipped))
    );
    let recorded: Vec<i64> = (stalled.recording.records().unwrap())
        .filter_map(|record| match record.unwrap() {
            Record::Event(event) if event.name == "schedule.slipped" => Some(event.value),
            _ => None,
        })
        .collect();
    assert_eq!(recorded, [slipped as i64]);
    assert!(stalled.states() == undisturbed.states());
}

#[test]
fn a_run_that_slips_outlives_more_than_a_second() {
    let rig = Rig::new();
    rig.clock.stall(500 * MS, 5000 * MS);
    let stalled = rig.run(Mode::RealTime, &Signals::default());
    assert_eq!((stalled.faults(), stalled.report.outcome), (vec![], PlantOutcome::Disarmed));
}

#[test]
fn a_run_that_stops_at_an_overrun_faults_and_ramps_first() {
    let rig = Rig { overrun: OverrunPolicy::Stop, ..Rig::new() };
    rig.clock.stall(500 * MS, 10 * MS);
    let stopped = rig.run(Mode::RealTime, &Signals::default());
    assert_eq!(stopped.report.outcome, PlantOutcome::Failed);
    assert!(matches!(stopped.report.error, Some(RunError::Periodic(_))), "{:?}", stopped.report.error);
    assert_eq!(code_of(&stopped), Some(EmergencyCode::Overrun));
    assert_ramped(&stopped);
}

#[test]
fn a_failed_simulation_is_reported_to_the_controller() {
    // As fast as this, the squares of the velocities overflow within a step.
    let text = SCENARIO.replace("60.0]", "60.0], initial = [0.0, 0.0, 1e150, 0.0]");
    let rig = Rig { scenario: Scenario::parse(&text, "test").unwrap(), ..Rig::new() };
    let failed = rig.run(Mode::Lockstep, &Signals::default());
    assert!(matches!(failed.report.error, Some(RunError::Plant(_))), "{:?}", failed.report);
    assert_eq!(failed.report.fault.unwrap().name, "simulation failed");
    assert_eq!(code_of(&failed), Some(EmergencyCode::SimulationFailed));
    // The state from which the step failed is recorded once, as the last.
    assert_eq!(failed.states().len() as u64, failed.report.samples);
}

#[test]
fn a_signal_disarms_ramps_and_tells_that_the_plant_leaves() {
    for mode in [Mode::RealTime, Mode::Lockstep] {
        let signals = Signals::default();
        let rig = Rig { speed: if mode == Mode::Lockstep { Speed::ACTUAL } else { Speed::UNPACED }, ..Rig::new() };
        let text = SCENARIO.replace("seed = 3", "seed = 3, duration_s = 0.7");
        let rig = Rig { scenario: Scenario::parse(&text, "test").unwrap(), ..rig };
        let ending = Ending { after_samples: rig.scenario.duration_samples().unwrap(), ..Ending::default() };
        let left = Rig { ending, ..rig }.run(mode, &signals);
        assert_eq!((left.report.outcome, left.faults()), (PlantOutcome::Completed, vec![]), "{mode}");
        assert_eq!(left.exciter.outcome(), Some(ExciterOutcome::PlantLeft), "{mode}");
        assert_ramped(&left);
        // The samples of the ramp come on top.
        assert_eq!(left.report.samples, 701 + 50, "{mode}");
    }
}

#[test]
fn a_bus_that_is_down_for_a_while_is_a_fault_and_the_run_continues() {
    for mode in [Mode::RealTime, Mode::Lockstep] {
        let ending = Ending { after_samples: Some(1500), ..Ending::default() };
        let rig = Rig { down_ns: 500 * MS..1200 * MS, ending, speed: Speed::UNPACED, ..Rig::new() };
        let rig = Rig { speed: if mode == Mode::Lockstep { Speed::ACTUAL } else { Speed::UNPACED }, ..rig };
        let run = rig.run(mode, &Signals::default());
        assert!(run.report.error.is_none(), "{:?}", run.report);
        let names: Vec<_> = run
            .events
            .iter()
            .filter(|event| matches!(event, RunEvent::BusLost { .. } | RunEvent::BusBack { .. }))
            .collect();
        assert!(matches!(names[..], [RunEvent::BusLost { .. }, RunEvent::BusBack { .. }]), "{mode}: {names:?}");
        assert_eq!(run.faults(), [EmergencyCode::BusLoss as u16], "{mode}");
        assert_eq!(code_of(&run), Some(EmergencyCode::BusLoss), "{mode}");
        assert!(run.report.samples >= 1501, "{mode}");
    }
}

#[test]
fn a_bus_that_stays_down_ends_the_run_and_says_so() {
    let rig = Rig { down_ns: 500 * MS..u64::MAX, ending: Ending::default(), ..Rig::new() };
    let run = rig.run(Mode::RealTime, &Signals::default());
    assert!(matches!(run.report.error, Some(RunError::Bus(BusError::InterfaceDown { .. }))), "{:?}", run.report);
    // The bus is lost at 0.5 s, and a run waits ten seconds for it.
    assert!((10_500 * MS..12_000 * MS).contains(&run.ended_ns), "{}", run.ended_ns);
    assert_eq!(run.faults(), [EmergencyCode::BusLoss as u16]);
}

#[test]
fn an_exciter_s_last_disarm_waits_for_the_queue_though_frames_are_unread() {
    let clock = ScriptedClock::default();
    let mut node = NodeBus::new(&scenario(), Mode::Lockstep, &clock).exciter;
    node.stop(0);
    let mut bus = JammedBus { clock: clock.clone(), until_ns: 100 * MS, sent: 0 };
    let report = super::exciter::run(
        &mut node,
        &mut bus,
        &clock,
        super::exciter::Patience { wait: None, rearm: 0, plant_ended: None },
        (&Signals::default(), None),
        &scenario(),
    );
    assert_eq!(report.outcome, Some(ExciterOutcome::Stopped));
    assert!(bus.sent >= 3, "boot-up, pre-operational, hello: {}", bus.sent);
    assert!(clock.now_ns() >= 100 * MS && clock.now_ns() < 110 * MS, "{}", clock.now_ns());
}

#[test]
fn an_exciter_alone_gives_up_and_a_plant_alone_has_a_patience() {
    let [mut near, mut far] = memory::pair(64);
    let options = Options { patience: Some(Duration::from_millis(50)), ..Options::default() };
    let session = Session::new(scenario(), Mode::Lockstep, options).unwrap();
    let report = session.exciter(&mut far, &Signals::default()).unwrap();
    insta::assert_snapshot!(report.error.unwrap(), @"no plant was heard within 0.05 s; start one with `resonarm run` on the same bus, with the same rate and base identifier");
    let mut events = Vec::new();
    let report = session.plant(&mut near, &Signals::default(), &mut |event| events.push(event)).unwrap();
    assert_eq!((report.outcome, report.samples, report.steps), (PlantOutcome::NotArmed, 0, 0));
    assert_eq!(events, [RunEvent::Ready]);
}

#[test]
fn a_plant_that_is_stopped_before_it_did_anything_did_nothing() {
    let [mut near, _far] = memory::pair(64);
    let signals = Signals::default();
    signals.stop();
    let session = Session::new(scenario(), Mode::Lockstep, Options::default()).unwrap();
    assert_eq!(session.plant(&mut near, &signals, &mut |_| {}).unwrap().outcome, PlantOutcome::NotArmed);
}

#[test]
fn a_report_as_json_has_the_fixed_keys() {
    let stopped = Rig { overrun: OverrunPolicy::Fault, ..Rig::new() };
    stopped.clock.stall(500 * MS, 10 * MS);
    let mut report = stopped.run(Mode::RealTime, &Signals::default()).report;
    (report.wakeup_us, report.exec_us) = (None, None);
    insta::assert_snapshot!(serde_json::to_string(&report).unwrap(), @r#"{"outcome":"faulted","fault":{"code":8,"name":"overrun","detail":10,"sample":498},"partner_fault":null,"bus_loss":null,"error":null,"samples":549,"steps":1096,"overruns":10,"overrun_causes":{"woke_late":10,"step_long":0,"bus_long":0,"stolen":0,"preempted":0},"slipped":0,"wakeup_us":null,"exec_us":null,"round_trip_us":null,"pacing":null,"bus":{"received":510,"sent":1659,"dropped":0,"refused":0,"other_sender":0,"malformed":0,"errors":{"protocol":0,"no_ack":0,"overflow":0,"warning":0,"passive":0,"bus_off":0,"restarted":0,"other":0}},"refused":{"not_armed":0,"late":0,"out_of_order":0,"repeated":0,"out_of_range":0,"rate_of_change":0,"travel":0},"recording":null}"#);
}

/// Why the exciter faulted.
fn code_of(ran: &Ran) -> Option<EmergencyCode> {
    match ran.exciter.outcome() {
        Some(ExciterOutcome::Faulted(emergency)) => Some(emergency.code),
        _ => None,
    }
}

/// The force went to zero step by step: at most a fiftieth of the amplitude beyond what the excitation does.
fn assert_ramped(ran: &Ran) {
    // Of a row of states the force along x is the seventh: four angles and rates and two torques come first.
    let forces: Vec<f64> = ran.states().iter().map(|state| f64::from_bits(state[6])).collect();
    let last = forces.len() - 1;
    assert_eq!(forces[last], 0.0);
    assert!(
        forces[last - 60..].iter().any(|force| force.abs() > 0.1),
        "there was something to ramp: {:?}",
        &forces[last - 60..]
    );
    let steps = forces[last - 60..].windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let largest = steps.fold(0.0, f64::max);
    // The ramp takes a fiftieth a sample, and a sine of 20 Hz at 1 kHz changes by at most 2π · 20/1000 of its
    // amplitude.
    assert!(largest < 40.0 * (1.0 / 50.0 + core::f64::consts::TAU * 20.0 / 1000.0), "a step of {largest} N");
}

/// docs/real-time.md: an armed plant is disarmed, or faults if an error ends the run.
#[test]
fn a_measurement_that_cannot_be_sent_is_a_fault_of_an_armed_plant() {
    let (rig, mode) = (Rig::new(), Mode::Lockstep);
    let session = Session::new(rig.scenario.clone(), mode, Options::default()).unwrap();
    let mut bus = NodeBus::new(&rig.scenario, mode, &rig.clock);
    let mut on_event = |_| {};
    let mut bench = session.bench(None, &mut on_event).unwrap();
    let rate = SampleRate::new(rig.scenario.simulation.rate_hz).unwrap();
    let mut pace = super::pace::Pace::start(&rig.clock, rate, Speed::UNPACED).unwrap();
    bench.start(0, 0);
    for _ in 0..1000 {
        rig.clock.pass(MS);
        let now_ns = rig.clock.now_ns();
        bench.transmit(now_ns, &mut bus).unwrap();
        bench.receive(now_ns, &mut bus).unwrap();
        bench.handle_deadline(now_ns);
    }
    assert!(bench.node.is_armed());
    let error = node::PublishError::NotFinite { name: "head_force_x_n".into(), got: f64::NAN };
    let (outcome, error) = super::finish::finish(&mut bench, &mut bus, &mut pace, Err(error.into()));
    assert_eq!((outcome, error.is_some()), (PlantOutcome::Failed, true));
    let fault = bench.node.latched_fault().map(|fault| fault.code);
    assert_eq!(fault, Some(EmergencyCode::SimulationFailed));
}
