//! The cases that a node with a flaw fails, and their reasons.

use super::super::*;
use super::device::{Device, ExciterDevice, PlantDevice, StartedAgain, Virtual};
use super::flaws::Flaw;
use super::{findings, findings_in, settings};
use crate::exciter_cases::Answered;
use resonarm_protocol::{NodeState, Profile};
use resonarm_session::run::Mode;

#[test]
fn a_plant_with_a_flaw_fails_the_cases_for_it() {
    let starved = [
        "plant-wrong-crc",
        "plant-repeated-counter",
        "plant-counter-jump",
        "plant-data-id",
        "plant-other-format",
        "plant-length",
        "plant-extended-id",
        "plant-foreign-base",
        "plant-reserved-bit",
        "plant-not-available",
        "plant-old-command",
        "plant-early-command",
        "plant-same-sample",
        "plant-older-command",
        "plant-too-large",
        "plant-too-fast",
        "plant-command-timeout",
        "plant-load-wrong-crc",
    ];
    let table: [(Flaw, &[&str]); 32] = [
        (Flaw::IgnoresCrc, &["plant-wrong-crc", "plant-data-id", "plant-load-wrong-crc", "plant-soak"]),
        (Flaw::IgnoresCounters, &["plant-repeated-counter", "plant-counter-jump", "plant-soak"]),
        (Flaw::NoHeartbeats, &["plant-heartbeats"]),
        (Flaw::FloodsHeartbeats, &["plant-heartbeats"]),
        (Flaw::AnswersRemote, &["plant-remote-frames"]),
        (Flaw::NoRamp, &["plant-command-timeout", "plant-disarm"]),
        (Flaw::ActsUnarmed, &["plant-not-armed", "plant-disarm", "plant-too-far"]),
        (Flaw::NoTimeout, &starved),
        (Flaw::Cuts, &["plant-too-large", "plant-too-fast", "plant-too-far"]),
        (Flaw::Jumps, &["plant-too-fast"]),
        (Flaw::Strays, &["plant-too-far"]),
        (Flaw::WrongHash, &["plant-hello", "plant-load-hello"]),
        (Flaw::BelievesHellos, &["plant-arms-for-a-hello", "plant-foreign-base", "plant-exciter-leaves"]),
        (Flaw::NoLatch, &["plant-states", "plant-load-states"]),
        (Flaw::DeafToLeaving, &["plant-exciter-leaves"]),
        (Flaw::DeafToItself, &["plant-second-sender"]),
        (Flaw::Distracted, &["plant-foreign-base", "plant-load-wrong-crc", "plant-load-states", "plant-soak"]),
        (Flaw::Clogs, &["plant-soak"]),
        (Flaw::HidesBusLoss, &["plant-bus-off"]),
        (Flaw::HidesClipping, &["plant-saturation"]),
        (Flaw::StepsBy(2), &["plant-counters"]),
        (Flaw::StepsBy(4), &["plant-counters"]),
        (Flaw::TakesOlder, &["plant-older-command"]),
        (Flaw::Late(NodeState::Operational), &["plant-states", "plant-load-states"]),
        (Flaw::Late(NodeState::PreOperational), &["plant-states", "plant-disarm", "plant-load-states"]),
        (Flaw::Late(NodeState::Fault), &["plant-states", "plant-load-states"]),
        (Flaw::AnyBase, &["plant-foreign-base", "plant-soak"]),
        (Flaw::IgnoresReset, &["plant-reset"]),
        (Flaw::CountsWallClock, &["plant-heartbeats", "plant-stopped"]),
        (Flaw::OtherPolynomial, &["plant-hello", "plant-heartbeats", "plant-load-hello"]),
        (Flaw::OtherStart, &["plant-hello", "plant-heartbeats", "plant-load-hello"]),
        (Flaw::OtherDataId, &["plant-hello", "plant-heartbeats", "plant-load-hello"]),
    ];
    let network = Network::default();
    let found = table.map(|(flaw, _)| {
        let plant = || Box::new(PlantDevice::with(network, Some(flaw))) as Box<dyn Device>;
        (flaw, failed(&findings(Node::Plant, network, plant)))
    });
    assert_eq!(found, table.map(|(flaw, expected)| (flaw, expected.to_vec())));
}

