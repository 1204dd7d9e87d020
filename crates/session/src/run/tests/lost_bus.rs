//! An exciter whose bus is lost for a while, beside frames that a held-up plant sent before.

use core::ops::Range;

use super::super::exciter::{self, Patience};
use super::*;
use resonarm_bus::ControllerState;
use resonarm_protocol::{
    Acceleration, Emergency, Heartbeat, Hello, ImpedanceHead, Message, Node, NodeState, Transmitter,
};

/// How a bus is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Loss {
    /// Every frame that is sent is an error.
    Refused,
    /// The queue takes none.
    Full,
    /// The controller says once that it is bus-off; the kernel takes frames, and nothing goes out or comes in.
    Silent,
}

/// A bus on which a plant's frames come in at set times, and which sends none while it is lost.
struct LostBus {
    clock: ScriptedClock,
    loss: Loss,
    lost_ns: Range<u64>,
    /// What comes in, the last first.
    incoming: Vec<(u64, Frame)>,
    has_failed: bool,
}

impl LostBus {
    fn is_lost(&self) -> bool {
        self.lost_ns.contains(&self.clock.now_ns())
    }

    fn off(&self) -> BusError {
        BusError::BusOff { interface: self.name() }
    }
}

impl Bus for LostBus {
    fn name(&self) -> String {
        String::from("lost")
    }

    fn send(&mut self, _frame: &Frame) -> Result<Sent, BusError> {
        match self.loss {
            Loss::Refused if self.is_lost() => Err(self.off()),
            Loss::Full if self.is_lost() => Ok(Sent::QueueFull),
            Loss::Refused | Loss::Full | Loss::Silent => Ok(Sent::Queued),
        }
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        let now_ns = self.clock.now_ns();
        let mut next = self.incoming.pop_if(|(at_ns, _)| *at_ns <= now_ns);
        if self.loss == Loss::Silent && self.is_lost() {
            if !core::mem::replace(&mut self.has_failed, true) {
                return Err(self.off());
            }
            next = None;
        }
        Ok(next.map(|(_, frame)| Received { frame, timestamp_ns: None }))
    }

    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError> {
        self.clock.pass(u64::try_from(timeout.as_nanos()).unwrap().clamp(1000, MS));
        Ok(false)
    }

    fn set_filters(&mut self, _filters: &[Filter]) -> Result<(), BusError> {
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        Statistics::default()
    }

    fn controller(&self) -> ControllerState {
        let is_off = self.loss == Loss::Silent && self.is_lost();
        if is_off { ControllerState::BusOff } else { ControllerState::Active }
    }

