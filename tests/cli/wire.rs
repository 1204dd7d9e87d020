//! `protocol decode`, `import` and `inspect` with a user's own protocol.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use insta::assert_snapshot;
use resonarm::dbc::Database;
use resonarm::node::WireSpec;
use resonarm::node::mapped::mapping::{Mapping, Protection};
use resonarm::protocol::Frame;
use resonarm::recording::{Recording, SampleRecord};
use resonarm::scenario::Scenario;

use crate::{complaint, document, resonarm};

/// m/s² of 1 g.
const G_M_S2: f64 = 9.806_65;
/// The beginning of the logs, s of the UNIX epoch.
const START_S: u64 = 1_700_000_000;

/// A folder with the DBC and the scenario `bench.toml`.
fn bench() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("bench.dbc"), include_str!("wire/bench.dbc")).unwrap();
    fs::write(folder.path().join("bench.toml"), include_str!("wire/bench.toml")).unwrap();
    folder
}

/// Makes protected frames of the bench.
struct Wire {
    database: Database,
    mapping: Mapping,
}

impl Wire {
    fn new(folder: &Path) -> Wire {
        let scenario = Scenario::read(&folder.join("bench.toml")).unwrap();
        let WireSpec::Mapped(mapping) = scenario.wire_spec().unwrap().unwrap();
        Wire { database: Database::read(&folder.join("bench.dbc")).unwrap(), mapping }
    }

    fn protection(&self, id: resonarm::protocol::Id) -> Protection {
        let incoming = self.mapping.incoming.iter().map(|of| (of.id, &of.protection));
        let mut all = incoming.chain(self.mapping.outgoing.iter().map(|of| (of.id, &of.protection)));
        all.find(|(other, _)| *other == id).map(|(_, protection)| protection.clone()).unwrap_or_default()
    }

    fn frame(&self, message: &str, values: &[(&str, f64)], counter: u64) -> Frame {
        let message = self.database.message(message).unwrap();
        let mut payload = vec![0; message.length()];
        message.codec().encode_into(values, &mut payload).unwrap();
        let protection = self.protection(message.id());
        if let Some(of) = &protection.counter {
            of.write(counter % of.values(), &mut payload).unwrap();
        }
        if let Some(checksum) = &protection.checksum {
            checksum.write(message.id(), &mut payload).unwrap();
        }
        Frame::new(message.id(), message.format(), &payload).unwrap()
    }

    /// The frames of a sample.
    fn sample(&self, sample: &SampleRecord) -> [Frame; 2] {
        let ([bx, by], [cx, cy]) = (sample.acceleration_b_m_s2, sample.acceleration_c_m_s2);
        let accelerations = [("BX", bx), ("BY", by), ("CX", cx), ("CY", cy)].map(|(name, of)| (name, of / G_M_S2));
        let [x, y] = sample.head_force_n;
        let index = ((sample.sample + 200) % 256) as f64;
        let head = [("HeadX", x), ("HeadY", y), ("State", 2.0), ("Sample", index)];
        [self.frame("Accelerations", &accelerations, 0), self.frame("Head", &head, sample.sample)]
    }
}

#[test]
fn frames_are_explained_by_the_scenario_s_own_protocol() {
    let folder = bench();
    let wire = Wire::new(folder.path());
    let drive = |force_n, enable, counter| wire.frame("Drive", &[("ForceY", force_n), ("Enable", enable)], counter);
    let head = [("HeadX", -1.25), ("HeadY", 0.5), ("State", 2.0), ("Sample", 17.0)];
    let mut wrong = drive(1.0, 1.0, 7).data().to_vec();
    wrong[0] ^= 1;
    let frames: Vec<String> = [
        drive(0.0, 0.0, 0),
        drive(10.0, 1.0, 1),
        drive(10.0, 1.0, 1),
        drive(-0.5, 1.0, 4),
        drive(-0.5, 1.0, 10),
        Frame::new(drive(0.0, 0.0, 0).id(), drive(0.0, 0.0, 0).format(), &wrong).unwrap(),
        wire.frame("Head", &head, 3),
        wire.frame("Accelerations", &[("BX", 0.5), ("BY", 0.0), ("CX", -1.0), ("CY", 2.0)], 0),
    ]
    .iter()
    .map(ToString::to_string)
    .chain(["300#0A19", "300#0A", "200#00010002", "201#R8", "123#00"].map(String::from))
    .collect();
    let frames: Vec<&str> = frames.iter().map(String::as_str).collect();
    let decode = [&["protocol", "decode", "--scenario", "bench.toml"], &frames[..]].concat();
    let said = resonarm(folder.path(), &decode);
    assert_eq!((said.code, said.stderr.as_str()), (1, ""));
    assert_snapshot!(said.stdout, @"");
    let found = document(folder.path(), 1, &[&decode[..], &["--json"]].concat());
    assert_eq!(found["counts"]["taken"], 5);
    assert_snapshot!(serde_json::to_string_pretty(&found["frames"][6]).unwrap(), @"");
}

