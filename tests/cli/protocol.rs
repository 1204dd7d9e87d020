//! `protocol`: the wire's documents, and decoding and encoding of frames.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use insta::assert_snapshot;

use crate::{complaint, document, names, resonarm};

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Exit code and standard output of a command that reads `input`.
fn piped(arguments: &[&str], input: &str) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_resonarm"));
    command.args(arguments).env_remove("RESONARM_LOG");
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

const LOG: &str = "\
(1.000000) vcan0 702#00
(1.100000) vcan0 201#8A00F40183FF3412
(1.200000) vcan0 201#8A00F40183FF3412

(1.300000) vcan0 123#00
(1.400000) vcan0 081#2100010003054812 R
203#R8
";

#[test]
fn a_log_is_decoded_with_a_receiver_s_verdicts() {
    let (code, stdout, stderr) = piped(&["protocol", "decode"], LOG);
    assert_eq!((code, stderr.as_str()), (1, ""));
    assert_snapshot!(stdout, @r"
    (1.000000) vcan0 702#00  ExciterHeartbeat state=0
    (1.100000) vcan0 201#8A00F40183FF3412  ForceCommand force_x_n=10 force_y_n=-2.5 sample=4660
    (1.200000) vcan0 201#8A00F40183FF3412  ForceCommand rejected: counter 0 was repeated
    (1.300000) vcan0 123#00  not of this network
    (1.400000) vcan0 081#2100010003054812  PlantEmergency code=1 detail=1283 sample=4680 (plant, code 1: no valid command in time (3 rejected, the last because the load is beyond the exciter's limits), at sample 4680)
    203#R8  ImpedanceHead rejected: expected a data frame, got a remote frame
    6 frames: 3 taken, 2 rejected, 1 of other protocols; 0 lost before them
    ");
    let (code, stdout, _) = piped(&["protocol", "decode", "--json"], LOG);
    let found: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!((code, found["counts"]["taken"].as_u64(), found["counts"]["refused"].as_u64()), (1, Some(3), Some(2)));
    let frames = found["frames"].as_array().unwrap();
    assert_eq!(names(&frames[1]), ["frame", "interface", "message", "sender", "signals", "time_s", "verdict"]);
    assert_eq!(frames[1]["signals"]["force_y_n"], -2.5);
    assert_eq!(frames[2]["reason"], "ForceCommand rejected: counter 0 was repeated");
}

#[test]
fn encoded_frames_decode_in_every_network() {
    for network in [&["--profile", "classic"][..], &["--profile", "fd", "--base", "0x300", "--plant-id", "7"]] {
        let signals = ["ForceCommand", "force_x_n=10", "force_y_n=-2.5", "sample=0x1234", "--counter", "3"];
        let made = resonarm(here(), &[&["protocol", "encode"], &signals[..], network].concat());
        assert_eq!((made.code, made.stderr.as_str()), (0, ""));
        let found = document(here(), 0, &[&["protocol", "decode", made.stdout.trim(), "--json"], network].concat());
        let frame = &found["frames"][0];
        assert_eq!((&frame["message"], &frame["verdict"]), (&"ForceCommand".into(), &"taken".into()));
        assert_eq!(frame["signals"], serde_json::json!({ "force_x_n": 10.0, "force_y_n": -2.5, "sample": 4660.0 }));
    }
    // A million newtons are beyond a classic frame's range, and within that of CAN FD.
    let fd = resonarm(
        here(),
        &["protocol", "encode", "ForceCommand", "force_x_n=1e6", "force_y_n=0", "sample=1", "--profile", "fd"],
    );
    let as_classic = resonarm(here(), &["protocol", "decode", fd.stdout.trim()]);
    assert_eq!(as_classic.code, 1);
    assert!(as_classic.stdout.ends_with("ForceCommand rejected: expected a classical frame, got a CAN FD frame\n"));
}

#[test]
fn the_documents_are_those_of_the_crate() {
    let file = |name: &str| std::fs::read_to_string(here().join("firmware-protocol").join(name)).unwrap();
    let printed = |arguments: &[&str]| resonarm(here(), arguments).stdout;
    assert_eq!(printed(&["protocol", "spec"]), file("SPEC.md"));
    assert_eq!(printed(&["protocol", "dbc"]), file("resonarm.dbc"));
    assert_eq!(printed(&["protocol", "dbc", "--profile", "fd"]), file("resonarm-fd.dbc"));
    assert_eq!(printed(&["protocol", "header"]), file("c/include/resonarm_config.h"));
    let moved = printed(&["protocol", "dbc", "--base", "0x300", "--plant-id", "3"]);
    assert!(moved.contains("\nBO_ 769 ForceCommand: 8 Exciter\n") && moved.contains("\nBA_ \"NodeId\" BU_ Plant 3;\n"));
    assert!(moved.contains("\nBO_ 1795 PlantHeartbeat: 1 Plant\n"));
    let moved = printed(&["protocol", "header", "--base", "0x300", "--plant-id", "3", "--profile", "fd"]);
    assert!(
        moved.contains("\n#define RESONARM_FORCE_COMMAND_ID 0x301u\n#define RESONARM_FORCE_COMMAND_DATA_ID 0x5402u\n")
    );
    assert!(moved.contains("\n#define RESONARM_FORCE_COMMAND_BYTES 16u\n"));
}

#[test]
fn bad_input_is_refused() {
    let said = |arguments: &[&str]| complaint(here(), 2, &[&["protocol"], arguments].concat());
    assert_snapshot!(said(&["decode", "201#0"]), @r#"resonarm: "201#0": the data must be pairs of hexadecimal digits"#);
    assert_snapshot!(said(&["decode", "201#00", "--base", "0x205"]), @"resonarm: base identifier 0x205 is not a multiple of 0x10: take 0x200");
    assert_snapshot!(said(&["dbc", "--plant-id", "2"]), @"resonarm: plant and exciter both have the node id 2: give them different ones");
    assert_snapshot!(said(&["header", "--base", "0x600"]), @"resonarm: base identifier 0x600 is outside 0x180 to 0x570");
    assert_snapshot!(said(&["encode", "Force"]), @r#"resonarm: unknown message "Force", expected one of OperatorCommand, ForceCommand, TorqueCommand, ImpedanceHead, AccelerometerB, AccelerometerC, PlantHello, ExciterHello, PlantHeartbeat, ExciterHeartbeat, PlantEmergency, ExciterEmergency, Sensors, SensorPair, PlantCapabilities, ExciterCapabilities"#);
    assert_snapshot!(said(&["encode", "ForceCommand", "force_x_n=1"]), @"resonarm: ForceCommand has no value for force_y_n: give one");
    assert_snapshot!(said(&["encode", "PlantHeartbeat", "state=3"]), @"resonarm: PlantHeartbeat: 3 is not a value of state");
    assert_snapshot!(said(&["encode", "PlantHeartbeat", "state=5", "mass=3"]), @"resonarm: PlantHeartbeat has no signal mass, expected one of state");
    assert_snapshot!(said(&["encode", "PlantHeartbeat", "state"]), @r#"resonarm: "state" is not of the form signal=number"#);
    let force = ["encode", "ForceCommand", "force_x_n=700", "force_y_n=0", "sample=0"];
    assert_snapshot!(said(&force), @"resonarm: ForceCommand: force_x_n is 700, beyond the range of ±655.34; nothing was sent");
    assert_snapshot!(said(&[&force[..], &["--counter", "15"]].concat()), @"resonarm: --counter is 15: for ForceCommand it must be from 0 to 14");
    assert_snapshot!(said(&["encode", "Sensors", "sample=0"]), @"resonarm: Sensors has no value for force_x_n: give one");
}

#[test]
fn a_line_without_a_frame_is_reported_counted_and_left_out() {
    let log = format!("201#8A00F40183FF3412\nnonsense here\n{}\n(2.0) vcan0 702#05\n", "x".repeat(200));
    let (code, stdout, stderr) = piped(&["protocol", "decode"], &log);
    assert_eq!((code, stderr.as_str()), (1, ""));
    assert_snapshot!(stdout, @r#"
    201#8A00F40183FF3412  ForceCommand force_x_n=10 force_y_n=-2.5 sample=4660
    line 2: "nonsense here": it is neither a frame, as 201#1122, nor a line of `candump` or `candump -L`
    line 3: "xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx"…: there is no `#` between identifier and data, as in 123#1122
    (2.000000) vcan0 702#05  ExciterHeartbeat state=5
    2 frames: 2 taken, 0 rejected, 0 of other protocols; 0 lost before them; 2 lines without a frame
    "#);
    let (code, stdout, _) = piped(&["protocol", "decode", "--json"], &log);
    let found: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!((code, &found["counts"]["unreadable_lines"]), (1, &2.into()));
    assert_eq!((&found["unreadable"][0]["line"], found["frames"].as_array().unwrap().len()), (&2.into(), 2));
}

/// The view of `candump` on a terminal, as in most reports of faults, and what a CAN controller reports.
#[test]
fn the_view_of_candump_and_error_frames_are_decoded() {
    let log = "  vcan0  201   [8]  8A 00 F4 01 83 FF 34 12\n(2.5) can0 20000004#0004000000000000\n";
    let (code, stdout, _) = piped(&["protocol", "decode"], log);
    assert_snapshot!(stdout, @"
    vcan0 201#8A00F40183FF3412  ForceCommand force_x_n=10 force_y_n=-2.5 sample=4660
    (2.500000) can0 error frame (controller problem)
    1 frames: 1 taken, 0 rejected, 0 of other protocols; 0 lost before them; 1 error frames
    ");
    // A report of the controller is no fault of a frame.
    assert_eq!(code, 0);
    let (code, stdout, _) = piped(&["protocol", "decode", "--json"], log);
    let found: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    let error = &found["frames"][1];
    assert_eq!((code, &found["counts"]["error_frames"], &error["verdict"]), (0, &1.into(), &"error_frame".into()));
    assert_eq!(error["reason"], "controller problem");
}

/// A log is read from standard input; the refusal of its name as a frame says so.
#[test]
fn the_name_of_a_log_as_a_frame_is_refused_with_the_way_to_read_it() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("can0.log"), LOG).unwrap();
    assert_snapshot!(complaint(folder.path(), 2, &["protocol", "decode", "can0.log"]), @r#"resonarm: "can0.log": there is no `#` between identifier and data, as in 123#1122. It is a file: `resonarm protocol decode < can0.log` reads it"#);
}

const DRIVES: &str = "[wire]\npreset = \"cia402\"\ndrives = [\n\
    { node_id = 3, joint = 1, gear_ratio = 100.0, rated_torque_nm = 1.0, encoder_counts_per_turn = 65536 },\n\
    { node_id = 4, joint = 2, gear_ratio = 50.0, rated_torque_nm = 0.5, encoder_counts_per_turn = 4096 },\n]\n";

#[test]
fn the_data_sheet_of_a_drive_is_that_of_its_scenario() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("drives.toml"), DRIVES).unwrap();
    std::fs::write(folder.path().join("other.toml"), "").unwrap();
    let of =
        |more: &[&str]| resonarm(folder.path(), &[&["protocol", "eds", "--scenario", "drives.toml"], more].concat());
    let sheet = of(&["--node-id", "4"]);
    assert_eq!((sheet.code, sheet.stderr.as_str()), (0, ""));
    for part in ["FileName=resonarm-4.eds\n", "ProductName=Resonarm joint 2\n", "DefaultValue=$NODEID+0x180\n"] {
        assert!(sheet.stdout.contains(part), "{part}");
    }
    // 0.5 N·m are 500 mN·m, the unit of the object.
    let rated = sheet.stdout.split("[6076]\n").nth(1).unwrap();
    assert!(rated.starts_with(
        "ParameterName=Motor rated torque\nObjectType=0x7\nDataType=0x0007\nAccessType=const\nDefaultValue=500\n"
    ));
    assert_snapshot!(of(&[]).stderr.trim(), @"resonarm: the scenario has several drives, with the node ids 3 and 4: choose one by --node-id");
    assert_snapshot!(of(&["--node-id", "5"]).stderr.trim(), @"resonarm: --node-id is 5, but the scenario has drives with the node ids 3 and 4");
    let none = complaint(folder.path(), 2, &["protocol", "eds", "--scenario", "other.toml"]);
    assert_snapshot!(none, @r#"resonarm: other.toml has no CANopen drives: give it [wire] with `preset = "cia402"`"#);
}
