//! Responses of modes in time, against closed forms.

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

/// The exact flow against explicit steps, which an element of no stiffness makes the stepper take.
#[test]
fn a_sine_acts_inside_the_step() {
    let weak = grounded(along("tip", Axis::X), Law::Cubic { stiffness3: f64::MIN_POSITIVE, stiffness5: 0.0 });
    let ends = [vec![], vec![weak]].map(|elements| {
        let assembly = two_modes(elements);
        let drive = [assembly.dof("tip.x").unwrap(), assembly.dof("mid.x").unwrap()];
        let mut stepper = Stepper::new(&assembly, &drive, Scheme::Exponential8, 200.0).unwrap();
        let load = StepLoad::Sine { amplitude: &[5.0, -2.0], omega_rad_s: 6.3 * 21.0 };
        (0..400).for_each(|k| stepper.advance_under(f64::from(k) / 200.0, &load).unwrap());
        let mut end = vec![0.0; stepper.states()];
        end[..2].copy_from_slice(stepper.position());
        end[2..].copy_from_slice(stepper.velocity());
        end
    });
    let largest = ends[0].iter().fold(0.0_f64, |largest, number| largest.max(number.abs()));
    for (exact, explicit) in ends[0].iter().zip(&ends[1]) {
        assert!((exact - explicit).abs() < 1e-8 * largest, "{ends:?}");
    }
}

/// Linear modes under a load of several harmonics move as the sum of their motions under each.
#[test]
fn harmonics_of_a_load_add_up() {
    let assembly = two_modes(vec![]);
    let (drive, omega_rad_s) = ([assembly.dof("tip.x").unwrap()], TAU * 7.0);
    let harmonics = [
        LoadHarmonic { order: 3, ratio: 0.5, phase_rad: 0.0 },
        LoadHarmonic { order: 8, ratio: -2.0, phase_rad: 0.5 * core::f64::consts::PI },
    ];
    let end = |of: &StepLoad<'_>| {
        let mut stepper = Stepper::new(&assembly, &drive, Scheme::Exponential8, 500.0).unwrap();
        (0..300).for_each(|k| stepper.advance_under(f64::from(k) / 500.0, of).unwrap());
        [stepper.position(), stepper.velocity()].concat()
    };
    let all = end(&StepLoad::Periodic { amplitude: &[5.0], omega_rad_s, harmonics: &harmonics });
    let one = end(&StepLoad::Sine { amplitude: &[5.0], omega_rad_s });
    let third = end(&StepLoad::Sine { amplitude: &[2.5], omega_rad_s: 3.0 * omega_rad_s });
    let eighth = [LoadHarmonic { order: 2, ratio: -2.0, phase_rad: 0.5 * core::f64::consts::PI }];
    // −10 cos 8Ωt beside a sine of 4Ω, which is taken off again.
    let beside = StepLoad::Periodic { amplitude: &[5.0], omega_rad_s: 4.0 * omega_rad_s, harmonics: &eighth };
    let beside = end(&beside);
    let fourth = end(&StepLoad::Sine { amplitude: &[5.0], omega_rad_s: 4.0 * omega_rad_s });
    for i in 0..4 {
        let expected = one[i] + third[i] + beside[i] - fourth[i];
        assert!((all[i] - expected).abs() < 1e-12 * one[i].abs().max(1.0), "{i}: {} {expected}", all[i]);
    }
    let many = [LoadHarmonic { order: 2, ratio: 1.0, phase_rad: 0.0 }; 9];
    let mut stepper = Stepper::new(&assembly, &drive, Scheme::Exponential8, 500.0).unwrap();
    let load = StepLoad::Periodic { amplitude: &[5.0], omega_rad_s, harmonics: &many };
    assert_eq!(stepper.advance_under(0.0, &load), Err(StepError::Harmonics { got: 9, most: 8 }));
}

/// One mode of shape 0.5 under a sine of 1 N.
fn sine_on_one_mode(damping_ratio: f64, frequency_hz: f64, rate_hz: f64, steps: u32, drive_hz: f64) -> [f64; 2] {
    let modes = vec![ModeSpec { frequency_hz, damping_ratio }];
    let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![0.5] }];
    let assembly = assembly(BodySpec::Modal(ModalSpec { modes, shapes }), vec![]);
    let tip = assembly.dof("tip.x").unwrap();
    let mut stepper = Stepper::new(&assembly, &[tip], Scheme::Exponential8, rate_hz).unwrap();
    let load = StepLoad::Sine { amplitude: &[1.0], omega_rad_s: TAU * drive_hz };
    (0..steps).for_each(|k| stepper.advance_under(f64::from(k) / rate_hz, &load).unwrap());
    [stepper.position()[0], stepper.velocity()[0]]
}

