//! The scenarios that come with the project, and the table of their keys in `scenarios/README.md`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use resonarm::arm::{Gravity, Preset};
use resonarm::plant::Plant;
use resonarm::scenario::Scenario;
use toml::{Table, Value};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

#[test]
fn every_scenario_makes_a_plant_and_a_profile() {
    let mut scenarios = 0;
    for name in ["scenarios", "recordings"] {
        let paths = fs::read_dir(folder(name)).unwrap().map(|entry| entry.unwrap().path());
        for path in paths.filter(|path| path.extension().is_some_and(|extension| extension == "toml")) {
            let check = || -> Result<(), Box<dyn std::error::Error>> {
                let scenario = Scenario::read(&path)?;
                Plant::new(&scenario.plant_spec()?)?;
                scenario.profile()?;
                scenario.wire_rate_hz()?;
                scenario.network()?;
                scenario.real_time_timing()?;
                scenario.lockstep_timing()?;
                Ok(())
            };
            check().unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            scenarios += 1;
        }
    }
    assert!(scenarios >= 4, "only {scenarios} scenarios found");
}

/// Keys and values of a table, the keys of inner tables with dots.
fn flatten(prefix: &str, table: &Table, into: &mut BTreeMap<String, Value>) {
    for (key, value) in table {
        match value {
            Value::Table(inner) => flatten(&format!("{prefix}{key}."), inner, into),
            value => drop(into.insert(format!("{prefix}{key}"), value.clone())),
        }
    }
}

fn keys_of(scenario: &Scenario) -> BTreeMap<String, Value> {
    let mut keys = BTreeMap::new();
    flatten("", &scenario.to_toml().unwrap().parse().unwrap(), &mut keys);
    keys
}

/// A scenario that states every key but those of the other waveforms.
fn full(waveform: &str) -> Scenario {
    let amplitude = "force_x_n = 1.0, force_y_n = 1.0, torque1_nm = 1.0, torque2_nm = 1.0";
    let text = format!(
        "simulation = {{ duration_s = 1.0 }}\nexcitation = {{ amplitude = {{ {amplitude} }}, profile = {{ {waveform} }} }}"
    );
    let mut scenario = Scenario::parse(&text, "full").unwrap();
    let mut parameters = Preset::default().parameters().unwrap();
    parameters.gravity = Some(Gravity { gravity_m_s2: 9.80665, mass1_kg: 1.0, centre1_m: 0.1 });
    scenario.arm.parameters = Table::try_from(parameters).unwrap();
    scenario
}

/// The rows of the table: the key, and its default.
fn documented() -> BTreeMap<String, String> {
    let text = fs::read_to_string(folder("scenarios/README.md")).unwrap();
    let rows = text.lines().filter_map(|line| line.strip_prefix("| `"));
    let mut keys = BTreeMap::new();
    for row in rows {
        let mut cells = row.split(" | ");
        let key = cells.next().unwrap().trim_end_matches('`').to_string();
        let default = cells.nth(1).unwrap_or_else(|| panic!("{key}: no default")).to_string();
        assert!(keys.insert(key.clone(), default).is_none(), "{key} stands there twice");
    }
    keys
}

#[test]
fn the_table_of_keys_has_every_key_and_no_other() {
    let waveforms = [
        "waveform = 'dwell', frequency_hz = 1, duration_s = 1, settle_s = 1",
        "waveform = 'stepped-sine', from_hz = 1, to_hz = 1, steps = 1, dwell_s = 1, settle_s = 1",
        "waveform = 'swept-sine', from_hz = 1, to_hz = 1, duration_s = 1",
        "waveform = 'impulse', pulse_s = 1, duration_s = 1",
    ];
    let mut known: Vec<String> = waveforms.iter().flat_map(|waveform| keys_of(&full(waveform)).into_keys()).collect();
    known.sort();
    known.dedup();
    let documented: Vec<String> = documented().into_keys().collect();
    assert_eq!(documented, known);
}

#[test]
fn the_table_of_keys_states_the_defaults() {
    let documented = documented();
    for (key, value) in keys_of(&Scenario::default()) {
        let cell = documented[&key].trim_matches('`');
        let stated: Table = format!("value = {cell}").parse().unwrap_or_else(|error| panic!("{key}: {cell}: {error}"));
        // 0.35 s went through nanoseconds; anything but a number is the same to the letter.
        match (&stated["value"], &value) {
            (Value::Float(stated), Value::Float(value)) => assert!((stated - value).abs() < 1e-12, "{key}"),
            (stated, value) => assert_eq!(stated, value, "{key}"),
        }
    }
}
