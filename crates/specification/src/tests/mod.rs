//! Tests against independent values, and of verdicts over many records.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod files;
mod oracles;
mod power;
mod shocks;
mod sines;

use resonarm_numeric::noise::Noise;
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

/// Signals at low level that controllers play before a test: a multisine, noise, and what a light mode makes of noise.
const LOW_LEVELS: [&str; 3] = ["multisine", "noise", "mode"];

/// Returns samples of such a signal within a band, Hz, with lines 0.125 Hz apart, or of a mode in the middle of its octaves.
fn low_level(kind: &str, rate_hz: f64, [from_hz, to_hz]: [f64; 2], samples: usize, seed: u64) -> Vec<f64> {
    use core::f64::consts::TAU;
    let mut noise = Noise::new(seed, 5);
    match kind {
        "multisine" => {
            let lines: Vec<[f64; 2]> = (0..)
                .map(|line| from_hz + 0.125 * f64::from(line))
                .take_while(|hz| *hz <= to_hz)
                .map(|hz| [hz, TAU * noise.normal()])
                .collect();
            let period = (8.0 * rate_hz) as usize;
            let at = |k: usize| lines.iter().map(|[hz, phase]| libm::cos(TAU * hz * k as f64 / rate_hz + phase)).sum();
            let one: Vec<f64> = (0..period).map(at).collect();
            one.into_iter().cycle().take(samples).collect()
        }
        "noise" => (0..samples).map(|_| noise.normal()).collect(),
        "mode" => {
            // y'' + 2 ζ ω y' + ω² y = noise, by its poles.
            let (turn, damping_ratio) = (TAU * libm::sqrt(from_hz * to_hz) / rate_hz, 0.01);
            let decay = libm::exp(-damping_ratio * turn);
            let (mut last, mut before) = (0.0, 0.0);
            let step = |_| {
                let next = 2.0 * decay * libm::cos(turn) * last - decay * decay * before + noise.normal();
                (before, last) = (last, next);
                next
            };
            (0..samples).map(step).collect()
        }
        other => panic!("there is no signal {other}"),
    }
}