/// The constants of a step are rounded, and so it errs alike in every step.
fn rounding(steps: u32) -> f64 {
    5e-13 + f64::from(steps) * f64::EPSILON / 2.0
}

/// Without damping, at resonance and beside it, with p = 0.5 and a = (ω + Ω)t/2, b = (ω − Ω)t/2:
/// q = pt/2ω (sinc a cos b − sinc b cos a), q̇ = pt/2 (sinc b sin a − sinc a sin b).
#[test]
fn a_sine_at_the_resonance_of_an_undamped_mode_is_exact() {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { libm::sin(x) / x };
    for off in [0.0, 1e-16, 5e-12, -1e-9, 1e-6, 1e-3, 0.3, -0.999] {
        for (rate_hz, steps) in [(8000.0, 80_000_u32), (50.0, 500), (0.1, 1)] {
            let (t, omega, drive) = (10.0, TAU * 20.0, TAU * (20.0 * (1.0 + off)));
            let (a, b) = (0.5 * (omega + drive) * t, 0.5 * (omega - drive) * t);
            let expected = [
                0.25 * t / omega * (sinc(a) * libm::cos(b) - sinc(b) * libm::cos(a)),
                0.25 * t * (sinc(b) * libm::sin(a) - sinc(a) * libm::sin(b)),
            ];
            let got = sine_on_one_mode(0.0, 20.0, rate_hz, steps, drive / TAU);
            let largest = 0.5 / (omega * omega) * (0.5 * omega * t).min(1.0 / off.abs());
            for (of, (got, expected)) in got.iter().zip(expected).enumerate() {
                let error = (got - expected).abs() / (largest * [1.0, omega][of]);
                assert!(error < rounding(steps), "{off} at {rate_hz} Hz: {got} {expected} {error:e}");
            }
        }
    }
    let [position, _] = sine_on_one_mode(0.0, 20.0, 8000.0, 80_000, 20.0);
    assert!((position + 0.019_894_367_886_486_9).abs() < 1e-14, "{position}");
}

/// At resonance q = p/2σω (e (cos ω_d t + σ/ω_d sin ω_d t) − cos ωt), e = exp(−σt), written without cancellation.
#[test]
fn a_sine_at_the_resonance_of_a_damped_mode_is_exact() {
    for zeta in [1e-300, 1e-16, 1e-12, 1e-8, 1e-4, 0.05, 0.7, 1.0 - 1e-9, 1.0 - 1e-16] {
        for (rate_hz, steps) in [(8000.0, 80_000_u32), (50.0, 500), (0.1, 1)] {
            let (t, omega) = (10.0, TAU * 20.0);
            let (sigma, root) = (zeta * omega, libm::sqrt((1.0 - zeta) * (1.0 + zeta)));
            let (damped, decay) = (root * omega, libm::exp(-sigma * t));
            let below = omega * zeta * zeta / (1.0 + root);
            let turned = 2.0 * libm::sin(0.5 * (damped + omega) * t) * libm::sin(0.5 * below * t);
            let swing = libm::expm1(-sigma * t) * libm::cos(omega * t);
            let rest = decay * (turned + sigma / damped * libm::sin(damped * t));
            let expected = 0.25 / (sigma * omega) * (swing + rest);
            let [got, _] = sine_on_one_mode(zeta, 20.0, rate_hz, steps, 20.0);
            let largest = 0.25 / omega * t.min(1.0 / sigma);
            let error = (got - expected).abs() / largest;
            assert!(error < rounding(steps), "{zeta} at {rate_hz} Hz: {got} {expected} {error:e}");
        }
    }
}

/// From rest a slow mode first moves by p Ω t³/6, with all digits.
#[test]
fn a_slow_mode_keeps_its_digits_in_short_steps_under_a_sine() {
    let [position, velocity] = sine_on_one_mode(0.01, 1e-3, 1e6, 1, 1e-3);
    let drive = TAU * 1e-3;
    assert!((position / (0.5 * drive * 1e-18 / 6.0) - 1.0).abs() < 1e-10, "{position}");
    assert!((velocity / (0.5 * drive * 1e-12 / 2.0) - 1.0).abs() < 1e-10, "{velocity}");
}

