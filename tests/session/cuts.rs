//! Parts of runs, simulated again.

use resonarm::recording::{self, Existing, Recording};
use resonarm::replay::resimulate;
use resonarm::run::{Mode, Options, RecordTo, Session, Signals};
use resonarm::scenario::Scenario;

/// The current in a coil is part of the state of a run in voltage mode: a cut begins with that of its first sample.
#[test]
fn a_cut_of_a_run_in_voltage_mode_is_simulated_again() {
    let text = "[rig.shaker]\namplifier = 'voltage'\nmoving_mass_kg = 0.5\nstiffness_n_m = 2000.0\ndamping_n_s_m = 10.0\n\
        force_factor_n_a = 20.0\nresistance_ohm = 2.0\ninductance_h = 3e-4\nstroke_m = 0.0127\ncurrent_limit_a = 15.0\n\
        voltage_limit_v = 60.0\n[excitation]\namplitude = { force_x_n = 20.0 }\n\
        profile = { waveform = 'dwell', frequency_hz = 18.0, duration_s = 0.5, settle_s = 0.1 }\n";
    let directory = tempfile::tempdir().unwrap();
    let (whole, part) = (directory.path().join("whole.mcap"), directory.path().join("part.mcap"));
    let record = Some(RecordTo { path: whole.clone(), existing: Existing::Refuse });
    let scenario = Scenario::parse(text, "test").unwrap();
    let session = Session::new(scenario, Mode::Free, Options { record, ..Options::default() }).unwrap();
    assert!(session.both(&Signals::default(), |_event| {}).unwrap().plant.error.is_none());
    let whole = Recording::open(&whole).unwrap();
    assert!(resimulate(&whole).unwrap().identical);
    recording::cut(&whole, 203..=311, &part, Existing::Refuse).unwrap();
    let verdict = resimulate(&Recording::open(&part).unwrap()).unwrap();
    assert!(verdict.identical && verdict.samples == 109, "{verdict:?}");
    // The readings of the cut are still those of the converters' delay before.
    assert_eq!(Recording::open(&part).unwrap().origin().reading_delay_samples, 2.5);
}
