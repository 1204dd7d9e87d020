//! The cases against this crate's own nodes, in virtual time, and against nodes with one flaw each.

pub(crate) mod device;
mod flaws;
mod verdicts;

use std::collections::BTreeSet;

use super::*;
use device::{Device, ExciterDevice, PlantDevice, StartedAgain, Stops, Virtual};
use resonarm_protocol::{Emergency, ForceCommand, Heartbeat, Message, NodeState, Profile, SPEC, Transmitter, Trip};
use resonarm_session::run::Mode;

/// The requirement numbers in the text.
fn marks(text: &str) -> Vec<&str> {
    let marked = text.split("[R-").skip(1).filter_map(|rest| rest.split_once(']'));
    marked.map(|(id, _)| id).filter(|id| id.starts_with(|c: char| c.is_ascii_digit())).collect()
}

#[test]
fn every_demand_of_the_specification_is_a_requirement() {
    let marked = marks(SPEC);
    let known: BTreeSet<_> = REQUIREMENTS.iter().map(|requirement| &requirement.id[2..]).collect();
    assert_eq!(marked.iter().copied().collect::<BTreeSet<_>>(), known);
    assert_eq!((marked.len(), known.len()), (REQUIREMENTS.len(), REQUIREMENTS.len()), "each number occurs once");
}

#[test]
fn every_sentence_with_must_has_a_mark() {
    // A sentence ends at a stop before a space or the end; its number follows it.
    let text = SPEC.split_whitespace().collect::<Vec<_>>().join(" ");
    let sentences = text.replace(". [R-", " [R-").replace("] ", "]. ");
    for sentence in sentences.split(". ").filter(|sentence| sentence.split(' ').any(|word| word == "must")) {
        assert!(!marks(sentence).is_empty(), "no number: {sentence}");
    }
}

#[test]
fn cases_cover_what_they_can_and_name_no_other() {
    let covered: BTreeSet<_> = Node::ALL
        .into_iter()
        .flat_map(|tested| Mode::ALL.into_iter().flat_map(move |mode| cases(tested, mode)))
        .flat_map(|case| case.requirements)
        .collect();
    for requirement in &REQUIREMENTS {
        let by_cases = matches!(requirement.check, Check::Cases);
        assert_eq!(covered.contains(&requirement.id), by_cases, "{requirement:?}");
    }
    assert!(covered.iter().all(|id| REQUIREMENTS.iter().any(|requirement| requirement.id == **id)));
}

fn settings() -> Settings {
    Settings {
        beyond_n: Some(650.0),
        beyond_n_per_s: Some(40e3),
        beyond_travel_n: Some(200.0),
        patience_ns: 2_000_000_000,
        bit_rate_hz: Some(1_000_000),
        soak_ns: 2_000_000_000,
        sine: Some(ExpectedSine { frequency_hz: 15.0, amplitude: SineAmplitude::ForceN(20.0) }),
        ..Settings::default()
    }
}

/// The findings of all cases, each with a new device, in real time.
fn findings(tested: Node, network: Network, make: impl Fn() -> Box<dyn Device>) -> Vec<(&'static str, Finding)> {
    findings_in(Mode::RealTime, tested, network, make)
}

fn findings_in(
    mode: Mode,
    tested: Node,
    network: Network,
    make: impl Fn() -> Box<dyn Device>,
) -> Vec<(&'static str, Finding)> {
    let run = |case: ProtocolCase| {
        let mut wire = Virtual::new(make());
        let finding = run(&case, &mut wire, network, settings()).unwrap();
        let rejected = finding.traffic.refused_of(|kind| kind.sender() == tested).next();
        assert!(finding.verdict != Verdict::Passed || rejected.is_none(), "{}: {finding:#?}", case.id);
        (case.id, finding)
    };
    cases(tested, mode).map(run).collect()
}

