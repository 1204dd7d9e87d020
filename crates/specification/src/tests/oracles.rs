//! Figures and verdicts against `tests/oracles/test-control.json`.

use resonarm_modal::spectra::{CrossSpectra, Segments, ShockResponse, Signals, Window};

use super::{near, number, numbers, oracle, random, shock, sine};
use crate::verdict::{Density, Verdict, judge_density, line_verdict, perfect_probability};
use crate::{Profile, perfect_db};

const TOLERANCE: f64 = 1e-9;

#[test]
fn profiles() {
    for case in oracle()["profiles"].as_array().unwrap() {
        let points = case["breakpoints"].as_array().unwrap().iter().map(|point| {
            let point = numbers(point);
            [point[0], point[1]]
        });
        let profile = Profile::new(&points.collect::<Vec<_>>()).unwrap();
        for (key, k) in [("rms", 0), ("velocity_rms", -2), ("displacement_rms", -4)] {
            near(profile.moment(k).sqrt(), number(case, key), TOLERANCE);
        }
    }
}

/// The slopes of NAVMAT P-9492 in dB/octave give the points of the oracle.
#[test]
fn slopes() {
    let slopes =
        "breakpoints = [{ from_hz = 20, db_octave = 3 }, [80, 0.04], [350, 0.04], { to_hz = 2000, db_octave = -3 }]";
    let test = random(&format!("{slopes}\ntolerance_db = [-3, 3]"));
    let expected = oracle()["profiles"][2]["breakpoints"].clone();
    for (point, expected) in test.profile.points().iter().zip(expected.as_array().unwrap()) {
        let expected = numbers(expected);
        near(point[0], expected[0], TOLERANCE);
        near(point[1], expected[1], TOLERANCE);
    }
    near(test.figures(None).rms_m_s2, 6.0643689848993745, TOLERANCE);
    near(test.profile.at(20.0).unwrap(), 0.010047545726038321, TOLERANCE);
    near(test.profile.at(200.0).unwrap(), 0.04, TOLERANCE);
    assert_eq!([test.profile.at(19.9), test.profile.at(2000.1)], [None, None]);
}

/// Independent numbers, the sum of twelve uniform ones less six.
fn generated(seed: u64, count: usize) -> Vec<f64> {
    let mut state = seed;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..count).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
}

#[test]
fn densities() {
    for case in oracle()["psd"].as_array().unwrap() {
        let segments = case["K"].as_u64().unwrap() as usize;
        // The oracle generates the same numbers by the same recursion, so that no samples are stored.
        let mut samples = generated(case["seed"].as_u64().unwrap(), 500 * (segments + 1));
        for (k, sample) in samples.iter_mut().enumerate() {
            *sample += 0.5 * libm::sin(core::f64::consts::TAU * 50.0 * k as f64 / 1000.0);
        }
        for (sample, expected) in samples.iter().zip(numbers(&case["first"])) {
            near(*sample, expected, TOLERANCE);
        }
        let record = Signals { inputs: &[], outputs: &[&samples] };
        let spectra = CrossSpectra::estimate(1000.0, &[record], &Segments::hann(1000)).unwrap();
        near(spectra.degrees_of_freedom, number(case, "dof"), TOLERANCE);
        near(spectra.outputs[0].iter().sum(), number(case, "sum_df"), TOLERANCE);
        for (line, expected) in case["lines"].as_object().unwrap() {
            near(spectra.outputs[0][line.parse::<usize>().unwrap()], expected.as_f64().unwrap(), TOLERANCE);
        }
    }
}

#[test]
fn degrees_of_freedom() {
    for case in oracle()["dof"].as_array().unwrap() {
        let overlap = (1000.0 * number(case, "overlap")) as usize;
        let segments = Segments { overlap, window: Window::Hann, ..Segments::hann(1000) };
        let count = case["segments"].as_u64().unwrap() as usize;
        near(segments.degrees_of_freedom(&[count]), number(case, "dof"), TOLERANCE);
        if overlap == 500 {
            near(crate::hann_degrees_of_freedom(count), number(case, "dof"), TOLERANCE);
        }
    }
}

#[test]
fn intervals() {
    for case in oracle()["interval"].as_array().unwrap() {
        let (freedom, confidence) = (number(case, "dof"), number(case, "conf"));
        let factor = |tail: f64| {
            let quantile = resonarm_numeric::distribution::chi_square_quantile(tail, freedom);
            freedom / quantile
        };
        near(factor(0.5 + 0.5 * confidence), number(case, "ratio_low"), TOLERANCE);
        near(factor(0.5 - 0.5 * confidence), number(case, "ratio_high"), TOLERANCE);
    }
    // The range of a perfect controller at 120 degrees of freedom, from SciPy.
    let [low, high] = perfect_db(120.0);
    assert!((low + 1.17).abs() < 0.005 && (high - 1.03).abs() < 0.005, "{low} {high}");
}

#[test]
fn lines() {
    let names = [Verdict::Out, Verdict::Undecided, Verdict::In];
    for case in oracle()["line_verdict"].as_array().unwrap() {
        let ratio = libm::pow(10.0, 0.1 * number(case, "ratio_db"));
        // The oracle has −1 for out, 0 for undecided and 1 for in.
        let expected = names[(case["verdict"].as_i64().unwrap() + 1) as usize];
        let found = line_verdict(ratio, number(case, "dof"), [number(case, "lo"), number(case, "hi")]);
        assert_eq!(found, expected, "{case}");
    }
}

