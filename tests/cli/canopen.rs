//! `protocol decode`, `import`, `compare` and `identify` with CANopen drives.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use insta::assert_snapshot;
use resonarm::node::WireSpec;
use resonarm::node::cia402::DriveSpec;
use resonarm::recording::{Recording, StateRecord};
use resonarm::scenario::Scenario;

use crate::{complaint, document, resonarm};

const DRIVES: &str = "[wire]\npreset = \"cia402\"\ndrives = [\n\
    { node_id = 3, joint = 1, gear_ratio = 100.0, rated_torque_nm = 1.0, encoder_counts_per_turn = 1048576 },\n\
    { node_id = 4, joint = 2, gear_ratio = 50.0, rated_torque_nm = 0.5, encoder_counts_per_turn = 1048576 },\n]\n";

/// A folder with the scenario `drives.toml`, and `more` in it.
fn bench(more: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("drives.toml"), format!("{DRIVES}{more}")).unwrap();
    folder
}

fn decoded(folder: &Path, code: i32, frames: &str) -> String {
    let frames: Vec<&str> = frames.split_whitespace().collect();
    let said = resonarm(folder, &[&["protocol", "decode", "--scenario", "drives.toml"], &frames[..]].concat());
    assert_eq!((said.code, said.stderr.as_str()), (code, ""));
    said.stdout
}

