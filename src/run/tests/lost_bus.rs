//! An exciter whose bus is lost for a while, beside frames that a held-up plant sent before.

use core::ops::Range;

use super::super::exciter::{self, Patience};
use super::*;
use crate::protocol::{Emergency, Heartbeat, Hello, Message, Node, NodeState, Transmitter};

/// A bus on which a plant's frames come in at set times, and which sends none while it is lost.
struct LostBus {
    clock: ScriptedClock,
    lost_ns: Range<u64>,
    /// What comes in, the last first.
    incoming: Vec<(u64, Frame)>,
}

impl Bus for LostBus {
    fn name(&self) -> String {
        String::from("lost")
    }

    fn send(&mut self, _frame: &Frame) -> Result<Sent, BusError> {
        let is_lost = self.lost_ns.contains(&self.clock.now_ns());
        if is_lost { Err(BusError::BusOff { interface: self.name() }) } else { Ok(Sent::Queued) }
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        let now_ns = self.clock.now_ns();
        let next = self.incoming.pop_if(|(at_ns, _)| *at_ns <= now_ns);
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

    fn close(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

/// The exciter's report, and when it ended. The plant is armed at 0.2 s and again, after the bus, at 1.2 s; meanwhile
/// frames still come that tell of it as armed. It leaves at 1.5 s.
fn exciter_beside(lost_ns: Range<u64>, rearm: u32) -> (ExciterReport, u64) {
    let scenario = Scenario::parse(&format!("{SCENARIO}\n[network]\npartner_timeout_s = 30"), "test").unwrap();
    let network = scenario.network().unwrap();
    let heartbeat = |state| Message::Heartbeat(Heartbeat { node: Node::Plant, state });
    let rate_hz = scenario.wire_rate_hz().unwrap();
    let leaving = Emergency { node: Node::Plant, code: EmergencyCode::Leaving, detail: 0, sample: 0 };
    let mut told = vec![(0, Message::PlantHello(Hello::new(network.profile(), rate_hz)))];
    told.extend((200..700).step_by(100).map(|ms| (ms * MS, heartbeat(NodeState::Operational))));
    told.extend((700..1200).step_by(100).map(|ms| (ms * MS, heartbeat(NodeState::PreOperational))));
    told.extend((1200..1500).step_by(100).map(|ms| (ms * MS, heartbeat(NodeState::Operational))));
    told.push((1500 * MS, Message::Emergency(leaving)));
    let mut transmitter = Transmitter::new(network);
    let mut incoming: Vec<_> =
        told.iter().map(|(at_ns, message)| (*at_ns, transmitter.frame(message).unwrap())).collect();
    incoming.reverse();
    let clock = ScriptedClock::default();
    let mut node = NodeBus::new(&scenario, Mode::RealTime, &clock).exciter;
    let mut bus = LostBus { clock: clock.clone(), lost_ns, incoming };
    let patience = Patience { wait: None, rearm, plant_ended: None };
    let report = exciter::run(&mut node, &mut bus, &clock, patience, (&Signals::default(), None));
    (report, clock.now_ns())
}

#[test]
fn an_exciter_spends_no_try_while_its_bus_is_lost() {
    let (report, _) = exciter_beside(300 * MS..650 * MS, 1);
    assert_eq!((report.outcome, report.rearmed), (Some(ExciterOutcome::PlantLeft), 1), "{report:?}");
    assert!(report.error.is_none(), "{report:?}");
}

#[test]
fn an_exciter_whose_bus_stays_lost_ends_and_says_so() {
    for rearm in [0, 1] {
        let (report, ended_ns) = exciter_beside(300 * MS..u64::MAX, rearm);
        assert!(matches!(report.error, Some(RunError::Bus(BusError::BusOff { .. }))), "{report:?}");
        assert_eq!(report.rearmed, 0, "{report:?}");
        let limit_ns = if rearm == 0 { 2_000 * MS } else { 12_000 * MS };
        assert!(ended_ns < limit_ns, "{ended_ns}");
    }
}