/// The viscous part of LuGre's friction damps the linear structure, as tanh's slope does, and as a linear damper.
#[test]
fn dampers_in_friction_damp_the_linear_structure() {
    let lugre = Law::Lugre {
        bristle_stiffness: 1e5,
        bristle_damping: 30.0,
        viscous: 8.0,
        coulomb: 2.0,
        breakaway: 3.0,
        stribeck: 0.1,
    };
    let linear = Law::Linear { stiffness: 0.0, damping: 8.0 };
    let tanh = Law::Tanh { slip: 2.0, velocity: 0.25 };
    let [lugre, linear, tanh] =
        [lugre, linear, tanh].map(|law| two_modes(vec![grounded(along("tip", Axis::X), law)]).modes().to_vec());
    let without = two_modes(vec![]).modes().to_vec();
    assert!(lugre == linear && tanh == linear, "{lugre:?} {linear:?} {tanh:?}");
    assert!(lugre.iter().zip(without).all(|(with, without)| with.damping_ratio > without.damping_ratio));
}

/// One mode of shape 0.5 under a force that is held: position and velocity after so many steps.
fn held_on_one_mode(damping_ratio: f64, frequency_hz: f64, rate_hz: f64, steps: u32, force_n: f64) -> [f64; 2] {
    let modes = vec![ModeSpec { frequency_hz, damping_ratio }];
    let shapes = vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![0.5] }];
    let assembly = assembly(BodySpec::Modal(ModalSpec { modes, shapes }), vec![]);
    let tip = assembly.dof("tip.x").unwrap();
    let mut stepper = Stepper::new(&assembly, &[tip], Scheme::Exponential8, rate_hz).unwrap();
    (0..steps).for_each(|k| stepper.advance(f64::from(k) / rate_hz, &[force_n]).unwrap());
    [stepper.position()[0], stepper.velocity()[0]]
}

/// A rigid mode moves by t and t²/2; under a sine from rest by p (t − sin(Ωt)/Ω)/Ω.
#[test]
fn a_rigid_mode_moves_freely() {
    for (rate_hz, steps) in [(1e4, 20_000_u32), (1.0, 2)] {
        let [position, velocity] = held_on_one_mode(0.0, 0.0, rate_hz, steps, 3.0);
        assert!(
            (position / (0.5 * 1.5 * 4.0) - 1.0).abs() < 1e-11 && (velocity / 3.0 - 1.0).abs() < 1e-11,
            "{position}"
        );
        let omega = TAU * 1.3;
        let [position, velocity] = sine_on_one_mode(0.0, 0.0, rate_hz, steps, 1.3);
        let expected =
            [0.5 * (2.0 - libm::sin(2.0 * omega) / omega) / omega, 0.5 * (1.0 - libm::cos(2.0 * omega)) / omega];
        assert!((position / expected[0] - 1.0).abs() < 1e-11, "{position} {expected:?}");
        assert!((velocity / expected[1] - 1.0).abs() < 1e-10, "{velocity} {expected:?}");
    }
    // The ratio says nothing.
    assert_eq!(held_on_one_mode(0.7, 0.0, 1e3, 50, 3.0), held_on_one_mode(0.0, 0.0, 1e3, 50, 3.0));
}

/// C and S by the exponentials of the two decay rates; e^{−σt} and t e^{−σt} where these are one.
fn two_decays(omega: f64, zeta: f64, t: f64) -> [f64; 2] {
    let (sigma, s) = (zeta * omega, omega * libm::sqrt(zeta * zeta - 1.0));
    if s == 0.0 {
        return [libm::exp(-sigma * t), t * libm::exp(-sigma * t)];
    }
    // The slower rate as ω² over the faster one: their difference would cancel for large ζ.
    let ends = [omega * omega / (sigma + s), sigma + s].map(|rate| libm::exp(-rate * t));
    [0.5 * (ends[0] + ends[1]), (ends[0] - ends[1]) / (2.0 * s)]
}