#[test]
fn a_node_with_a_flaw_in_two_samples_a_frame_fails_the_case_for_it() {
    let network = Network::default().with_profile(Profile::Fd);
    let plant = || Box::new(PlantDevice::with(network, Some(Flaw::SwapsPairs))) as Box<dyn Device>;
    assert_eq!(failed(&findings(Node::Plant, network, plant)), ["plant-pairs"]);
    let exciter = || Box::new(ExciterDevice::with(network, Some(Flaw::AnswersFirst))) as Box<dyn Device>;
    assert_eq!(failed(&findings(Node::Exciter, network, exciter)), ["exciter-pairs"]);
}

#[test]
fn a_node_that_forgets_the_limits_it_states_fails_the_case_for_it() {
    let network = Network::default().with_profile(Profile::Fd);
    let exciter = || Box::new(ExciterDevice::with(network, Some(Flaw::BeyondLimits))) as Box<dyn Device>;
    assert_eq!(failed(&findings(Node::Exciter, network, exciter)), ["exciter-own-limits"]);
    // No force is given that it must reject.
    let case = cases(Node::Plant, Mode::RealTime).find(|case| case.id == "plant-too-large").unwrap();
    let verdict = |flaw| {
        let mut wire = Virtual::new(Box::new(PlantDevice::with(network, flaw)));
        run(&case, &mut wire, network, Settings { beyond_n: None, ..settings() }).unwrap().verdict
    };
    assert_eq!(verdict(None), Verdict::Passed);
    insta::assert_debug_snapshot!(verdict(Some(Flaw::ForgetsLimits)), @r#"
    Failed(
        "it acts: the head reads -606.00 N at sample 260",
    )
    "#);
}

/// Frames with a counter that the tester rejects come in nearly all cases: none of those passes.
#[test]
fn no_case_passes_beside_a_frame_that_the_tester_rejected() {
    let network = Network::default();
    for (flaw, cases) in [
        (Flaw::LosesCount, ["plant-counters", "plant-frames", "plant-heartbeats", "plant-states", "plant-soak"]),
        (Flaw::OneCounter, ["plant-counters", "plant-heartbeats", "plant-states", "plant-foreign-base", "plant-soak"]),
    ] {
        let failed = failed(&findings(Node::Plant, network, || Box::new(PlantDevice::with(network, Some(flaw)))));
        assert!(cases.iter().all(|case| failed.contains(case)), "{flaw:?}: {failed:?}");
    }
    let found = findings(Node::Exciter, network, || Box::new(ExciterDevice::with(network, Some(Flaw::OneCounter))));
    let failed = failed(&found);
    for case in ["exciter-counters", "exciter-leaves", "exciter-sine", "exciter-soak"] {
        assert!(failed.contains(&case), "{failed:?}");
    }
    // Its emergency and its last requests have other counters: they are lost to a plant.
    insta::assert_snapshot!(report(Flaw::JumpsInFault, "exciter-bus-off"), @r"
    failed: 1 of its frames is rejected (R-2.1): ExciterEmergency rejected: counter 8 after 0, a step of more than 4: 082#D3080C0000006400
    ExciterEmergency rejected: counter 8 after 0, a step of more than 4: 082#D3080C0000006400
    ");
}

/// The tester may have lost the frames before.
#[test]
fn a_rejected_counter_decides_nothing_if_the_tester_was_held_up() {
    let network = Network::default();
    let case = cases(Node::Plant, Mode::RealTime).find(|case| case.id == "plant-heartbeats").unwrap();
    let mut wire = Virtual::new(Box::new(PlantDevice::with(network, Some(Flaw::LosesCount))));
    wire.held_up_every = Some(400);
    let finding = run(&case, &mut wire, network, settings()).unwrap();
    assert!(matches!(&finding.verdict, Verdict::Inconclusive(text) if text.contains("held up for")), "{finding:?}");
}

/// An exciter that begins its sine at any phase has the opposite sign by chance, but not in each of three tries.
#[test]
fn an_exciter_of_the_opposite_sign_and_one_that_is_slow_to_arm_fail() {
    let network = Network::default();
    let verdict = |flaw, case_id: &str| {
        let case = cases(Node::Exciter, Mode::RealTime).find(|case| case.id == case_id).unwrap();
        let mut wire = Virtual::new(Box::new(StartedAgain::new(ExciterDevice::with(network, Some(flaw)), 0)));
        run(&case, &mut wire, network, Settings { patience_ns: 5_000_000_000, ..settings() }).unwrap().verdict
    };
    insta::assert_debug_snapshot!(verdict(Flaw::OppositeSign, "exciter-sine"), @r#"
    Failed(
        "its sine begins with negative force_x_n: it is the expected one with the opposite sign. Is a sign wrong?",
    )
    "#);
    insta::assert_debug_snapshot!(verdict(Flaw::SlowToArm, "exciter-asks-to-arm"), @r#"
    Failed(
        "it asks for arming 3000 ms after the plant's hello, at most 1000 ms are allowed",
    )
    "#);
}

/// A time base that is off is stated, and one that no quartz crystal has is a fault.
#[test]
fn the_time_base_of_a_sine_is_stated() {
    let network = Network::default();
    let finding = |flaw| {
        let case = cases(Node::Exciter, Mode::RealTime).find(|case| case.id == "exciter-sine").unwrap();
        let mut wire = Virtual::new(Box::new(ExciterDevice::with(network, flaw)));
        run(&case, &mut wire, network, settings()).unwrap()
    };
    insta::assert_debug_snapshot!(finding(None).measured, @r#"
    [
        "20.001 N at 15.00000 Hz, +0 ppm from 15 Hz (standard deviation 0.4 ppm)",
    ]
    "#);
    let fast = finding(Some(Flaw::FastBy(200)));
    assert_eq!(fast.verdict, Verdict::Passed);
    insta::assert_debug_snapshot!(fast.measured, @r#"
    [
        "20.000 N at 15.00300 Hz, +200 ppm from 15 Hz (standard deviation 0.4 ppm)",
    ]
    "#);
    insta::assert_debug_snapshot!(finding(Some(Flaw::FastBy(5000))).verdict, @r#"
    Failed(
        "it commands 20.000 N at 15.07500 Hz, +5000 ppm from 15 Hz (standard deviation 0.4 ppm), by its samples: at most 1000 ppm are allowed. Does its time advance by a sample period with each sample?",
    )
    "#);
}

/// Answers to samples before the series, and second ones, don't make the count larger than the series.
#[test]
fn no_more_samples_are_answered_than_were_sent() {
    let answers = Answered::new(&[98, 99, 100, 101, 101, 103, 300], 100, 5);
    assert_eq!((answers.count, answers.missing()), (3, 2));
    let wrapped = Answered::new(&[65_535, 0, 1], 65_535, 3);
    assert_eq!((wrapped.count, wrapped.missing()), (3, 0));
}

/// The report on a node with a flaw, by the case for it.
fn report(flaw: Flaw, case_id: &str) -> String {
    let network = Network::default();
    let tested = if case_id.starts_with("plant") { Node::Plant } else { Node::Exciter };
    let case = cases(tested, Mode::RealTime).find(|case| case.id == case_id).unwrap();
    let mut wire = Virtual::new(match tested {
        Node::Plant => Box::new(PlantDevice::with(network, Some(flaw))) as Box<dyn Device>,
        Node::Exciter => Box::new(ExciterDevice::with(network, Some(flaw))),
    });
    let finding = run(&case, &mut wire, network, settings()).unwrap();
    let mut lines = vec![match finding.verdict {
        Verdict::Passed => String::from("passed"),
        Verdict::Failed(text) => format!("failed: {text}"),
        Verdict::Inconclusive(text) => format!("inconclusive: {text}"),
        Verdict::Skipped(text) => format!("skipped: {text}"),
    }];
    lines.extend(finding.traffic.refused.iter().map(ToString::to_string));
    lines.join("\n")
}

#[test]
fn the_reason_describes_the_flaw() {
    insta::assert_snapshot!(report(Flaw::StepsBy(2), "plant-counters"), @"failed: the counter of ImpedanceHead is 2 for sample 1 after 0 for sample 0: a step of 2, not 1");
    insta::assert_snapshot!(report(Flaw::OneCounter, "exciter-counters"), @"failed: the first OperatorCommand after its boot has the counter 2, not 0");
    insta::assert_snapshot!(report(Flaw::Late(NodeState::PreOperational), "plant-states"), @"failed: its heartbeat pre-operational after the request comes 80 samples late, not at once");
    insta::assert_snapshot!(report(Flaw::Late(NodeState::Operational), "exciter-state-changes"), @"failed: it answers 80 samples before its heartbeat operational, which comes at once");
    insta::assert_snapshot!(report(Flaw::IgnoresReset, "plant-reset"), @"failed: in fault it ignores the reset: no heartbeat pre-operational within 150 ms");
    insta::assert_snapshot!(report(Flaw::CountsWallClock, "plant-stopped"), @"failed: stopped for 400 ms it takes its own silence for its partner's: plant, code 1: no valid command in time, at sample 209");
    insta::assert_snapshot!(report(Flaw::NeverLeaves, "exciter-leaves"), @"failed: it is silent for 1000 ms, and did not say before that it leaves");
    insta::assert_snapshot!(report(Flaw::WrongHash, "plant-hello"), @"failed: its hello is incompatible with this program's (another DBC): version 1.2, DBC hash 0x066601, profile classic, 1000 Hz, expected version 1.2, DBC hash 0x066600, profile classic, 1000 Hz");
    insta::assert_snapshot!(report(Flaw::NoLatch, "plant-states"), @"failed: in the state fault the request arm makes it pre-operational");
    insta::assert_snapshot!(report(Flaw::TakesOlder, "plant-older-command"), @"failed: it acts: the head reads -5.00 N at sample 260");
    insta::assert_snapshot!(report(Flaw::BelievesHellos, "plant-arms-for-a-hello"), @"failed: it arms in spite of the mismatch: no hello seen");
}

/// Only the machine's clock shows the delay, so the node fails at the third time.
#[test]
fn an_exciter_whose_heartbeat_is_late_each_time_fails() {
    let network = Network::default();
    let verdict = |case_id, state| {
        let case = cases(Node::Exciter, Mode::RealTime).find(|case| case.id == case_id).unwrap();
        let exciter = ExciterDevice::with(network, Some(Flaw::Late(state)));
        let mut wire = Virtual::new(Box::new(StartedAgain::new(exciter, 0)));
        run(&case, &mut wire, network, settings()).unwrap().verdict
    };
    insta::assert_debug_snapshot!(verdict("exciter-state-changes", NodeState::PreOperational), @r#"
    Failed(
        "its heartbeat pre-operational comes 80 ms after the plant's, not at once",
    )
    "#);
    insta::assert_debug_snapshot!(verdict("exciter-plant-faults", NodeState::Fault), @r#"
    Failed(
        "its heartbeat fault comes 80 ms after its emergency, not at once",
    )
    "#);
}

#[test]
fn a_wrong_crc_is_shown_beside_the_right_one() {
    insta::assert_snapshot!(report(Flaw::OtherPolynomial, "plant-hello"), @r"
    failed: its hello is wrong: PlantHello rejected: CRC 0xD7 instead of 0x5E: 206#D70012006606E803, with the right CRC 206#5E0012006606E803 (3 times)
    PlantHello rejected: CRC 0xD7 instead of 0x5E: 206#D70012006606E803, with the right CRC 206#5E0012006606E803 (3 times)
    ImpedanceHead rejected: CRC 0x2E instead of 0xF0: 203#2E00000000000000, with the right CRC 203#F000000000000000 (996 times)
    AccelerometerB rejected: CRC 0x85 instead of 0xE9: 204#8510FF7F00000000, with the right CRC 204#E910FF7F00000000 (997 times)
    AccelerometerC rejected: CRC 0xDC instead of 0x3A: 205#DC00000000000000, with the right CRC 205#3A00000000000000 (997 times)
    AccelerometerB rejected: counter 4 after 9, a step of more than 4: 204#C014FF7F0000F202
    AccelerometerC rejected: counter 11 after 1, a step of more than 4: 205#650B000000001703
    ImpedanceHead rejected: counter 5 after 14, a step of more than 4: 203#C405000000009803
    ");
    insta::assert_snapshot!(report(Flaw::OtherStart, "exciter-hello"), @r"
    failed: its hello is wrong: ExciterHello rejected: CRC 0xF4 instead of 0x77: 207#F40012006606E803, with the right CRC 207#770012006606E803 (3 times)
    ExciterHello rejected: CRC 0xF4 instead of 0x77: 207#F40012006606E803, with the right CRC 207#770012006606E803 (3 times)
    ");
    insta::assert_snapshot!(report(Flaw::OtherDataId, "exciter-hello"), @r"
    failed: its hello is wrong: ExciterHello rejected: CRC 0x28 instead of 0x77: 207#280012006606E803, with the right CRC 207#770012006606E803 (3 times)
    ExciterHello rejected: CRC 0x28 instead of 0x77: 207#280012006606E803, with the right CRC 207#770012006606E803 (3 times)
    ");
    insta::assert_snapshot!(report(Flaw::OtherDataId, "plant-states"), @r"
    inconclusive: no hello of a plant was received: check that it is on this bus, with this base, these node ids and this profile. Received instead: PlantHello rejected: CRC 0x01 instead of 0x5E: 206#010012006606E803, with the right CRC 206#5E0012006606E803 (4 times)
    PlantHello rejected: CRC 0x01 instead of 0x5E: 206#010012006606E803, with the right CRC 206#5E0012006606E803 (4 times)
    ImpedanceHead rejected: CRC 0xC1 instead of 0x9E: 203#C10A00000000581B, with the right CRC 203#9E0A00000000581B (2000 times)
    AccelerometerB rejected: CRC 0xD8 instead of 0x87: 204#D81AFF7F0000581B, with the right CRC 204#871AFF7F0000581B (2000 times)
    AccelerometerC rejected: CRC 0x0B instead of 0x54: 205#0B0A00000000581B, with the right CRC 205#540A00000000581B (2000 times)
    ");
}

#[test]
fn a_sine_that_is_not_the_expected_one_is_explained() {
    insta::assert_snapshot!(report(Flaw::Unscaled, "exciter-sine"), @"failed: it commands 0.4018 N, 0.0201 times the amplitude; expected 20 N at 15 Hz along force_x_n. Is it sent without the factor of its counts?");
    insta::assert_snapshot!(report(Flaw::Swapped, "exciter-sine"), @"failed: with the bytes of each value the other way round it commands 20.0012 N; expected 20 N at 15 Hz along force_x_n. Is its byte order wrong?");
    insta::assert_snapshot!(report(Flaw::ClipsAt(12), "exciter-sine"), @"failed: its commands are no sine: they are clipped at -12 and 12 N; expected 20 N at 15 Hz along force_x_n");
    insta::assert_snapshot!(report(Flaw::MostlyZero, "exciter-sine"), @"failed: its commands are no sine of this frequency: they are from -20 to 20 N, and the best sine leaves 6.1242 N rms of them; expected 20 N at 15 Hz along force_x_n");
    insta::assert_snapshot!(report(Flaw::FastBy(30_000), "exciter-sine"), @"failed: it commands 19.9998 N at 15.4500 Hz; expected 20 N at 15 Hz along force_x_n");
    insta::assert_snapshot!(report(Flaw::Skips(10), "exciter-answers"), @"failed: of 60 samples it leaves 6 without an answer within 150 ms, at a regular distance of 10 samples");
    insta::assert_snapshot!(report(Flaw::DeafToEmergencies, "exciter-plant-emergency"), @"failed: no heartbeat fault within 150 ms");
    insta::assert_snapshot!(report(Flaw::AnswersRemote, "exciter-remote-frames"), @"failed: it answers remote frames: 363 ExciterHeartbeat were received beside 30 remote frames of each message, and 3 without them");
    insta::assert_snapshot!(report(Flaw::FloodsHeartbeats, "exciter-heartbeats"), @"failed: 342 heartbeats, 1 of them of a new state, came in 1000 ms: at most 20 a second are allowed besides those of a new state");
    insta::assert_snapshot!(report(Flaw::OtherAxis, "exciter-sine"), @"failed: it commands 20.0012 N along force_y_n; expected 20 N at 15 Hz along force_x_n");
}

#[test]
fn an_exciter_with_a_flaw_fails_the_cases_for_it() {
    // The first good sample is answered like the last bad one.
    let answers_last = [
        "exciter-answers",
        "exciter-incomplete",
        "exciter-wrong-crc",
        "exciter-repeated-counter",
        "exciter-data-id",
        "exciter-foreign-base",
        "exciter-not-available",
        "exciter-load-wrong-crc",
        "exciter-soak",
    ];
    let answers_head = &answers_last[1..];
    let deaf_to_states = [
        "exciter-plant-in-fault",
        "exciter-plant-faults",
        "exciter-plant-boots",
        "exciter-plant-disarmed",
        "exciter-state-changes",
        "exciter-load-plant-disarmed",
    ];
    let table: [(Flaw, &[&str]); 35] = [
        (Flaw::IgnoresCrc, &["exciter-wrong-crc", "exciter-data-id", "exciter-load-wrong-crc", "exciter-soak"]),
        (Flaw::NoHeartbeats, &["exciter-heartbeats"]),
        (Flaw::FloodsHeartbeats, &["exciter-heartbeats"]),
        (Flaw::AnswersRemote, &["exciter-remote-frames"]),
        (Flaw::DeafToEmergencies, &["exciter-plant-emergency"]),
        (Flaw::Skips(10), &["exciter-answers"]),
        (Flaw::ClipsAt(12), &["exciter-sine"]),
        (Flaw::MostlyZero, &["exciter-sine"]),
        (Flaw::NoTimeout, &["exciter-sensor-timeout"]),
        (Flaw::WrongHash, &["exciter-hello", "exciter-load-hello"]),
        (Flaw::BelievesHellos, &["exciter-begins-for-a-hello"]),
        (Flaw::DeafToStates, &deaf_to_states),
        (Flaw::DeafToLeaving, &["exciter-plant-leaves"]),
        (Flaw::DeafToItself, &["exciter-second-sender"]),
        (Flaw::Dies, &["exciter-plant-faults", "exciter-leaves-faulted"]),
        (Flaw::Distracted, &["exciter-load-wrong-crc", "exciter-load-plant-disarmed"]),
        (Flaw::Clogs, &["exciter-soak"]),
        (Flaw::HidesBusLoss, &["exciter-bus-off"]),
        (Flaw::DeafToClipping, &["exciter-saturation"]),
        (Flaw::AnswersNext, &["exciter-answers", "exciter-soak"]),
        (Flaw::AnswersLast, &answers_last),
        (Flaw::StepsBy(2), &["exciter-counters"]),
        (Flaw::StepsBy(4), &["exciter-counters"]),
        (Flaw::Late(NodeState::Operational), &["exciter-state-changes"]),
        (Flaw::AnyBase, &["exciter-foreign-base", "exciter-soak"]),
        (Flaw::AnswersC, &["exciter-incomplete", "exciter-repeated-counter", "exciter-soak"]),
        (Flaw::AnswersHead, answers_head),
        (Flaw::NeverLeaves, &["exciter-leaves", "exciter-leaves-faulted"]),
        (Flaw::LeavesUnfaulted, &["exciter-leaves-faulted"]),
        (Flaw::Unscaled, &["exciter-sine"]),
        (Flaw::Swapped, &["exciter-sine"]),
        (Flaw::OtherAxis, &["exciter-sine"]),
        (Flaw::OtherPolynomial, &["exciter-hello", "exciter-heartbeats", "exciter-load-hello"]),
        (Flaw::OtherStart, &["exciter-hello", "exciter-heartbeats", "exciter-load-hello"]),
        (Flaw::OtherDataId, &["exciter-hello", "exciter-heartbeats", "exciter-load-hello"]),
    ];
    let network = Network::default();
    let found = table.map(|(flaw, _)| {
        let exciter = || Box::new(ExciterDevice::with(network, Some(flaw))) as Box<dyn Device>;
        (flaw, failed(&findings(Node::Exciter, network, exciter)))
    });
    assert_eq!(found, table.map(|(flaw, expected)| (flaw, expected.to_vec())));
}

#[test]
fn a_node_with_a_flaw_in_lockstep_fails_the_cases_for_it() {
    let network = Network::default();
    let plants: [(Flaw, &[&str]); 5] = [
        (Flaw::NoHeartbeats, &["lockstep-plant-heartbeats"]),
        (Flaw::DeafToLeaving, &["lockstep-plant-refused"]),
        (Flaw::RunsOn, &["lockstep-plant-waits", "lockstep-plant-other-samples"]),
        (Flaw::TakesOthers, &["lockstep-plant-other-samples", "lockstep-plant-refused"]),
        (Flaw::NoTimeout, &["lockstep-plant-timeout"]),
    ];
    for (flaw, expected) in plants {
        let plant = || Box::new(PlantDevice::in_mode(Mode::Lockstep, network, Some(flaw))) as Box<dyn Device>;
        assert_eq!(failed(&findings_in(Mode::Lockstep, Node::Plant, network, plant)), expected, "{flaw:?}");
    }
    let exciters: [(Flaw, &[&str]); 4] = [
        (Flaw::NoHeartbeats, &["lockstep-exciter-heartbeats"]),
        (Flaw::AnswersNext, &["lockstep-exciter-answers"]),
        (Flaw::Impatient, &["lockstep-exciter-waits", "lockstep-exciter-timeout"]),
        (Flaw::NoTimeout, &["lockstep-exciter-timeout"]),
    ];
    for (flaw, expected) in exciters {
        let exciter = || Box::new(ExciterDevice::in_mode(Mode::Lockstep, network, Some(flaw))) as Box<dyn Device>;
        assert_eq!(failed(&findings_in(Mode::Lockstep, Node::Exciter, network, exciter)), expected, "{flaw:?}");
    }
}

#[test]
fn an_exciter_that_answers_another_sample_in_lockstep_is_shown_which() {
    let network = Network::default();
    let case = cases(Node::Exciter, Mode::Lockstep).find(|case| case.id == "lockstep-exciter-answers").unwrap();
    let verdict = |flaw| {
        let device = ExciterDevice::in_mode(Mode::Lockstep, network, Some(flaw));
        let mut wire = Virtual::new(Box::new(StartedAgain::new(device, 0)));
        match run(&case, &mut wire, network, settings()).unwrap().verdict {
            Verdict::Failed(reason) => reason,
            verdict => panic!("{verdict:?}"),
        }
    };
    insta::assert_snapshot!(verdict(Flaw::AnswersNext), @"sample 0 waits for its answer, and it answers sample 1");
    insta::assert_snapshot!(verdict(Flaw::AnswersLast), @"sample 0 waits for its answer, and it answers sample 65535");
}

fn failed(found: &[(&'static str, Finding)]) -> Vec<&'static str> {
    let is_failed = |finding: &Finding| matches!(finding.verdict, Verdict::Failed(_));
    found.iter().filter(|(_, finding)| is_failed(finding)).map(|(id, _)| *id).collect()
}
