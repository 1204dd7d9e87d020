//! Tests against independent values, and of verdicts over many records.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod files;
mod oracles;
mod power;
mod shocks;
mod sines;

use serde_json::Value;

use crate::{RandomTest, ShockTest, SineTest, Specification, SpecificationError, SpecificationFile, SrsTest, Test};

/// The independent values; see `tests/oracles/README.md`.
fn oracle() -> Value {
    serde_json::from_str(include_str!("../../../../tests/oracles/test-control.json")).unwrap()
}

/// Checks a text, whose tables of breakpoints can't be read.
fn parsed(text: &str) -> Result<Specification, SpecificationError> {
    let file: SpecificationFile = toml::from_str(text).unwrap_or_else(|error| panic!("{error}"));
    Specification::new(&file, |_| Err(String::from("there are no files")))
}

fn random(keys: &str) -> RandomTest {
    let text = format!("spec = {{ kind = 'random', sources = [] }}\n[random]\nunit = '(m/s2)2/Hz'\n{keys}");
    match parsed(&text).unwrap().test {
        Test::Random(test) => test,
        other => panic!("{other:?}"),
    }
}

fn sine(keys: &str) -> SineTest {
    match parsed(&format!("spec = {{ kind = 'sine', sources = [] }}\n[sine]\n{keys}")).unwrap().test {
        Test::Sine(test) => test,
        other => panic!("{other:?}"),
    }
}

fn shock(keys: &str) -> ShockTest {
    match parsed(&format!("spec = {{ kind = 'shock', sources = [] }}\n[shock]\n{keys}")).unwrap().test {
        Test::Shock(test) => test,
        other => panic!("{other:?}"),
    }
}

fn srs(keys: &str) -> SrsTest {
    match parsed(&format!("spec = {{ kind = 'shock', sources = [] }}\n[srs]\n{keys}")).unwrap().test {
        Test::Srs(test) => test,
        other => panic!("{other:?}"),
    }
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} of {value}"))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

#[track_caller]
fn near(found: f64, expected: f64, relative: f64) {
    assert!((found - expected).abs() <= relative * expected.abs(), "{found}, expected {expected}");
}
