//! Runs that share poles, what responses may be, chosen poles, and input that is refused.

use core::f64::consts::TAU;

use nalgebra::Complex;
use resonarm_numeric::dft::Fft;
use resonarm_numeric::noise::Noise;

use super::closed_form::{BAND, RATE_HZ, Readings, Truth, accelerance, cases, many, three};
use crate::pole::pole;
use crate::spectra::SpectraError;
use crate::{
    Band, Channel, Identification, ModalError, Options, Quantity, Record, ResidueKind, ResponseFunction, Start,
    Warning, assurance, identify_records, identify_responses,
};

/// Frequencies of a set of frequency responses, Hz.
fn lines(from_hz: f64, to_hz: f64, count: usize) -> Vec<f64> {
    (0..count).map(|k| from_hz + (to_hz - from_hz) * k as f64 / (count - 1) as f64).collect()
}

/// Frequency responses without noise: (reference, response, values).
fn functions(modes: &[Truth], frequency_hz: &[f64], quantity: Quantity) -> Vec<(usize, usize, Vec<Complex<f64>>)> {
    let of_pair = |reference: usize, response: usize| {
        let value = |f: &f64| {
            let s = Complex::new(0.0, TAU * f);
            accelerance(modes, *f, response, reference)
                / match quantity {
                    Quantity::Acceleration => Complex::new(1.0, 0.0),
                    Quantity::Velocity => s,
                    Quantity::Displacement => s * s,
                }
        };
        (reference, response, frequency_hz.iter().map(value).collect())
    };
    let outputs = modes[0].shape.len();
    (0..2)
        .flat_map(|reference| (0..outputs).map(move |response| (reference, response)))
        .map(|(i, o)| of_pair(i, o))
        .collect()
}

fn identify_functions(
    frequency_hz: &[f64],
    all: &[(usize, usize, Vec<Complex<f64>>)],
    options: &Options,
) -> Result<Identification, ModalError> {
    let functions: Vec<ResponseFunction<'_>> = all
        .iter()
        .map(|(reference, response, values)| ResponseFunction { reference: *reference, response: *response, values })
        .collect();
    identify_responses(frequency_hz, &functions, options)
}

/// Poles and shapes to a relative tolerance.
fn agree(found: &Identification, truth: &[Truth], tolerance: f64) {
    assert_eq!(
        found.modes.len(),
        truth.len(),
        "{:?}",
        found.modes.iter().map(|mode| mode.frequency_hz).collect::<Vec<_>>()
    );
    for (mode, truth) in found.modes.iter().zip(truth) {
        assert!((mode.frequency_hz / truth.frequency_hz - 1.0).abs() < 0.01 * tolerance, "{}", mode.frequency_hz);
        assert!((mode.damping_ratio / truth.damping_ratio - 1.0).abs() < tolerance, "{}", mode.damping_ratio);
        let shape = mode.shape.as_ref().unwrap();
        let sign = truth.shape[shape.driving_point].signum();
        assert_eq!(shape.components.len(), truth.shape.len());
        for component in &shape.components {
            let expected = sign * truth.shape[component.dof];
            assert!((component.value.re / expected - 1.0).abs() < tolerance, "{component:?}, expected {expected}");
        }
        let own = truth.shape[shape.driving_point];
        assert!((shape.modal_mass * own * own - 1.0).abs() < 2.0 * tolerance, "{}", shape.modal_mass);
    }
}