#[test]
fn whole_profiles() {
    let frequency_hz: Vec<f64> = (0..=250).map(f64::from).collect();
    let mut cases = 0;
    for case in oracle()["profile_verdict"].as_array().unwrap() {
        let (amplitude, kind) = (number(case, "amp"), case["kind"].as_str().unwrap());
        let count = case["lines"].as_u64().unwrap() as usize;
        let ratio = |k: usize| {
            let turn = |cycles: f64| libm::sin(core::f64::consts::TAU * cycles * k as f64);
            let is_raised = match kind {
                "block" => (60..70).contains(&k),
                "scatter" => k >= 5 && (k - 5).is_multiple_of(20),
                _ => false,
            };
            let db = 0.4 * turn(0.137) + 0.3 * turn(0.291) + if is_raised { amplitude } else { 0.0 };
            libm::pow(10.0, 0.1 * db)
        };
        let ratios: Vec<f64> = (0..count).map(ratio).collect();
        // The first judged line is two lines within the edge.
        let mut density = vec![1.0; frequency_hz.len()];
        density[12..12 + count].copy_from_slice(&ratios);
        let tolerance = number(case, "tol");
        let keys = format!(
            "breakpoints = [[10, 1], [{}, 1]]\ntolerance_db = [-{tolerance}, {tolerance}]\nlines_hz = 1",
            13 + count
        );
        let control =
            Density { frequency_hz: &frequency_hz, density: &density, degrees_of_freedom: number(case, "dof") };
        let found = judge_density(&random(&keys), &control, &[]).unwrap();
        assert_eq!(found.lines.len(), count);
        assert_eq!(found.profile.name(), case["verdict"].as_str().unwrap(), "{case}");
        assert_eq!(found.proven_hz.len() as u64, case["lines_out"].as_u64().unwrap(), "{case}");
        near(perfect_probability(&ratios, number(case, "dof"), 1.5), number(case, "p_perfect"), TOLERANCE);
        cases += 1;
    }
    assert_eq!(cases, 30);
}

#[test]
fn shock_response_spectra_and_velocity_changes() {
    for case in oracle()["srs"].as_array().unwrap() {
        let (name, rate_hz) = (case["pulse"].as_str().unwrap(), number(case, "fs"));
        let test = shock(&format!(
            "pulse = '{name}'\npeak_m_s2 = {}\nduration_s = {}\nband = 0.2",
            number(case, "A"),
            number(case, "D")
        ));
        let mut record = test.samples(rate_hz);
        near(record.iter().sum::<f64>() / rate_hz, number(case, "dv"), TOLERANCE);
        // The oracle sums samples, which differs from the integral in closed form, most of all at the edge of a
        // saw-tooth.
        near(test.velocity_change_m_s(), number(case, "dv"), 0.01);
        let frequencies = numbers(&case["fn"]);
        record.resize(record.len() + (0.05 * rate_hz + rate_hz / frequencies[0]) as usize, 0.0);
        let found = ShockResponse::estimate(rate_hz, &record, number(case, "Q"), &frequencies).unwrap();
        for (key, found) in
            [("positive", &found.positive), ("negative", &found.negative), ("maximax", &found.maximax())]
        {
            found.iter().zip(numbers(&case[key])).for_each(|(found, expected)| near(*found, expected, TOLERANCE));
        }
    }
}

#[test]
fn sweeps() {
    let oracle = oracle();
    for case in oracle["sweep"].as_array().unwrap() {
        let [f1, f2, rate] = ["f1", "f2", "oct_min"].map(|key| number(case, key));
        let test = sine(&format!(
            "from_hz = {f1}\nrate_oct_min = {rate}\nsegments = [{{ to_hz = {f2}, acceleration_m_s2 = 2 }}]\ntolerance = 0.1"
        ));
        near(test.sweep_s(f1, f2), number(case, "seconds"), TOLERANCE);
        near(test.cycles(f1, f2), number(case, "cycles"), TOLERANCE);
        near(test.phase_rad(test.sweep_s(f1, f2)) / core::f64::consts::TAU, number(case, "cycles"), TOLERANCE);
        near(test.frequency_hz(test.sweep_s(f1, f2)), f2, TOLERANCE);
        for mode in case["eta"].as_array().unwrap() {
            near(test.sweep_parameter(number(mode, "fn"), 0.5 / number(mode, "Q")), number(mode, "eta"), TOLERANCE);
        }
    }
    let test =
        sine("from_hz = 20\nrate_oct_min = 4\nsegments = [{ to_hz = 200, acceleration_m_s2 = 2 }]\ntolerance = 0.1");
    for (k, expected) in oracle["chirp"]["samples"].as_object().unwrap() {
        let t_s = k.parse::<f64>().unwrap() / 1000.0;
        let found = 2.0 * libm::sin(test.phase_rad(t_s));
        assert!((found - expected.as_f64().unwrap()).abs() < TOLERANCE, "{k}: {found}");
    }
}

/// A flat density is as wide as it is; of G = f the bandwidth is 3/4 (f₂² − f₁²)²/(f₂³ − f₁³).
#[test]
fn statistical_bandwidths_are_those_of_closed_form() {
    let bandwidth_hz = |points: &[[f64; 2]]| Profile::new(points).unwrap().statistical_bandwidth_hz();
    near(bandwidth_hz(&[[10.0, 3.0], [60.0, 3.0]]), 50.0, 1e-14);
    near(bandwidth_hz(&[[10.0, 10.0], [20.0, 20.0]]), 0.75 * 300.0 * 300.0 / 7000.0, 1e-14);
}