    fn close(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

/// The exciter's report, and when it ended. The plant is armed at 0.2 s and again, after the bus, at 1.2 s; meanwhile
/// frames still come that tell of it as armed. It leaves at 1.5 s. Two samples come at 0.31 s.
///
/// A bus that refuses frames or is full takes them from the end of its loss on. On a silent one the first to go out
/// then is the heartbeat shortly before 0.7 s, and what comes before that tells of an armed plant still.
fn exciter_beside(loss: Loss, lost_ns: Range<u64>, rearm: u32) -> (ExciterReport, u64) {
    let scenario = Scenario::parse(&format!("{SCENARIO}\n[network]\npartner_timeout_s = 30"), "test").unwrap();
    let network = scenario.network().unwrap();
    let heartbeat = |state| Message::Heartbeat(Heartbeat { node: Node::Plant, state });
    let rate_hz = scenario.wire_rate_hz().unwrap();
    let leaving = Emergency { node: Node::Plant, code: EmergencyCode::Leaving, detail: 0, sample: 0 };
    let mut messages = vec![(0, Message::PlantHello(Hello::new(network.profile(), rate_hz)))];
    messages.extend([200, 300].map(|ms| (ms * MS, heartbeat(NodeState::Operational))));
    messages.extend((0..2).flat_map(sample).map(|message| (310 * MS, message)));
    messages.extend([400, 500, 600].map(|ms| (ms * MS, heartbeat(NodeState::Operational))));
    if loss == Loss::Silent {
        messages.push((660 * MS, heartbeat(NodeState::Operational)));
    }
    messages.extend((700..1200).step_by(100).map(|ms| (ms * MS, heartbeat(NodeState::PreOperational))));
    messages.extend((1200..1500).step_by(100).map(|ms| (ms * MS, heartbeat(NodeState::Operational))));
    messages.push((1500 * MS, Message::Emergency(leaving)));
    let mut transmitter = Transmitter::new(network);
    let mut incoming: Vec<_> =
        messages.iter().map(|(at_ns, message)| (*at_ns, transmitter.frame(message).unwrap())).collect();
    incoming.reverse();
    let clock = ScriptedClock::default();
    let mut node = NodeBus::new(&scenario, Mode::RealTime, &clock).exciter;
    let mut bus = LostBus { clock: clock.clone(), loss, lost_ns, incoming, has_failed: false };
    let patience = Patience { wait: None, rearm, plant_ended: None };
    let report = exciter::run(&mut node, &mut bus, &clock, patience, (&Signals::default(), None), &scenario);
    (report, clock.now_ns())
}

/// A sample at rest.
fn sample(sample: u16) -> [Message; 3] {
    let (x_saturated, y_saturated) = (false, false);
    let rest = Acceleration { acceleration_x_m_s2: 0.0, acceleration_y_m_s2: 0.0, x_saturated, y_saturated, sample };
    let head = ImpedanceHead { force_x_n: 0.0, force_y_n: 0.0, x_saturated, y_saturated, sample };
    [Message::Head(head), Message::AccelerometerB(rest), Message::AccelerometerC(rest)]
}

#[test]
fn an_exciter_spends_no_try_while_its_bus_is_lost() {
    for loss in [Loss::Refused, Loss::Full, Loss::Silent] {
        let (report, _) = exciter_beside(loss, 300 * MS..650 * MS, 1);
        assert_eq!((report.outcome, report.rearmed), (Some(ExciterOutcome::PlantLeft), 1), "{loss:?}: {report:?}");
        assert!(report.error.is_none(), "{loss:?}: {report:?}");
        let expected = if loss == Loss::Full { None } else { Some(BusLoss::BusOff) };
        assert_eq!(report.bus_loss, expected, "{loss:?}");
    }
}

#[test]
fn an_exciter_whose_bus_stays_lost_ends_and_says_so() {
    for rearm in [0, 1] {
        let (report, ended_ns) = exciter_beside(Loss::Refused, 300 * MS..u64::MAX, rearm);
        assert!(matches!(report.error, Some(RunError::Bus(BusError::BusOff { .. }))), "{report:?}");
        assert_eq!(report.rearmed, 0, "{report:?}");
        // With a try left it waits out the ten seconds of an outage first.
        let limit_ns = if rearm == 0 { 2_000 * MS } else { 12_000 * MS };
        assert!(ended_ns < limit_ns, "{ended_ns}");
    }
}

/// One whose queue stays full, or whose controller stays bus-off without another word, ends with its tries unspent.
#[test]
fn an_exciter_does_not_wait_without_end_for_its_bus() {
    for loss in [Loss::Full, Loss::Silent] {
        let (report, ended_ns) = exciter_beside(loss, 300 * MS..u64::MAX, 1);
        let fault = report.fault().unwrap_or_else(|| panic!("{loss:?}: {report:?}"));
        assert_eq!((fault.code, report.rearmed), (EmergencyCode::BusLoss, 0), "{loss:?}");
        assert!((10_000 * MS..12_000 * MS).contains(&ended_ns), "{loss:?}: {ended_ns}");
    }
}

#[test]
fn bus_off_is_called_bus_off() {
    let (report, _) = exciter_beside(Loss::Silent, 300 * MS..650 * MS, 0);
    insta::assert_snapshot!(ExciterEnd::from(&report).reason.unwrap(), @"fault of the exciter, code 9: bus-off, or frames could not be sent (0 frames), at sample 0, since its controller was bus-off; to fix it: check the bit rate, the wiring and the two terminations of 120 Ω, since there were too many transmit errors");
}

/// Of the two commands that answer the samples at 0.31 s one takes the other's place.
#[test]
fn an_exciter_counts_the_frames_that_it_never_sent() {
    let (report, _) = exciter_beside(Loss::Full, 300 * MS..650 * MS, 0);
    assert!(report.bus.dropped > 0, "{report:?}");
}

/// The samples of the ramp are simulated and recorded, though nobody hears of them.
#[test]
fn a_bus_that_is_gone_ends_a_run_after_the_ramp() {
    let gone = |interface| BusError::InterfaceGone { interface };
    for mode in [Mode::RealTime, Mode::Lockstep] {
        let speed = if mode == Mode::Lockstep { Speed::ACTUAL } else { Speed::UNPACED };
        let run = Rig { down_ns: 500 * MS..u64::MAX, loss: gone, speed, ..Rig::new() }.run(mode, &Signals::default());
        assert!(matches!(run.report.error, Some(RunError::Bus(BusError::InterfaceGone { .. }))), "{:?}", run.report);
        assert_eq!(run.faults(), [EmergencyCode::BusLoss as u16], "{mode}");
        assert_ramped(&run);
    }
}
