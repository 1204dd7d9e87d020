//! The scenarios that come with the project, and the table of their keys in `scenarios/README.md`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use resonarm::rig::{Converter, RigSpec};
use resonarm::scenario::Scenario;
use toml::{Table, Value};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

#[test]
fn every_scenario_makes_a_plant_and_a_controller() {
    let mut scenarios = 0;
    for name in ["scenarios", "recordings", "examples/structures", "examples/test-control"] {
        let paths = fs::read_dir(folder(name)).unwrap().map(|entry| entry.unwrap().path());
        let is_scenario = |path: &PathBuf| {
            let text = fs::read_to_string(path).unwrap_or_default();
            path.extension().is_some_and(|extension| extension == "toml") && !text.contains("[spec]")
        };
        for path in paths.filter(is_scenario) {
            let check = || -> Result<(), Box<dyn std::error::Error>> {
                let scenario = Scenario::read(&path)?;
                scenario.plant()?;
                match scenario.amplitude() {
                    Some(_) => drop(scenario.controller()?),
                    None => assert!(path.ends_with("test-control/plant.toml"), "it has no load"),
                }
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
            Value::Array(tables) if tables.iter().any(Value::is_table) => {
                let tables = tables.iter().filter_map(Value::as_table);
                tables.for_each(|inner| flatten(&format!("{prefix}{key}."), inner, into));
            }
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
    let profile = format!("excitation = {{ amplitude = {{ {AMPLITUDE} }}, profile = {{ {waveform} }} }}");
    with_every_other_key(&profile)
}

/// The same with a control.
fn controlled() -> Scenario {
    let spec = "mode_number = 2, points = 7, from_part = 0.5, from_lag_deg = 20, to_lag_deg = 30";
    with_every_other_key(&format!("control = {{ law = 'phase-walk', amplitude = {{ {AMPLITUDE} }}, {spec} }}"))
}

/// The same with the response kept.
fn response_controlled() -> Scenario {
    let spec = "mode_number = 2, points = 7, displacement_m = 0.1, from_hz = 1, to_hz = 1";
    with_every_other_key(&format!("control = {{ law = 'response-control', amplitude = {{ {AMPLITUDE} }}, {spec} }}"))
}

/// The same with the force in the head kept.
fn force_controlled(waveform: &str) -> Scenario {
    let profile = format!(
        "ramp_s = 1.0, cancel_harmonics = [2], notch_b_m_s2 = 1.0, notch_c_m_s2 = 1.0, profile = {{ {waveform} }}"
    );
    with_every_other_key(&format!("control = {{ law = 'force-control', amplitude = {{ {AMPLITUDE} }}, {profile} }}"))
}

/// The same with a test by its specification.
fn test_controlled() -> Scenario {
    let operator = "operator = [{ word = 'level', at_s = 1.0, level_db = -3.0 }]";
    let spec = format!("specification = 'spec.toml', seed = 1, {operator}");
    with_every_other_key(&format!("control = {{ law = 'random', amplitude = {{ {AMPLITUDE} }}, {spec} }}"))
}

/// The section of a shaker.
pub(crate) const SHAKER: &str = "[rig.shaker]
moving_mass_kg = 0.2
stiffness_n_m = 5e3
damping_n_s_m = 5.0
force_factor_n_a = 20.0
resistance_ohm = 2.0
inductance_h = 3e-4
stroke_m = 0.02
current_limit_a = 15.0
voltage_limit_v = 60.0";

const AMPLITUDE: &str = "exciter_x = 1.0, exciter_y = 1.0, joint1 = 1.0, joint2 = 1.0";

/// Every key of an instrument, also those that state the same, which no instrument takes together.
const ACCELEROMETER: &str = "at = 'tip', noise_rms_m_s2 = 1, noise_density_m_s2_per_sqrt_hz = 1, resolution_m_s2 = 1, bits = 2, \
    gravity_m_s2 = 9.81, sensor_range_m_s2 = 1, transverse = 0.1, gain = 1, highpass_hz = 1, lowpass_hz = 2, delay_samples = 1";
const HEAD: &str = "noise_rms_n = 1, noise_density_n_per_sqrt_hz = 1, resolution_n = 1, bits = 2, sensor_range_n = 1, \
    transverse = 0.1, gain = 1, highpass_hz = 1, lowpass_hz = 2, delay_samples = 1";
const FAULT: &str = "instrument = 'b', kind = 'drift', from_s = 1, to_s = 2, rate_m_s2_per_s = 1, \
    rate_n_per_s = 1, rms_m_s2 = 1, rms_n = 1, amplitude_m_s2 = 1, amplitude_n = 1, rate_m_s_per_s = 1, rms_m_s = 1, \
    amplitude_m_s = 1, rate_m_per_s = 1, rms_m = 1, amplitude_m = 1, rate_rad_per_s = 1, rms_rad = 1, amplitude_rad = 1, factor = 1";
const SENSOR: &str = "at = 'tip', measures = 'velocity', noise_rms_m_s = 1, noise_density_m_s_per_sqrt_hz = 1, resolution_m_s = 1, \
    bits = 2, sensor_range_m_s = 1, transverse = 0.1, gain = 1, highpass_hz = 1, lowpass_hz = 2, delay_samples = 1";
const GATE: &str = "force_rate_limit_n_per_s = 1, torque_rate_limit_nm_per_s = 1, travel_limit_m = 0.001";
const NETWORK_FAULT: &str = "node = 'plant'\nkind = 'loss'\ndirection = 'both'\nfrom_s = 1\nto_s = 2\nids = [1]\nextended_ids = [1]\n\
    probability = 1\ncount = 1\ndelay_s = 1\nrate_hz = 1";
const LIMITS: &str = "force_n = 1\ntorque_nm = 1\nacceleration_m_s2 = 1\ndistortion = 1\nclipped_samples = 1\n\
    stuck_samples = 2\nstuck_above_n = 1\nstuck_above_nm = 1\nsensors.m3 = 1";

fn rig() -> RigSpec {
    let instruments = format!(
        "exciter.at = 'tip'\nsensors.b = {{ {ACCELEROMETER} }}\nsensors.c = {{ {ACCELEROMETER} }}\nsensors.m3 = {{ {SENSOR} }}\nhead = {{ {HEAD} }}\n\
         faults = [{{ {FAULT} }}]\ngate = {{ {GATE} }}"
    );
    Scenario::parse(&format!("[rig]\n{instruments}\n{SHAKER}"), "rig").unwrap().rig
}

fn with_every_other_key(section: &str) -> Scenario {
    let text = format!("simulation = {{ duration_s = 1.0 }}\n{section}");
    let mut scenario = Scenario::parse(&text, "full").unwrap();
    scenario.structure.name = Some(String::from("lab arm"));
    scenario.structure.initial = vec![0.0; 4];
    scenario.structure.gravity_m_s2 = Some(9.80665);
    scenario.rig = rig();
    scenario.limits = Some(toml::from_str(LIMITS).unwrap());
    scenario.network.plant_converter = Some(Converter::Sinc3);
    scenario.network.bit_rate_hz = Some(1_000_000);
    scenario.network.data_bit_rate_hz = Some(2_000_000);
    scenario.network.bit_error_rate = Some(1e-6);
    scenario.network.faults = vec![toml::from_str(NETWORK_FAULT).unwrap()];
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
        "waveform = 'sine-list', frequencies_hz = [1], dwell_s = 1, settle_s = 1",
        "waveform = 'swept-sine', from_hz = 1, to_hz = 1, duration_s = 1",
        "waveform = 'impulse', pulse_s = 1, duration_s = 1",
        "waveform = 'random', from_hz = 1, to_hz = 2, duration_s = 1, spectrum = [[1, 1], [2, 3]]",
        "waveform = 'burst-random', from_hz = 1, to_hz = 2, burst_s = 1, period_s = 1, periods = 1, \
         spectrum = [[1, 1], [2, 3]]",
        "waveform = 'multisine', from_hz = 1, to_hz = 1, period_s = 1, periods = 1",
        "waveform = 'file', path = 'load.csv'",
    ];
    let mut known: Vec<String> = waveforms.iter().flat_map(|waveform| keys_of(&full(waveform)).into_keys()).collect();
    known.extend(keys_of(&controlled()).into_keys());
    known.extend(keys_of(&response_controlled()).into_keys());
    known.extend(keys_of(&test_controlled()).into_keys());
    for waveform in &waveforms[..3] {
        known.extend(keys_of(&force_controlled(waveform)).into_keys());
    }
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

#[test]
fn a_load_file_is_read_from_the_scenarios_folder() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scenario.toml");
    let profile = "profile = { waveform = 'file', path = 'load.csv' }";
    fs::write(&path, format!("[excitation]\namplitude = {{ joint2 = 20 }}\n{profile}\n")).unwrap();
    let said = |scenario: Result<Scenario, _>| {
        let error: resonarm::scenario::ScenarioError = scenario.unwrap_err();
        error.to_string().replace(folder.path().to_str().unwrap(), "FOLDER")
    };
    assert_eq!(
        said(Scenario::read(&path)),
        "can't read the load file FOLDER/load.csv: No such file or directory (os error 2); `excitation.profile.path` is \
         relative to the scenario's folder"
    );
    fs::write(folder.path().join("load.csv"), "1\nx\n").unwrap();
    assert_eq!(said(Scenario::read(&path)), "load file FOLDER/load.csv: line 2: `x` is not a finite number");
    fs::write(folder.path().join("load.csv"), "1\n-2\n").unwrap();
    let scenario = Scenario::read(&path).unwrap();
    let profile = scenario.profile().unwrap();
    let loads = [0, 1, 2].map(|n| profile.load(n).torque_nm[1]);
    assert_eq!(loads, [10.0, -20.0, 0.0]);
    // What is written down names the file, and holds none of its loads.
    let written = scenario.to_toml().unwrap();
    assert!(written.contains("path = \"load.csv\"") && !written.contains("20.0, "), "{written}");
}

/// A wire with every key.
const WIRE: &str = r#"
dbc = "bench.dbc"
node = "Shaker"
arm = "operator"
lockstep = "sync"
sync = "Sync"
[[commands]]
message = "Drive"
timeout_s = 1.0
drive = 0
counter = { signal = "Alive", values = 15, most_lost = 3 }
checksum = { signal = "Crc", preset = "autosar-p1", data_id = 1 }
force_x_n = { signal = "A", scale = 1.0, offset = 0.0 }
force_y_n = { signal = "B" }
force_n = { signal = "C", constant_per_a = 1.0 }
torque1_nm = { signal = "D", gear_ratio = 2.0 }
torque2_nm = { signal = "E" }
[[events]]
message = "Drive"
signal = "F"
arm = [1]
disarm = [2]
reset = [3]
stop = [4]
require = [5]
on_frame = "arm"
every_frame = true
drive = 0
[[events]]
message = "Other"
[events.checksum]
signal = "Crc"
algorithm = "crc"
polynomial = 1
start = 1
xor_out = 1
reflect = true
subtract = true
reversed = true
own_as_zero = true
leave_out = [1]
before = [1, { id_bytes = 2, motorola = true }]
after = [{ length_bytes = 1 }, { by_counter = [1, 2] }]
[[readings]]
message = "Meas"
every = 1
period_s = 1.0
on = "sync"
on_request = true
drive = 0
signals.A = { quantity = "alpha1_rad", gear_ratio = 1.0, scale = 1.0, offset = 0.0, constant_per_a = 1.0 }
signals.B = { clipped = "head_force_x_n" }
signals.C = { state = { fault = 1 } }
signals.D = { reason = { none = 1 } }
signals.E = { constant = 1 }
signals.F = { sample = true }
"#;

#[test]
fn every_key_of_a_users_protocol_is_documented() {
    let wire: resonarm::scenario::WireSection = toml::from_str(WIRE).unwrap();
    let Value::Table(written) = Value::try_from(&wire).unwrap() else { panic!("no table") };
    let text = fs::read_to_string(folder("docs/own-protocol.md")).unwrap();
    let mut keys = Vec::new();
    collect(&written, &mut keys);
    assert!(keys.len() > 40, "{keys:?}");
    // In the tables and the text: alone, behind a section, or in an example of a table.
    let stated = |key: &String| {
        ["`KEY`", ".KEY`", " KEY =", "`KEY ="].iter().any(|form| text.contains(&form.replace("KEY", key)))
    };
    let missing: Vec<_> = keys.iter().filter(|key| !stated(key)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// A chain, modes and an FMU with every key of each.
const STRUCTURES: [&str; 4] = [
    "kind = 'chain'\nname = 'x'\nfile = 'x'\ntip = 'x'\ngravity_m_s2 = 9.81\ninitial = [0.0]\n\
     joints = [{ name = 'x', stiffness_nm_rad = 1, damping_nm_s_rad = 1, angle_deg = 1 }]\n\
     links = [{ length_m = 1, mass_kg = 1, centre_of_mass_m = 1, inertia_kg_m2 = 1, angle_deg = 1, \
     stiffness_nm_rad = 1, damping_nm_s_rad = 1 }]",
    "kind = 'modal'\nnodes = { A = 1 }\npoints = { A = [0, 0, 0] }\nlines = [['A', 'A']]\ndofs = { A = 1 }\n\
     matrices = { mass = 'm', damping = 'c', stiffness = 'k', modes = 1 }\n\
     modes = [{ frequency_hz = 1, damping_ratio = 0, shape = { A = 1 } }]",
    "kind = 'fmu'\nsha256 = 'x'\nread = 'end'\ninputs = { A = 'x' }\nparameters = { A = 1 }\n\
     outputs = { A = { displacement = 'x', velocity = 'x', acceleration = 'x', force = 'x' } }",
    "preset = 'x'\nangles_deg = [0]\nset = { A = 1 }\nelements = [{ kind = 'contact', joint = 1, at = 'x', between = ['x', 'y'], side = 'negative' }]",
];

#[test]
fn every_key_of_a_structure_is_documented() {
    let text = fs::read_to_string(folder("docs/structures.md")).unwrap();
    let mut keys = Vec::new();
    for structure in STRUCTURES {
        let section: resonarm::scenario::StructureSection = toml::from_str(structure).unwrap();
        let Value::Table(written) = Value::try_from(&section).unwrap() else { panic!("no table") };
        collect(&written, &mut keys);
    }
    assert!(keys.len() > 30, "{keys:?}");
    let stated = |key: &String| text.contains(&format!("`{key}`")) || text.contains(&format!(".{key}`"));
    let missing: Vec<_> = keys.iter().filter(|key| !stated(key)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// The keys of a table and those below, but for sections and the names of signals, states and faults.
fn collect(table: &Table, keys: &mut Vec<String>) {
    for (key, value) in table {
        let sections = ["commands", "events", "readings", "signals"];
        let is_name = key.len() == 1 || ["fault", "none"].contains(&key.as_str()) || sections.contains(&key.as_str());
        if !is_name {
            keys.push(key.clone());
        }
        match value {
            Value::Table(below) => collect(below, keys),
            Value::Array(all) => all.iter().filter_map(Value::as_table).for_each(|below| collect(below, keys)),
            _ => {}
        }
    }
}
