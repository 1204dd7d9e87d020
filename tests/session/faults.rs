//! Faults of instruments in whole runs.

use std::path::Path;

use resonarm::recording::{Existing, Recording, SampleRecord};
use resonarm::replay::resimulate;
use resonarm::run::{Mode, Options, RecordTo, Session, Signals};
use resonarm::scenario::Scenario;

const DWELL: &str = "[excitation]\namplitude = { exciter_x = 40.0 }\n\
    profile = { waveform = 'dwell', frequency_hz = 18.0, duration_s = 0.4, settle_s = 0.1 }\n";

const FAULTS: &str = "[[rig.faults]]\ninstrument = 'c'\naxis = 'x'\nkind = 'stuck'\nfrom_s = 0.1\nto_s = 0.15\n\
    [[rig.faults]]\ninstrument = 'c'\naxis = 'y'\nkind = 'noise'\nrms_m_s2 = 4.0\nfrom_s = 0.12\n\
    [[rig.faults]]\ninstrument = 'head'\nkind = 'dropout'\nfrom_s = 0.2\nto_s = 0.3\n";

/// Samples of a run, and whether it is simulated again bit for bit.
fn run(text: &str, mode: Mode, path: &Path) -> (Vec<SampleRecord>, bool) {
    let record = Some(RecordTo { path: path.to_path_buf(), existing: Existing::Overwrite });
    let session = Session::new(Scenario::parse(text, "test").unwrap(), mode, Options { record, ..Options::default() });
    let report = session.unwrap().both(&Signals::default(), &mut |_event| {}).unwrap();
    assert!(report.plant.error.is_none(), "{:?}", report.plant.error);
    let recording = Recording::open(path).unwrap();
    let samples = recording.samples().unwrap().map(|sample| sample.unwrap()).collect();
    (samples, resimulate(&recording).unwrap().identical)
}

#[test]
fn a_run_with_faults_is_the_same_in_lockstep_and_simulated_again() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("run.mcap");
    let faulty = format!("{DWELL}{FAULTS}");
    let (free, identical) = run(&faulty, Mode::Free, &path);
    assert!(identical);
    let (lockstep, identical) = run(&faulty, Mode::Lockstep, &path);
    assert!(identical);
    assert_eq!(free[..400], lockstep[..400]);

    let (sound, _) = run(DWELL, Mode::Free, &path);
    for (sample, sound) in free.iter().zip(&sound) {
        let n = sample.sample;
        let ([x, y], [sound_x, sound_y]) = (sample.acceleration_c_m_s2, sound.acceleration_c_m_s2);
        // A stuck axis repeats what it read last, noise included.
        let expected = if (100..150).contains(&n) { free[99].acceleration_c_m_s2[0] } else { sound_x };
        assert_eq!(x.to_bits(), expected.to_bits(), "sample {n}");
        assert!(n >= 120 || y.to_bits() == sound_y.to_bits(), "sample {n}");
        assert_eq!(sample.acceleration_b_m_s2, sound.acceleration_b_m_s2, "sample {n}");
        let head = if (200..300).contains(&n) { [0.0; 2] } else { sound.head_force_n };
        assert_eq!(sample.head_force_n, head, "sample {n}");
    }
    let noisy = free.iter().zip(&sound).skip(120);
    let differ = noisy.filter(|(a, b)| a.acceleration_c_m_s2[1] != b.acceleration_c_m_s2[1]).count();
    assert!(differ > 250, "{differ}");
}
