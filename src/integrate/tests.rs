use super::*;
use crate::arm::Preset;
use crate::arm::tests::arm;

/// Integrates from `state` for `steps` steps.
fn run(arm: &Arm, scheme: Scheme, rate_hz: f64, steps: u32, state: State, excitation: &impl Excitation) -> State {
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
    let truth = run(&arm, Scheme::Gl6, 16_000.0, 1600, start, &sine);
    for scheme in Scheme::ALL {
        let rate = if scheme.order() == 6 { 500.0 } else { 2000.0 };
        let error = |factor: u32| {
            let steps = (rate * 0.1) as u32 * factor;
            distance(&truth, &run(&arm, scheme, rate * f64::from(factor), steps, start, &sine))
        };
        let order = libm::log2(error(1) / error(2));
        assert!((order - f64::from(scheme.order())).abs() < 0.25, "{scheme}: observed order {order}");
    }
}

#[test]
fn gauss_legendre_retraces_its_steps() {
    let preset = Preset::Irb1600Fitted.parameters().unwrap();
    let undamped = crate::arm::Parameters { damping1_nm_s_rad: 0.0, damping2_nm_s_rad: 0.0, ..preset };
    let arm = Arm::new(undamped, crate::arm::Pose { beta1_deg: 0.0, beta2_deg: 60.0 }).unwrap();
    let start = State::new([0.1, -0.08], [0.5, -1.0]);
    for scheme in [Scheme::Gl4, Scheme::Gl6] {
        let there = run(&arm, scheme, 1000.0, 1000, start, &Load::default());
        let turned = State { alpha_dot_rad_s: -there.alpha_dot_rad_s, ..there };
        let back = run(&arm, scheme, 1000.0, 1000, turned, &Load::default());
        let back = State { alpha_dot_rad_s: -back.alpha_dot_rad_s, ..back };
        assert!(distance(&start, &back) < 1e-9, "{scheme}: {}", distance(&start, &back));
        let (first, last) = (arm.energy(&start).total_j(), arm.energy(&there).total_j());
        assert!((last / first - 1.0).abs() < 1e-4, "{scheme}: energy {first} J, then {last} J");
    }
}

/// Where fixed-point iteration diverges, too: the straight arm of Table 1, 569 Hz, at 1 kHz (ωh = 3.6). The amplitude is
/// that of the first fold of a strongly driven arm; the dampers may only take energy.
#[test]
fn newton_converges_at_every_pose() {
    for preset in Preset::ALL {
        for beta2_deg in (-180..=180).step_by(5) {
            let arm = arm(preset, 10.0, f64::from(beta2_deg));
            let lowest_hz = arm.angular_frequencies_rad_s()[1] / Scheme::Gl6.phase_limit_rad();
            for (scheme, rate_hz) in [(Scheme::Gl4, 1000.0), (Scheme::Gl6, 1000.0), (Scheme::Gl6, lowest_hz.ceil())] {
                let start = State::new([0.1, -0.1], [5.0, 5.0]);
                let end = run(&arm, scheme, rate_hz, rate_hz as u32, start, &Load::default());
                let (first, last) = (arm.energy(&start).total_j(), arm.energy(&end).total_j());
                assert!(last < first, "{scheme} {preset} {beta2_deg}° {rate_hz} Hz: {first} J, then {last} J");
            }
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
    insta::assert_snapshot!("euler".parse::<Scheme>().unwrap_err(), @"there is no integration scheme `euler`: the schemes are rk4, gl4, gl6");
}

/// A load that no arm can bear ends in an error, never in a bad number.
#[test]
fn refuses_to_go_on_without_a_number() {
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
            Err(IntegrateError::NoConvergence { .. } | IntegrateError::NotFinite { .. }) => true,
            Err(other) => panic!("{other}"),
        });
        assert!(failed && state.is_finite());
    }
}
