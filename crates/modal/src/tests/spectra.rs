//! Spectral estimators against SciPy (`tests/oracles/spectra.json`), and the confidence that they state.

use nalgebra::Complex;
use serde_json::Value;

use super::generator::SplitMix;
use super::{complex, numbers};
use crate::spectra::{CrossSpectra, Detrend, Estimator, Segments, Signals, SpectraError, Window};

const TOLERANCE: f64 = 1e-12;

fn oracle() -> Value {
    serde_json::from_str(include_str!("../../../../tests/oracles/spectra.json")).unwrap()
}

/// The four channels of the oracle: inputs x and z, outputs y and w.
fn channels(samples: usize) -> [Vec<f64>; 4] {
    let uniform = |seed| {
        let mut generator = SplitMix(seed);
        (0..samples).map(|_| generator.uniform() - 0.5).collect::<Vec<_>>()
    };
    let [x, z, a, b] = [1, 2, 3, 4].map(uniform);
    let z: Vec<f64> = x.iter().zip(&z).map(|(p, q)| 0.8 * q + 0.4 * p).collect();
    let resonator = |gains: [f64; 2], noise: &[f64], offset: f64| {
        let (mut one, mut two) = (0.0, 0.0);
        let value = |n: usize| {
            let next = 1.6 * one - 0.9 * two + (gains[0] * x[n] + gains[1] * z[n]) + 0.3 * noise[n];
            (one, two) = (next, one);
            next + offset + 0.001 * n as f64
        };
        (0..samples).map(value).collect::<Vec<_>>()
    };
    let (y, w) = (resonator([1.0, 0.5], &a, 2.0), resonator([0.2, -1.0], &b, -1.0));
    [x, z, y, w]
}

fn segments(case: &Value) -> Segments {
    let window = match case["window"].as_str().unwrap() {
        "boxcar" => Window::Rectangular,
        "hann" => Window::Hann,
        "hamming" => Window::Hamming,
        "blackman" => Window::Blackman,
        "blackmanharris" => Window::BlackmanHarris,
        "flattop" => Window::FlatTop,
        other => panic!("{other}"),
    };
    let detrend = match case["detrend"].as_str().unwrap() {
        "none" => Detrend::None,
        "constant" => Detrend::Constant,
        "linear" => Detrend::Linear,
        other => panic!("{other}"),
    };
    let number = |key: &str| case[key].as_u64().unwrap() as usize;
    Segments { length: number("length"), overlap: number("overlap"), window, detrend }
}

/// Numbers that agree to the tolerance, relative to the largest one.
fn agree(what: &str, found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let largest = expected.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    for (line, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((found - expected).abs() <= TOLERANCE * largest, "{what}, line {line}: {found}, expected {expected}");
    }
}

fn agree_complex(what: &str, found: &[Complex<f64>], expected: &[Complex<f64>]) {
    let flat = |values: &[Complex<f64>]| values.iter().flat_map(|value| [value.re, value.im]).collect::<Vec<_>>();
    agree(what, &flat(found), &flat(expected));
}

