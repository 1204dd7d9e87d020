//! Any text as a scenario: it is refused, or everything that a run makes from it is made or refused, and it is the same
//! when written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use resonarm::plant::Plant;
use resonarm::scenario::{Scenario, ScenarioError};

fuzz_target!(|text: &str| {
    let Ok(scenario) = Scenario::parse(text, "fuzz") else { return };
    if let Ok(tested) = scenario.under_test() {
        let _ = Plant::new(&scenario.plant_spec(), &tested).map(|mut plant| plant.measure());
    }
    let _ = (scenario.profile(), scenario.duration_samples(), scenario.network());
    let _ = (scenario.real_time_timing(), scenario.lockstep_timing(), scenario.wire_rate_hz());
    match scenario.to_toml() {
        // Compared as text: a scenario with NaN, which the parts above refuse, equals nothing.
        Ok(written) => {
            let again = Scenario::parse(&written, "written").and_then(|scenario| scenario.to_toml());
            assert_eq!(again.ok(), Some(written));
        }
        Err(error) => assert!(matches!(error, ScenarioError::Write { .. }), "{error}"),
    }
});