/// A held force moves an overdamped mode by (1 − C − σS)/ω² of it, a sine by Im(P e^{iΩt}), P = p/(ω² − Ω² + 2iσΩ), and
/// the free motion from what that lacks at the start. Steps of all lengths are exact.
#[test]
fn critical_and_overdamped_modes_are_exact() {
    for zeta in [1.0, 1.0 + 1e-6, 1.1, 2.0, 30.0, 1e4] {
        for (rate_hz, steps) in [(8000.0, 16_000_u32), (50.0, 100), (0.5, 1)] {
            let (t, omega) = (2.0, TAU * 3.0);
            let (sigma, [c, s]) = (zeta * omega, two_decays(omega, zeta, t));
            let [position, velocity] = held_on_one_mode(zeta, 3.0, rate_hz, steps, 1.0);
            let expected = [0.5 * (1.0 - c - sigma * s) / (omega * omega), 0.5 * s];
            for (got, expected) in [position, velocity].iter().zip(expected) {
                assert!((got - expected).abs() < 1e-10 * expected.abs() + 1e-13, "{zeta} {rate_hz}: {got} {expected}");
            }
            let drive = TAU * 1.7;
            let phasor = nalgebra::Complex::new(omega * omega - drive * drive, 2.0 * sigma * drive).inv() * 0.5;
            let (start, rate) = (-phasor.im, -drive * phasor.re);
            let (sine, cosine) = libm::sincos(drive * t);
            let steady = phasor.re * sine + phasor.im * cosine;
            let expected = steady + c * start + s * (rate + sigma * start);
            let [got, _] = sine_on_one_mode(zeta, 3.0, rate_hz, steps, 1.7);
            let size = libm::hypot(phasor.re, phasor.im);
            assert!((got - expected).abs() < 1e-9 * size, "{zeta} {rate_hz}: {got} {expected}");
        }
    }
}

/// From rest a mode first moves by p h²/2 (1 − 2σh/3), whatever its damping, with all digits.
#[test]
fn short_steps_of_overdamped_modes_keep_their_digits() {
    for (zeta, frequency_hz) in [(1.0, 1e-3), (3.0, 1e-3), (1e3, 1e-3), (1.0 + 1e-12, 10.0)] {
        let h = 1e-7;
        let [position, velocity] = held_on_one_mode(zeta, frequency_hz, 1.0 / h, 1, 1.0);
        let sigma = zeta * TAU * frequency_hz;
        assert!((position / (0.25 * h * h * (1.0 - 2.0 * sigma * h / 3.0)) - 1.0).abs() < 1e-10, "{zeta}: {position}");
        assert!((velocity / (0.5 * h * (1.0 - sigma * h)) - 1.0).abs() < 1e-10, "{zeta}: {velocity}");
    }
}

/// A free structure of a rigid mode, one that oscillates and one that doesn't.
fn free(elements: Vec<ElementSpec>) -> Assembly {
    let mode = |frequency_hz, damping_ratio| ModeSpec { frequency_hz, damping_ratio };
    let shape =
        |point: &str, by_mode: [f64; 3]| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: by_mode.into() };
    let modes = vec![mode(0.0, 0.0), mode(20.0, 0.004), mode(57.0, 3.0)];
    let shapes = vec![shape("tip", [0.5, 0.5, 0.4]), shape("mid", [0.5, -0.5, 0.35])];
    assembly(BodySpec::Modal(ModalSpec { modes, shapes }), elements)
}

/// Explicit steps resolve the faster decay of an overdamped mode, and rigid modes: as exact steps do, and with a shaker.
#[test]
fn explicit_steps_follow_rigid_and_overdamped_modes() {
    let weak = grounded(along("tip", Axis::X), Law::Cubic { stiffness3: f64::MIN_POSITIVE, stiffness5: 0.0 });
    let coil = Coil::Voltage { force_factor_n_a: 20.0, resistance_ohm: 2.0, inductance_h: 1e-2 };
    for is_shaken in [false, true] {
        let ends = [vec![], vec![weak.clone()]].map(|elements| {
            let assembly = free(elements);
            let tip = assembly.dof("tip.x").unwrap();
            let mut stepper = if is_shaken {
                let along = [Some((tip, 1.0)), None];
                let armature = Armature { along, mass_kg: 0.4, stiffness_n_m: 300.0, damping_n_s_m: 8.0, coil };
                Stepper::shaken(&assembly, &armature, Scheme::Exponential8, 1000.0).unwrap()
            } else {
                Stepper::new(&assembly, &[tip], Scheme::Exponential8, 1000.0).unwrap()
            };
            for k in 0..500 {
                let time_s = f64::from(k) / 1000.0;
                stepper.advance(time_s, &[5.0 * libm::sin(40.0 * time_s) + 1.0]).unwrap();
            }
            [stepper.position().to_vec(), stepper.velocity().to_vec()].concat()
        });
        for (exact, explicit) in ends[0].iter().zip(&ends[1]) {
            assert!((exact - explicit).abs() < 1e-8 * exact.abs().max(1e-3), "{is_shaken} {ends:?}");
        }
    }
}

