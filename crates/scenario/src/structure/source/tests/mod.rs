//! Structures read from files, against numbers of other programs, and the messages about invalid files.

mod matrices;
mod of_modes;
mod uff;
mod urdf;

use std::path::{Path, PathBuf};

use crate::{Scenario, ScenarioError};

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/structures")
}

fn close(got: f64, expected: f64, relative: f64) {
    assert!((got - expected).abs() <= relative * expected.abs(), "{got} in place of {expected}");
}

/// Reads a scenario whose files are in a folder.
fn read_in(folder: &Path, text: &str) -> Result<Scenario, ScenarioError> {
    let mut scenario = Scenario::parse(text, "bench.toml")?;
    scenario.read_files(folder)?;
    Ok(scenario)
}

/// The message about a scenario in the examples' folder.
fn says(text: &str) -> String {
    match read_in(&examples(), text).and_then(|scenario| scenario.under_test()) {
        Ok(tested) => format!("{tested:?}"),
        Err(error) => error.to_string().replace(&examples().display().to_string(), "examples"),
    }
}

#[test]
fn what_was_read_is_written_and_needs_no_file() {
    for name in ["chain", "bracket", "contact", "plate"] {
        let scenario = Scenario::read(&examples().join(format!("{name}.toml"))).unwrap();
        let text = scenario.to_toml().unwrap();
        let mut written = Scenario::parse(&text, "written.toml").unwrap();
        assert_eq!(written.under_test().unwrap(), scenario.under_test().unwrap(), "{name}");
        written.read_files(Path::new("/dev/null/none")).unwrap();
        assert_eq!(written.structure, scenario.structure, "{name}");
        // Without what was read it is that of the file.
        let section = &mut written.structure;
        section.links.clear();
        section.modes.clear();
        written.read_files(&examples()).unwrap();
        assert_eq!(written.structure, scenario.structure, "{name}");
    }
}

#[test]
fn keys_that_contradict_are_refused() {
    insta::assert_snapshot!(says("[structure]\nkind = 'modal'\nfile = 'none.uff'\n"), @"can't read examples/none.uff: No such file or directory (os error 2); paths are relative to the scenario's folder");
    insta::assert_snapshot!(says("[structure]\nkind = 'modal'\nfile = 'bracket.uff'\nmatrices = { mass = 'm', stiffness = 'k' }\n"), @"structure: give `file` or `matrices`, not both: modes come from one of them");
    insta::assert_snapshot!(says("[structure]\nfile = 'arm6.urdf'\n"), @"structure: `file` does not apply to a structure of kind `preset`: leave it out");
    insta::assert_snapshot!(says("[structure]\nkind = 'chain'\nmatrices = { mass = 'm', stiffness = 'k' }\n"), @"structure: `matrices` does not apply to a structure of kind `chain`: leave it out");
    insta::assert_snapshot!(says("[structure]\nkind = 'chain'\ntip = 'tool0'\n"), @"structure: `tip` applies only to a chain with the `file` of a robot, URDF: leave it out");
    insta::assert_snapshot!(says("[structure]\nkind = 'chain'\njoints = [{ name = 'a', stiffness_nm_rad = 1, damping_nm_s_rad = 1 }]\n"), @"structure: `joints` applies only to a chain with the `file` of a robot, URDF: leave it out");
    insta::assert_snapshot!(says("[structure]\nkind = 'modal'\nnodes = { tip = 1 }\n"), @"structure: `nodes` applies only to a modal structure with the `file` of its modes, UFF: leave it out");
    insta::assert_snapshot!(says("[structure]\nkind = 'modal'\nfile = 'bracket.uff'\ndofs = { 'tip.x' = 1 }\n"), @"structure: `dofs` applies only to a modal structure with `matrices`: leave it out");
    let unread = Scenario::parse("[structure]\nkind = 'modal'\nfile = 'bracket.uff'\n", "bench.toml").unwrap();
    insta::assert_snapshot!(unread.under_test().unwrap_err(), @"structure: `file` names a file that has not been read: read the scenario from its file, or give `modes`");
}