#[test]
fn frames_are_explained_by_a_dbc_alone() {
    let folder = bench();
    let said = resonarm(
        folder.path(),
        &["protocol", "decode", "--dbc", "bench.dbc", "300#0AE7", "201#0000000002000000", "300#0A", "123#00"],
    );
    assert_eq!((said.code, said.stderr.as_str()), (1, ""));
    assert_snapshot!(said.stdout, @"");
    // Nothing is wrong with frames of others.
    assert_eq!(resonarm(folder.path(), &["protocol", "decode", "--dbc", "bench.dbc", "300#0AE7", "123#00"]).code, 0);
    fs::write(folder.path().join("odd.dbc"), "BO_ 256 Odd: 8 A\n SG_ Far : 60|8@1+ (1,0) [0|1] \"\" B\n").unwrap();
    let odd = resonarm(folder.path(), &["protocol", "decode", "--dbc", "odd.dbc", "100#0000000000000000"]);
    assert_eq!(odd.code, 0);
    assert_snapshot!(odd.stderr, @"");
    assert_snapshot!(odd.stdout, @"");
}

#[test]
fn bad_input_of_decode_is_refused() {
    let folder = bench();
    let said = |arguments: &[&str]| complaint(folder.path(), 2, &[&["protocol", "decode"], arguments].concat());
    assert_snapshot!(said(&["--dbc", "none.dbc", "300#00"]), @"");
    assert_snapshot!(said(&["--dbc", "bench.toml", "300#00"]), @"");
    assert_snapshot!(said(&["--scenario", "none.toml", "300#00"]), @"");
    assert_snapshot!(said(&["--recording", "none.mcap"]), @"");
    assert!(said(&["--dbc", "bench.dbc", "--scenario", "bench.toml", "300#00"]).contains("cannot be used with"));
    assert!(said(&["--dbc", "bench.dbc", "--base", "0x300", "300#00"]).contains("cannot be used with"));
    fs::write(folder.path().join("plain.toml"), "[network]\nbase_id = 0x300\n").unwrap();
    let plain = resonarm(folder.path(), &["protocol", "decode", "--scenario", "plain.toml", "705#00", "702#05"]);
    assert_snapshot!(plain.stdout, @"");
}

/// A random force, as in a scenario.
const RANDOM: &str = "[excitation]\namplitude = { force_y_n = 6.0 }\n\
    profile = { waveform = 'random', from_hz = 5, to_hz = 80, duration_s = 12, seed = 2 }\n";

/// The readings of a run with an excitation, and the log of a bench that plays and reads the same.
fn logged(folder: &Path, excitation: &str, samples: impl Fn(u64) -> bool) -> Vec<SampleRecord> {
    fs::write(folder.join("run.toml"), excitation).unwrap();
    let run = ["run", "--mode", "free", "--scenario", "run.toml", "--record", "run.mcap"];
    assert_eq!(resonarm(folder, &run).code, 0);
    let recording = Recording::open(folder.join("run.mcap")).unwrap();
    let read: Vec<SampleRecord> = recording.samples().unwrap().map(Result::unwrap).collect();
    let held: Vec<f64> = recording.states().unwrap().map(|state| state.unwrap().force_n[1]).collect();
    let (wire, mut log) = (Wire::new(folder), String::new());
    for (sample, force_n) in read.iter().zip(held).filter(|(sample, _)| samples(sample.sample)) {
        let [accelerations, head] = wire.sample(sample);
        let drive = wire.frame("Drive", &[("ForceY", force_n), ("Enable", 1.0)], sample.sample);
        for (frame, delay_us) in [(accelerations, 0), (head, 240), (drive, 500)] {
            let us = sample.sample * 1000 + delay_us;
            writeln!(log, "({}.{:06}) can0 {frame}", START_S + us / 1_000_000, us % 1_000_000).unwrap();
        }
    }
    fs::write(folder.join("bench.log"), log).unwrap();
    read
}

#[test]
fn readings_of_a_log_are_those_of_the_bench() {
    let folder = bench();
    let folder = folder.path();
    let expected = logged(folder, RANDOM, |_| true);
    let said = resonarm(folder, &["import", "bench.log", "bench.mcap", "--scenario", "bench.toml"]);
    assert_eq!((said.code, said.stderr.as_str()), (0, ""));
    assert_snapshot!(said.stdout, @"");
    let recording = Recording::open(folder.join("bench.mcap")).unwrap();
    let read: Vec<SampleRecord> = recording.samples().unwrap().map(Result::unwrap).collect();
    assert_eq!(read.len(), expected.len());
    let near = |a: [f64; 2], b: [f64; 2], most: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= most);
    for (read, expected) in read.iter().zip(&expected) {
        assert_eq!((read.sample, read.clipped), (expected.sample, expected.clipped));
        let half = 0.5 * 0.0005 * G_M_S2 * 1.000_001;
        assert!(near(read.acceleration_b_m_s2, expected.acceleration_b_m_s2, half), "{read:?} {expected:?}");
        assert!(near(read.acceleration_c_m_s2, expected.acceleration_c_m_s2, half), "{read:?} {expected:?}");
        assert!(near(read.head_force_n, expected.head_force_n, 0.005_001), "{read:?} {expected:?}");
    }
    // The modes are found in them.
    let found = document(folder, 0, &["identify", "bench.mcap", "--json"]);
    let first = found["modes"][0]["frequency_hz"].as_f64().unwrap();
    assert!((first - 22.16).abs() < 0.05, "{first}");
    // The recording knows its own protocol.
    let decoded = resonarm(folder, &["protocol", "decode", "--recording", "bench.mcap"]);
    assert_eq!(decoded.code, 0);
    assert_snapshot!(decoded.stdout.lines().last().unwrap(), @"");
    let statistics = &document(folder, 0, &["inspect", "bench.mcap", "--statistics", "--json"])["statistics"];
    assert_eq!(statistics["messages"], serde_json::json!({ "Accelerations": read.len(), "Drive": read.len(), "Head": read.len() }));
    assert_eq!((&statistics["lost_frames"], &statistics["foreign_frames"]), (&0.into(), &0.into()));
}