/// Without noise poles, shapes and the response itself come out to rounding errors, for every quantity; and with modes below
/// and above the band, whose terms are a and b.
#[test]
fn perfect_responses_give_the_modes_exactly() {
    let modes = three([0.01, 0.02, 0.005]);
    let frequency_hz = lines(10.0, 190.0, 901);
    let band = Band { from_hz: 10.0, to_hz: 190.0 };
    for quantity in [Quantity::Acceleration, Quantity::Velocity, Quantity::Displacement] {
        let all = functions(&modes, &frequency_hz, quantity);
        let found = identify_functions(&frequency_hz, &all, &Options { quantity, ..Options::new(band) }).unwrap();
        agree(&found, &modes, 1e-7);
        for (reference, response, values) in &all {
            let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.norm_sqr().sqrt()));
            for (f, expected) in frequency_hz.iter().zip(values) {
                let fitted = found.response(0, *reference, *response, *f).unwrap();
                assert!(
                    (fitted - expected).norm_sqr().sqrt() < 1e-7 * largest,
                    "{quantity:?} {f} Hz: {fitted} {expected}"
                );
            }
        }
        assert!(found.response(0, 0, 7, 50.0).is_none());
        let shapes: Vec<Vec<f64>> = found
            .modes
            .iter()
            .map(|mode| mode.shape.as_ref().unwrap().normal().iter().map(|(_, v)| *v).collect())
            .collect();
        for (mode, normal) in found.modes.iter().zip(&shapes) {
            let shape = mode.shape.as_ref().unwrap();
            assert!(shape.collinearity > 1.0 - 1e-9 && shape.phase_deviation_deg < 1e-3 && mode.warnings.is_empty());
            for (component, normal) in shape.components.iter().zip(normal) {
                assert!((component.value.re - normal).abs() < 1e-6, "{component:?} {normal}");
            }
        }
    }

    // The middle mode alone: 31 Hz is below the band, 120 Hz above it.
    let frequency_hz = lines(50.0, 70.0, 401);
    let band = Band { from_hz: 50.0, to_hz: 70.0 };
    let all = functions(&modes, &frequency_hz, Quantity::Acceleration);
    let found = identify_functions(&frequency_hz, &all, &Options::new(band)).unwrap();
    agree(&found, &modes[1..2], 0.01);
    for (reference, response, values) in &all {
        let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.norm_sqr().sqrt()));
        for (f, expected) in frequency_hz.iter().zip(values) {
            let fitted = found.response(0, *reference, *response, *f).unwrap();
            assert!((fitted - expected).norm_sqr().sqrt() < 0.01 * largest, "{f} Hz: {fitted} {expected}");
        }
    }

    // Terms a and b that are known.
    let mut all = functions(&modes[1..2], &frequency_hz, Quantity::Velocity);
    for (value, f) in all[1].2.iter_mut().zip(&frequency_hz) {
        let s = Complex::new(0.0, TAU * f);
        *value += Complex::new(0.7, 0.0) / s + s * 2e-6;
    }
    let options = Options { quantity: Quantity::Velocity, ..Options::new(band) };
    let found = identify_functions(&frequency_hz, &all, &options).unwrap();
    agree(&found, &modes[1..2], 1e-7);
    let terms = &found.residual_terms[1];
    assert_eq!((terms.reference, terms.response), (0, 1));
    assert!((terms.below / 0.7 - 1.0).abs() < 1e-6 && (terms.above / 2e-6 - 1.0).abs() < 1e-6, "{terms:?}");
}

/// Imaginary residues are half as many unknowns: of a structure with normal modes they come out with smaller deviations.
#[test]
fn imaginary_residues_describe_normal_modes() {
    let modes = three([0.01, 0.02, 0.005]);
    let frequency_hz = lines(10.0, 190.0, 901);
    let band = Band { from_hz: 10.0, to_hz: 190.0 };
    let mut all = functions(&modes, &frequency_hz, Quantity::Acceleration);
    let mut noise = Noise::new(3, 0);
    for (.., values) in &mut all {
        values.iter_mut().for_each(|value| *value += Complex::new(noise.normal(), noise.normal()) * 0.05);
    }
    let [complex, imaginary] = [ResidueKind::Complex, ResidueKind::Imaginary]
        .map(|residues| identify_functions(&frequency_hz, &all, &Options { residues, ..Options::new(band) }).unwrap());
    agree(&imaginary, &modes, 0.01);
    for (mode, other) in imaginary.modes.iter().zip(&complex.modes) {
        assert!(mode.residues.iter().all(|residue| residue.value.re == 0.0 && residue.deviation.re == 0.0));
        assert!(
            mode.computed.frequency_hz < 0.95 * other.computed.frequency_hz,
            "{:?} {:?}",
            mode.computed,
            other.computed
        );
    }
}

