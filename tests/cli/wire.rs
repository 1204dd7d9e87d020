//! `protocol decode`, `import` and `inspect` with a user's own protocol.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use insta::assert_snapshot;
use resonarm::dbc::Database;
use resonarm::node::WireSpec;
use resonarm::node::mapped::mapping::{Mapping, Protection};
use resonarm::protocol::Frame;
use resonarm::recording::{Recording, SampleRecord, StateRecord};
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
        let Some(WireSpec::Mapped(mapping)) = scenario.wire_spec().unwrap() else { panic!("no mapping") };
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
        // The index of the bench has eight bits and began at another number than the run.
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
    // One bit of the force, which the checksum covers.
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
    assert_snapshot!(said.stdout, @r#"
    100#00000000000000CC  Drive ForceY=0 N (load force_y_n=0) Enable=0 (disarm) Alive=0 (counter) Crc=204 (checksum)
    100#F40101000000013D  Drive ForceY=10 N (load force_y_n=10) Enable=1 (arm) Alive=1 (counter) Crc=61 (checksum)
    100#F40101000000013D  Drive rejected: counter 1 was repeated; ForceY=10 N (load force_y_n=10) Enable=1 (arm, unchanged) Alive=1 (counter) Crc=61 (checksum)
    100#E7FF010000000445  Drive ForceY=-0.5 N (load force_y_n=-0.5) Enable=1 (arm, unchanged) Alive=4 (counter) Crc=69 (checksum); 2 lost before it
    100#E7FF010000000AE3  Drive rejected: 5 frames were lost before it, but at most 3 may be; ForceY=-0.5 N (load force_y_n=-0.5) Enable=1 (arm, unchanged) Alive=10 (counter) Crc=227 (checksum)
    100#3300010000000799  Drive rejected: the checksum is 0x99, expected 0xc4; ForceY=1.02 N (load force_y_n=1.02) Enable=1 (arm, unchanged) Alive=7 (counter) Crc=153 (checksum)
    201#83FF320002110382  Head HeadX=-1.25 N (head_force_x_n=-1.25) HeadY=0.5 N (head_force_y_n=0.5) State=2 "running" (operational) Sample=17 (sample) Alive=3 (counter) Crc=130 (checksum)
    200#03E80000F8300FA0  Accelerations BX=0.5 g (acceleration_b_x_m_s2=4.903325) BY=0 g (acceleration_b_y_m_s2=0) CX=-1 g (acceleration_c_x_m_s2=-9.80665) CY=2 g (acceleration_c_y_m_s2=19.6133)
    300#0A19  Cooling Speed=1000 1/min Temperature=25 °C
    300#0A  Cooling Speed=1000 1/min; 1 of 2 bytes, beyond them Temperature
    200#00010002  Accelerations rejected: the payload of 4 bytes ends before CX; BX=0.0005 g (acceleration_b_x_m_s2=0.004903325) BY=0.001 g (acceleration_b_y_m_s2=0.00980665); 4 of 8 bytes, beyond them CX, CY
    201#R8  Head requested by a remote frame, which the plant does not answer
    123#00  of no message in the DBC
    13 frames: 5 taken, 4 rejected, 1 of messages that are not mapped, 1 too short, 1 requests, 1 of no message; 2 lost before them
    "#);
    let found = document(folder.path(), 1, &[&decode[..], &["--json"]].concat());
    assert_eq!(found["counts"]["taken"], 5);
    assert_snapshot!(serde_json::to_string_pretty(&found["frames"][6]).unwrap(), @r#"
    {
      "beyond": [],
      "bytes": 8,
      "expected_bytes": 8,
      "frame": "201#83FF320002110382",
      "interface": null,
      "lost": 0,
      "means": {
        "Alive": [
          {
            "kind": "counter"
          }
        ],
        "Crc": [
          {
            "kind": "checksum"
          }
        ],
        "HeadX": [
          {
            "kind": "quantity",
            "name": "head_force_x_n",
            "unit": "N",
            "value": -1.25
          }
        ],
        "HeadY": [
          {
            "kind": "quantity",
            "name": "head_force_y_n",
            "unit": "N",
            "value": 0.5
          }
        ],
        "Sample": [
          {
            "kind": "sample"
          }
        ],
        "State": [
          {
            "kind": "state",
            "name": "operational"
          }
        ]
      },
      "message": "Head",
      "message_means": [],
      "raw": {},
      "senders": [
        "Plant"
      ],
      "signals": {
        "Alive": 3.0,
        "Crc": 130.0,
        "HeadX": -1.25,
        "HeadY": 0.5,
        "Sample": 17.0,
        "State": 2.0
      },
      "texts": {
        "State": "running"
      },
      "time_s": null,
      "units": {
        "HeadX": "N",
        "HeadY": "N"
      },
      "verdict": "taken"
    }
    "#);
}

/// A frame of one byte, which ends before its first signal: once it had two semicolons.
#[test]
fn a_frame_that_ends_before_its_first_signal_is_explained() {
    let folder = bench();
    let said = resonarm(folder.path(), &["protocol", "decode", "--scenario", "bench.toml", "200#00"]);
    let explained = said.stdout.lines().next().unwrap_or_default();
    assert_snapshot!(explained, @"200#00  Accelerations rejected: the payload of 1 bytes ends before BX; 1 of 8 bytes, beyond them BX, BY, CX, CY");
}

#[test]
fn frames_are_explained_by_a_dbc_alone() {
    let folder = bench();
    let said = resonarm(
        folder.path(),
        &["protocol", "decode", "--dbc", "bench.dbc", "300#0AE7", "201#0000000002000000", "300#0A", "123#00"],
    );
    assert_eq!((said.code, said.stderr.as_str()), (1, ""));
    assert_snapshot!(said.stdout, @r#"
    300#0AE7  Cooling Speed=1000 1/min Temperature=-25 °C
    201#0000000002000000  Head HeadX=0 N HeadY=0 N State=2 "running" Sample=0 Alive=0 Crc=0
    300#0A  Cooling Speed=1000 1/min; 1 of 2 bytes, beyond them Temperature
    123#00  of no message in the DBC
    4 frames: 2 decoded, 1 too short, 0 requests, 1 of no message
    "#);
    // Nothing is wrong with frames of others.
    assert_eq!(resonarm(folder.path(), &["protocol", "decode", "--dbc", "bench.dbc", "300#0AE7", "123#00"]).code, 0);
    fs::write(folder.path().join("odd.dbc"), "BO_ 256 Odd: 8 A\n SG_ Far : 60|8@1+ (1,0) [0|1] \"\" B\n").unwrap();
    let odd = resonarm(folder.path(), &["protocol", "decode", "--dbc", "odd.dbc", "100#0000000000000000"]);
    assert_eq!(odd.code, 0);
    assert!(
        odd.stderr.trim().ends_with(
            "odd.dbc, line 2: message Odd, signal Far: from start bit 60 its 8 bits take 9 bytes, but the payload has only 8"
        ),
        "{}",
        odd.stderr
    );
    assert_snapshot!(odd.stdout, @"100#0000000000000000  Odd");
}

/// Integers of more than 53 bits and signals that share bits have their values, and what is wrong is in the JSON, too.
#[test]
fn what_a_dbc_breaks_is_decoded_with_warnings() {
    let folder = tempfile::tempdir().unwrap();
    let dbc = "BO_ 258 TS: 8 A\n SG_ t : 0|64@1+ (1e-6,0) [0|0] \"s\" A\n SG_ n : 0|64@1+ (1,0) [0|0] \"\" A\n";
    fs::write(folder.path().join("a.dbc"), dbc).unwrap();
    let decode = ["protocol", "decode", "--dbc", "a.dbc", "102#0102030405060708"];
    assert_snapshot!(resonarm(folder.path(), &decode).stdout, @"102#0102030405060708  TS t=578437695752.307 s (raw 578437695752307201) n=578437695752307201");
    let found = document(folder.path(), 0, &[&decode[..], &["--json"]].concat());
    let frame = &found["frames"][0];
    assert_eq!(frame["raw"]["t"], 578_437_695_752_307_201_u64);
    assert_eq!(frame["signals"]["n"], 578_437_695_752_307_201_u64);
    assert_eq!(frame["signals"]["t"], 578_437_695_752.307_1);
    let warnings = found["warnings"].as_array().unwrap();
    assert_eq!(warnings.len(), 2);
    assert_eq!((&warnings[0]["line"], &warnings[0]["signal"]), (&2.into(), &"t".into()));
    assert_eq!(
        warnings[0]["problem"],
        "it is an integer of 64 bits: it must have at most 53, which a floating-point number represents exactly"
    );
}

/// The recording of a log has no scenario: a DBC says what its frames are.
#[test]
fn an_imported_log_is_explained_by_a_dbc() {
    let folder = bench();
    fs::write(folder.path().join("bus.log"), "(1.0) can0 300#0AE7\n(1.5) can0 123#00\n").unwrap();
    assert_eq!(resonarm(folder.path(), &["import", "bus.log", "bus.mcap"]).code, 0);
    let decode = ["protocol", "decode", "--recording", "bus.mcap"];
    let said = resonarm(folder.path(), &[&decode[..], &["--dbc", "bench.dbc"]].concat());
    assert_snapshot!(said.stdout, @"
    (0.000000) can0 300#0AE7  Cooling Speed=1000 1/min Temperature=-25 °C
    (0.500000) can0 123#00  of no message in the DBC
    2 frames: 1 decoded, 0 too short, 0 requests, 1 of no message
    ");
    assert_eq!(said.code, 0);
    assert_eq!(resonarm(folder.path(), &[&decode[..], &["--scenario", "bench.toml"]].concat()).code, 0);
    // Without either the frames are taken for those of Resonarm's protocol, as those of the log are.
    let plain = resonarm(folder.path(), &decode);
    assert_eq!(plain.stdout.lines().next(), Some("(0.000000) can0 300#0AE7  not of this network"));
    assert_eq!(plain.code, 0);
}

#[test]
fn bad_input_of_decode_is_refused() {
    let folder = bench();
    let said = |arguments: &[&str]| complaint(folder.path(), 2, &[&["protocol", "decode"], arguments].concat());
    assert_snapshot!(said(&["--dbc", "none.dbc", "300#00"]), @"resonarm: can't read the DBC none.dbc: No such file or directory (os error 2)");
    assert_snapshot!(said(&["--dbc", "bench.toml", "300#00"]), @r#"resonarm: bench.toml, line 1, column 1: expected a statement such as BO_, got "[rig.sensors.b]""#);
    assert_snapshot!(said(&["--scenario", "none.toml", "300#00"]), @"resonarm: can't read the scenario none.toml: No such file or directory (os error 2)");
    assert_snapshot!(said(&["--recording", "none.mcap"]), @"resonarm: can't read recording `none.mcap`: No such file or directory (os error 2)");
    assert!(said(&["--dbc", "bench.dbc", "--scenario", "bench.toml", "300#00"]).contains("cannot be used with"));
    assert!(said(&["--dbc", "bench.dbc", "--base", "0x300", "300#00"]).contains("cannot be used with"));
    fs::write(folder.path().join("plain.toml"), "[network]\nbase_id = 0x300\n").unwrap();
    let plain = resonarm(folder.path(), &["protocol", "decode", "--scenario", "plain.toml", "705#00", "702#05"]);
    assert_snapshot!(plain.stdout, @"
    705#00  not of this network
    702#05  ExciterHeartbeat state=5
    2 frames: 1 taken, 0 rejected, 1 of other protocols; 0 lost before them
    ");
}

/// A random force, as in a scenario.
const RANDOM: &str = "[excitation]\namplitude = { exciter_y = 6.0 }\n\
    profile = { waveform = 'random', from_hz = 5, to_hz = 80, duration_s = 12, seed = 2 }\n";

/// The readings of a run with an excitation, and the log of a bench that plays and reads the same.
fn logged(folder: &Path, excitation: &str, samples: impl Fn(u64) -> bool) -> Vec<SampleRecord> {
    fs::write(folder.join("run.toml"), excitation).unwrap();
    let run = ["run", "--mode", "free", "--scenario", "run.toml", "--record", "run.mcap"];
    assert_eq!(resonarm(folder, &run).code, 0);
    let recording = Recording::open(folder.join("run.mcap")).unwrap();
    let read: Vec<SampleRecord> = recording.samples().unwrap().map(Result::unwrap).collect();
    let held: Vec<f64> = recording.states().unwrap().map(|state| state.unwrap().load.force_n[1]).collect();
    let (wire, mut log) = (Wire::new(folder), String::new());
    for (sample, force_n) in read.iter().zip(held).filter(|(sample, _)| samples(sample.sample)) {
        let [accelerations, head] = wire.sample(sample);
        let drive = wire.frame("Drive", &[("ForceY", force_n), ("Enable", 1.0)], sample.sample);
        // One after another, as frames of a bus are.
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
    assert_snapshot!(said.stdout, @"
    bench.mcap: 36153 frames of 12.051 s; left out 0 of other interfaces and 0 lines or objects that are no frames
    readings of 12051 samples; 0 samples missing in 0 gaps, 0 left out since some of their frames are missing
    no states and loads; they are in the frames only: the user protocol does not carry alpha1_rad, alpha2_rad, alpha1_dot_rad_s, alpha2_dot_rad_s
    a message with readings has neither index nor counter: its frames are placed by their time stamps
    ");
    let recording = Recording::open(folder.join("bench.mcap")).unwrap();
    let read: Vec<SampleRecord> = recording.samples().unwrap().map(Result::unwrap).collect();
    assert_eq!(read.len(), expected.len());
    let near = |a: [f64; 2], b: [f64; 2], most: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= most);
    for (read, expected) in read.iter().zip(&expected) {
        assert_eq!((read.sample, read.clipped), (expected.sample, expected.clipped));
        // Half of a count of 0.0005 g, and a little for rounding.
        let half = 0.5 * 0.0005 * G_M_S2 * 1.000_001;
        assert!(near(read.acceleration_b_m_s2, expected.acceleration_b_m_s2, half), "{read:?} {expected:?}");
        assert!(near(read.acceleration_c_m_s2, expected.acceleration_c_m_s2, half), "{read:?} {expected:?}");
        assert!(near(read.head_force_n, expected.head_force_n, 0.005_001), "{read:?} {expected:?}");
    }
    // The modes are found in them.
    let found = document(folder, 0, &["identify", "bench.mcap", "--json"]);
    let first = found["modes"][0]["pole_frequency_hz"].as_f64().unwrap();
    assert!((first - 22.16).abs() < 0.05, "{first}");
    // The recording knows its own protocol.
    let decoded = resonarm(folder, &["protocol", "decode", "--recording", "bench.mcap"]);
    assert_eq!(decoded.code, 0);
    assert_snapshot!(decoded.stdout.lines().last().unwrap(), @"36153 frames: 36153 taken, 0 rejected, 0 of messages that are not mapped, 0 too short, 0 requests, 0 of no message; 0 lost before them");
    let statistics = &document(folder, 0, &["inspect", "bench.mcap", "--statistics", "--json"])["statistics"];
    assert_eq!(
        statistics["messages"],
        serde_json::json!({ "Accelerations": read.len(), "Drive": read.len(), "Head": read.len() })
    );
    assert_eq!((&statistics["lost_frames"], &statistics["foreign_frames"]), (&0.into(), &0.into()));
}

#[test]
fn what_a_log_lacks_is_a_gap() {
    let folder = bench();
    let folder = folder.path();
    // More are lost than the index of a sample can count.
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
    assert_snapshot!(said.stdout, @"
    bench.mcap: 34050 frames of 12.051 s; left out 0 of other interfaces and 0 lines or objects that are no frames
    readings of 11348 samples; 703 samples missing in 4 gaps, 2 left out since some of their frames are missing
    no states and loads; they are in the frames only: the user protocol does not carry alpha1_rad, alpha2_rad, alpha1_dot_rad_s, alpha2_dot_rad_s
    a message with readings has neither index nor counter: its frames are placed by their time stamps
    frames of Drive left out: 1; their checksum, counter or length is wrong, or a value is not a number
    frames of Head left out: 1; their checksum, counter or length is wrong, or a value is not a number
    frames left out because they repeat a sample or are late: 1; frames lost according to the counters: 14
    ");
    assert_snapshot!(complaint(folder, 2, &["identify", "bench.mcap"]), @"resonarm: recording `bench.mcap` is not continuous in topic `/plant/samples`: expected sample 100, got sample 101 (4 such gaps in all); the run lost records, or the file was recovered from a damaged one");
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
    assert_snapshot!(said.stdout, @"
    less.mcap: 2 frames of 0.001 s; left out 0 of other interfaces and 0 lines or objects that are no frames
    no readings: the user protocol does not carry acceleration_b_x_m_s2, nor head_force_x_n, head_force_y_n every sample
    no states and loads; they are in the frames only: the user protocol does not carry alpha1_rad, alpha2_rad, alpha1_dot_rad_s, alpha2_dot_rad_s
    ");
    let found =
        document(folder, 0, &["import", "less.log", "less.mcap", "--scenario", "less.toml", "--overwrite", "--json"]);
    assert_eq!(found["wire"]["samples"], 0);
    assert_eq!(found["wire"]["missing_readings"][0]["channel"], "head_force_x_n");
    assert_snapshot!(complaint(folder, 2, &["identify", "less.mcap"]), @"resonarm: the recording was imported from less.log and has no readings: the user protocol does not carry all of them, and `import` lists the missing ones");
}

#[test]
fn responses_to_a_controller_of_the_user_are_compared() {
    let folder = bench();
    let folder = folder.path();
    let dwell = "[excitation]\namplitude = { exciter_y = 6.0 }\n\
        profile = { waveform = 'dwell', frequency_hz = 18.0, duration_s = 6, settle_s = 4 }\n";
    logged(folder, dwell, |_| true);
    let of_plant = "[network]\nplant_converter = 'sinc5'\n";
    let scenario = format!("{}\n{of_plant}{dwell}", include_str!("wire/bench.toml"));
    fs::write(folder.join("dwell.toml"), scenario).unwrap();
    document(folder, 0, &["import", "bench.log", "bench.mcap", "--scenario", "dwell.toml", "--json"]);
    let [ours, theirs] = ["run.mcap", "bench.mcap"].map(|name| document(folder, 0, &["compare", name, "--json"]));
    let amplitude = |found: &serde_json::Value| found["points"][0]["readings"]["tip.y"]["amplitude"].as_f64().unwrap();
    assert!((amplitude(&theirs) / amplitude(&ours) - 1.0).abs() < 1e-3, "{ours:#} {theirs:#}");
    // Another excitation was played, or none is known.
    fs::write(
        folder.join("other.toml"),
        fs::read_to_string(folder.join("dwell.toml")).unwrap().replace("18.0", "19.0"),
    )
    .unwrap();
    let compare = |scenario: &str| {
        let import = ["import", "bench.log", "other.mcap", "--scenario", scenario, "--overwrite"];
        assert_eq!(resonarm(folder, &import).code, 0);
        complaint(folder, 2, &["compare", "other.mcap"])
    };
    assert!(compare("other.toml").contains("another controller was recorded"));
    assert_snapshot!(compare("bench.toml"), @"resonarm: other.mcap holds no responses: its scenario does not state what the exciter played; responses are read with [control] or with an [excitation] with `dwell`, `stepped-sine` or `sine-list`: `resonarm experiment walk --drive DOF=A --record walk.mcap` makes such a recording");
}

/// The scenario that the page on own protocols names.
#[test]
fn the_exciter_plays_the_example_on_its_own_protocol() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/own-protocol/exciter.toml");
    resonarm(folder.path(), &["run", "--mode", "free", "--scenario", scenario, "--record", "free.mcap"]);
    let verdict = document(folder.path(), 0, &["resim", "free.mcap", "--json"]);
    assert_eq!((verdict["identical"].as_bool(), verdict["samples"].as_u64()), (Some(true), Some(2002)));
}

/// A chain of three links on its own protocol: torque at joint 3, and all states as floats.
const CHAIN: &str = r#"
[structure]
kind = "chain"
links = [
  { length_m = 0.5, mass_kg = 20.0, centre_of_mass_m = 0.25, inertia_kg_m2 = 0.5, stiffness_nm_rad = 4e5, damping_nm_s_rad = 80.0, angle_deg = 10.0 },
  { length_m = 0.4, mass_kg = 12.0, centre_of_mass_m = 0.2, inertia_kg_m2 = 0.2, stiffness_nm_rad = 2e5, damping_nm_s_rad = 40.0, angle_deg = 20.0 },
  { length_m = 0.3, mass_kg = 6.0, centre_of_mass_m = 0.15, inertia_kg_m2 = 0.05, stiffness_nm_rad = 1e5, damping_nm_s_rad = 20.0, angle_deg = 30.0 },
]

[excitation]
amplitude = { joint3 = 20.0 }
ramp_s = 0.05
profile = { waveform = "dwell", frequency_hz = 15.0, duration_s = 0.3, settle_s = 0.1 }

[wire]
dbc = "chain.dbc"
lockstep = "command"
commands = [{ message = "Torque", torque3_nm = { signal = "Torque3" }, timeout_s = 0.5 }]
events = [{ message = "Torque", signal = "Enable", arm = [1], disarm = [0] }]

[[wire.readings]]
message = "Joint1"
every = 1
signals.Angle = { quantity = "alpha1_rad" }
signals.Rate = { quantity = "alpha1_dot_rad_s" }

[[wire.readings]]
message = "Joint2"
every = 1
signals.Angle = { quantity = "alpha2_rad" }
signals.Rate = { quantity = "alpha2_dot_rad_s" }

[[wire.readings]]
message = "Joint3"
every = 1
signals.Angle = { quantity = "alpha3_rad" }
signals.Rate = { quantity = "alpha3_dot_rad_s" }
"#;

/// A name means the same quantity whatever the structure: what a controller reads of a chain of three links, and what an
/// imported log holds, are the angles and rates that the run recorded. (As in a two-link arm, `alpha1_dot_rad_s` used to be
/// the third state, which is here the angle of joint 3.)
#[test]
fn a_log_of_a_chain_holds_the_states_that_its_run_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let mut dbc = String::from(
        "VERSION \"\"\nBU_: Plant Controller\nBO_ 256 Torque: 5 Controller\n SG_ Torque3 : 0|32@1- (1,0) [0|0] \"Nm\" Plant\n SG_ Enable : 32|8@1+ (1,0) [0|0] \"\" Plant\n",
    );
    let mut types = String::from("SIG_VALTYPE_ 256 Torque3 : 1;\n");
    for joint in 1..=3 {
        let id = 512 + joint;
        write!(
            dbc,
            "BO_ {id} Joint{joint}: 8 Plant\n SG_ Angle : 0|32@1- (1,0) [0|0] \"rad\" Controller\n \
             SG_ Rate : 32|32@1- (1,0) [0|0] \"rad/s\" Controller\n"
        )
        .unwrap();
        write!(types, "SIG_VALTYPE_ {id} Angle : 1;\nSIG_VALTYPE_ {id} Rate : 1;\n").unwrap();
    }
    fs::write(folder.path().join("chain.dbc"), dbc + &types).unwrap();
    fs::write(folder.path().join("chain.toml"), CHAIN).unwrap();
    document(
        folder.path(),
        0,
        &["run", "--mode", "free", "--scenario", "chain.toml", "--record", "run.mcap", "--json"],
    );
    document(folder.path(), 0, &["export", "run.mcap", "--to", "candump", "--json"]);
    let import = ["import", "run.log", "back.mcap", "--scenario", "chain.toml", "--json"];
    let imported = document(folder.path(), 0, &import);
    assert_eq!(imported["wire"]["missing_states"], serde_json::json!([]));
    // The commands are the excitation, rounded to floats.
    let compared = resonarm(folder.path(), &["compare", "run.mcap"]);
    assert!(!compared.stderr.contains("another controller"), "{}", compared.stderr);
    let states = |name: &str| -> Vec<StateRecord> {
        Recording::open(folder.path().join(name)).unwrap().states().unwrap().map(Result::unwrap).collect()
    };
    let (ours, back) = (states("run.mcap"), states("back.mcap"));
    assert!(back.len() > 250, "{} of {} samples", back.len(), ours.len());
    let largest = |of: &dyn Fn(&StateRecord) -> f64| ours.iter().map(|state| of(state).abs()).fold(0.0, f64::max);
    assert!(largest(&|state| state.load.torque_nm[2]) > 19.0 && largest(&|state| state.states.rates()[0]) > 1e-3);
    for state in &back {
        let recorded = ours.iter().find(|other| other.sample == state.sample).unwrap();
        assert_eq!(state.states.len(), 6);
        for (got, expected) in state.states.iter().zip(recorded.states.iter()) {
            // The frames carry floats of 32 bits.
            assert_eq!(*got as f32, *expected as f32, "sample {}", state.sample);
        }
    }
}