#[test]
fn what_a_log_lacks_is_a_gap() {
    let folder = bench();
    let folder = folder.path();
    // More are lost than the index of a sample can say.
    logged(folder, RANDOM, |sample| !(1000..1700).contains(&sample) && sample != 3000);
    let log = fs::read_to_string(folder.join("bench.log")).unwrap();
    let wrong = |(number, line): (usize, &str)| match number {
        // Of three frames of the head one has another force, one comes twice, one is missing.
        301 => line.replace("#", "#FF").get(..line.len()).map(String::from),
        601 => Some(format!("{line}\n{line}")),
        901 => None,
        _ => Some(line.to_string()),
    };
    let lines: Vec<String> = log.lines().enumerate().filter_map(wrong).collect();
    fs::write(folder.join("bench.log"), lines.join("\n") + "\n").unwrap();
    let said = resonarm(folder, &["import", "bench.log", "bench.mcap", "--scenario", "bench.toml"]);
    assert_eq!((said.code, said.stderr.as_str()), (0, ""));
    assert_snapshot!(said.stdout, @"");
    assert_snapshot!(complaint(folder, 2, &["identify", "bench.mcap"]), @"");
}

#[test]
fn readings_that_the_wire_does_not_carry_are_named() {
    let folder = bench();
    let folder = folder.path();
    let scenario = include_str!("wire/bench.toml");
    let less = scenario.replace("message = \"Head\"\n", "message = \"Head\"\nevery = 10\n");
    let less = less.replace("signals.BX = { quantity = \"acceleration_b_x_m_s2\" }\n", "");
    fs::write(folder.join("less.toml"), less).unwrap();
    fs::write(folder.join("less.log"), "(1.000000) can0 200#0000000000000000\n(1.001000) can0 300#0A19\n").unwrap();
    let said = resonarm(folder, &["import", "less.log", "less.mcap", "--scenario", "less.toml"]);
    assert_eq!((said.code, said.stderr.as_str()), (0, ""));
    assert_snapshot!(said.stdout, @"");
    let found =
        document(folder, 0, &["import", "less.log", "less.mcap", "--scenario", "less.toml", "--overwrite", "--json"]);
    assert_eq!(found["wire"]["samples"], 0);
    assert_eq!(found["wire"]["missing_readings"][0]["channel"], "head_force_x_n");
    assert!(complaint(folder, 2, &["identify", "less.mcap"]).contains("/plant/samples"));
}

#[test]
fn responses_to_a_controller_of_the_user_are_compared() {
    let folder = bench();
    let folder = folder.path();
    let dwell = "[excitation]\namplitude = { force_y_n = 6.0 }\n\
        profile = { waveform = 'dwell', frequency_hz = 18.0, duration_s = 6, settle_s = 4 }\n";
    logged(folder, dwell, |_| true);
    let scenario = format!("{}\n{dwell}", include_str!("wire/bench.toml"));
    fs::write(folder.join("dwell.toml"), scenario).unwrap();
    document(folder, 0, &["import", "bench.log", "bench.mcap", "--scenario", "dwell.toml", "--json"]);
    let [ours, theirs] = ["run.mcap", "bench.mcap"].map(|name| document(folder, 0, &["compare", name, "--json"]));
    let amplitude = |found: &serde_json::Value| found["points"][0]["harmonic1_rad"][1].as_f64().unwrap();
    assert!((amplitude(&theirs) / amplitude(&ours) - 1.0).abs() < 1e-3, "{ours:#} {theirs:#}");
    // Another excitation was played, or none is known.
    fs::write(folder.join("other.toml"), fs::read_to_string(folder.join("dwell.toml")).unwrap().replace("18.0", "19.0"))
        .unwrap();
    let compare = |scenario: &str| {
        let import = ["import", "bench.log", "other.mcap", "--scenario", scenario, "--overwrite"];
        assert_eq!(resonarm(folder, &import).code, 0);
        complaint(folder, 2, &["compare", "other.mcap"])
    };
    assert!(compare("other.toml").contains("another controller was recorded"));
    assert_snapshot!(compare("bench.toml"), @"");
}
