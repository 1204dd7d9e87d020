//! `resonarm integrators`: the table, the document, and its messages on bad input.

use std::path::Path;

use resonarm::analysis::Forced;
use resonarm::analysis::mode_errors;
use resonarm::integrate::Scheme;
use resonarm::scenario::Scenario;
use serde_json::Value;

use crate::resonarm;

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn document(arguments: &[&str]) -> Value {
    crate::document(here(), 0, &[&["integrators", "--json"], arguments].concat())
}

fn complaint(arguments: &[&str]) -> String {
    crate::complaint(here(), 2, &[&["integrators"], arguments].concat())
}

#[test]
fn document_has_every_scheme_measured() {
    let rate_hz = Scenario::default().simulation.step_rate_hz();
    let assembly = Scenario::default().under_test().unwrap().assembly;
    let joint1 = assembly.dof("joint1").unwrap();
    let chain = Forced::new(assembly, joint1, 1.0).undamped().unwrap().assembly().clone();
    let got = document(&["--drift-steps", "500"]);
    let preset = &got["configuration"]["structure"]["preset"];
    assert_eq!((preset, got["rate_hz"].as_f64()), (&"irb1600-fitted".into(), Some(rate_hz)));
    assert_eq!(got["default_scheme"], Scheme::default().name());
    let rows = got["schemes"].as_array().unwrap();
    assert_eq!(rows.len(), Scheme::ALL.len());
    for (row, scheme) in rows.iter().zip(Scheme::ALL) {
        assert_eq!((&row["scheme"], row["order"].as_u64()), (&scheme.name().into(), Some(scheme.order().into())));
        assert!(row["refused"].is_null() && row["cost_ns"].as_f64() > Some(1.0), "{row}");
        assert_eq!((&row["energy"]["steps"], row["energy"]["tenths"].as_array().unwrap().len()), (&500.into(), 10));
        let expected = mode_errors(&chain, scheme, rate_hz).unwrap();
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

/// The rate is that of the scenario unless a flag gives one; a scheme for which the rate is too low states the rate it
/// needs, and the others are still measured.
#[test]
fn a_scheme_that_fails_says_so_in_its_row() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = folder.path().join("straight.toml");
    std::fs::write(
        &scenario,
        "[structure]\npreset = 'irb1600-table1'\nangles_deg = [0, 0]\n[simulation]\nrate_hz = 500\nsteps_per_sample = 2\n",
    )
    .unwrap();
    let scenario: &Path = &scenario;
    let got = document(&["--scenario", scenario.to_str().unwrap(), "--drift-steps", "100"]);
    // Two steps for each of 500 samples a second.
    assert_eq!(got["rate_hz"].as_f64(), Some(1000.0));
    let row =
        |scheme: Scheme| got["schemes"].as_array().unwrap().iter().find(|row| row["scheme"] == scheme.name()).unwrap();
    insta::assert_snapshot!(row(Scheme::Rk4)["refused"].as_str().unwrap(), @"scheme rk4 is too coarse for this structure at 1000 Hz: its fastest mode needs a rate of at least 1265 Hz");
    assert!(row(Scheme::Rk4)["modes"].is_null() && row(Scheme::Rk4)["cost_ns"].is_null());
    assert!(row(Scheme::Gl6)["modes"][1]["frequency_error"].as_f64() < Some(-1e-6));
    let higher = ["--scenario", scenario.to_str().unwrap(), "--drift-steps", "100", "--rate-hz", "8000"];
    assert_eq!(document(&higher)["rate_hz"].as_f64(), Some(8000.0));
}

#[test]
fn table_has_a_line_for_every_scheme() {
    let arguments = ["--preset", "irb1600-table1", "--angles-deg", "0,0", "--rate-hz", "1000", "--drift-steps", "10"];
    let text = resonarm(here(), &[&["integrators"], &arguments[..]].concat()).stdout;
    let head: Vec<&str> = text.lines().take(6).collect();
    insta::assert_snapshot!(head.join("\n"), @r"
    irb1600-table1 at 0°, 0°, 1000 steps a second; default scheme: exponential8

                            mode 1: 21.77 Hz        mode 2: 569.25 Hz       energy, 10 steps
      scheme       order     damping   frequency     damping   frequency    change   spread   ns a step
      rk4              4           –           –           –           –         –        –           –
                     scheme rk4 is too coarse for this structure at 1000 Hz: its fastest mode needs a rate of at least 1265 Hz
    ");
    for scheme in Scheme::ALL {
        assert!(text.lines().any(|line| line.trim_start().starts_with(scheme.name())), "{scheme} in {text}");
    }
}

#[test]
fn bad_input_is_refused() {
    insta::assert_snapshot!(complaint(&["--rate-hz", "0"]), @"resonarm: --rate-hz: the integration rate is 0 Hz: it must be a positive number");
    insta::assert_snapshot!(complaint(&["--rate-hz", "nan"]), @r"
    error: invalid value 'nan' for '--rate-hz <HZ>': it must be a finite number

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(complaint(&["--rate-hz", "1e14"]), @"resonarm: --rate-hz: the integration rate is 1e14 Hz: it must be at most 3.29881543934e11 Hz for this structure, since the changes over a shorter step are lost in rounding");
    insta::assert_snapshot!(complaint(&["--preset", "irb140"]), @"
    error: invalid value 'irb140' for '--preset <NAME>': there is no preset `irb140`: expected one of irb1600-table1, irb1600-fitted

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(complaint(&["--drift-steps", "9"]), @r"
    error: invalid value '9' for '--drift-steps <N>': it must be an integer from 10 to 4294967295

    For more information, try '--help'.
    ");
}
