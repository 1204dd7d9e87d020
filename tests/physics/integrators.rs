//! The table of `resonarm integrators`, and what the choice of the default scheme and rate rests on.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking, its helpers too")]

use std::path::Path;
use std::process::{Command, Output};

use resonarm::analysis::{energy_drift, mode_errors};
use resonarm::arm::{Arm, Pose, Preset, State};
use resonarm::integrate::Scheme;
use resonarm::scenario::Scenario;
use serde_json::Value;

fn arm(preset: Preset, beta2_deg: f64) -> Arm {
    Arm::new(preset.parameters().unwrap(), Pose { beta1_deg: 0.0, beta2_deg }).unwrap()
}

/// Integration steps a second of a scenario that says nothing of them.
fn default_rate_hz() -> f64 {
    let simulation = Scenario::default().simulation;
    simulation.rate_hz * f64::from(simulation.steps_per_sample)
}

/// The worst own damping ratio and relative frequency error of `scheme` at the default rate over both presets and both modes, β2
/// from −150° to 150°.
fn worst_over_the_poses(scheme: Scheme) -> f64 {
    let poses = Preset::ALL.into_iter().flat_map(|preset| (-150..=150).step_by(5).map(move |beta2| (preset, beta2)));
    let errors = poses.flat_map(|(preset, beta2_deg)| {
        mode_errors(&arm(preset, f64::from(beta2_deg)), scheme, default_rate_hz()).unwrap()
    });
    errors.map(|error| error.damping_ratio.abs().max(error.frequency_error.abs())).fold(0.0, f64::max)
}

/// Damping ratios of the arm are about 1e-4: the default adds less than a hundredth of that anywhere, the 569 Hz of the straight arm
/// of Table 1 included. That the measure tells schemes apart shows on gl6, which misses there.
#[test]
fn default_scheme_and_rate_add_less_than_a_millionth() {
    let worst = worst_over_the_poses(Scheme::default());
    assert!(worst < 1e-6, "{worst:e}");
    let gl6 = worst_over_the_poses(Scheme::Gl6);
    assert!(gl6 > 1e-6 && gl6 < 1e-5, "{gl6:e}");
}

/// Free vibration without dampers, far from linear: no symmetric scheme loses or gains energy, step after step, beyond rounding. A drift
/// of 1e-10 in 1e7 steps would be one of 1e-12 here.
#[test]
fn energy_of_the_symmetric_schemes_goes_nowhere() {
    let start = State::new([0.05, -0.08], [0.5, -1.0]);
    for (preset, beta2_deg) in [(Preset::Irb1600Fitted, 60.0), (Preset::Irb1600Table1, 120.0)] {
        let arm = arm(preset, beta2_deg);
        for scheme in Scheme::ALL.into_iter().filter(|scheme| scheme.is_symmetric()) {
            let drift = energy_drift(&arm, scheme, default_rate_hz(), &start, 100_000).unwrap();
            assert!(drift.change.abs() < 1e-12, "{preset} {beta2_deg}° {scheme}: {drift:?}");
        }
        // What the schemes that are not symmetric do, the measure sees.
        let rk4 = energy_drift(&arm, Scheme::Rk4, default_rate_hz(), &start, 20_000).unwrap();
        assert!(rk4.change < -1e-6, "{preset} {beta2_deg}°: {rk4:?}");
    }
}

fn integrators(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_resonarm"));
    command.arg("integrators").args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).env_remove("RESONARM_LOG");
    command.output().unwrap()
}