/// A narrow band far above 0 Hz fills the circle of the start, in an interval with an odd and one with an even number.
#[test]
fn narrow_bands_have_a_start() {
    let modes: Vec<Truth> = [(1002.3, 4e-4), (1006.1, 6e-4)]
        .into_iter()
        .map(|(frequency_hz, damping_ratio)| Truth {
            frequency_hz,
            damping_ratio,
            shape: vec![1.0, if frequency_hz < 1004.0 { 0.5 } else { -0.8 }],
        })
        .collect();
    for (from_hz, to_hz) in [(1000.0, 1010.0), (999.0, 1011.0), (998.0, 1008.0)] {
        let frequency_hz = lines(from_hz, to_hz, 801);
        let all = functions(&modes, &frequency_hz, Quantity::Acceleration);
        let found = identify_functions(&frequency_hz, &all, &Options::new(Band { from_hz, to_hz })).unwrap();
        agree(&found, &modes, 1e-5);
        for mode in &modes {
            let near =
                |found: Complex<f64>| (found - pole(mode.frequency_hz, mode.damping_ratio)).norm_sqr().sqrt() < 0.5;
            assert!(found.stabilisation.clusters.iter().any(|cluster| near(cluster.pole)), "{from_hz} to {to_hz} Hz");
        }
    }
}

/// Sensors that rove: two runs with one force, of which only one has the driving point.
#[test]
fn roving_sensors_make_one_shape() {
    let case = cases().into_iter().find(|case| case.name == "4 modes").unwrap();
    let [first, second] = [1, 2].map(|seed| case.samples(seed).remove(0));
    let channel = |dof, samples| Channel { dof, samples, noise: None };
    let record = |samples: &'static super::closed_form::Samples, dofs: &[usize]| Record {
        rate_hz: RATE_HZ,
        references: vec![channel(0, &samples.force)],
        responses: dofs.iter().map(|dof| channel(*dof, &samples.responses[*dof])).collect(),
    };
    let [first, second] = [first, second].map(|samples| &*Box::leak(Box::new(samples)));
    let records = [record(first, &[0, 1]), record(second, &[2, 1])];
    let found = identify_records(&records, &Options::new(BAND)).unwrap();
    agree(&found, &case.modes, 0.02);
    let alone = identify_records(&records[..1], &Options::new(BAND)).unwrap();
    for ((mode, truth), alone) in found.modes.iter().zip(&case.modes).zip(&alone.modes) {
        let shape = mode.shape.as_ref().unwrap();
        let sign = truth.shape[0].signum();
        for component in &shape.components {
            let z = (component.value.re - sign * truth.shape[component.dof]) / component.deviation.re;
            assert!(z.abs() < 4.0, "{component:?} {truth:?}");
        }
        // Two records tell more of the poles than one.
        assert!(mode.computed.frequency_hz < alone.computed.frequency_hz);
        let values: Vec<Complex<f64>> = shape.components.iter().map(|component| component.value).collect();
        let truth: Vec<Complex<f64>> = truth.shape.iter().map(|value| Complex::new(*value, 0.0)).collect();
        assert!(assurance(&values, &truth) > 0.9999);
    }
    // Without the driving point there are residues but no shape.
    let found = identify_records(&records[1..], &Options::new(BAND)).unwrap();
    assert!(found.modes.iter().all(|mode| mode.shape.is_none() && mode.residues.len() == 2));
}

