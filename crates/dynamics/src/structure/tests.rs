use super::*;
use serde_json::Value;

/// The cases of a kind; see `tests/oracles/README.md`.
pub(super) fn oracles(kind: &str) -> Vec<Value> {
    let file: Value = serde_json::from_str(include_str!("../../../../tests/oracles/structures.json")).unwrap();
    file[kind].as_array().unwrap().clone()
}

pub(super) fn numbers(of: &Value) -> Vec<f64> {
    of.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

pub(super) fn chain(case: &Value) -> ChainSpec {
    ChainSpec { links: serde_json::from_value(case["links"].clone()).unwrap(), gravity_m_s2: 0.0 }
}

#[test]
fn modes_are_those_of_independent_code() {
    for case in oracles("chains") {
        let assembly = Assembly::new(&StructureSpec { body: BodySpec::Chain(chain(&case)), elements: vec![] }).unwrap();
        let near = |what: &str, of: fn(&StructureMode) -> f64| {
            let expected = numbers(&case[what]);
            assert_eq!(assembly.modes().len(), expected.len());
            for (mode, expected) in assembly.modes().iter().zip(expected) {
                assert!((of(mode) / expected - 1.0).abs() < 1e-10, "{what}: {mode:?}, expected {expected}");
            }
        };
        near("frequencies_hz", |mode| mode.frequency_hz);
        near("damping_ratios", |mode| mode.damping_ratio);
    }
}
