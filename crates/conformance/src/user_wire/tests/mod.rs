//! The cases on users' own protocols against nodes of this program, in virtual time, and against nodes with one flaw
//! each.

mod controllers;
mod devices;
mod plants;

use std::collections::BTreeSet;

use super::*;
use crate::tests::device::{Device, Nobody, Stops, Virtual};
use crate::{Check, Verdict};
use devices::{ControllerDevice, Flaw, NONE, PlantDevice};
use resonarm_bench::node::WireSpec;
use resonarm_protocol::{Frame, FrameFormat, Id, Node};
use resonarm_scenario::Scenario;
use resonarm_session::run::Mode;
use resonarm_wire::canopen::SYNC_ID;

/// A scenario with a protocol of each kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum On {
    Dbc,
    Odrive,
    Cia402,
}

impl On {
    const ALL: [On; 3] = [On::Dbc, On::Odrive, On::Cia402];

    fn scenario(self) -> Scenario {
        let text = match self {
            On::Dbc => include_str!("bench.toml"),
            On::Odrive => include_str!("axes.toml"),
            On::Cia402 => include_str!("drives.toml"),
        };
        let mut scenario = Scenario::parse(text, "a test").unwrap();
        if let Some(wire) = scenario.wire.as_mut().filter(|wire| wire.preset.is_none()) {
            wire.text = Some(include_str!("bench.dbc").to_string());
        }
        scenario
    }

    pub fn wire(self, tested: Node, mode: Mode) -> UserWire {
        UserWire::new(self.scenario(), tested, mode).unwrap()
    }

    fn modes(self) -> &'static [Mode] {
        if self == On::Odrive { &[Mode::RealTime] } else { &[Mode::RealTime, Mode::Lockstep] }
    }
}

fn settings() -> Settings {
    Settings { patience_ns: 1_500_000_000, beyond_n: Some(650.0), ..Settings::default() }
}

/// The findings of all cases, each with a new device.
fn findings(on: &UserWire, make: impl Fn() -> Box<dyn Device>) -> Vec<(&'static str, Finding)> {
    let run = |case: WireCase| {
        let mut wire = Virtual::new(make());
        let finding = run_on_wire(&case, &mut wire, on, settings()).unwrap();
        let rejected = finding.traffic.user_refused.iter().find(|refused| monitor::breaks_rules(&refused.fault));
        assert!(finding.verdict != Verdict::Passed || rejected.is_none(), "{}: {finding:#?}", case.id);
        (case.id, finding)
    };
    wire_cases(on).into_iter().map(run).collect()
}

