//! The fit against independent code: `tests/oracles/modal.json` holds what a prototype in Python found.

use super::reference::{Data, Set, sets};
use crate::{
    Band, Channel, Identification, Options, Record, ResponseFunction, Start, identify_records, identify_responses,
};

/// Identifies the modes of a set.
fn identify(set: &Set, start: Start) -> Identification {
    match &set.data {
        Data::Functions { frequency_hz, functions } => {
            let mut all = Vec::new();
            for (response, of_output) in functions.iter().enumerate() {
                for (values, reference) in of_output.iter().zip(&set.references) {
                    all.push(ResponseFunction { reference: *reference, response, values });
                }
            }
            let band = Band { from_hz: frequency_hz[0], to_hz: *frequency_hz.last().unwrap() };
            identify_responses(frequency_hz, &all, &Options { start, ..Options::new(band) }).unwrap()
        }
        Data::Record { rate_hz, band_hz, force, responses } => {
            let channel = |dof: usize, samples, noise| Channel { dof, samples, noise: Some(noise) };
            let record = Record {
                rate_hz: *rate_hz,
                references: vec![channel(set.references[0], force, 0.0115)],
                responses: responses.iter().enumerate().map(|(o, samples)| channel(o, samples, 0.0247)).collect(),
            };
            let band = Band { from_hz: band_hz[0], to_hz: band_hz[1] };
            identify_records(&[record], &Options { start, ..Options::new(band) }).unwrap()
        }
    }
}

/// Frequencies and damping ratios within 0.05 of their deviations, residues and shapes within 0.1, and deviations within 1 %
/// of those in the file.
fn agree(set: &Set, found: &Identification) {
    let expected = set.found["modes"].as_array().unwrap();
    assert_eq!(found.modes.len(), expected.len(), "{}", set.name);
    for (mode, expected) in found.modes.iter().zip(expected) {
        let what = format!("{}, {} Hz", set.name, mode.frequency_hz);
        let number = |key: &str| expected[key].as_f64().unwrap();
        let near = |name: &str, value: f64, expected: f64, deviation: f64, part: f64| {
            assert!((value - expected).abs() < part * deviation, "{what}, {name}: {value}, expected {expected}");
        };
        let alike = |name: &str, value: f64, expected: f64| {
            assert!((value / expected - 1.0).abs() < 0.01, "{what}, deviation of {name}: {value}, expected {expected}");
        };
        near("frequency", mode.frequency_hz, number("f_hz"), number("f_sd"), 0.05);
        near("damping", mode.damping_ratio, number("zeta"), number("zeta_sd"), 0.05);
        alike("frequency", mode.computed.frequency_hz, number("f_sd"));
        alike("damping", mode.computed.damping_ratio, number("zeta_sd"));
        for residue in &mode.residues {
            let reference = set.references.iter().position(|reference| *reference == residue.reference).unwrap();
            let expected = &expected["residues"][reference][residue.response];
            let number = |key: &str| expected[key].as_f64().unwrap();
            near("residue", residue.value.re, number("re"), number("sd_re"), 0.1);
            near("residue", residue.value.im, number("im"), number("sd_im"), 0.1);
            alike("residue", residue.deviation.re, number("sd_re"));
            alike("residue", residue.deviation.im, number("sd_im"));
        }
        // The file scales shapes at the first reference; here it is that with the least uncertain residue.
        let shape = mode.shape.as_ref().unwrap();
        assert!((shape.collinearity - number("mpc")).abs() < 1e-5, "{what}: {}", shape.collinearity);
        if shape.driving_point == set.references[0] {
            for component in &shape.components {
                let of = |key: &str| expected[key][component.dof].as_f64().unwrap();
                near("shape", component.value.re, of("shape"), of("shape_sd"), 0.1);
                alike("shape", component.deviation.re, of("shape_sd"));
            }
        }
    }
}

#[test]
fn chosen_poles_give_the_modes_of_the_reference_file() {
    for set in sets() {
        let start = set.modes.iter().map(|mode| crate::pole::pole(mode.frequency_hz, mode.damping_ratio));
        let found = identify(&set, Start::Chosen(start.collect()));
        agree(&set, &found);
        if let Data::Record { .. } = set.data {
            let noise = &set.found["noise_sd"];
            let report = &found.runs[0];
            assert!(report.transient);
            let expected = noise["force"].as_f64().unwrap();
            assert!((report.reference_noise[0].estimated / expected - 1.0).abs() < 0.01, "{report:?}");
            for (o, channel) in report.response_noise.iter().enumerate() {
                let expected = noise["response"][o].as_f64().unwrap();
                assert!((channel.estimated / expected - 1.0).abs() < 0.01, "{report:?}");
            }
        }
    }
}

#[test]
fn modes_of_the_reference_file_are_found_without_a_choice() {
    for set in sets() {
        agree(&set, &identify(&set, Start::Automatic));
    }
}
