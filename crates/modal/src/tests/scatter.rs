//! Stated deviations against the scatter over seeds, on records in closed form. The example `scatter` does the same for all
//! cases and 100 seeds.

use super::closed_form::{BAND, Case, Errors, Readings, cases, moments};
use crate::{Doubt, Identification, Options, TransientModel, identify_records};

fn case(name: &str) -> Case {
    cases().into_iter().find(|case| case.name == name).unwrap()
}

fn identify(case: &Case, seed: u64) -> Identification {
    let samples = case.samples(seed);
    identify_records(&case.records(&samples), &Options::new(BAND)).unwrap()
}

/// The number of modes is right for every seed, errors over stated deviations have mean 0 and deviation 1, and the noise of the
/// instruments is found.
#[test]
fn deviations_are_those_of_the_scatter() {
    let (mut all, mut bias) = (Errors::default(), Vec::new());
    for name in [
        "three 2 %",
        "three 0.1 %, 20 dB",
        "three 10 %",
        "pair 0.5, 2 references",
        "6 modes",
        "noisy force, 1/1.5/2 %",
        "noisy force, 0.1 %",
        "noisy force, 50 and 51 Hz",
        "blow, 2 %",
    ] {
        let case = case(name);
        for seed in 1..=3 {
            let found = identify(&case, seed);
            assert_eq!(found.modes.len(), case.modes.len(), "{name}, seed {seed}");
            all.add(&found.modes, &case.modes);
            if let Readings::Instruments { response, force } = case.readings
                && found.runs[0].lines >= 1500
            {
                let report = &found.runs[0];
                bias.push(report.reference_noise[0].estimated / force - 1.0);
                bias.extend(report.response_noise.iter().map(|channel| channel.estimated / response - 1.0));
            }
        }
    }
    for (what, errors) in
        [("frequency", &all.frequency), ("damping", &all.damping), ("shape", &all.shape), ("sum", &all.sum)]
    {
        let [mean, deviation] = moments(errors);
        let inside = errors.iter().filter(|z| z.abs() < 2.0).count() as f64 / errors.len() as f64;
        let largest = errors.iter().fold(0.0_f64, |largest, z| largest.max(z.abs()));
        assert!(mean.abs() < 0.25, "{what}: mean {mean} of {}", errors.len());
        assert!((0.8..1.2).contains(&deviation), "{what}: deviation {deviation} of {}", errors.len());
        assert!(inside > 0.92, "{what}: {inside} of {} within two deviations", errors.len());
        assert!(largest < 4.5, "{what}: {largest}");
    }
    assert!(bias.len() >= 27 && bias.iter().all(|bias| bias.abs() < 0.1), "{bias:?}");
}

/// Of 13 modes over three octaves the start finds about half; no more than four were added once.
#[test]
fn modes_that_the_start_has_missed_are_added() {
    let case = case("13 modes over octaves");
    let found = identify(&case, 1);
    assert!(found.stabilisation.clusters.len() <= 8);
    assert_eq!(found.modes.len(), 13);
    for (mode, truth) in found.modes.iter().zip(&case.modes) {
        assert!((mode.frequency_hz / truth.frequency_hz - 1.0).abs() < 1e-3, "{mode:?}");
    }
}

/// Records in which a plain regression for the variances lets that of a response collapse, and the weights then make up a mode
/// at the end of the band.
#[test]
fn variances_do_not_collapse() {
    let case = case("noisy force, 1/1.5/2 %");
    for seed in [52, 66] {
        let found = identify(&case, seed);
        assert_eq!(found.modes.len(), 3, "seed {seed}");
        for channel in found.runs[0].reference_noise.iter().chain(&found.runs[0].response_noise) {
            assert!((channel.estimated / channel.known.unwrap() - 1.0).abs() < 0.1, "seed {seed}: {channel:?}");
        }
        assert!(found.modes.iter().all(|mode| mode.deviations().is_ok()), "seed {seed}");
    }
}

/// After a blow the response is a decay, as a transient is: with both in the model, the fit goes wrong.
#[test]
fn a_blow_has_no_transient_beside_its_response() {
    let case = case("blow, 2 %");
    let samples = case.samples(1);
    let records = case.records(&samples);
    let found = identify_records(&records, &Options::new(BAND)).unwrap();
    assert!(!found.runs[0].transient);
    let forced = Options { transient: TransientModel::Present, ..Options::new(BAND) };
    let forced = identify_records(&records, &forced).unwrap();
    assert!(forced.runs[0].transient);
    // A tenth of the shape is missing, and the deviations show that nothing is known of it.
    let component = |found: &Identification| found.modes[0].shape.as_ref().unwrap().components[0];
    let [right, wrong] = [component(&found), component(&forced)];
    let truth = case.modes[0].shape[0];
    assert!((right.value.re / truth - 1.0).abs() < 1e-3, "{right:?}");
    assert!((wrong.value.re / truth - 1.0).abs() > 0.1, "{wrong:?}");
    assert!(wrong.deviation.re > 100.0 * right.deviation.re, "{wrong:?} {right:?}");
}

/// With less than 0.3 lines in the half-power bandwidth no deviation is stated, unless the record is at rest at its ends.
#[test]
fn a_record_that_is_too_short_states_no_deviation() {
    let short = Case { seconds: 4.0, ..case("noisy force, 0.1 %") };
    let found = identify(&short, 1);
    let doubts = found.modes[0].deviations().unwrap_err();
    assert!(matches!(doubts, [Doubt::TooShort { lines }] if *lines > 0.24 && *lines < 0.26), "{doubts:?}");
    assert!(found.modes[1].deviations().is_ok() && found.modes[2].deviations().is_ok());
}
