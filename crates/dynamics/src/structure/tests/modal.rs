//! Modes in time.

use core::f64::consts::TAU;

use super::*;
use crate::integrate::Scheme;

/// 32 modes under a force that changes every step: against the sum of the responses to its changes, each in closed
/// form, where the stepper goes from step to step.
#[test]
fn modes_without_elements_are_exact() {
    let omega = |i: usize| TAU * 7.0 * (1.0 + i as f64);
    let zeta = |i: usize| 0.002 + 0.02 * i as f64;
    let modes = (0..32).map(|i| ModeSpec { frequency_hz: omega(i) / TAU, damping_ratio: zeta(i) }).collect();
    let by_mode: Vec<f64> = (0..32).map(|i| libm::cos(i as f64)).collect();
    let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::Z, by_mode: by_mode.clone() }];
    let assembly = assembly(BodySpec::Modal(ModalSpec { modes, shapes }), vec![]);
    let tip = assembly.dof("tip.z").unwrap();
    let mut stepper = Stepper::new(&assembly, &[tip], Scheme::Exponential8, 200.0).unwrap();
    let force = |k: usize| 10.0 * libm::sin(1.7 * k as f64 + 0.3);
    for k in 0..40 {
        stepper.advance(k as f64 * 0.005, &[force(k)]).unwrap();
    }
    // A force of 1 N from time 0 on moves the mode by (1 − e^{−σt} (cos ω_d t + σ/ω_d sin ω_d t)) φ/ω².
    for (i, (shape, position)) in by_mode.iter().zip(stepper.position()).enumerate() {
        let (sigma, damped) = (zeta(i) * omega(i), omega(i) * libm::sqrt(1.0 - zeta(i) * zeta(i)));
        let step = |t: f64| {
            let swing = libm::cos(damped * t) + sigma / damped * libm::sin(damped * t);
            shape / (omega(i) * omega(i)) * (1.0 - libm::exp(-sigma * t) * swing)
        };
        let change = |k: usize| force(k) - if k == 0 { 0.0 } else { force(k - 1) };
        let expected: f64 = (0..40).map(|k| change(k) * step(0.005 * (40 - k) as f64)).sum();
        let largest = 100.0 / (omega(i) * omega(i));
        assert!((position - expected).abs() < 1e-13 * largest, "{i}: {position} {expected}");
    }
}