/// Two masses of 2 kg with a spring between them have modes at 0 and 120 Hz; a spring to the ground at one of them
/// leaves none at 0 Hz, and one between them leaves the rigid mode.
#[test]
fn modes_of_a_free_structure() {
    let omega = TAU * 120.0;
    let masses = |elements| {
        let mode = |frequency_hz| ModeSpec { frequency_hz, damping_ratio: 0.01 };
        let shape =
            |point: &str, by_mode: [f64; 2]| ShapeSpec { point: point.into(), axis: Axis::Y, by_mode: by_mode.into() };
        let shapes = vec![shape("a", [0.5, 0.5]), shape("b", [0.5, -0.5])];
        assembly(BodySpec::Modal(ModalSpec { modes: vec![mode(0.0), mode(120.0)], shapes }), elements)
    };
    let found =
        |of: &Assembly| of.modes().iter().map(|mode| (mode.frequency_hz, mode.damping_ratio)).collect::<Vec<_>>();
    let modes = found(&masses(vec![]));
    assert_eq!(modes[0], (0.0, 0.0));
    assert!((modes[1].0 / 120.0 - 1.0).abs() < 1e-14 && (modes[1].1 / 0.01 - 1.0).abs() < 1e-14, "{modes:?}");
    let (stiffness, damping) = (1e5, 0.0);
    let spring = Law::Linear { stiffness, damping };
    let inner = ElementSpec::Point { at: along("a", Axis::Y), to: Some(along("b", Axis::Y)), law: spring };
    // k (1/m + 1/m) more.
    let modes = found(&masses(vec![inner]));
    assert_eq!(modes[0], (0.0, 0.0));
    assert!((modes[1].0 - libm::sqrt(omega * omega + stiffness) / TAU).abs() < 1e-9, "{modes:?}");
    // λ² − λ (ω² + k/m) + ω² k/2m = 0.
    let modes = found(&masses(vec![grounded(along("a", Axis::Y), spring)]));
    let (sum, product) = (omega * omega + stiffness / 2.0, omega * omega * stiffness / 4.0);
    let root = libm::sqrt(sum * sum / 4.0 - product);
    for (mode, square) in modes.iter().zip([product / (sum / 2.0 + root), sum / 2.0 + root]) {
        assert!((mode.0 - libm::sqrt(square) / TAU).abs() < 1e-9 * mode.0, "{modes:?}");
    }
    // A damper on the rigid mode has no ratio below infinity.
    let damper = Law::Linear { stiffness: 0.0, damping: 3.0 };
    assert_eq!(found(&masses(vec![grounded(along("a", Axis::Y), damper)]))[0], (0.0, f64::INFINITY));
}

/// A mass of 4 kg on a spring, on a base that moves along z: Γ = φᵀm = √m. A held acceleration a of the base moves the mass
/// relative to it as the force −ma does, and its absolute acceleration is −ω²x − 2ζω ẋ.
#[test]
fn a_base_moves_the_structure_by_its_acceleration() {
    let modes = vec![ModeSpec { frequency_hz: 20.0, damping_ratio: 0.05 }];
    let shape = |point: &str, axis, phi| ShapeSpec { point: point.into(), axis, by_mode: vec![phi] };
    let shapes = vec![shape("tip", Axis::Z, 0.5), shape("tip", Axis::X, 0.0), shape(BASE, Axis::Z, 2.0)];
    let assembly = assembly(BodySpec::Modal(ModalSpec { modes, shapes }), vec![]);
    let [tip, across, base] = ["tip.z", "tip.x", "base.z"].map(|name| assembly.dof(name).unwrap());
    assert_eq!((assembly.points(), base.load_unit(), base.is_base()), (vec!["tip".into()], "m/s²", true));
    assert_eq!([tip, across, base].map(|dof| assembly.carried(dof, base)), [1.0, 0.0, 1.0]);
    let run = |drive: Dof, load: f64| {
        let mut stepper = Stepper::new(&assembly, &[drive], Scheme::Exponential8, 1000.0).unwrap();
        (0..100).for_each(|k| stepper.advance(f64::from(k) / 1000.0, &[load]).unwrap());
        stepper
    };
    let (moved, pushed) = (run(base, 3.0), run(tip, -12.0));
    assert!((moved.position()[0] - pushed.position()[0]).abs() < 1e-15 && moved.position()[0] != 0.0);
    let mut a = [0.0];
    moved.acceleration(&[3.0], &mut a).unwrap();
    let at = assembly.at(moved.position());
    let absolute = at.acceleration(tip, moved.velocity(), &a) + 3.0 * assembly.carried(tip, base);
    let (omega, x, v) = (TAU * 20.0, at.displacement(tip), at.velocity(tip, moved.velocity()));
    assert!((absolute + omega * omega * x + 2.0 * 0.05 * omega * v).abs() < 1e-12, "{absolute}");
    assert_eq!((at.displacement(base), at.velocity(base, moved.velocity())), (0.0, 0.0));
}