/// Two forces at once, both with noise: the steady state of periodic random forces, from a record that holds one period.
#[test]
fn two_forces_at_once_are_separated() {
    let modes = three([0.01, 0.015, 0.02]);
    let fft = Fft::at_least(16_384);
    let spacing_hz = RATE_HZ / fft.length() as f64;
    let mut noise = Noise::new(9, 0);
    let mut spectrum = || {
        let line = |k: usize| {
            let inside = (5.0..200.0).contains(&(k as f64 * spacing_hz));
            if inside { Complex::new(noise.normal(), noise.normal()) * 0.02 } else { Complex::new(0.0, 0.0) }
        };
        (0..fft.length()).map(line).collect::<Vec<Complex<f64>>>()
    };
    let forces = [spectrum(), spectrum()];
    let cut = |mut values: Vec<Complex<f64>>| {
        fft.backward(&mut values);
        values.iter().map(|value| 2.0 * value.re).collect::<Vec<f64>>()
    };
    let response = |output: usize| {
        let line = |k: usize| {
            let f = k as f64 * spacing_hz;
            if k == 0 {
                return Complex::new(0.0, 0.0);
            }
            (0..2).map(|reference| forces[reference][k] * accelerance(&modes, f, output, reference)).sum()
        };
        cut((0..fft.length()).map(line).collect())
    };
    let mut channels: Vec<Vec<f64>> = forces.iter().cloned().map(cut).chain([0, 1].map(response)).collect();
    let sigmas = [0.02, 0.05, 0.03, 0.04];
    for (channel, sigma) in channels.iter_mut().zip(sigmas) {
        channel.iter_mut().for_each(|value| *value += sigma * noise.normal());
    }
    let channel = |dof: usize, index: usize| Channel { dof, samples: &channels[index], noise: Some(sigmas[index]) };
    let record = Record {
        rate_hz: RATE_HZ,
        references: vec![channel(0, 0), channel(1, 1)],
        responses: vec![channel(0, 2), channel(1, 3)],
    };
    let found = identify_records(&[record], &Options::new(BAND)).unwrap();
    agree(&found, &modes, 0.01);
    for (mode, truth) in found.modes.iter().zip(&modes) {
        assert!(((mode.frequency_hz - truth.frequency_hz) / mode.computed.frequency_hz).abs() < 4.0);
        assert!(((mode.damping_ratio - truth.damping_ratio) / mode.computed.damping_ratio).abs() < 4.0);
        assert!(mode.deviations().is_ok(), "{:?}", mode.doubts);
        for residue in &mode.residues {
            let omega = mode.pole.im;
            let expected = -truth.shape[residue.response] * truth.shape[residue.reference] / (2.0 * omega);
            assert!(((residue.value.im - expected) / residue.deviation.im).abs() < 4.0, "{residue:?} {expected}");
        }
    }
    let report = &found.runs[0];
    for channel in report.reference_noise.iter().chain(&report.response_noise) {
        assert!((channel.estimated / channel.known.unwrap() - 1.0).abs() < 0.1, "{channel:?}");
    }
}

/// Responses of some pairs only: poles are still common.
#[test]
fn incomplete_sets_are_identified() {
    let modes = many(4);
    let frequency_hz = lines(8.0, 195.0, 1201);
    let mut all = functions(&modes, &frequency_hz, Quantity::Acceleration);
    all.remove(1);
    let found = identify_functions(&frequency_hz, &all, &Options::new(BAND)).unwrap();
    assert_eq!(found.modes.len(), 4);
    for (mode, truth) in found.modes.iter().zip(&modes) {
        assert!((mode.damping_ratio / truth.damping_ratio - 1.0).abs() < 1e-6);
        assert_eq!(mode.residues.len(), 5);
    }
}

/// A sensor that is mounted the other way round at the driving point gives a warning; so does a complex shape.
#[test]
fn what_looks_wrong_is_said() {
    let modes = many(4);
    let frequency_hz = lines(8.0, 195.0, 1201);
    let mut all = functions(&modes, &frequency_hz, Quantity::Acceleration);
    all.retain(|(reference, ..)| *reference == 0);
    all[0].2.iter_mut().for_each(|value| *value = -*value);
    let found = identify_functions(&frequency_hz, &all, &Options::new(BAND)).unwrap();
    for mode in &found.modes {
        assert!(
            mode.warnings.iter().any(|warning| matches!(warning, Warning::DrivingPoint { dof: 0, .. })),
            "{:?}",
            mode.warnings
        );
    }
    let mut all = functions(&modes, &frequency_hz, Quantity::Acceleration);
    all.retain(|(reference, ..)| *reference == 0);
    // A sensor with a delay of a quarter of a period at 60 Hz.
    for (value, f) in all[2].2.iter_mut().zip(&frequency_hz) {
        let (sine, cosine) = libm::sincos(-TAU * f / 240.0);
        *value *= Complex::new(cosine, sine);
    }
    let found = identify_functions(&frequency_hz, &all, &Options::new(BAND)).unwrap();
    let complex = |warning: &Warning| matches!(warning, Warning::Complex { collinearity, .. } if *collinearity < 0.95);
    assert!(found.modes.iter().any(|mode| mode.warnings.iter().any(complex)));
}

