//! Tests of the physics against independently computed numbers; see `tests/oracles/README.md`.

use resonarm::analysis::modes;
use resonarm::arm::{Arm, Load, Parameters, Pose, Preset, Sine, State};
use resonarm::integrate::{Integrator, Scheme};
use serde_json::Value;

fn oracles(kind: &str) -> Vec<Value> {
    let text = include_str!("../oracles/oracles.json");
    let file: Value = serde_json::from_str(text).unwrap();
    file[kind].as_array().unwrap().clone()
}

/// The arm of a case: Table 1 with the case's I_S2, in the case's pose.
fn arm(case: &Value) -> Arm {
    let table1 = Preset::Irb1600Table1.parameters().unwrap();
    let parameters = Parameters { inertia2_kg_m2: case["I_S2"].as_f64().unwrap(), ..table1 };
    let pose =
        Pose { beta1_deg: case["beta1_deg"].as_f64().unwrap_or(0.0), beta2_deg: case["beta2_deg"].as_f64().unwrap() };
    Arm::new(parameters, pose).unwrap()
}

#[test]
fn modes_agree() {
    let cases = oracles("modes");
    assert_eq!(cases.len(), 12);
    for case in &cases {
        for (i, mode) in modes(&arm(case)).iter().enumerate() {
            let near = |what: &str, got: f64| {
                let expected = case[what][i].as_f64().unwrap();
                assert!((got / expected - 1.0).abs() < 1e-9, "{what}: {got}, expected {expected}, in {case}");
            };
            near("frequency_hz", mode.frequency_hz);
            near("damping_ratio", mode.damping_ratio);
            near("alpha2_over_alpha1", mode.shape[1] / mode.shape[0]);
        }
    }
}

/// The largest difference of α (rad) and α̇ (rad/s) from the case's states, at `rate_hz`.
fn trajectory_error(case: &Value, scheme: Scheme, rate_hz: f64) -> f64 {
    let number = |name: &str| case[name].as_f64().unwrap();
    let pair = |name: &str, i: usize| [0, 1].map(|n| case[name][i][n].as_f64().unwrap());
    let arm = arm(case);
    let amplitude = Load {
        torque_nm: [number("torque1_nm"), 0.0].into(),
        force_n: [number("force_x_n"), number("force_y_n")].into(),
    };
    let sine = Sine { amplitude, frequency_hz: number("excitation_hz") };
    let integrator = Integrator::new(scheme, rate_hz, &arm).unwrap();
    let mut state = State::new(pair("alpha_rad", 0), pair("alpha_dot_rad_s", 0));
    let (mut steps, mut worst) = (0_u32, 0.0_f64);
    for (i, t_s) in case["t_s"].as_array().unwrap().iter().enumerate() {
        while f64::from(steps) < t_s.as_f64().unwrap() * rate_hz {
            state = integrator.step(&arm, f64::from(steps) / rate_hz, &state, &sine).unwrap();
            steps += 1;
        }
        let expected = State::new(pair("alpha_rad", i), pair("alpha_dot_rad_s", i));
        worst = worst.max((state.alpha_rad - expected.alpha_rad).amax());
        worst = worst.max((state.alpha_dot_rad_s - expected.alpha_dot_rad_s).amax());
    }
    worst
}

/// Every scheme of order above four agrees with every trajectory to 1e-10 at the rate given here.
#[test]
fn trajectories_agree() {
    let cases = oracles("trajectories");
    assert_eq!(cases.len(), 4);
    for (scheme, rate_hz) in [
        (Scheme::Dop853, 16_000.0),
        (Scheme::Exponential, 32_000.0),
        (Scheme::Exponential8, 16_000.0),
        (Scheme::Gl6, 32_000.0),
    ] {
        for case in &cases {
            let error = trajectory_error(case, scheme, rate_hz);
            assert!(error < 1e-10, "{scheme} at {rate_hz} Hz: {error:e} in {case}");
        }
    }
}