#[test]
fn spectra_and_responses_are_those_of_scipy() {
    let oracle = oracle();
    let rate_hz = oracle["rate_hz"].as_f64().unwrap();
    let [x, z, y, w] = channels(oracle["samples"].as_u64().unwrap() as usize);
    for (channel, sum) in [&x, &z, &y, &w].into_iter().zip(numbers(&oracle["sums"])) {
        assert!((channel.iter().sum::<f64>() - sum).abs() < 1e-10);
    }
    for case in oracle["cases"].as_array().unwrap() {
        let segments = segments(case);
        let what = |name: &str| format!("{name} with {segments:?}");
        let one = [Signals { inputs: &[&x], outputs: &[&y] }];
        let single = CrossSpectra::estimate(rate_hz, &one, &segments).unwrap();
        agree(&what("frequency"), &single.frequency_hz, &numbers(&case["frequency_hz"]));
        agree(&what("density"), &single.outputs[0], &numbers(&case["psd_y"]));
        let power: Vec<f64> = single.outputs[0].iter().map(|density| density * single.noise_bandwidth_hz).collect();
        agree(&what("power"), &power, &numbers(&case["power_y"]));
        agree_complex(&what("cross density"), &single.to_outputs[0][0], &complex(&case["csd_xy"]));
        agree(&what("coherence"), &single.coherence(0, 0).unwrap(), &numbers(&case["coherence_xy"]));
        let h1 = single.responses(Estimator::H1).unwrap();
        agree(&what("multiple coherence of one input"), &h1.coherence[0], &numbers(&case["coherence_xy"]));
        let h2 = single.responses(Estimator::H2).unwrap();
        let ratio: Vec<Complex<f64>> =
            h1.responses[0][0].iter().zip(&h1.coherence[0]).map(|(h, coherence)| h / *coherence).collect();
        agree_complex(&what("H2"), &h2.responses[0][0], &ratio);
        let hv = single.responses(Estimator::Hv { noise_ratio: 4.0 }).unwrap();
        agree_complex(&what("Hv"), &hv.responses[0][0], &complex(&case["hv_xy"]));

        let two = [Signals { inputs: &[&x, &z], outputs: &[&y, &w] }];
        let both = CrossSpectra::estimate(rate_hz, &two, &segments).unwrap();
        assert_eq!(both.outputs[0], single.outputs[0]);
        let h1 = both.responses(Estimator::H1).unwrap();
        for (o, i) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            agree_complex(&what("H1"), &h1.responses[o][i], &complex(&case["h1"][2 * o + i]));
        }
        for o in 0..2 {
            agree(&what("multiple coherence"), &h1.coherence[o], &numbers(&case["multiple_coherence"][o]));
        }
        let hv = both.responses(Estimator::Hv { noise_ratio: 4.0 }).unwrap();
        for i in 0..2 {
            // The offset and the trend of the outputs fill the lowest lines. No input explains them, and the vector of the
            // least eigenvalue is not determined to all digits.
            let lines = 4..;
            let expected = &complex(&case["hv_y"][i])[lines.clone()];
            agree_complex(&what("Hv of two inputs"), &hv.responses[0][i][lines], expected);
        }
    }
}

/// Hv with the right ratio is unbiased where H1 is too small and H2 too large, and tends to either of them.
#[test]
fn noise_in_both_channels_averages_out_in_hv() {
    let mut generator = SplitMix(5);
    let mut normals = || generator.normals(1 << 17);
    let [truth, a, b] = [(); 3].map(|()| normals());
    let x: Vec<f64> = truth.iter().zip(&a).map(|(x, e)| x + 0.5 * e).collect();
    let y: Vec<f64> = truth.iter().zip(&b).map(|(x, e)| 3.0 * x + 1.0 * e).collect();
    let signals = [Signals { inputs: &[&x], outputs: &[&y] }];
    let spectra = CrossSpectra::estimate(1.0, &signals, &Segments::hann(64)).unwrap();
    let mean = |estimator| {
        let found = spectra.responses(estimator).unwrap();
        let lines = &found.responses[0][0][1..32];
        lines.iter().sum::<Complex<f64>>().re / lines.len() as f64
    };
    let [h1, h2, hv] = [Estimator::H1, Estimator::H2, Estimator::Hv { noise_ratio: 4.0 }].map(mean);
    // A quarter of noise in the input's power makes H1 too small, and a ninth in the output's makes H2 too large.
    assert!((h1 - 3.0 / 1.25).abs() < 0.02, "{h1}");
    assert!((h2 - 3.0 * (1.0 + 1.0 / 9.0)).abs() < 0.02, "{h2}");
    assert!((hv - 3.0).abs() < 0.02, "{hv}");
    assert!((mean(Estimator::Hv { noise_ratio: 1e9 }) - h1).abs() < 1e-6);
    assert!((mean(Estimator::Hv { noise_ratio: 1e-9 }) - h2).abs() < 1e-6);
}