#[test]
fn frames_of_drives_are_explained() {
    let folder = bench("");
    let frames = "703#00 000#0100 703#05 603#4041600000000000 583#4B41600050020000 603#2F6060000A000000 \
        583#6060600000000000 603#2F60600008000000 583#8060600030000906 203#06000000 203#0F01F401 080# \
        183#37120AF401 283#0F000000F6FFFFFF 083#5082110A00340000 183#R5 204#8000FFFF";
    assert_snapshot!(decoded(folder.path(), 0, frames), @r#"
    703#00  Heartbeat of node 3 state=0 "boot-up"
    000#0100  NMT command=1 "start" node=0 "all"
    703#05  Heartbeat of node 3 state=5 "operational"
    603#4041600000000000  SDO request to node 3 (read 6041 Statusword)
    583#4B41600050020000  SDO answer of node 3 (value of 6041 Statusword) value=592 "0x0250: switch on disabled, voltage, remote"
    603#2F6060000A000000  SDO request to node 3 (write 6060 Modes of operation) value=10 "cyclic synchronous torque"
    583#6060600000000000  SDO answer of node 3 (written 6060 Modes of operation)
    603#2F60600008000000  SDO request to node 3 (write 6060 Modes of operation) value=8 "cyclic synchronous position"
    583#8060600030000906  SDO answer of node 3 (abort 6060 Modes of operation) code=101253168 "0x06090030: the value is not allowed"
    203#06000000  RPDO 1 of node 3 Controlword=6 "0x0006: shutdown" Target torque=0 ‰ (load torque1_nm=0)
    203#0F01F401  RPDO 1 of node 3 Controlword=271 "0x010f: enable operation, halt" Target torque=500 ‰ (load torque1_nm=50)
    080#  SYNC (sync)
    183#37120AF401  TPDO 1 of node 3 Statusword=4663 "0x1237: operation enabled, voltage, remote, follows the target" Modes of operation display=10 "cyclic synchronous torque" Torque actual value=500 ‰ (torque1_nm=50)
    283#0F000000F6FFFFFF  TPDO 2 of node 3 Position actual value=15 counts (alpha1_rad=8.98816868e-7) Velocity actual value=-10 counts/s (alpha1_dot_rad_s=-5.99211245e-7)
    083#5082110A00340000  EMCY of node 3 code=33360 "0x8250: RPDO timeout: no target was accepted in time" register=17 "generic, communication" detail=10 sample=52
    183#R5  TPDO 1 of node 3 requested
    204#8000FFFF  RPDO 1 of node 4 Controlword=128 "0x0080: fault reset" Target torque=-1 ‰ (load torque2_nm=-0.025)
    17 frames: 16 taken, 0 rejected, 1 requests, 0 of none of the drives
    "#);
    let value = document(
        folder.path(),
        0,
        &["protocol", "decode", "--scenario", "drives.toml", "--json", "583#8060600030000906"],
    );
    assert_snapshot!(value["frames"][0]["message_means"][0], @r#"{"action":"abort","kind":"object","object":{"index":24672,"name":"Modes of operation","subindex":0}}"#);
}

/// A master gives both drives the same identifier: node 4 takes target alone from it.
#[test]
fn a_mapping_that_the_frames_set_is_followed() {
    let folder = bench("");
    let frames = "604#2300140104020080 584#6000140100000000 604#2F00160000000000 584#6000160000000000 \
        604#2300160110007160 584#6000160100000000 604#2F00160001000000 584#6000160000000000 \
        604#2300140103020000 584#6000140100000000 203#0F00F401 000#8204 203#0F00F401";
    assert_snapshot!(decoded(folder.path(), 0, frames), @r#"
    604#2300140104020080  SDO request to node 4 (write 1400:01 RPDO 1 communication, COB-ID) value=2147484164 "0x204, disabled"
    584#6000140100000000  SDO answer of node 4 (written 1400:01 RPDO 1 communication, COB-ID)
    604#2F00160000000000  SDO request to node 4 (write 1600 RPDO 1 mapping, Number of entries) value=0
    584#6000160000000000  SDO answer of node 4 (written 1600 RPDO 1 mapping, Number of entries)
    604#2300160110007160  SDO request to node 4 (write 1600:01 RPDO 1 mapping, Entry 1) value=1618018320 "6071 Target torque, 16 bits"
    584#6000160100000000  SDO answer of node 4 (written 1600:01 RPDO 1 mapping, Entry 1)
    604#2F00160001000000  SDO request to node 4 (write 1600 RPDO 1 mapping, Number of entries) value=1
    584#6000160000000000  SDO answer of node 4 (written 1600 RPDO 1 mapping, Number of entries)
    604#2300140103020000  SDO request to node 4 (write 1400:01 RPDO 1 communication, COB-ID) value=515 "0x203"
    584#6000140100000000  SDO answer of node 4 (written 1400:01 RPDO 1 communication, COB-ID)
    203#0F00F401  RPDO 1 of node 3, RPDO 1 of node 4 Controlword in RPDO 1 of node 3=15 "0x000f: enable operation" Target torque in RPDO 1 of node 3=500 ‰ (load torque1_nm=50) Target torque in RPDO 1 of node 4=15 ‰ (load torque2_nm=0.375)
    000#8204  NMT command=130 "reset communication" node=4
    203#0F00F401  RPDO 1 of node 3 Controlword=15 "0x000f: enable operation" Target torque=500 ‰ (load torque1_nm=50)
    13 frames: 13 taken, 0 rejected, 0 requests, 0 of none of the drives
    "#);
}

#[test]
fn frames_that_break_the_rules_of_canopen_are_refused() {
    let folder = bench("");
    let frames = "203#0F 283#01020304 603#40 583#C200000000000000 603#2300300111223344 703#06 000#0300 083#00 \
        603#R8 205#00 604#4008100000000000 584#4108100010000000 604#6000000000000000 584#005265736F6E6172";
    assert_snapshot!(decoded(folder.path(), 1, frames), @r#"
    203#0F  RPDO 1 of node 3 rejected: the payload of 1 bytes ends before Controlword
    283#01020304  TPDO 2 of node 3 rejected: the payload of 4 bytes ends before Velocity actual value; Position actual value=67305985 counts (alpha1_rad=4.03305031)
    603#40  SDO request to node 3 rejected: it has 1 bytes: expected 8
    583#C200000000000000  SDO answer of node 3 rejected: 0xc2 is not a command of an expedited or segmented transfer
    603#2300300111223344  SDO request to node 3 (write 3000:01 unknown object) bytes=4 "11 22 33 44"
    703#06  Heartbeat of node 3 rejected: 0x06 is not a state of a node: expected 0x00, 0x04, 0x05 or 0x7f
    000#0300  NMT rejected: 0x03 is not a command of network management: expected 0x01, 0x02, 0x80, 0x81 or 0x82
    083#00  EMCY of node 3 rejected: it has 1 bytes: expected 8
    603#R8  SDO request to node 3 rejected: expected a data frame, got a remote frame
    205#00  of none of the drives
    604#4008100000000000  SDO request to node 4 (read 1008 Device name)
    584#4108100010000000  SDO answer of node 4 (segments of 1008 Device name) bytes=16
    604#6000000000000000  SDO request to node 4 (next segment of 1008 Device name)
    584#005265736F6E6172  SDO answer of node 4 (segment of 1008 Device name) bytes=7
    14 frames: 5 taken, 8 rejected, 0 requests, 1 of none of the drives
    "#);
}

/// A torque that both drives exert.
const DWELL: &str = "[excitation]\namplitude = { joint1 = 20.0, joint2 = 5.0 }\n\
    profile = { waveform = 'dwell', frequency_hz = 18.0, duration_s = 1, settle_s = 0 }\n";

/// The drives of the scenario, and the states of a run with the excitation.
fn run(folder: &Path) -> (Vec<DriveSpec>, Vec<StateRecord>) {
    fs::write(folder.join("run.toml"), DWELL).unwrap();
    let run = ["run", "--mode", "free", "--scenario", "run.toml", "--record", "run.mcap"];
    assert_eq!(resonarm(folder, &run).code, 0);
    let recording = Recording::open(folder.join("run.mcap")).unwrap();
    let states = recording.states().unwrap().map(Result::unwrap).filter(|state| !state.is_end).collect();
    let scenario = Scenario::read(&folder.join("drives.toml")).unwrap();
    let Some(WireSpec::Cia402(spec)) = scenario.wire_spec().unwrap() else { panic!("no drives") };
    (spec.drives, states)
}

/// The log of a bus on which a master has these drives play the torques of the states, and reads angles and rates: a
/// sample takes 1 ms, or 3 ms in a log by SYNC.
fn log(drives: &[DriveSpec], states: &[StateRecord], sample_us: u64) -> String {
    let mut log = String::new();
    let mut line = |us: u64, frame: String| {
        writeln!(log, "({}.{:06}) can0 {frame}", 1_700_000_000 + us / 1_000_000, us % 1_000_000).unwrap();
    };
    for drive in drives {
        let node = drive.node_id;
        line(0, format!("{:03X}#2F6060000A000000", 0x600 + u16::from(node)));
        line(0, format!("{:03X}#6060600000000000", 0x580 + u16::from(node)));
        // Shutdown, switch on, enable operation: the way to a drive that takes torques (CiA 402).
        ["06000000", "07000000", "0F000000"].iter().for_each(|word| line(0, format!("20{node}#{word}")));
    }
    let bytes = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02X}")).collect::<String>();
    for (place, state) in (0..).zip(states) {
        let us = 1000 + place * sample_us;
        line(us, String::from("080#"));
        for (joint, drive) in drives.iter().enumerate() {
            let counts = |rad: f64| (rad * drive.counts_per_rad()).round() as i32;
            let [position, velocity] = [counts(state.states.coordinates()[joint]), counts(state.states.rates()[joint])];
            let data = [position.to_le_bytes(), velocity.to_le_bytes()].concat();
            line(us + 150 + 150 * joint as u64, format!("28{}#{}", drive.node_id, bytes(&data)));
            // Targets are in thousandths of the rated torque.
            let target = (state.load.torque_nm[joint] / drive.torque_step_nm()).round() as i16;
            let data = [[0x0F, 0], target.to_le_bytes()].concat();
            line(us + 500, format!("20{}#{}", drive.node_id, bytes(&data)));
        }
    }
    log
}

#[test]
fn states_and_torques_of_a_log_are_those_of_the_bench() {
    let folder = bench(DWELL);
    let folder = folder.path();
    let (drives, expected) = run(folder);
    // At 3 ms a sample, time stamps alone would put every sample three times as late.
    for (sample_us, flags) in [(1000, &[][..]), (3000, &["--by-sync"])] {
        fs::write(folder.join("bus.log"), log(&drives, &expected, sample_us)).unwrap();
        let import = [&["import", "bus.log", "bus.mcap", "--scenario", "drives.toml", "--overwrite"], flags].concat();
        let said = resonarm(folder, &import);
        assert_eq!((said.code, said.stderr.as_str()), (0, ""));
        if flags.is_empty() {
            assert_snapshot!(said.stdout, @"
            bus.mcap: 5260 frames of 1.050 s; left out 0 of other interfaces and 0 lines or objects that are no frames
            no readings: the user protocol does not carry head_force_x_n, head_force_y_n, acceleration_b_x_m_s2, acceleration_b_y_m_s2, acceleration_c_x_m_s2, acceleration_c_y_m_s2
            states and commanded loads of 1050 samples; 0 samples missing in 0 gaps, 0 left out since some of their frames are missing
            a message with readings has neither index nor counter: its frames are placed by their time stamps
            ");
        } else {
            assert_snapshot!(said.stdout, @"
            bus.mcap: 5260 frames of 3.149 s; left out 0 of other interfaces and 0 lines or objects that are no frames
            no readings: the user protocol does not carry head_force_x_n, head_force_y_n, acceleration_b_x_m_s2, acceleration_b_y_m_s2, acceleration_c_x_m_s2, acceleration_c_y_m_s2
            states and commanded loads of 1050 samples; 0 samples missing in 0 gaps, 0 left out since some of their frames are missing
            ");
        }
        let recording = Recording::open(folder.join("bus.mcap")).unwrap();
        let read: Vec<StateRecord> = recording.states().unwrap().map(Result::unwrap).collect();
        assert_eq!(read.len(), expected.len());
        let first = read[0].sample;
        for (read, expected) in read.iter().zip(&expected) {
            assert_eq!(read.sample - first, expected.sample);
            for (joint, drive) in drives.iter().enumerate() {
                let near = |a: &[f64], b: &[f64], count| (a[joint] - b[joint]).abs() <= 0.500_001 * count;
                let count_rad = 1.0 / drive.counts_per_rad();
                let (got, wanted) = (&read.states, &expected.states);
                assert!(near(got.coordinates(), wanted.coordinates(), count_rad), "{read:?} {expected:?}");
                assert!(near(got.rates(), wanted.rates(), count_rad), "{read:?} {expected:?}");
                assert!(
                    near(read.load.torque_nm.as_slice(), expected.load.torque_nm.as_slice(), drive.torque_step_nm()),
                    "{read:?} {expected:?}"
                );
            }
        }
    }
    assert_snapshot!(complaint(folder, 2, &["compare", "bus.mcap"]), @"resonarm: the recording was imported from bus.log and has no readings, so no responses can be read: the user protocol does not carry all of them, and `import` lists the missing ones");
    assert_snapshot!(complaint(folder, 2, &["identify", "bus.mcap"]), @"resonarm: the recording was imported from bus.log and has no readings: the user protocol does not carry all of them, and `import` lists the missing ones");
}

#[test]
fn what_a_log_of_drives_lacks_is_named() {
    let folder = bench("");
    let folder = folder.path();
    let one: String =
        DRIVES.lines().filter(|line| !line.contains("node_id = 4")).map(|line| format!("{line}\n")).collect();
    fs::write(folder.join("one.toml"), one).unwrap();
    let log = "(1.000000) can0 080#\n(1.000200) can0 283#0300000001000000\n(1.000300) can0 283#03\n";
    fs::write(folder.join("one.log"), log).unwrap();
    let said = resonarm(folder, &["import", "one.log", "one.mcap", "--scenario", "one.toml"]);
    assert_eq!((said.code, said.stderr.as_str()), (0, ""));
    assert_snapshot!(said.stdout, @"
    one.mcap: 3 frames of 0.000 s; left out 0 of other interfaces and 0 lines or objects that are no frames
    no readings: the user protocol does not carry head_force_x_n, head_force_y_n, acceleration_b_x_m_s2, acceleration_b_y_m_s2, acceleration_c_x_m_s2, acceleration_c_y_m_s2
    no states and loads; they are in the frames only: the user protocol does not carry alpha2_rad, alpha2_dot_rad_s
    a message with readings has neither index nor counter: its frames are placed by their time stamps
    frames of TPDO 2 of node 3 left out: 1; their checksum, counter or length is wrong, or a value is not a number
    ");
    let by_sync = ["import", "one.log", "two.mcap", "--by-sync"];
    assert!(complaint(folder, 2, &by_sync).contains("--scenario"));
    fs::write(folder.join("plain.toml"), "").unwrap();
    assert_snapshot!(complaint(folder, 2, &[&by_sync[..], &["--scenario", "plain.toml"]].concat()), @r#"resonarm: SYNC can count only samples of CANopen drives; use a scenario that has [wire] with `preset = "cia402"`"#);
}
