//! The physics against numbers computed independently; see `tests/oracles/README.md`.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking, its helpers too")]
use resonarm::analysis::modes;
use resonarm::arm::{Arm, Parameters, Pose, Preset};
use serde_json::Value;

fn oracles(kind: &str) -> Vec<Value> {
    let text = include_str!("oracles/oracles.json");
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
