//! Parts of runs, simulated again.

use resonarm::cut;
use resonarm::recording::{Existing, Recording};
use resonarm::replay::{resimulate, resimulate_readings};
use resonarm::run::{Mode, Options, RecordTo, Session, Signals};
use resonarm::scenario::Scenario;

/// A mode, and one that touches a stop.
const MODES: &str = "structure = { kind = 'modal', \
    modes = [{ frequency_hz = 20.0, damping_ratio = 0.01, shape = { 'tip.x' = 0.5 } }] }\n";
const TOUCHING: &str = "structure = { kind = 'modal', \
    modes = [{ frequency_hz = 20.0, damping_ratio = 0.01, shape = { 'tip.x' = 0.5 } }], \
    elements = [{ kind = 'contact', at = 'tip.x', stiffness_n_m = 1e5, gap_m = 1e-4 }] }\n";

/// A cut from any sample on is simulated again, bit for bit, and has the readings of the whole.
#[test]
fn cuts_of_every_kind_of_run_are_simulated_again() {
    let shaker = "[rig.shaker]\nmoving_mass_kg = 0.5\nstiffness_n_m = 2000.0\ndamping_n_s_m = 10.0\n\
        force_factor_n_a = 20.0\nresistance_ohm = 2.0\ninductance_h = 3e-4\nstroke_m = 0.0127\n\
        current_limit_a = 15.0\nvoltage_limit_v = 60.0\namplifier = ";
    let rigs = [String::new(), format!("{shaker}'current'\n"), format!("{shaker}'voltage'\n")];
    let converters = ["instant", "sinc5"];
    let arm = rigs.iter().flat_map(|rig| converters.map(|converter| (rig, converter, "")));
    let others = [(&rigs[1], "sinc5", MODES), (&rigs[2], "instant", MODES), (&rigs[2], "sinc5", TOUCHING)];
    for (rig, converter, structure) in arm.chain(others) {
        let text = format!(
            "{structure}[rig]\nconverter = '{converter}'\n{rig}[rig.sensors.x]\nat = 'tip.x'\nmeasures = 'displacement'\n\
             [excitation]\namplitude = {{ exciter_x = 20.0 }}\n\
             profile = {{ waveform = 'dwell', frequency_hz = 18.0, duration_s = 0.3, settle_s = 0.1 }}\n"
        );
        let directory = tempfile::tempdir().unwrap();
        let (whole, part) = (directory.path().join("whole.mcap"), directory.path().join("part.mcap"));
        let record = Some(RecordTo { path: whole.clone(), existing: Existing::Refuse });
        let scenario = Scenario::parse(&text, "test").unwrap();
        let session = Session::new(scenario, Mode::Free, Options { record, ..Options::default() }).unwrap();
        assert!(session.both(&Signals::default(), &mut |_event| {}).unwrap().plant.error.is_none());
        let whole = Recording::open(&whole).unwrap();
        let readings: Vec<_> = whole.samples().unwrap().map(Result::unwrap).collect();
        let (_, last) = whole.summary().samples.unwrap();
        // A prime number, so that cuts begin at all phases of the vibration and of the filters.
        for first in (0..last).step_by(23) {
            cut::cut(&whole, first..=last, &part, Existing::Overwrite).unwrap();
            let part = Recording::open(&part).unwrap();
            assert_eq!(part.channels(), whole.channels());
            let verdict = resimulate(&part).unwrap();
            assert!(verdict.identical && verdict.samples == last - first + 1, "{rig} from {first}: {verdict:?}");
            assert!(part.samples().unwrap().map(Result::unwrap).eq(readings[first as usize..].iter().copied()));
            let verdict = resimulate_readings(&part).unwrap();
            assert!(verdict.identical && verdict.samples == last - first + 1, "{rig} from {first}: {verdict:?}");
        }
    }
}

