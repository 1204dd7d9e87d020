//! Responses to a master of CANopen drives.

use std::path::Path;

use super::*;
use crate::replay::responses;
use crate::run::{Mode, Session, Signals};
use resonarm_files::recording::{FrameRecord, Options, Record, Recorder};
use resonarm_protocol::{Frame, Id};

const DWELL: &str = "
    [excitation]
    amplitude = { joint1 = 60.0, joint2 = 6.0 }
    profile = { waveform = 'dwell', frequency_hz = 22.1, duration_s = 0.5, settle_s = 0.1 }
";
const DRIVES: &str = "
    [wire]
    preset = 'cia402'
    drives = [
        { node_id = 1, joint = 1, gear_ratio = 100.0, rated_torque_nm = 1.0, encoder_counts_per_turn = 65536 },
        { node_id = 2, joint = 2, gear_ratio = 10.0, rated_torque_nm = 1.0, encoder_counts_per_turn = 65536 },
    ]
";

fn frame(text: &str, sample: u64) -> Record {
    let (frame, time_ns) = (text.parse().unwrap(), 1_000_000 * sample);
    Record::Frame(FrameRecord { sample, direction: Direction::Received, time_ns, bus_timestamp_ns: None, frame })
}

/// A target of a node; the counts of its torque step.
fn target(node: u16, torque_nm: f64, step_nm: f64, sample: u64) -> Record {
    let [low, high] = ((torque_nm / step_nm).round() as i16).to_le_bytes();
    let frame = Frame::classic(Id::Standard(0x200 + node), &[0x0F, 0, low, high]).unwrap();
    Record::Frame(FrameRecord {
        sample,
        direction: Direction::Received,
        time_ns: 1_000_000 * sample + 500_000,
        bus_timestamp_ns: None,
        frame,
    })
}

/// The recording of a run in which a master commands `scale` times the torques of the excitation.
fn commanded(folder: &Path, scale: f64) -> Recording {
    let scenario = Scenario::parse(DWELL, "test").unwrap();
    let plain = folder.join(format!("plain-{scale}.mcap"));
    let recorder =
        Recorder::create(&plain, &scenario.configuration("free").unwrap(), Options::virtual_time(1e-3, "none"));
    let options = crate::run::Options { end_on_disarm: true, ..Default::default() };
    let session = Session::new(scenario.clone(), Mode::Free, options).unwrap();
    session.free(Some(recorder.unwrap()), &Signals::default(), &mut |_| {}).unwrap();
    let stated = Scenario::parse(&format!("{DWELL}{DRIVES}"), "test").unwrap();
    let path = folder.join(format!("{scale}.mcap"));
    let recorder =
        Recorder::create(&path, &stated.configuration("lockstep").unwrap(), Options::virtual_time(1e-3, "none"))
            .unwrap();
    let mut channel = recorder.channel("test", 4096).unwrap();
    for (place, node) in [1, 2].into_iter().enumerate() {
        let id = 0x600 + node;
        // The mode cyclic synchronous torque with its confirmation, then the three controlwords that lead to operation
        // enabled (CiA 402-2).
        let set_up = [format!("{id:03X}#2F6060000A000000"), format!("{:03X}#6060600000000000", id - 0x80)]
            .into_iter()
            .chain(["06000000", "07000000", "0F000000"].map(|word| format!("20{node}#{word}")));
        set_up.for_each(|text| channel.push_blocking(&frame(&text, place as u64)).unwrap());
    }
    let profile = scenario.profile().unwrap();
    for sample in Recording::open(&plain).unwrap().samples().unwrap() {
        let sample = sample.unwrap();
        let torque_nm = profile.load(sample.sample).torque_nm * scale;
        // A step is a thousandth of the rated torque behind the gear: 100 and 10 times 1 mN·m.
        channel.push_blocking(&target(1, torque_nm[0], 0.1, sample.sample)).unwrap();
        channel.push_blocking(&target(2, torque_nm[1], 0.01, sample.sample)).unwrap();
        channel.push_blocking(&Record::Sample(sample)).unwrap();
    }
    drop(channel);
    recorder.finish(&[]).unwrap();
    Recording::open(&path).unwrap()
}

#[test]
fn a_master_that_played_the_excitation_has_the_responses_of_the_controller() {
    let folder = tempfile::tempdir().unwrap();
    let session = Session::new(Scenario::parse(DWELL, "test").unwrap(), Mode::Free, Default::default()).unwrap();
    let expected = session.both(&Signals::default(), &mut |_| {}).unwrap().exciter.responses;
    let read = responses(&commanded(folder.path(), 1.0)).unwrap();
    let [read] = &read[..] else { panic!("{read:?}") };
    let [expected] = &expected[..] else { panic!("{expected:?}") };
    assert_eq!((read.frequency_hz, read.load), (expected.frequency_hz, expected.load));
    // The controller of the run read them from frames, whose counts differ from the recorded numbers in the last bits.
    for (read, expected) in read.acceleration_c_m_s2.iter().zip(&expected.acceleration_c_m_s2) {
        assert!((read.re - expected.re).abs() + (read.im - expected.im).abs() < 1e-9, "{read:?} {expected:?}");
    }
}

#[test]
fn other_torques_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let said = responses(&commanded(folder.path(), 1.1)).unwrap_err();
    assert!(matches!(said, ReplayError::Command { .. }), "{said}");
    let said = responses(&commanded(folder.path(), 0.0)).unwrap_err();
    assert!(matches!(said, ReplayError::NoLoad), "{said}");
}
