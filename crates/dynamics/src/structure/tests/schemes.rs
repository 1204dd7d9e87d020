//! Every scheme on the arm of the presets: order, symmetry, large steps, held loads, and what it can't carry.

use core::f64::consts::TAU;

use super::*;
use crate::integrate::IntegrateError;

/// A preset with its links at angles, degrees.
fn arm(preset: Preset, angles_deg: [f64; 2]) -> Assembly {
    assembly(BodySpec::Chain(preset.chain().unwrap().at_angles_deg(&angles_deg)), vec![])
}

/// Loads at degrees of freedom, held or swinging.
struct Driven {
    amplitude: Vec<(&'static str, f64)>,
    frequency_hz: Option<f64>,
}

const FREE: Driven = Driven { amplitude: vec![], frequency_hz: None };

/// The state, angles and rates, after `steps` steps from `start`.
fn run(of: &Assembly, scheme: Scheme, rate_hz: f64, steps: u32, start: [f64; 4], driven: &Driven) -> [f64; 4] {
    let drive: Vec<Dof> = driven.amplitude.iter().map(|(name, _)| of.dof(name).unwrap()).collect();
    let amplitude: Vec<f64> = driven.amplitude.iter().map(|(_, load)| *load).collect();
    let load = match driven.frequency_hz {
        Some(hz) => StepLoad::Sine { amplitude: &amplitude, omega_rad_s: TAU * hz },
        None => StepLoad::Held(&amplitude),
    };
    let mut stepper = Stepper::new(of, &drive, scheme, rate_hz).unwrap();
    stepper.restore(&start).unwrap();
    for k in 0..steps {
        stepper.advance_under(f64::from(k) / rate_hz, &load).unwrap();
    }
    [stepper.position(), stepper.velocity()].concat().try_into().unwrap()
}

fn norm(pair: &[f64]) -> f64 {
    libm::hypot(pair[0], pair[1])
}

fn distance(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    let apart: [f64; 4] = core::array::from_fn(|i| a[i] - b[i]);
    norm(&apart[..2]) + norm(&apart[2..])
}

fn energy_j(of: &Assembly, state: &[f64; 4]) -> f64 {
    of.energy_j(&state[..2], &state[2..])
}

#[test]
fn error_falls_with_the_order_of_the_scheme() {
    let arm = arm(Preset::Irb1600Fitted, [20.0, 60.0]);
    let start = [0.05, -0.08, 0.5, -1.0];
    let amplitude = vec![("joint1", 60.0), ("tip.x", 30.0), ("tip.y", 25.0)];
    let sine = Driven { amplitude, frequency_hz: Some(24.0) };
    // At this rate the error of order 8 is far below all errors that are compared.
    let truth = run(&arm, Scheme::Exponential8, 8_000.0, 800, start, &sine);
    for scheme in Scheme::ALL {
        // High enough for the leading term of the error, low enough for rounding.
        let rate = match scheme.order() {
            4 => 2000.0,
            6 => 1000.0,
            _ => 640.0,
        };
        let error = |factor: u32| {
            let steps = (rate * 0.1) as u32 * factor;
            distance(&truth, &run(&arm, scheme, rate * f64::from(factor), steps, start, &sine))
        };
        let order = libm::log2(error(1) / error(2));
        assert!((order - f64::from(scheme.order())).abs() < 0.3, "{scheme}: observed order {order}");
    }
}

#[test]
fn symmetric_schemes_retrace_their_steps() {
    let mut chain = Preset::Irb1600Fitted.chain().unwrap().at_angles_deg(&[0.0, 60.0]);
    chain.links.iter_mut().for_each(|link| link.damping_nm_s_rad = 0.0);
    let arm = assembly(BodySpec::Chain(chain), vec![]);
    let turned = |state: [f64; 4]| [state[0], state[1], -state[2], -state[3]];
    let start = [0.1, -0.08, 0.5, -1.0];
    for scheme in Scheme::ALL.into_iter().filter(|scheme| scheme.is_symmetric()) {
        let there = run(&arm, scheme, 1000.0, 1000, start, &FREE);
        let back = turned(run(&arm, scheme, 1000.0, 1000, turned(there), &FREE));
        assert!(distance(&start, &back) < 1e-9, "{scheme}: {}", distance(&start, &back));
        let (first, last) = (energy_j(&arm, &start), energy_j(&arm, &there));
        assert!((last / first - 1.0).abs() < 1e-4, "{scheme}: energy {first} J, then {last} J");
    }
}

/// The scheme also works where fixed-point iteration diverges: the straight arm of Table 1, 569 Hz, at 1 kHz (ωh =
/// 3.6). The amplitudes go up to those of the last fold of a strongly driven arm. The dampers take the same energy as
/// in an accurate solution, within 5 %.
#[test]
fn implicit_schemes_hold_at_every_pose() {
    for (preset, amplitude_rad) in [0.1, 0.3].into_iter().flat_map(|a| Preset::ALL.map(|preset| (preset, a))) {
        for beta2_deg in (-180..=180).step_by(15) {
            let arm = arm(preset, [10.0, f64::from(beta2_deg)]);
            let start = [amplitude_rad, -amplitude_rad, 5.0, 5.0];
            let truth = run(&arm, Scheme::Dop853, 32_000.0, 8_000, start, &FREE);
            let fastest_rad_s = TAU * arm.modes()[1].frequency_hz;
            // One step a period of the fastest mode, the least that implicit schemes accept.
            let lowest_hz = (fastest_rad_s / Scheme::Gl6.phase_limit_rad()).ceil();
            for scheme in [Scheme::Gl4, Scheme::Gl6, Scheme::Exponential, Scheme::Exponential8] {
                for rate_hz in [1000.0, lowest_hz] {
                    let end = run(&arm, scheme, rate_hz, (rate_hz / 4.0).round() as u32, start, &FREE);
                    let [first, last, true_last] = [start, end, truth].map(|state| energy_j(&arm, &state));
                    let case = format_args!("{scheme} {preset} {beta2_deg}° {rate_hz} Hz {amplitude_rad} rad");
                    assert!(
                        last < first && (last / true_last - 1.0).abs() < 0.05,
                        "{case}: {first} J, {last} J, {true_last} J"
                    );
                }
            }
        }
    }
}

/// A held load, too: one step of a millisecond is as accurate as a thousand of a microsecond by another scheme.
#[test]
fn exponential_schemes_are_exact_under_a_held_load() {
    let arm = arm(Preset::Irb1600Table1, [0.0, 0.0]);
    let load = Driven { amplitude: vec![("joint1", 1e-3), ("tip.y", 1e-3)], frequency_hz: None };
    let many = run(&arm, Scheme::Gl6, 1e6, 1000, [0.0; 4], &load);
    for scheme in [Scheme::Exponential, Scheme::Exponential8] {
        let one = run(&arm, scheme, 1000.0, 1, [0.0; 4], &load);
        assert!(distance(&one, &many) < 1e-9 * norm(&one[2..]), "{one:?} {many:?}");
    }
}

/// A motion so small that its energy underflows counts as rest, not as a failure.
#[test]
fn a_motion_whose_energy_underflows_continues() {
    let arm = arm(Preset::Irb1600Fitted, [20.0, 60.0]);
    for scheme in Scheme::ALL {
        for exponent in 150..=170 {
            // Squares of numbers below 1e-154 lose digits, and below 1e-162 they are 0.
            let small = libm::exp10(-f64::from(exponent));
            let start = [small, -0.7 * small, 30.0 * small, 11.0 * small];
            let end = run(&arm, scheme, 1000.0, 50, start, &FREE);
            assert!(distance(&end, &[0.0; 4]) < 1e3 * small, "{scheme}, {small}: {end:?}");
        }
    }
}

#[test]
fn says_which_rate_would_do() {
    let arm = arm(Preset::Irb1600Table1, [0.0, 0.0]);
    let says = |scheme, rate_hz| Stepper::new(&arm, &[], scheme, rate_hz).unwrap_err().to_string();
    insta::assert_snapshot!(says(Scheme::Rk4, 0.0), @"the integration rate is 0 Hz: it must be a positive number");
    insta::assert_snapshot!(says(Scheme::Rk4, 1000.0), @"scheme rk4 is too coarse for this structure at 1000 Hz: its fastest mode needs a rate of at least 1265 Hz");
    insta::assert_snapshot!(says(Scheme::Gl6, 500.0), @"scheme gl6 is too coarse for this structure at 500 Hz: its fastest mode needs a rate of at least 570 Hz");
    insta::assert_snapshot!(says(Scheme::Exponential, 1e300), @"the integration rate is 1e300 Hz: it must be at most 3.840457667642e12 Hz for this structure, since the changes over a shorter step are lost in rounding");
    // Not much below that limit a rate is taken as it is.
    assert!(Stepper::new(&arm, &[], Scheme::Gl4, 1e12).is_ok());
    insta::assert_snapshot!("euler".parse::<Scheme>().unwrap_err(), @"there is no integration scheme `euler`: expected one of rk4, dop853, gl4, gl6, exponential, exponential8");
}

/// A load that no arm can bear ends in an error, never in a bad number.
#[test]
fn a_state_that_is_not_finite_is_an_error() {
    let arm = arm(Preset::Irb1600Fitted, [0.0, 60.0]);
    let joint1 = arm.dof("joint1").unwrap();
    for scheme in Scheme::ALL {
        let mut stepper = Stepper::new(&arm, &[joint1], scheme, 1000.0).unwrap();
        let error = (0..100).find_map(|_| stepper.advance(0.0, &[f64::MAX]).err()).unwrap();
        assert!(
            matches!(
                error,
                StepError::Integrate(
                    IntegrateError::NoConvergence { .. }
                        | IntegrateError::NotFinite { .. }
                        | IntegrateError::Unbalanced { .. }
                )
            ),
            "{scheme}: {error}"
        );
        assert!(stepper.position().iter().chain(stepper.velocity()).all(|number| number.is_finite()), "{scheme}");
    }
}

/// An arm with strong dampers comes to rest under a held load within a second. Steps at rest once failed: the acceleration is
/// only rounding there, and Newton's method compared its corrections with it. At rest the springs carry the load: α = u/k.
#[test]
fn rest_under_a_load_is_kept() {
    let mut chain = Preset::Irb1600Fitted.chain().unwrap();
    let (stiffness_nm_rad, damping_nm_s_rad) = (5e5, 2000.0);
    chain.links.iter_mut().for_each(|link| {
        (link.stiffness_nm_rad, link.damping_nm_s_rad) = (stiffness_nm_rad, damping_nm_s_rad);
    });
    let arm = assembly(BodySpec::Chain(chain), vec![]);
    for scheme in [Scheme::Gl4, Scheme::Gl6, Scheme::Exponential, Scheme::Exponential8] {
        // About four of a hundred loads had such a step.
        for k in 0..100 {
            let torque_nm = [20.0 - 0.37 * f64::from(k), 2.0 + 0.11 * f64::from(k)];
            let driven = Driven { amplitude: vec![("joint1", torque_nm[0]), ("joint2", torque_nm[1])], ..FREE };
            let state = run(&arm, scheme, 2_000.0, 2_400, [0.0; 4], &driven);
            let rest = [torque_nm[0] / stiffness_nm_rad, torque_nm[1] / stiffness_nm_rad, 0.0, 0.0];
            assert!(distance(&state, &rest) < 1e-15, "{scheme}: {state:?}, expected {rest:?}");
        }
    }
}