/// The radii of the circles about the responses H1 of the first output to the first of `inputs` inputs that contain the
/// true responses with the probability 90 %.
///
/// |Ĥ − H|² over its estimated variance has Fisher's distribution F of 2 and m = 2(n − q) degrees of freedom (J. S. Bendat,
/// A. G. Piersol, "Random Data", 4th edition 2010, section 9.2), whose quantile is (m/2)[(1 − c)^(−2/m) − 1].
fn radii(spectra: &CrossSpectra, inputs: usize) -> Vec<f64> {
    let surplus = 0.5 * spectra.degrees_of_freedom - inputs as f64;
    let quantile = surplus * (libm::pow(1.0 - 0.9, -1.0 / surplus) - 1.0);
    let deviations = spectra.responses(Estimator::H1).unwrap().standard_deviation(0, 0).unwrap();
    deviations.into_iter().map(|deviation| deviation * libm::sqrt(quantile)).collect()
}

/// Intervals of 90 % contain the truth in nine of ten cases: densities of white noise, and responses to two inputs of which
/// the second is a part of the first. Lines that are three apart are independent.
#[test]
fn intervals_contain_the_truth_as_often_as_they_state() {
    let (mut density, mut single, mut response, mut count) = (0, 0, 0, 0);
    for seed in 0..60 {
        let mut generator = SplitMix(1000 + seed);
        let [x, other, noise] = [(); 3].map(|()| generator.normals(1500));
        let z: Vec<f64> = x.iter().zip(&other).map(|(x, z)| 0.6 * x + z).collect();
        let y: Vec<f64> = (0..1500).map(|n| 2.0 * x[n] - z[n] + noise[n]).collect();
        let signals = [Signals { inputs: &[&x, &z], outputs: &[&y] }];
        let spectra = CrossSpectra::estimate(1.0, &signals, &Segments::hann(200)).unwrap();
        let [low, high] = spectra.confidence_factors(0.9);
        let found = spectra.responses(Estimator::H1).unwrap();
        let radius = radii(&spectra, 2);
        let signals = [Signals { inputs: &[&other], outputs: &[&y] }];
        let alone = CrossSpectra::estimate(1.0, &signals, &Segments::hann(200)).unwrap();
        let alone_radius = radii(&alone, 1);
        let alone = alone.responses(Estimator::H1).unwrap();
        for line in (3..97).step_by(3) {
            // White noise of unit variance has the one-sided density 2/fs.
            let power = spectra.between_inputs[0][0][line].re;
            density += usize::from((low * power..high * power).contains(&2.0));
            response += usize::from((found.responses[0][0][line] - 2.0).norm_sqr() < radius[line] * radius[line]);
            // y holds −z, and z holds `other` once: the response to that alone is −1.
            let miss = alone.responses[0][0][line] + 1.0;
            single += usize::from(miss.norm_sqr() < alone_radius[line] * alone_radius[line]);
            count += 1;
        }
    }
    for (what, inside) in [("density", density), ("one input", single), ("two inputs", response)] {
        let share = inside as f64 / count as f64;
        assert!((share - 0.9).abs() < 0.02, "{what}: {share} of {count}");
    }
}

/// Segments without overlap are independent: two degrees of freedom each. Overlap adds some, but never twice as many.
#[test]
fn degrees_of_freedom_count_independent_segments() {
    let x = SplitMix(6).normals(4096);
    let freedom = |segments: Segments| {
        let signals = [Signals { inputs: &[], outputs: &[&x] }];
        CrossSpectra::estimate(1.0, &signals, &segments).unwrap().degrees_of_freedom
    };
    assert_eq!(freedom(Segments::rectangular(256)), 32.0);
    assert_eq!(freedom(Segments::rectangular(4096)), 2.0);
    let half = freedom(Segments::hann(256));
    // 31 segments with ρ₁ = 1/36 for Hann's window.
    assert!((half - 2.0 * 31.0 * 31.0 / (31.0 + 2.0 * 30.0 / 36.0)).abs() < 1e-9, "{half}");
    let most = freedom(Segments { overlap: 192, ..Segments::hann(256) });
    assert!(half < most && most < 1.2 * half, "{half} {most}");
}

