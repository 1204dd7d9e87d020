//! The run loops of lockstep under the conformance cases, on a memory bus.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use resonarm::bus::memory;
use resonarm::conformance::{BusWire, Finding, Settings, Verdict, cases, run};
use resonarm::protocol::Node;
use resonarm::run::{Mode, Options, Session, Signals};
use resonarm::scenario::Scenario;

const DWELL: &str = "[excitation]\namplitude = { exciter_x = 5.0 }\n\
    profile = { waveform = 'dwell', frequency_hz = 18.0, duration_s = 1000.0, settle_s = 0.1 }\n";

/// A machine that holds a process up makes a finding inconclusive, and no node wrong.
fn is_never_failed(tested: Node) {
    let session = Session::new(Scenario::parse(DWELL, "test").unwrap(), Mode::Lockstep, Options::default()).unwrap();
    let [mut near, mut far] = memory::pair(1024);
    let (signals, is_over) = (Signals::default(), AtomicBool::new(false));
    let findings: Vec<(&str, Finding)> = thread::scope(|scope| {
        scope.spawn(|| match tested {
            Node::Plant => drop(session.plant(&mut far, &signals, &mut |_event| {}).unwrap()),
            // It is started again whenever it has ended.
            Node::Exciter => {
                while !is_over.load(Ordering::Relaxed) {
                    session.exciter(&mut far, &signals).unwrap();
                }
            }
        });
        let mut wire = BusWire::new(&mut near, None);
        let network = session.scenario().network().unwrap();
        let found = cases(tested, Mode::Lockstep)
            .map(|case| (case.id, run(&case, &mut wire, network, Settings::default()).unwrap()))
            .collect();
        is_over.store(true, Ordering::Relaxed);
        signals.stop();
        found
    });
    for (id, finding) in &findings {
        assert!(!matches!(finding.verdict, Verdict::Failed(_) | Verdict::Skipped(_)), "{id}: {finding:?}");
    }
    assert!(findings.iter().any(|(_, finding)| finding.verdict == Verdict::Passed), "{findings:?}");
}

#[test]
fn the_plant_s_loop_is_never_failed() {
    is_never_failed(Node::Plant);
}

#[test]
fn the_exciter_s_loop_is_never_failed() {
    is_never_failed(Node::Exciter);
}
