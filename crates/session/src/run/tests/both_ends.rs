//! Plant and exciter in one process, where one knows of the other's end.

use core::sync::atomic::AtomicBool;
use std::panic::{self, AssertUnwindSafe};
use std::sync::mpsc;
use std::thread;

use super::super::exciter::{self, Patience};
use super::*;
use resonarm_files::recording::{Existing, Recording};
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
    let report = one_period(deaf).both(&Signals::default(), &mut |_| {}).unwrap();
    assert_eq!((report.plant.samples, report.exciter.bus.received), (2, 0));
    assert_eq!(report.exciter.outcome, Some(ExciterOutcome::PlantLeft), "{:?}", report.exciter);
    assert!(report.exciter.error.is_none(), "{:?}", report.exciter);
}

#[test]
fn an_exciter_that_starts_after_its_plant_has_ended_hears_it_out_and_ends() {
    let [mut near, mut far] = memory::pair(64);
    let session = one_period("");
    assert_eq!(session.plant(&mut near, &Signals::default(), &mut |_| {}).unwrap().samples, 2);
    drop(near);
    let mut node = NodeBus::new(&scenario(), Mode::RealTime, &ScriptedClock::default()).exciter;
    let patience = Patience { wait: Some(PATIENCE), rearm: 0, plant_ended: Some(&AtomicBool::new(true)) };
    let report = exciter::run(&mut node, &mut far, &SystemClock, patience, (&Signals::default(), None), &scenario());
    assert_eq!(report.outcome, Some(ExciterOutcome::PlantLeft), "{report:?}");
    assert!(report.error.is_none() && report.bus.received > 0, "{report:?}");
}

/// The exciter's thread waited for ever for a plant whose thread had panicked before it was armed.
#[test]
fn a_plant_that_panics_before_it_is_armed_ends_the_run() {
    let session = Session::new(scenario(), Mode::Lockstep, Options::default()).unwrap();
    let (done, ended) = mpsc::channel();
    thread::spawn(move || {
        let run = || session.both(&Signals::default(), &mut |event| assert!(event != RunEvent::Ready, "made to panic"));
        done.send(panic::catch_unwind(AssertUnwindSafe(run)).is_err()).unwrap();
    });
    assert_eq!(ended.recv_timeout(PATIENCE), Ok(true), "the panic of the plant's thread is passed on");
}

/// Nobody can arm the plant any more, so that one without a patience would wait for ever.
#[test]
fn a_plant_ends_when_the_exciter_beside_it_has_ended_before_arming() {
    for mode in [Mode::RealTime, Mode::Lockstep] {
        let session = Session::new(scenario(), mode, Options::default()).unwrap();
        let [mut near, _far] = memory::pair(64);
        let signals = Signals::default();
        signals.set_exciter_ended(true);
        let report = session.plant(&mut near, &signals, &mut |_| {}).unwrap();
        assert_eq!(report.outcome, PlantOutcome::NotArmed, "{mode}");
    }
}

/// What an exciter on a bus reads of the force in the head, N, of a plant with this converter.
fn head_force_n(plant_converter: &str, exciter_knows: &str) -> f64 {
    const DWELL: &str = "[excitation]\namplitude = { exciter_x = 40.0 }\nramp_s = 0.1\n\
        profile = { waveform = 'dwell', frequency_hz = 60.0, duration_s = 0.4, settle_s = 0.1 }\n";
    let session = |text: String| {
        let scenario = Scenario::parse(&text, "test").unwrap();
        let options = Options { end_on_disarm: true, patience: Some(PATIENCE), ..Options::default() };
        Session::new(scenario, Mode::Lockstep, options).unwrap()
    };
    let plant = session(format!("{DWELL}[rig]\nconverter = '{plant_converter}'"));
    let exciter = session(format!("{DWELL}[network]\n{exciter_knows}"));
    let [mut near, mut far] = memory::pair(1024);
    let report = thread::scope(|scope| {
        let plant = scope.spawn(|| plant.plant(&mut near, &Signals::default(), &mut |_| {}).unwrap());
        let report = exciter.exciter(&mut far, &Signals::default()).unwrap();
        plant.join().unwrap();
        report
    });
    let [point] = &report.responses[..] else { panic!("{report:?}") };
    point.head_force_n[0].norm_sqr().sqrt()
}

/// An exciter divided the readings of any plant by the gain of `rig.converter`, that of the simulated rig: here by 0.971.
#[test]
fn an_exciter_on_a_bus_corrects_readings_for_no_converter_that_is_not_stated() {
    let near = |got_n: f64| (got_n / 40.0 - 1.0).abs() < 2e-3;
    let foreign_n = head_force_n("instant", "");
    assert!(near(foreign_n), "the force as it is on the bus: {foreign_n}");
    let raw_n = head_force_n("sinc5", "");
    assert!((raw_n / 40.0 - 0.965).abs() < 2e-3, "the filtered readings as they are on the bus: {raw_n}");
    let corrected_n = head_force_n("sinc5", "plant_converter = 'sinc5'");
    // A held sine is smaller than its samples.
    assert!((corrected_n / 40.0 - 0.994).abs() < 2e-3, "corrected for the converter stated: {corrected_n}");
}

/// Read again with the rig's converter, the commands of an exciter that knows none were those of another controller.
#[test]
fn the_responses_of_an_exciter_that_knows_no_converter_are_read_again() {
    const WALK: &str = "[control]\nlaw = 'phase-walk'\namplitude = { exciter_x = 5.0 }\npoints = 3\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let record = Some(RecordTo { path: path.clone(), existing: Existing::Refuse });
    let session = |record| {
        let options = Options { end_on_disarm: true, patience: Some(PATIENCE), record, ..Options::default() };
        Session::new(Scenario::parse(WALK, "test").unwrap(), Mode::Lockstep, options).unwrap()
    };
    let (plant, exciter) = (session(record), session(None));
    let [mut near, mut far] = memory::pair(1024);
    let report = thread::scope(|scope| {
        let plant = scope.spawn(|| plant.plant(&mut near, &Signals::default(), &mut |_| {}).unwrap());
        let report = exciter.exciter(&mut far, &Signals::default()).unwrap();
        plant.join().unwrap();
        report
    });
    assert_eq!(report.responses.len(), 3, "{:?}", report.outcome);
    assert_eq!(crate::replay::responses(&Recording::open(&path).unwrap()).unwrap(), report.responses);
}