const CONDITIONED: &str = "[rig]
converter = 'sinc3'
sensors.b = { highpass_hz = 1.0, lowpass_hz = 200.0, delay_samples = 40 }
head = { delay_samples = 3, range_n = 15.0 }
[[rig.faults]]
instrument = 'c'
kind = 'noise'
rms_m_s2 = 0.3
from_s = 0.05
to_s = 0.15
[excitation]
amplitude = { exciter_x = 20.0 }
profile = { waveform = 'dwell', frequency_hz = 18.0, duration_s = 0.3, settle_s = 0.1 }
";

/// Filters, delays and noise of a fault continue in a cut, in a cut of it, and in both joined again.
#[test]
fn the_readings_of_a_cut_are_simulated_again() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name);
    let record = Some(RecordTo { path: path("whole.mcap"), existing: Existing::Refuse });
    let scenario = Scenario::parse(CONDITIONED, "test").unwrap();
    let session = Session::new(scenario, Mode::Free, Options { record, ..Options::default() }).unwrap();
    assert!(session.both(&Signals::default(), &mut |_event| {}).unwrap().plant.error.is_none());
    let open = |name: &str| Recording::open(path(name)).unwrap();
    let identical = |name: &str, samples: u64| {
        let verdict = resimulate_readings(&open(name)).unwrap();
        assert!(verdict.identical && verdict.samples == samples, "{name}: {verdict:?}");
    };
    let (whole, refuse) = (open("whole.mcap"), Existing::Refuse);
    let (_, last) = whole.summary().samples.unwrap();
    identical("whole.mcap", last + 1);
    cut::cut(&whole, 100..=last, &path("part.mcap"), refuse).unwrap();
    cut::cut(&open("part.mcap"), 140..=last, &path("end.mcap"), refuse).unwrap();
    cut::cut(&open("part.mcap"), 100..=139, &path("middle.mcap"), refuse).unwrap();
    cut::merge(&[&open("middle.mcap"), &open("end.mcap")], &path("joined.mcap"), refuse).unwrap();
    for (name, first) in [("part.mcap", 100), ("end.mcap", 140), ("joined.mcap", 100)] {
        identical(name, last - first + 1);
        assert!(open(name).samples().unwrap().any(|sample| sample.unwrap().clipped.any()));
    }
}

/// The current in a coil is part of the state of a run in voltage mode: a cut begins with that of its first sample.
#[test]
fn a_cut_of_a_run_in_voltage_mode_is_simulated_again() {
    let text = "[rig.shaker]\namplifier = 'voltage'\nmoving_mass_kg = 0.5\nstiffness_n_m = 2000.0\ndamping_n_s_m = 10.0\n\
        force_factor_n_a = 20.0\nresistance_ohm = 2.0\ninductance_h = 3e-4\nstroke_m = 0.0127\ncurrent_limit_a = 15.0\n\
        voltage_limit_v = 60.0\n[excitation]\namplitude = { exciter_x = 20.0 }\n\
        profile = { waveform = 'dwell', frequency_hz = 18.0, duration_s = 0.5, settle_s = 0.1 }\n";
    let directory = tempfile::tempdir().unwrap();
    let (whole, part) = (directory.path().join("whole.mcap"), directory.path().join("part.mcap"));
    let record = Some(RecordTo { path: whole.clone(), existing: Existing::Refuse });
    let scenario = Scenario::parse(text, "test").unwrap();
    let session = Session::new(scenario, Mode::Free, Options { record, ..Options::default() }).unwrap();
    assert!(session.both(&Signals::default(), &mut |_event| {}).unwrap().plant.error.is_none());
    let whole = Recording::open(&whole).unwrap();
    assert!(resimulate(&whole).unwrap().identical);
    cut::cut(&whole, 203..=311, &part, Existing::Refuse).unwrap();
    let verdict = resimulate(&Recording::open(&part).unwrap()).unwrap();
    assert!(verdict.identical && verdict.samples == 109, "{verdict:?}");
    // The readings of the cut are still those of the converters' delay before.
    assert_eq!(Recording::open(&part).unwrap().origin().reading_delay_samples, 2.5);
}