/// The names of the cases that fail.
fn failed(found: &[(&'static str, Finding)]) -> Vec<&'static str> {
    let is_failed = |finding: &Finding| matches!(finding.verdict, Verdict::Failed(_));
    found.iter().filter(|(_, finding)| is_failed(finding)).map(|(id, _)| *id).collect()
}

fn all_pass(found: &[(&'static str, Finding)], skipped: &[&str]) {
    let others = found.iter().filter(|(id, finding)| match finding.verdict {
        Verdict::Passed => false,
        Verdict::Skipped(_) => !skipped.contains(id),
        Verdict::Failed(_) | Verdict::Inconclusive(_) => true,
    });
    let others: Vec<_> = others.map(|(id, finding)| (id, &finding.verdict)).collect();
    assert!(others.is_empty(), "{others:#?}");
}

#[test]
fn cases_cover_what_they_can_and_name_no_other() {
    let all = || On::ALL.into_iter().flat_map(|on| on.modes().iter().map(move |mode| (on, *mode)));
    let wires = all().flat_map(|(on, mode)| Node::ALL.map(|tested| on.wire(tested, mode)));
    let covered: BTreeSet<_> = wires.flat_map(|wire| wire_cases(&wire)).flat_map(|case| case.requirements).collect();
    for requirement in &WIRE_REQUIREMENTS {
        let by_cases = matches!(requirement.check, Check::Cases);
        assert_eq!(covered.contains(&requirement.id), by_cases, "{requirement:?}");
    }
    assert!(covered.iter().all(|id| WIRE_REQUIREMENTS.iter().any(|requirement| requirement.id == **id)));
}

#[test]
fn an_empty_bus_gives_no_verdict() {
    for on in On::ALL {
        for (tested, mode) in Node::ALL.into_iter().flat_map(|node| on.modes().iter().map(move |mode| (node, *mode))) {
            for (id, finding) in findings(&on.wire(tested, mode), || Box::new(Nobody)) {
                let is_open = matches!(finding.verdict, Verdict::Inconclusive(_) | Verdict::Skipped(_));
                assert!(is_open, "{on:?} {id}: {finding:?}");
            }
        }
    }
}

#[test]
fn a_node_that_is_stopped_again_and_again_never_fails() {
    for on in On::ALL {
        for (tested, mode) in Node::ALL.into_iter().flat_map(|node| on.modes().iter().map(move |mode| (node, *mode))) {
            let wire = on.wire(tested, mode);
            for case in wire_cases(&wire) {
                let device: Box<dyn Device> = match tested {
                    Node::Plant => Box::new(PlantDevice::new(wire.clone(), NONE)),
                    Node::Exciter => Box::new(ControllerDevice::new(wire.clone(), NONE)),
                };
                let mut bus = Virtual::new(device);
                bus.stops = Some(Stops { for_ns: 150_000_000, every_ns: 570_000_000, until_ns: u64::MAX });
                let Finding { verdict, .. } = run_on_wire(&case, &mut bus, &wire, settings()).unwrap();
                assert!(!matches!(verdict, Verdict::Failed(_)), "{on:?} {}: {verdict:?}", case.id);
            }
        }
    }
}

#[test]
fn a_failure_while_the_tester_was_held_up_is_inconclusive() {
    let mut scenario = On::Dbc.scenario();
    scenario.wire.as_mut().unwrap().commands[0].timeout_s = Some(0.08);
    let wire = UserWire::new(scenario, Node::Plant, Mode::RealTime).unwrap();
    let case = wire_cases(&wire).into_iter().find(|case| case.id == "plant-disarm").unwrap();
    let stays = Flaw { holds: |_| resonarm_bench::rig::Load::force_n(5.0, 0.0), ..NONE };
    let mut bus = Virtual::new(Box::new(PlantDevice::new(wire.clone(), stays)));
    let verdict = |bus: &mut Virtual| run_on_wire(&case, bus, &wire, settings()).unwrap().verdict;
    assert!(matches!(verdict(&mut bus), Verdict::Failed(_)));
    bus.held_up_every = Some(50);
    let held_up = verdict(&mut bus);
    assert!(matches!(&held_up, Verdict::Inconclusive(text) if text.contains("held up for")), "{held_up:?}");
}

#[test]
fn a_scenario_that_has_no_cases_is_refused_in_words() {
    let refused = |scenario: Scenario| UserWire::new(scenario, Node::Plant, Mode::RealTime).unwrap_err().to_string();
    insta::assert_snapshot!(refused(Scenario::default()), @"the scenario has no [wire], so it maps no user protocol: leave the scenario out to test on Resonarm's protocol");
    let mut by_operator = On::Dbc.scenario();
    let wire = by_operator.wire.as_mut().unwrap();
    wire.events.clear();
    wire.arm = Some(resonarm_scenario::wire::ArmSpec::Operator);
    insta::assert_snapshot!(refused(by_operator), @r#"[wire] `arm = "operator"`: no message arms the plant, so the emulated exciter can't arm it; give an event with `arm`, or `arm = "zero-command"`"#);
}

/// The protocol of the DBC with loads, enable and the head's force alone.
fn bare(tested: Node) -> UserWire {
    let mut scenario = On::Dbc.scenario();
    let wire = scenario.wire.as_mut().unwrap();
    (wire.commands[0].counter, wire.commands[0].checksum) = (None, None);
    wire.events.truncate(1);
    (wire.readings[0].counter, wire.readings[0].checksum) = (None, None);
    wire.readings[0].signals.retain(|name, _| name == "HeadX");
    UserWire::new(scenario, tested, Mode::RealTime).unwrap()
}

#[test]
fn what_a_protocol_does_not_have_is_skipped_with_the_reason() {
    let reasons = |found: Vec<(&'static str, Finding)>| {
        let in_words = |(id, finding): (&str, Finding)| match finding.verdict {
            Verdict::Passed => format!("{id}\n"),
            Verdict::Skipped(reason) => format!("{id}: {reason}\n"),
            Verdict::Failed(_) | Verdict::Inconclusive(_) => format!("{id}: {:?}\n", finding.verdict),
        };
        found.into_iter().map(in_words).collect::<String>()
    };
    let wire = bare(Node::Exciter);
    let found = findings(&wire, || Box::new(ControllerDevice::new(wire.clone(), NONE)));
    insta::assert_snapshot!(reasons(found), @"
    exciter-arms
    exciter-before-arming
    exciter-frames
    exciter-counters: no message of the controller has a counter
    exciter-in-time
    exciter-acts
    exciter-limits
    exciter-plant-faults: no reading that is sent at least twice a second says that the plant is in fault
    exciter-plant-disarmed: no reading that is sent at least twice a second says that the plant is disarmed
    ");
    let wire = bare(Node::Plant);
    let found = findings(&wire, || Box::new(PlantDevice::new(wire.clone(), NONE)));
    insta::assert_snapshot!(reasons(found), @"
    plant-rates
    plant-requests: no reading is sent on request
    plant-frames
    plant-counters: no message of the plant has a counter
    plant-arms: no reading that is sent at least twice a second carries the plant's state
    plant-commands-act
    plant-wrong-checksum: not every message with loads has a checksum
    plant-repeated-counter: not every message with loads has a counter
    plant-counter-jump: not every message with loads has a counter of which so many values can be lost
    plant-length
    plant-not-finite
    plant-too-large
    plant-command-timeout: no reading that is sent at least twice a second carries the plant's fault
    plant-disarm
    plant-reset: no message resets a fault, or no reading that is sent at least twice a second carries one
    plant-stop: no message stops the plant, or no reading that is sent at least twice a second carries a fault
    ");
}
