//! Tests of the physics against independently computed numbers; see `tests/oracles/README.md`.

use core::f64::consts::TAU;

use resonarm::integrate::Scheme;
use resonarm::structure::{Assembly, BodySpec, Preset, StepLoad, Stepper, StructureSpec};
use serde_json::Value;

fn oracles(kind: &str) -> Vec<Value> {
    let text = include_str!("../oracles/oracles.json");
    let file: Value = serde_json::from_str(text).unwrap();
    file[kind].as_array().unwrap().clone()
}

/// The arm of a case: Table 1 with the case's I_S2, in the case's pose.
fn arm(case: &Value) -> Assembly {
    let angles_deg = [case["beta1_deg"].as_f64().unwrap_or(0.0), case["beta2_deg"].as_f64().unwrap()];
    let mut chain = Preset::Irb1600Table1.chain().unwrap().at_angles_deg(&angles_deg);
    chain.links[1].inertia_kg_m2 = case["I_S2"].as_f64().unwrap();
    Assembly::new(&StructureSpec { body: BodySpec::Chain(chain), elements: vec![] }).unwrap()
}

#[test]
fn modes_agree() {
    let cases = oracles("modes");
    // A file that has lost its cases must not pass.
    assert_eq!(cases.len(), 12);
    for case in &cases {
        let arm = arm(case);
        let damping = arm.linear().damping;
        for (i, mode) in arm.modes().iter().enumerate() {
            let near = |what: &str, got: f64| {
                let expected = case[what][i].as_f64().unwrap();
                assert!((got / expected - 1.0).abs() < 1e-9, "{what}: {got}, expected {expected}, in {case}");
            };
            near("frequency_hz", mode.frequency_hz);
            // The oracle's is the modal one, φᵀDφ/(2ω), without the coupling of the modes by the dampers.
            let modal: f64 = (0..4).map(|n| mode.shape[n / 2] * damping[n] * mode.shape[n % 2]).sum();
            near("damping_ratio", modal / (2.0 * TAU * mode.frequency_hz));
            near("alpha2_over_alpha1", mode.shape[1] / mode.shape[0]);
        }
    }
}

/// The largest difference of α (rad) and α̇ (rad/s) from the case's states, at `rate_hz`.
fn trajectory_error(case: &Value, scheme: Scheme, rate_hz: f64) -> f64 {
    let number = |name: &str| case[name].as_f64().unwrap();
    let numbers = |i: usize| -> Vec<f64> {
        let pair = |name: &str| [0, 1].map(|n| case[name][i][n].as_f64().unwrap());
        [pair("alpha_rad"), pair("alpha_dot_rad_s")].concat()
    };
    let arm = arm(case);
    let drive = ["joint1", "tip.x", "tip.y"].map(|name| arm.dof(name).unwrap());
    let amplitude = ["torque1_nm", "force_x_n", "force_y_n"].map(number);
    let load = StepLoad::Sine { amplitude: &amplitude, omega_rad_s: TAU * number("excitation_hz") };
    let mut stepper = Stepper::new(&arm, &drive, scheme, rate_hz).unwrap();
    stepper.restore(&numbers(0)).unwrap();
    let (mut steps, mut worst) = (0_u32, 0.0_f64);
    for (i, t_s) in case["t_s"].as_array().unwrap().iter().enumerate() {
        while f64::from(steps) < t_s.as_f64().unwrap() * rate_hz {
            stepper.advance_under(f64::from(steps) / rate_hz, &load).unwrap();
            steps += 1;
        }
        let got = stepper.position().iter().chain(stepper.velocity());
        worst = got.zip(numbers(i)).fold(worst, |worst, (got, expected)| worst.max((got - expected).abs()));
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