/// All pass, except those that need the FD profile.
fn all_pass(findings: &[(&str, Finding)], profile: Profile) {
    let is_fine = |id: &str, verdict: &Verdict| match verdict {
        Verdict::Passed => true,
        Verdict::Skipped(_) => match profile {
            Profile::Classic => id.ends_with("-pairs") || id == "exciter-own-limits",
            // The reading fits a single, but is flagged.
            Profile::Fd => false,
        },
        Verdict::Failed(_) | Verdict::Inconclusive(_) => false,
    };
    let others: Vec<_> = findings.iter().filter(|(id, finding)| !is_fine(id, &finding.verdict)).collect();
    assert!(others.is_empty(), "{others:#?}");
}

#[test]
fn the_nodes_of_this_crate_pass_in_both_profiles() {
    for profile in Profile::ALL {
        let network = Network::default().with_profile(profile);
        all_pass(&findings(Node::Plant, network, || Box::new(PlantDevice::new(network))), profile);
        all_pass(&findings(Node::Exciter, network, || Box::new(ExciterDevice::new(network))), profile);
        let (plant, exciter) = (
            || Box::new(PlantDevice::in_mode(Mode::Lockstep, network, None)) as Box<dyn Device>,
            || Box::new(ExciterDevice::in_mode(Mode::Lockstep, network, None)) as Box<dyn Device>,
        );
        all_pass(&findings_in(Mode::Lockstep, Node::Plant, network, plant), profile);
        all_pass(&findings_in(Mode::Lockstep, Node::Exciter, network, exciter), profile);
    }
}

#[test]
fn runs_are_the_same_each_time() {
    let network = Network::default();
    let plant = || findings(Node::Plant, network, || Box::new(PlantDevice::new(network)));
    assert_eq!(plant(), plant());
}

#[test]
fn a_failure_while_the_tester_was_held_up_is_inconclusive() {
    let network = Network::default();
    let case = cases(Node::Plant, Mode::RealTime).find(|case| case.id == "plant-command-timeout").unwrap();
    let mut wire = Virtual::new(Box::new(PlantDevice::with(network, Some(flaws::Flaw::NoTimeout))));
    wire.held_up_every = Some(400);
    let finding = run(&case, &mut wire, network, settings()).unwrap();
    assert!(matches!(&finding.verdict, Verdict::Inconclusive(text) if text.contains("held up for")), "{finding:?}");
}

#[test]
fn a_trip_at_the_travel_instead_of_the_required_emergency_is_inconclusive() {
    let trip = |trip: Trip| Emergency {
        node: Node::Plant,
        code: EmergencyCode::ExciterTripped,
        detail: trip as u16,
        sample: 1654,
    };
    let travel = plant_role::instead::<()>(&trip(Trip::Travel), "without commands");
    assert!(
        matches!(&travel, Err(Stop::Inconclusive(text)) if text.contains("let the arm come to rest")),
        "{travel:?}"
    );
    let shaker = plant_role::instead::<()>(&trip(Trip::Shaker), "without commands");
    assert!(matches!(shaker, Err(Stop::Failed(_))), "{shaker:?}");
}

#[test]
fn a_node_that_is_stopped_again_and_again_never_fails() {
    let network = Network::default();
    for tested in Node::ALL {
        for every_ms in [450, 500, 530, 570, 610, 1010] {
            for case in [Mode::RealTime, Mode::Lockstep].into_iter().flat_map(|mode| cases(tested, mode)) {
                let mut wire = Virtual::new(match tested {
                    Node::Plant => Box::new(PlantDevice::in_mode(case.mode, network, None)),
                    Node::Exciter => Box::new(ExciterDevice::in_mode(case.mode, network, None)),
                });
                let every_ns = every_ms * 1_000_000;
                wire.stops = Some(Stops { for_ns: 150_000_000, every_ns, until_ns: u64::MAX });
                let Finding { verdict, .. } = run(&case, &mut wire, network, settings()).unwrap();
                assert!(
                    !matches!(verdict, Verdict::Failed(_)),
                    "{}, stopped every {every_ms} ms: {verdict:?}",
                    case.id
                );
            }
        }
    }
}

