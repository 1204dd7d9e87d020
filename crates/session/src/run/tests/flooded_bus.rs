//! A bus on which frames of others come faster than the exciter reads them.

use super::super::exciter::{self, Patience};
use super::*;
use resonarm_protocol::Id;

/// Frames after which a loop that reads until nothing is left counts as endless.
const ENDLESS: u64 = 1_000_000;

/// A bus that always has another frame of somebody else; reading one takes a microsecond.
struct FloodedBus {
    clock: ScriptedClock,
    received: u64,
}

impl Bus for FloodedBus {
    fn name(&self) -> String {
        String::from("flooded")
    }

    fn send(&mut self, _frame: &Frame) -> Result<Sent, BusError> {
        Ok(Sent::Queued)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        self.clock.pass(1000);
        self.received += 1;
        assert!(self.received < ENDLESS, "the loop reads for ever");
        let frame = Frame::classic(Id::Standard(0x7FF), &[]).unwrap();
        Ok(Some(Received { frame, timestamp_ns: None }))
    }

    fn wait(&mut self, _timeout: Duration) -> Result<bool, BusError> {
        Ok(true)
    }

    fn set_filters(&mut self, _filters: &[Filter]) -> Result<(), BusError> {
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        Statistics { received: self.received, ..Statistics::default() }
    }

    fn close(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

fn run_flooded(wait: Option<Duration>, signals: &Signals) -> ExciterReport {
    let clock = ScriptedClock::default();
    let mut node = NodeBus::new(&scenario(), Mode::RealTime, &clock).exciter;
    let mut bus = FloodedBus { clock: clock.clone(), received: 0 };
    let patience = Patience { wait, rearm: 0, plant_ended: None };
    exciter::run(&mut node, &mut bus, &clock, patience, (signals, None), &scenario())
}

/// The exciter read its bus until nothing was left, so that a flood delayed the stop and every timeout for ever.
#[test]
fn a_flood_delays_neither_the_stop_nor_the_patience_of_an_exciter() {
    let report = run_flooded(Some(Duration::from_millis(10)), &Signals::default());
    assert!(matches!(report.error, Some(RunError::NoPlant { .. })), "{report:?}");

    let stopped = Signals::default();
    stopped.stop();
    assert_eq!(run_flooded(None, &stopped).outcome, Some(ExciterOutcome::Stopped));
}