/// Records of the same channels count as one longer record without segments across their ends.
#[test]
fn records_are_averaged_together() {
    let [x, _, y, _] = channels(1000);
    let halves = [
        Signals { inputs: &[&x[..512]], outputs: &[&y[..512]] },
        Signals { inputs: &[&x[512..]], outputs: &[&y[512..]] },
    ];
    let both = CrossSpectra::estimate(500.0, &halves, &Segments::hann(128)).unwrap();
    let each = halves.map(|half| CrossSpectra::estimate(500.0, &[half], &Segments::hann(128)).unwrap());
    assert_eq!(both.averages, each[0].averages + each[1].averages);
    let counts = [0, 1].map(|k| each[k].averages as f64);
    let mean: Vec<f64> = (0..65)
        .map(|line| (0..2).map(|k| counts[k] * each[k].outputs[0][line]).sum::<f64>() / (counts[0] + counts[1]))
        .collect();
    agree("density", &both.outputs[0], &mean);
}

#[test]
fn dependent_inputs_have_no_response() {
    let [x, _, y, _] = channels(1000);
    let twice: Vec<f64> = x.iter().map(|x| 2.0 * x).collect();
    let signals = [Signals { inputs: &[&x, &twice], outputs: &[&y] }];
    let spectra = CrossSpectra::estimate(500.0, &signals, &Segments::hann(128)).unwrap();
    let found = spectra.responses(Estimator::H1).unwrap();
    assert!(found.responses[0][0].iter().all(|value| value.re.is_nan()));
}

#[test]
fn what_does_not_fit_is_refused_with_its_values() {
    let [x, z, y, _] = channels(100);
    let inputs: [&[f64]; 2] = [&x, &z];
    let outputs: [&[f64]; 1] = [&y];
    let estimate = |rate_hz, signals: Signals<'_>, segments| CrossSpectra::estimate(rate_hz, &[signals], &segments);
    let signals = Signals { inputs: &inputs, outputs: &outputs };
    let hann = Segments::hann(50);
    assert_eq!(estimate(0.0, signals, hann).unwrap_err(), SpectraError::Rate { rate_hz: 0.0 });
    assert_eq!(CrossSpectra::estimate(1.0, &[], &hann).unwrap_err(), SpectraError::NoRecord);
    let long = Segments::hann(101);
    assert_eq!(estimate(1.0, signals, long).unwrap_err(), SpectraError::Segment { segment: 101, samples: 100 });
    let full = Segments { overlap: 50, ..hann };
    assert_eq!(estimate(1.0, signals, full).unwrap_err(), SpectraError::Overlap { segment: 50, overlap: 50 });
    let short: [&[f64]; 1] = [&y[1..]];
    let uneven = Signals { inputs: &inputs, outputs: &short };
    assert_eq!(estimate(1.0, uneven, hann).unwrap_err(), SpectraError::Channels { record: 0, inputs: 2, outputs: 1 });
    let mut broken = y.clone();
    broken[7] = f64::NAN;
    let outputs: [&[f64]; 1] = [&broken];
    let broken = Signals { inputs: &inputs, outputs: &outputs };
    assert_eq!(estimate(1.0, broken, hann).unwrap_err(), SpectraError::NotFinite { record: 0, sample: 7 });

    let spectra = estimate(1.0, signals, hann).unwrap();
    assert_eq!(spectra.responses(Estimator::H2).unwrap_err(), SpectraError::SeveralInputs { inputs: 2 });
    let ratio = Estimator::Hv { noise_ratio: 0.0 };
    assert_eq!(spectra.responses(ratio).unwrap_err(), SpectraError::NoiseRatio { ratio: 0.0 });
    let whole = estimate(1.0, signals, Segments::rectangular(100)).unwrap();
    assert_eq!(whole.responses(Estimator::H1).unwrap_err(), SpectraError::TooFewAverages { averages: 1, inputs: 2 });
    let alone = estimate(1.0, Signals { inputs: &[], outputs: signals.outputs }, hann).unwrap();
    assert_eq!(alone.responses(Estimator::H1).unwrap_err(), SpectraError::NoResponse { inputs: 0, outputs: 1 });
    assert!(spectra.coherence(2, 0).is_none() && spectra.coherence(0, 1).is_none());
}