/// Many short stops, none of them noticed as a silence, make an exciter slow.
#[test]
fn an_exciter_fails_if_slow_each_time_but_not_if_slow_in_one_try() {
    let network = Network::default();
    let case = cases(Node::Exciter, Mode::RealTime).find(|case| case.id == "exciter-sensor-timeout").unwrap();
    let verdict = |flaw: Option<flaws::Flaw>, until_ns: u64| {
        let mut wire = Virtual::new(Box::new(StartedAgain::new(ExciterDevice::with(network, flaw), 0)));
        wire.stops = Some(Stops { for_ns: 40_000_000, every_ns: 70_000_000, until_ns });
        run(&case, &mut wire, network, settings()).unwrap().verdict
    };
    insta::assert_debug_snapshot!(verdict(None, 1_000_000_000), @r#"
    Inconclusive(
        "no emergency 501 ms after the last sample, but 328 ms later, in 1 of 2 tries",
    )
    "#);
    insta::assert_debug_snapshot!(verdict(Some(flaws::Flaw::SlowTimeout), 0), @r#"
    Failed(
        "no emergency 501 ms after the last sample, but 199 ms later",
    )
    "#);
}

/// An exciter that was stopped in the previous case ends in this one.
#[test]
fn messages_of_the_previous_case_s_exciter_are_not_judged() {
    let network = Network::default();
    for case in cases(Node::Exciter, Mode::RealTime) {
        let mut before = Transmitter::new(network);
        let late = [
            Message::Force(ForceCommand { force_x_n: 1.0, force_y_n: 0.0, sample: 49 }),
            Message::Heartbeat(Heartbeat { node: Node::Exciter, state: NodeState::Operational }),
            Message::Heartbeat(Heartbeat { node: Node::Exciter, state: NodeState::PreOperational }),
        ];
        let frames = late.map(|message| before.frame(&message).unwrap());
        let mut wire = Virtual::with_waiting(Box::new(ExciterDevice::new(network)), frames);
        let Finding { verdict, .. } = run(&case, &mut wire, network, settings()).unwrap();
        assert!(matches!(verdict, Verdict::Passed | Verdict::Skipped(_)), "{}: {verdict:?}", case.id);
    }
}

/// A successor may answer samples before the case is over if an exciter is slow to begin.
#[test]
fn messages_of_a_restarted_exciter_are_not_those_of_its_predecessor() {
    let network = Network::default();
    // Any later, a hello that doesn't fit would go unanswered for too long.
    for late_ms in (0..=300).step_by(50) {
        for case in cases(Node::Exciter, Mode::RealTime) {
            let mut wire = Virtual::new(Box::new(StartedAgain::new(ExciterDevice::new(network), late_ms * 1_000_000)));
            let Finding { verdict, .. } = run(&case, &mut wire, network, settings()).unwrap();
            assert!(!matches!(verdict, Verdict::Failed(_)), "{}, {late_ms} ms late: {verdict:?}", case.id);
        }
    }
}

#[test]
fn an_empty_bus_gives_no_verdict() {
    for tested in Node::ALL {
        for case in [Mode::RealTime, Mode::Lockstep].into_iter().flat_map(|mode| cases(tested, mode)) {
            let mut wire = Virtual::new(Box::new(device::Nobody));
            let finding = run(&case, &mut wire, Network::default(), settings()).unwrap();
            // The classic profile has no limits to state, whatever the node.
            let is_open = |verdict: &Verdict| match verdict {
                Verdict::Inconclusive(_) => true,
                Verdict::Skipped(_) => case.id == "exciter-own-limits",
                Verdict::Passed | Verdict::Failed(_) => false,
            };
            assert!(is_open(&finding.verdict), "{}: {finding:?}", case.id);
        }
    }
}
