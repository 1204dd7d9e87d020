//! Linear or not: the same structure at two levels of excitation.

use core::f64::consts::TAU;

use nalgebra::Complex;
use resonarm_numeric::dft::Fft;
use resonarm_numeric::noise::Noise;

use super::closed_form::{BAND, RATE_HZ, three};
use crate::{Channel, Doubt, Mode, ModeShift, Options, Record, compare_levels, identify_records, judge_levels};

/// Samples of force between two readings.
const FINE: usize = 16;

/// Identifies the modes of a structure under a random force of this root mean square, N, with a cubic spring at its tip, N/m³,
/// by Runge and Kutta's method of order 4 from rest.
fn identify(rms: f64, cubic: f64, noise_level: f64, seed: u64) -> Vec<Mode> {
    let (modes, samples) = (three([0.02; 3]), 10_000);
    let mut noise = Noise::new(seed, 0);
    // The force between the readings, from 5 to 200 Hz, and at the half steps of the integration.
    let fft = Fft::at_least(samples * FINE);
    let spacing_hz = RATE_HZ * FINE as f64 / fft.length() as f64;
    let [first, last] = [5.0, 200.0].map(|f| (f / spacing_hz) as usize);
    let mut spectrum = vec![Complex::new(0.0, 0.0); fft.length()];
    for line in &mut spectrum[first..last] {
        // Twice the real part of L lines, each part of which has the variance σ², has the variance 4Lσ².
        *line = Complex::new(noise.normal(), noise.normal()) * (rms / (4.0 * (last - first) as f64).sqrt());
    }
    fft.backward(&mut spectrum);
    let force: Vec<f64> = spectrum.iter().map(|value| 2.0 * value.re).collect();

    let acceleration = |q: &[f64; 3], v: &[f64; 3], force: f64| -> [f64; 3] {
        let tip: f64 = modes.iter().zip(q).map(|(mode, q)| mode.shape[0] * q).sum();
        let total = force - cubic * tip * tip * tip;
        core::array::from_fn(|k| {
            let omega = TAU * modes[k].frequency_hz;
            modes[k].shape[0] * total - 2.0 * modes[k].damping_ratio * omega * v[k] - omega * omega * q[k]
        })
    };
    // A step takes the force at its start, in its middle and at its end.
    let step_s = 2.0 / (RATE_HZ * FINE as f64);
    let (mut q, mut v) = ([0.0; 3], [0.0; 3]);
    let mut readings = [const { Vec::new() }; 3];
    for n in 0..samples * FINE / 2 {
        if n % (FINE / 2) == 0 {
            let a = acceleration(&q, &v, force[2 * n]);
            readings[0].push(force[2 * n]);
            for point in 0..2 {
                readings[1 + point].push((0..3).map(|k| modes[k].shape[point] * a[k]).sum::<f64>());
            }
        }
        let add = |x: &[f64; 3], d: &[f64; 3], h: f64| core::array::from_fn(|k| x[k] + h * d[k]);
        let (k1, l1) = (v, acceleration(&q, &v, force[2 * n]));
        let (q2, v2) = (add(&q, &k1, 0.5 * step_s), add(&v, &l1, 0.5 * step_s));
        let (k2, l2) = (v2, acceleration(&q2, &v2, force[2 * n + 1]));
        let (q3, v3) = (add(&q, &k2, 0.5 * step_s), add(&v, &l2, 0.5 * step_s));
        let (k3, l3) = (v3, acceleration(&q3, &v3, force[2 * n + 1]));
        let (q4, v4) = (add(&q, &k3, step_s), add(&v, &l3, step_s));
        let (k4, l4) = (v4, acceleration(&q4, &v4, force[(2 * n + 2) % force.len()]));
        for k in 0..3 {
            q[k] += step_s / 6.0 * (k1[k] + 2.0 * (k2[k] + k3[k]) + k4[k]);
            v[k] += step_s / 6.0 * (l1[k] + 2.0 * (l2[k] + l3[k]) + l4[k]);
        }
    }
    let sigmas = [0.0115, 0.0247, 0.0247];
    for (channel, sigma) in readings.iter_mut().zip(sigmas) {
        channel.iter_mut().for_each(|value| *value += noise_level * sigma * noise.normal());
    }
    let channel = |dof: usize, index: usize| Channel {
        dof,
        samples: &readings[index],
        noise: (noise_level > 0.0).then_some(noise_level * sigmas[index]),
    };
    let record =
        Record { rate_hz: RATE_HZ, references: vec![channel(0, 0)], responses: vec![channel(0, 1), channel(1, 2)] };
    identify_records(&[record], &Options::new(BAND)).unwrap().modes
}

fn is_nonlinear(shifts: &[ModeShift]) -> bool {
    shifts.iter().any(|shift| shift.nonlinear)
}

/// A cubic spring is noticed, and then no deviation is stated; a linear structure is never accused, with and without noise.
#[test]
fn two_levels_tell_a_nonlinear_structure_from_a_linear_one() {
    for seed in 0..2 {
        let mut low = identify(5.0, 0.0, 1.0, 2 * seed);
        let mut high = identify(20.0, 0.0, 1.0, 2 * seed + 1);
        let shifts = judge_levels(&mut low, &mut high);
        assert!(shifts.len() == 3 && !is_nonlinear(&shifts), "{shifts:?}");
        assert!(low.iter().chain(&high).all(|mode| mode.deviations().is_ok()), "{:?}", high[0].doubts);

        let mut low = identify(5.0, 1e8, 1.0, 2 * seed);
        let mut high = identify(20.0, 1e8, 1.0, 2 * seed + 1);
        let shifts = judge_levels(&mut low, &mut high);
        assert!(is_nonlinear(&shifts) && shifts[0].frequency_z > 4.0, "{shifts:?}");
        assert!(low[0].doubts.iter().any(|doubt| matches!(doubt, Doubt::Nonlinear { z } if *z > 4.0)));
        assert!(low[0].deviations().is_err());
    }
    let shifts = compare_levels(&identify(5.0, 0.0, 0.0, 7), &identify(20.0, 0.0, 0.0, 8));
    assert!(shifts.len() >= 3 && !is_nonlinear(&shifts), "{shifts:?}");
}
