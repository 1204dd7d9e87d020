//! Plant and exciter in one process, where one knows of the other's end.

use core::sync::atomic::AtomicBool;

use super::super::exciter::{self, Patience};
use super::*;
use resonarm_realtime::SystemClock;

/// Ends a hang, and is an error then; far longer than a machine under load keeps a thread waiting.
const PATIENCE: Duration = Duration::from_secs(60);

/// A plant in real time with two samples: those at both ends of a period.
fn one_period(text: &str) -> Session {
    let mut scenario = Scenario::parse(&format!("{SCENARIO}\n{text}"), "test").unwrap();
    scenario.simulation.duration_s = Some(1e-3);
    Session::new(scenario, Mode::RealTime, Options { patience: Some(PATIENCE), ..Options::default() }).unwrap()
}

#[test]
fn an_exciter_that_never_hears_its_plant_ends_with_it() {
    let deaf =
        "[[network.faults]]\nnode = 'exciter'\nkind = 'loss'\nprobability = 1.0\ndirection = 'receive'\nfrom_s = 0";
    let report = one_period(deaf).both(&Signals::default(), |_| {}).unwrap();
    assert_eq!((report.plant.samples, report.exciter.bus.received), (2, 0));
    assert_eq!(report.exciter.outcome, Some(ExciterOutcome::PlantLeft), "{:?}", report.exciter);
    assert!(report.exciter.error.is_none(), "{:?}", report.exciter);
}

#[test]
fn an_exciter_that_starts_after_its_plant_has_ended_hears_it_out_and_ends() {
    let [mut near, mut far] = memory::pair(64);
    let session = one_period("");
    assert_eq!(session.plant(&mut near, &Signals::default(), |_| {}).unwrap().samples, 2);
    drop(near);
    let mut node = NodeBus::new(&scenario(), Mode::RealTime, &ScriptedClock::default()).exciter;
    let patience = Patience { wait: Some(PATIENCE), rearm: 0, plant_ended: Some(&AtomicBool::new(true)) };
    let report = exciter::run(&mut node, &mut far, &SystemClock, patience, (&Signals::default(), None));
    assert_eq!(report.outcome, Some(ExciterOutcome::PlantLeft), "{report:?}");
    assert!(report.error.is_none() && report.bus.received > 0, "{report:?}");
}