#[test]
fn chosen_poles_stay() {
    let modes = three([0.01; 3]);
    let frequency_hz = lines(10.0, 190.0, 901);
    let band = Band { from_hz: 10.0, to_hz: 190.0 };
    let all = functions(&modes, &frequency_hz, Quantity::Acceleration);
    let options = |poles: Vec<Complex<f64>>| Options { start: Start::Chosen(poles), ..Options::new(band) };
    let found = identify_functions(&frequency_hz, &all, &options(vec![pole(57.0, 0.02), pole(119.0, 0.01)])).unwrap();
    assert_eq!(found.modes.len(), 2);
    let outside = identify_functions(&frequency_hz, &all, &options(vec![pole(60.0, 0.01), pole(195.0, 0.01)]));
    let Err(ModalError::ChosenPole { pole: 1, frequency_hz: f, .. }) = outside else { panic!("{outside:?}") };
    assert!((f - 195.0).abs() < 1e-9);
    assert_eq!(identify_functions(&frequency_hz, &all, &options(vec![])).unwrap_err(), ModalError::NoModes);
}

#[test]
fn what_does_not_fit_is_refused_with_its_values() {
    let case = cases().into_iter().find(|case| case.name == "2 modes").unwrap();
    assert!(matches!(case.readings, Readings::Ratio(_)));
    let samples = case.samples(1);
    let record = case.records(&samples).remove(0);
    let options = Options::new(BAND);
    let error = |record: Record<'_>, options: &Options| identify_records(&[record], options).unwrap_err();
    assert_eq!(identify_records(&[], &options).unwrap_err(), ModalError::NoData);
    assert_eq!(error(Record { references: vec![], ..record.clone() }, &options), ModalError::NoData);
    let wide = Options::new(Band { from_hz: 8.0, to_hz: 600.0 });
    assert_eq!(error(record.clone(), &wide), ModalError::Band { from_hz: 8.0, to_hz: 600.0, most_hz: 500.0 });
    let order = Options { order: 3, ..options.clone() };
    assert_eq!(error(record.clone(), &order), ModalError::Order { order: 3, least: 4, most: 200 });
    let narrow = Options::new(Band { from_hz: 50.0, to_hz: 50.2 });
    assert!(
        matches!(error(record.clone(), &narrow), ModalError::TooFewLines { .. }),
        "{:?}",
        error(record.clone(), &narrow)
    );
    let mut uneven = record.clone();
    uneven.responses[0].samples = &uneven.responses[0].samples[1..];
    let channels = SpectraError::Channels { record: 0, inputs: 1, outputs: 3 };
    assert_eq!(error(uneven, &options), ModalError::Spectra(channels));
    let silence = vec![0.0; record.references[0].samples.len()];
    let mut silent = record.clone();
    silent.references[0].samples = &silence;
    assert_eq!(error(silent, &options), ModalError::NoPower { run: 0, dof: 0 });
    let mut silent = record.clone();
    silent.responses[2].samples = &silence;
    assert_eq!(error(silent, &options), ModalError::Silent { run: 0, dof: 2 });
    let mut broken = record.responses[1].samples.to_vec();
    broken[5] = f64::INFINITY;
    let mut infinite = record.clone();
    infinite.responses[1].samples = &broken;
    let not_finite = SpectraError::NotFinite { record: 0, sample: 5 };
    assert_eq!(error(infinite, &options), ModalError::Spectra(not_finite));
    let slower = Record { rate_hz: 900.0, ..record.clone() };
    assert_eq!(
        identify_records(&[record, slower], &options).unwrap_err(),
        ModalError::Rates { run: 1, rate_hz: 900.0, first_hz: 1000.0 }
    );

    let mut frequency_hz = lines(10.0, 190.0, 901);
    let all = functions(&case.modes, &frequency_hz, Quantity::Acceleration);
    let band = Options::new(Band { from_hz: 10.0, to_hz: 190.0 });
    assert_eq!(identify_functions(&frequency_hz, &[], &band).unwrap_err(), ModalError::NoData);
    assert_eq!(
        identify_functions(&frequency_hz[1..], &all, &band).unwrap_err(),
        ModalError::Length { response: 0, values: 901, lines: 900 }
    );
    frequency_hz[7] += 0.1;
    assert_eq!(
        identify_functions(&frequency_hz, &all, &band).unwrap_err(),
        ModalError::Frequencies { line: 7, frequency_hz: frequency_hz[7] }
    );
}
