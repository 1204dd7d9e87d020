//! `conformance`: its flags, and a missing bus. `tests/vcan` tests its verdicts on nodes.

use std::path::Path;

use insta::assert_snapshot;

use crate::complaint;

fn conformance(code: i32, arguments: &[&str]) -> String {
    complaint(Path::new("."), code, &[&["conformance", "--role", "plant"], arguments].concat())
}

#[test]
fn flags_that_cannot_be() {
    assert_snapshot!(conformance(2, &["--bus", "vcan0", "--force-n", "0"]), @"resonarm: --force-n must be a number above 0 N");
    assert_snapshot!(conformance(2, &["--bus", "vcan0", "--beyond-n", "nan"]), @r"
    error: invalid value 'nan' for '--beyond-n <N>': it must be a finite number

    For more information, try '--help'.
    ");
    assert_snapshot!(conformance(2, &["--bus", "vcan0", "--beyond-n-per-s", "-1"]), @"resonarm: --beyond-n-per-s must be a number above 0 N/s");
    assert_snapshot!(conformance(2, &["--bus", "vcan0", "--beyond-travel-n", "0"]), @"resonarm: --beyond-travel-n must be a number above 0 N");
    assert_snapshot!(conformance(2, &["--bus", "vcan0", "--patience-s", "-1"]), @"resonarm: --patience-s is -1: cannot convert float seconds to Duration: value is negative; expected a time in seconds, 0 or more");
    assert_snapshot!(conformance(2, &["--bus", "vcan0", "--seed", "1.5"]), @r"
    error: invalid value '1.5' for '--seed <N>': a seed is a whole number from 0 to 18446744073709551615, or hexadecimal as 0x1F

    For more information, try '--help'.
    ");
    assert_snapshot!(conformance(2, &["--bus", "vcan0", "--exciter-id", "1"]), @"resonarm: plant and exciter both have the node id 1: give them different ones");
    assert_snapshot!(conformance(2, &["--bus", "memory"]), @"resonarm: a memory bus exists only inside one process, and no other program can be reached on it: expected a bus that several processes share. Use vcan0 or another CAN interface; `resonarm demo` runs plant and exciter together on a memory bus");
    assert_snapshot!(conformance(2, &["--bus", "vcan0", "--case", "exciter"]), @r#"resonarm: unknown case "exciter", expected one of plant-hello, plant-first-hello, plant-heartbeats, plant-frames, plant-counters, plant-remote-frames, plant-arms-for-a-hello, plant-states, plant-reset, plant-commands-act, plant-not-armed, plant-wrong-crc, plant-repeated-counter, plant-counter-jump, plant-data-id, plant-other-format, plant-length, plant-extended-id, plant-foreign-base, plant-reserved-bit, plant-not-available, plant-old-command, plant-early-command, plant-same-sample, plant-older-command, plant-too-large, plant-too-fast, plant-command-timeout, plant-disarm, plant-partner-fault, plant-exciter-leaves, plant-second-sender, plant-stopped, plant-bus-off, plant-saturation, plant-pairs, plant-load-hello, plant-load-wrong-crc, plant-load-states, plant-soak, plant-too-far"#);
    assert_snapshot!(conformance(2, &["--bus", "vcan0", "--bit-rate-hz", "9600"]), @r"
    error: invalid value '9600' for '--bit-rate-hz <HZ>': it must be an integer from 10000 to 1000000

    For more information, try '--help'.
    ");
    assert_snapshot!(conformance(2, &["--bus", "vcan0", "--soak-s", "nan"]), @r"
    error: invalid value 'nan' for '--soak-s <S>': it must be a finite number

    For more information, try '--help'.
    ");
}

#[test]
fn forces_that_cannot_be() {
    let on_vcan0 = |arguments: &[&str]| conformance(2, &[&["--bus", "vcan0"], arguments].concat());
    assert_snapshot!(on_vcan0(&["--force-n", "700"]), @"resonarm: --force-n is 700 N, but commands of the classic profile reach only ±655.34 N; use --profile fd, which carries more");
    assert_snapshot!(on_vcan0(&["--beyond-n", "700"]), @"resonarm: --beyond-n is 700 N, but commands of the classic profile reach only ±655.34 N; use --profile fd, which carries more");
    assert_snapshot!(on_vcan0(&["--beyond-travel-n", "1e39", "--profile", "fd"]), @"resonarm: --beyond-travel-n is 1e39 N, but commands of the fd profile reach only ±3.4028234663852886e38 N");
    assert_snapshot!(on_vcan0(&["--beyond-n", "5"]), @"resonarm: --beyond-n is 5 N, but it must be larger than --force-n, 5 N");
    assert_snapshot!(on_vcan0(&["--expect-force-n", "20", "--expect-frequency-hz", "15"]), @"resonarm: --expect-frequency-hz is for --role exciter: leave it out");
    let of_exciter = |arguments: &[&str]| {
        complaint(Path::new("."), 2, &[&["conformance", "--role", "exciter", "--bus", "vcan0"], arguments].concat())
    };
    assert_snapshot!(of_exciter(&["--beyond-n", "600"]), @"resonarm: --beyond-n is for --role plant: leave it out");
    assert_snapshot!(of_exciter(&["--expect-force-n", "20"]), @"resonarm: an expected sine needs its frequency and its amplitude: give --expect-frequency-hz with --expect-force-n or --expect-torque-nm");
    assert_snapshot!(of_exciter(&["--expect-frequency-hz", "0"]), @"resonarm: --expect-frequency-hz must be a number above 0 Hz");
    let both = ["--expect-force-n", "20", "--expect-torque-nm", "20", "--expect-frequency-hz", "15"];
    assert_snapshot!(of_exciter(&both), @"resonarm: --expect-force-n and --expect-torque-nm exclude each other, since a command is a force or a torque: give one of them");
}

#[test]
fn scenarios_that_cannot_be() {
    let on = |scenario: &str, arguments: &[&str]| {
        let all = [&["--bus", "nobody0", "--scenario", scenario], arguments].concat();
        conformance(2, &all)
    };
    let (own, drives) = ("examples/own-protocol/bench.toml", "examples/canopen/drives.toml");
    assert_snapshot!(on("scenarios/bench.toml", &[]), @"resonarm: the scenario has no [wire], so it maps no user protocol: leave the scenario out to test on Resonarm's protocol");
    assert_snapshot!(on(own, &["--base", "0x300"]), @r"
    error: the argument '--scenario <FILE>' cannot be used with '--base <ID>'

    Usage: resonarm conformance --bus <BUS> --role <ROLE> --scenario <FILE>

    For more information, try '--help'.
    ");
    assert_snapshot!(on(own, &["--torque-nm", "0"]), @"resonarm: --torque-nm must be a number above 0 N m");
    assert_snapshot!(on("examples/odrive/drives.toml", &["--mode", "lockstep"]), @r#"resonarm: [wire] does not define lockstep: give `lockstep = "command"` or `lockstep = "sync"`, or run in real time"#);
    assert_snapshot!(on(drives, &["--case", "x"]), @r#"resonarm: unknown case "x", expected one of plant-rates, plant-requests, plant-frames, plant-counters, plant-arms, plant-commands-act, plant-wrong-checksum, plant-repeated-counter, plant-counter-jump, plant-length, plant-not-finite, plant-too-large, plant-command-timeout, plant-disarm, plant-reset, plant-stop, plant-objects, plant-aborts, plant-states, plant-heartbeats, plant-positions, plant-not-enabled, plant-emergencies"#);
    assert_snapshot!(conformance(2, &["--bus", "nobody0", "--torque-nm", "3"]), @r"
    error: the following required arguments were not provided:
      --scenario <FILE>

    Usage: resonarm conformance --bus <BUS> --role <ROLE> --scenario <FILE> --torque-nm <NM>

    For more information, try '--help'.
    ");
}

#[test]
fn existing_files_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    // The bus need not exist: files are checked before it is opened.
    std::fs::write(folder.path().join("report.xml"), "kept").unwrap();
    for flag in ["--junit", "--record"] {
        let arguments = ["conformance", "--role", "plant", "--bus", "vcan0", flag, "report.xml"];
        let said = complaint(folder.path(), 2, &arguments);
        assert!(said.starts_with("resonarm: report.xml already exists: "), "{said}");
    }
    assert_eq!(std::fs::read_to_string(folder.path().join("report.xml")).unwrap(), "kept");
}

/// Either the interface is missing, or CAN itself.
#[test]
fn a_missing_bus_has_its_exit_code() {
    let said = complaint(Path::new("."), 3, &["conformance", "--role", "plant", "--bus", "nobody0"]);
    assert!(said.starts_with("resonarm: "), "{said}");
}

/// A bus inside this process.
#[cfg(feature = "python-can")]
mod on_an_empty_bus {
    use super::*;
    use crate::{document, names, resonarm};

    const EMPTY: [&str; 9] = [
        "conformance",
        "--bus",
        "python-can:interface=virtual,channel=conformance",
        "--patience-s",
        "0.05",
        "--role",
        "plant",
        "--case",
        "plant-hello",
    ];

    #[test]
    fn nothing_is_passed() {
        let folder = tempfile::tempdir().unwrap();
        let said = document(folder.path(), 1, &[&EMPTY[..], &["--json", "--junit", "report.xml"]].concat());
        let counts = ["passed", "failed", "inconclusive", "skipped", "not_run"].map(|name| said[name].as_u64());
        assert_eq!(counts, [0, 0, 1, 0, 0].map(Some));
        assert_snapshot!(names(&said).join(" "), @"cases commands failed inconclusive not_run passed recording role skipped untested");
        assert_snapshot!(names(&said["cases"][0]).join(" "), @"case heard held_up_ms measured others reason refused requirements silent_ms title took_s verdict");
        assert_snapshot!(said["cases"][0]["reason"].as_str().unwrap(), @"no hello of a plant was received: check that it is on this bus, with this base, these node ids and this profile. Received instead: nothing");
        assert_eq!(said["untested"][0]["requirement"], "R-1.1");
        let junit = std::fs::read_to_string(folder.path().join("report.xml")).unwrap();
        // The duration differs from run to run.
        let took = junit.split("time=\"").nth(1).unwrap().split('"').next().unwrap();
        assert_snapshot!(junit.replace(took, "TIME"), @r#"
        <?xml version="1.0" encoding="UTF-8"?>
        <testsuites>
          <testsuite name="resonarm conformance plant" tests="1" failures="0" skipped="1">
            <testcase classname="resonarm" name="plant-hello" time="TIME"><skipped message="inconclusive: no hello of a plant was received: check that it is on this bus, with this base, these node ids and this profile. Received instead: nothing"/></testcase>
          </testsuite>
        </testsuites>
        "#);
    }

    #[test]
    fn the_text_has_the_same_content() {
        let outcome = resonarm(Path::new("."), &EMPTY);
        assert_eq!((outcome.code, outcome.stderr.as_str()), (1, ""));
        assert_snapshot!(outcome.stdout, @r"
        inconclusive  plant-hello                version, profile, DBC hash and rate in its hello
                      no hello of a plant was received: check that it is on this bus, with this base, these node ids and this profile. Received instead: nothing  R-6.5
                      heard: nothing
        0 passed, 0 failed, 1 inconclusive, 0 skipped, 0 not run
        ");
    }
}
