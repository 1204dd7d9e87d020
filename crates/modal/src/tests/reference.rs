//! The reference file, `tests/oracles/modal.json`: data of known modes, and what independent code finds in them.

use core::f64::consts::TAU;

use nalgebra::Complex;
use serde_json::Value;

use super::generator::SplitMix;
use super::numbers;

/// A mode that the data are made of.
#[derive(Clone, Debug)]
pub struct Truth {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    pub shape: Vec<f64>,
}

/// Accelerance of an output over a reference, s² φₒφᵢ/(s² + 2ζωs + ω²) over all modes.
pub fn accelerance(modes: &[Truth], frequency_hz: f64, output: usize, reference: usize) -> Complex<f64> {
    let s = Complex::new(0.0, TAU * frequency_hz);
    let term = |mode: &Truth| {
        let omega = TAU * mode.frequency_hz;
        s * s * (mode.shape[output] * mode.shape[reference])
            / (s * s + s * (2.0 * mode.damping_ratio * omega) + omega * omega)
    };
    modes.iter().map(term).sum()
}

/// A set of the file.
pub struct Set {
    pub name: String,
    pub modes: Vec<Truth>,
    pub references: Vec<usize>,
    pub data: Data,
    pub found: Value,
}

/// The data of a set.
pub enum Data {
    /// Frequencies, and the responses of outputs and references: `[output][reference][line]`.
    Functions { frequency_hz: Vec<f64>, functions: Vec<Vec<Vec<Complex<f64>>>> },
    /// The force on a structure and the accelerations of its points.
    Record { rate_hz: f64, band_hz: [f64; 2], force: Vec<f64>, responses: Vec<Vec<f64>> },
}

/// All sets; their data are computed anew, and compared with samples in the file.
pub fn sets() -> Vec<Set> {
    let file: Value = serde_json::from_str(include_str!("../../../../tests/oracles/modal.json")).unwrap();
    file["sets"].as_array().unwrap().iter().map(set).collect()
}

fn set(value: &Value) -> Set {
    let input = &value["input"];
    let number = |key: &str| input[key].as_f64().unwrap();
    let count = |key: &str| input[key].as_u64().unwrap() as usize;
    let modes: Vec<Truth> = input["modes"]
        .as_array()
        .unwrap()
        .iter()
        .map(|mode| Truth {
            frequency_hz: mode["f"].as_f64().unwrap(),
            damping_ratio: mode["zeta"].as_f64().unwrap(),
            shape: numbers(&mode["shape"]),
        })
        .collect();
    let references: Vec<usize> = numbers(&input["refs"]).into_iter().map(|reference| reference as usize).collect();
    let outputs = count("outputs");
    let mut generator = SplitMix(input["seed"].as_u64().unwrap());
    let data = if input["kind"] == "frf" {
        let lines = count("lines");
        let (from, to) = (number("f1"), number("f2"));
        let frequency_hz: Vec<f64> = (0..lines).map(|k| from + (to - from) * k as f64 / (lines - 1) as f64).collect();
        let noise = generator.normals(2 * outputs * references.len() * lines);
        let scale = number("sigma") / 2.0_f64.sqrt();
        let mut noise = noise.chunks_exact(2).map(|pair| Complex::new(pair[0], pair[1]) * scale);
        let functions = (0..outputs)
            .map(|output| {
                let of = |reference: &usize| {
                    frequency_hz
                        .iter()
                        .map(|f| accelerance(&modes, *f, output, *reference) + noise.next().unwrap())
                        .collect()
                };
                references.iter().map(of).collect()
            })
            .collect();
        Data::Functions { frequency_hz, functions }
    } else {
        record(input, &modes, references[0], outputs, &mut generator)
    };
    let set =
        Set { name: input["name"].as_str().unwrap().into(), modes, references, data, found: value["found"].clone() };
    check(&set);
    set
}

/// The steady-state response to sinusoids between the lines, with noise of force and responses.
fn record(input: &Value, modes: &[Truth], reference: usize, outputs: usize, generator: &mut SplitMix) -> Data {
    let number = |key: &str| input[key].as_f64().unwrap();
    let (samples, sines, rate_hz) = (number("samples") as usize, number("sines") as usize, number("fs"));
    let phases: Vec<f64> = (0..sines).map(|_| TAU * generator.uniform()).collect();
    let amplitude = number("force_rms") * (2.0 / sines as f64).sqrt();
    let mut force = vec![0.0; samples];
    let mut responses = vec![vec![0.0; samples]; outputs];
    for (m, phase) in phases.iter().enumerate() {
        let frequency_hz = number("f1") + (number("f2") - number("f1")) * (m as f64 + 0.37) / sines as f64;
        let gains: Vec<Complex<f64>> = (0..outputs).map(|o| accelerance(modes, frequency_hz, o, reference)).collect();
        // The sinusoid turns by a constant factor from sample to sample, and is computed afresh now and then.
        let (sine, cosine) = libm::sincos(TAU * frequency_hz / rate_hz);
        let turn = Complex::new(cosine, sine);
        let mut wave = Complex::new(0.0, 0.0);
        for n in 0..samples {
            if n % 64 == 0 {
                let (sine, cosine) = libm::sincos(TAU * frequency_hz * n as f64 / rate_hz + phase);
                wave = Complex::new(cosine, sine) * amplitude;
            }
            force[n] += wave.re;
            responses.iter_mut().zip(&gains).for_each(|(response, gain)| response[n] += (gain * wave).re);
            wave *= turn;
        }
    }
    let mut add = |channel: &mut Vec<f64>, sigma: f64| {
        let noise = generator.normals(samples);
        channel.iter_mut().zip(noise).for_each(|(value, noise)| *value += sigma * noise);
    };
    add(&mut force, number("sigma_u"));
    responses.iter_mut().for_each(|response| add(response, number("sigma")));
    Data::Record { rate_hz, band_hz: [number("b1"), number("b2")], force, responses }
}

/// Compares the data with the samples in the file.
fn check(set: &Set) {
    let check = &set.found["check"];
    let near = |found: f64, expected: f64, what: &str| {
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{}, {what}: {found} {expected}", set.name);
    };
    match &set.data {
        Data::Functions { functions, .. } => {
            let first = functions[0][0][0];
            let expected = numbers(&check["first"]);
            near(first.re, expected[0], "first");
            near(first.im, expected[1], "first");
        }
        Data::Record { force, responses, .. } => {
            for (n, expected) in numbers(&check["u"]).into_iter().enumerate() {
                near(force[n], expected, "force");
            }
            for (n, expected) in numbers(&check["y0"]).into_iter().enumerate() {
                near(responses[0][n], expected, "response");
            }
            let mean = force.iter().sum::<f64>() / force.len() as f64;
            let square: f64 = force.iter().map(|x| (x - mean) * (x - mean)).sum();
            let rms = (square / force.len() as f64).sqrt();
            near(rms, check["rms_u"].as_f64().unwrap(), "rms of the force");
        }
    }
}