fn document(arguments: &[&str]) -> Value {
    let output = integrators(&[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn complaint(arguments: &[&str]) -> String {
    let output = integrators(arguments);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0), "{output:?}");
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn document_has_every_scheme_measured() {
    let got = document(&["--drift-steps", "500"]);
    assert_eq!((&got["preset"], got["rate_hz"].as_f64()), (&"irb1600-fitted".into(), Some(default_rate_hz())));
    assert_eq!(got["default_scheme"], Scheme::default().name());
    let rows = got["schemes"].as_array().unwrap();
    assert_eq!(rows.len(), Scheme::ALL.len());
    for (row, scheme) in rows.iter().zip(Scheme::ALL) {
        assert_eq!((&row["scheme"], row["order"].as_u64()), (&scheme.name().into(), Some(scheme.order().into())));
        assert!(row["refused"].is_null() && row["cost_ns"].as_f64() > Some(1.0), "{row}");
        assert_eq!((&row["energy"]["steps"], row["energy"]["tenths"].as_array().unwrap().len()), (&500.into(), 10));
        let expected = mode_errors(&arm(Preset::Irb1600Fitted, 60.0), scheme, default_rate_hz()).unwrap();
        for (got, expected) in row["modes"].as_array().unwrap().iter().zip(expected) {
            let near = |name: &str, expected: f64| {
                let got = got[name].as_f64().unwrap();
                assert!((got - expected).abs() <= 1e-14 * expected.abs(), "{name}: {got:e} {expected:e}");
            };
            near("frequency_hz", expected.frequency_hz);
            near("damping_ratio", expected.damping_ratio);
            near("frequency_error", expected.frequency_error);
        }
    }
}

/// The rate of a scenario counts, a flag wins over it; a scheme that a rate is too low for names the rate that would do, and the others
/// are measured all the same.
#[test]
fn what_a_scheme_cannot_carry_is_said_in_its_row() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = folder.path().join("straight.toml");
    std::fs::write(
        &scenario,
        "[arm]\npreset = 'irb1600-table1'\nbeta2_deg = 0\n[simulation]\nrate_hz = 500\nsteps_per_sample = 2\n",
    )
    .unwrap();
    let scenario: &Path = &scenario;
    let got = document(&["--scenario", scenario.to_str().unwrap(), "--drift-steps", "100"]);
    assert_eq!(got["rate_hz"].as_f64(), Some(1000.0));
    let row =
        |scheme: Scheme| got["schemes"].as_array().unwrap().iter().find(|row| row["scheme"] == scheme.name()).unwrap();
    insta::assert_snapshot!(row(Scheme::Rk4)["refused"].as_str().unwrap(), @"scheme rk4 can't carry this arm at 1000 Hz: its second mode needs at least 1265 Hz");
    assert!(row(Scheme::Rk4)["modes"].is_null() && row(Scheme::Rk4)["cost_ns"].is_null());
    assert!(row(Scheme::Gl6)["modes"][1]["frequency_error"].as_f64() < Some(-1e-6));
    let higher = ["--scenario", scenario.to_str().unwrap(), "--drift-steps", "100", "--rate-hz", "8000"];
    assert_eq!(document(&higher)["rate_hz"].as_f64(), Some(8000.0));
}

#[test]
fn table_has_a_line_for_every_scheme() {
    let output =
        integrators(&["--preset", "irb1600-table1", "--beta2-deg", "0", "--rate-hz", "1000", "--drift-steps", "10"]);
    let text = String::from_utf8(output.stdout).unwrap();
    let head: Vec<&str> = text.lines().take(6).collect();
    insta::assert_snapshot!(head.join("\n"), @r"
    irb1600-table1 at β1 = 0°, β2 = 0°, 1000 steps a second; default scheme: exponential

                            mode 1: 21.77 Hz        mode 2: 569.25 Hz       energy, 10 steps
      scheme       order     damping   frequency     damping   frequency    change   spread   ns a step
      rk4              4           –           –           –           –         –        –           –
                     scheme rk4 can't carry this arm at 1000 Hz: its second mode needs at least 1265 Hz
    ");
    for scheme in Scheme::ALL {
        assert!(text.lines().any(|line| line.trim_start().starts_with(scheme.name())), "{scheme} in {text}");
    }
}

#[test]
fn says_what_is_wrong() {
    insta::assert_snapshot!(complaint(&["--rate-hz", "0"]), @"resonarm: integration rate 0 Hz: it must be a positive number");
    insta::assert_snapshot!(complaint(&["--rate-hz", "nan"]), @"resonarm: integration rate NaN Hz: it must be a positive number");
    insta::assert_snapshot!(complaint(&["--rate-hz", "1e14"]), @"resonarm: integration rate 1e14 Hz: it must be at most 3.29881543934e11 Hz for this arm; what a shorter step changes is lost in rounding");
    insta::assert_snapshot!(complaint(&["--preset", "irb140"]), @"resonarm: there is no preset `irb140`: the presets are irb1600-table1, irb1600-fitted");
    insta::assert_snapshot!(complaint(&["--drift-steps", "9"]), @r"
    error: invalid value '9' for '--drift-steps <N>': 9 is not in 10..=4294967295

    For more information, try '--help'.
    ");
}
