use super::*;
use crate::arm::tests::arm;
use crate::arm::{Arm, Load, Preset, Sine, State};

/// Integrates from `state` for `steps` steps.
fn run(arm: &Arm, scheme: Scheme, rate_hz: f64, steps: u32, state: State, excitation: &impl Excitation<Load>) -> State {
    let integrator = Integrator::new(scheme, rate_hz, arm).unwrap();
    (0..steps).fold(state, |state, k| integrator.step(arm, f64::from(k) / rate_hz, &state, excitation).unwrap())
}

fn distance(a: &State, b: &State) -> f64 {
    (a.alpha_rad - b.alpha_rad).norm() + (a.alpha_dot_rad_s - b.alpha_dot_rad_s).norm()
}

#[test]
fn error_falls_with_the_order_of_the_scheme() {
    let arm = arm(Preset::Irb1600Fitted, 20.0, 60.0);
    let start = State::new([0.05, -0.08], [0.5, -1.0]);
    let sine =
        Sine { amplitude: Load { torque_nm: [60.0, 0.0].into(), force_n: [30.0, 25.0].into() }, frequency_hz: 24.0 };
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
    let preset = Preset::Irb1600Fitted.parameters().unwrap();
    let undamped = crate::arm::Parameters { damping1_nm_s_rad: 0.0, damping2_nm_s_rad: 0.0, ..preset };
    let arm = Arm::new(undamped, crate::arm::Pose { beta1_deg: 0.0, beta2_deg: 60.0 }).unwrap();
    let start = State::new([0.1, -0.08], [0.5, -1.0]);
    for scheme in Scheme::ALL.into_iter().filter(|scheme| scheme.is_symmetric()) {
        let there = run(&arm, scheme, 1000.0, 1000, start, &Load::default());
        let turned = State { alpha_dot_rad_s: -there.alpha_dot_rad_s, ..there };
        let back = run(&arm, scheme, 1000.0, 1000, turned, &Load::default());
        let back = State { alpha_dot_rad_s: -back.alpha_dot_rad_s, ..back };
        assert!(distance(&start, &back) < 1e-9, "{scheme}: {}", distance(&start, &back));
        let (first, last) = (arm.energy(&start).total_j(), arm.energy(&there).total_j());
        assert!((last / first - 1.0).abs() < 1e-4, "{scheme}: energy {first} J, then {last} J");
    }
}

/// Where fixed-point iteration diverges, too: the straight arm of Table 1, 569 Hz, at 1 kHz (ωh = 3.6). The amplitudes
/// go up to those of the last fold of a strongly driven arm. The dampers take the same energy as in an accurate
/// solution, within 5 %.
#[test]
fn implicit_schemes_hold_at_every_pose() {
    for (preset, amplitude_rad) in [0.1, 0.3].into_iter().flat_map(|a| Preset::ALL.map(|preset| (preset, a))) {
        for beta2_deg in (-180..=180).step_by(15) {
            let arm = arm(preset, 10.0, f64::from(beta2_deg));
            let start = State::new([amplitude_rad, -amplitude_rad], [5.0, 5.0]);
            let truth = run(&arm, Scheme::Dop853, 32_000.0, 8_000, start, &Load::default());
            let lowest_hz = (arm.angular_frequencies_rad_s()[1] / Scheme::Gl6.phase_limit_rad()).ceil();
            for scheme in [Scheme::Gl4, Scheme::Gl6, Scheme::Exponential, Scheme::Exponential8] {
                for rate_hz in [1000.0, lowest_hz] {
                    let end = run(&arm, scheme, rate_hz, (rate_hz / 4.0).round() as u32, start, &Load::default());
                    let [first, last, true_last] = [start, end, truth].map(|state| arm.energy(&state).total_j());
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

const EXPONENTIAL: [Scheme; 2] = [Scheme::Exponential, Scheme::Exponential8];

/// A held load, too: one step of a millisecond is as accurate as a thousand of a microsecond by another scheme.
#[test]
fn exponential_schemes_are_exact_under_a_held_load() {
    let arm = arm(Preset::Irb1600Table1, 0.0, 0.0);
    let load = Load { torque_nm: [1e-3, 0.0].into(), force_n: [0.0, 1e-3].into() };
    let many = run(&arm, Scheme::Gl6, 1e6, 1000, State::default(), &load);
    for one in EXPONENTIAL.map(|scheme| run(&arm, scheme, 1000.0, 1, State::default(), &load)) {
        assert!(distance(&one, &many) < 1e-9 * one.alpha_dot_rad_s.norm(), "{one:?} {many:?}");
    }
}

/// A motion so small that its energy underflows counts as rest, not as a failure.
#[test]
fn a_motion_whose_energy_underflows_continues() {
    let arm = arm(Preset::Irb1600Fitted, 20.0, 60.0);
    for scheme in Scheme::ALL {
        for exponent in 150..=170 {
            let small = libm::exp10(-f64::from(exponent));
            let start = State::new([small, -0.7 * small], [30.0 * small, 11.0 * small]);
            let end = run(&arm, scheme, 1000.0, 50, start, &Load::default());
            assert!(distance(&end, &State::default()) < 1e3 * small, "{scheme}, {small}: {end:?}");
        }
    }
}

#[test]
fn says_which_rate_would_do() {
    let arm = arm(Preset::Irb1600Table1, 0.0, 0.0);
    let says = |scheme, rate_hz| Integrator::new(scheme, rate_hz, &arm).unwrap_err().to_string();
    insta::assert_snapshot!(says(Scheme::Rk4, 0.0), @"integration rate 0 Hz: it must be a positive number");
    insta::assert_snapshot!(says(Scheme::Rk4, 1000.0), @"scheme rk4 can't carry this arm at 1000 Hz: its second mode needs at least 1265 Hz");
    insta::assert_snapshot!(says(Scheme::Gl6, 500.0), @"scheme gl6 can't carry this arm at 500 Hz: its second mode needs at least 570 Hz");
    insta::assert_snapshot!(says(Scheme::Exponential, 1e300), @"integration rate 1e300 Hz: it must be at most 3.840457667642e12 Hz for this arm; what a shorter step changes is lost in rounding");
    assert!(Integrator::new(Scheme::Gl4, 1e12, &arm).is_ok());
    insta::assert_snapshot!("euler".parse::<Scheme>().unwrap_err(), @"there is no integration scheme `euler`: the schemes are rk4, dop853, gl4, gl6, exponential, exponential8");
}

/// A load that no arm can bear ends in an error, never in a bad number.
#[test]
fn a_state_that_is_not_finite_is_an_error() {
    let arm = arm(Preset::Irb1600Fitted, 0.0, 60.0);
    let load = Load::torque_nm(f64::MAX, 0.0);
    for scheme in Scheme::ALL {
        let integrator = Integrator::new(scheme, 1000.0, &arm).unwrap();
        let mut state = State::default();
        let failed = (0..100).any(|_| match integrator.step(&arm, 0.0, &state, &load) {
            Ok(next) => {
                state = next;
                false
            }
            Err(
                IntegrateError::NoConvergence { .. }
                | IntegrateError::NotFinite { .. }
                | IntegrateError::Unbalanced { .. },
            ) => true,
            Err(other) => panic!("{other}"),
        });
        assert!(failed && state.is_finite());
    }
}
