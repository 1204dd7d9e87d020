//! Names of structures in headers and figures, and the parameters that a scenario changes.

use core::fmt;

use crate::error::ScenarioError;
use crate::structure::{StructureKind, StructureSection};
use resonarm_dynamics::structure::{Assembly, BodySpec};
use resonarm_numeric::number::short;

/// Largest number of characters of a name: as many as fit a figure's width beside the angles.
const MOST_CHARACTERS: usize = 60;

/// A parameter to which a scenario gives another value than the structure's own.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// The name of the parameter, as `link2.mass_kg`.
    pub name: String,
    /// Value in the scenario.
    pub value: f64,
    /// The value in the preset, if the structure is one that has it.
    pub preset: Option<f64>,
}

impl fmt::Display for Change {
    /// Formats the change as `link2.mass_kg = 40 (preset 50.58)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.name, short(&self.value))?;
        self.preset.map_or(Ok(()), |preset| write!(f, " (preset {})", short(&preset)))
    }
}

impl StructureSection {
    /// Returns the parameters that are set to other values than those of the preset, or of the structure as it is
    /// stated; those of angles among them.
    pub fn changes(&self) -> Vec<Change> {
        let plain = StructureSection { set: Default::default(), gravity_m_s2: None, ..self.clone() }.assembly().ok();
        let is_preset = self.kind == StructureKind::Preset;
        let gravity = self.gravity_m_s2.filter(|_| is_preset).map(|value| (String::from("gravity_m_s2"), value));
        let set = self.set.iter().map(|(name, value)| (name.clone(), *value));
        // A preset may leave parameters of its links unstated. Setting one of them replaces no value of the
        // preset.
        let stated = |assembly: &Assembly, name: &str| {
            let parameter = assembly.parameter(name).ok()?;
            match &assembly.spec().body {
                BodySpec::Chain(chain) if chain.unstated.contains(&parameter) => None,
                _ => assembly.value(parameter).ok(),
            }
        };
        gravity
            .into_iter()
            .chain(set)
            .map(|(name, value)| {
                let preset = plain.as_ref().filter(|_| is_preset).and_then(|plain| stated(plain, &name));
                Change { name, value, preset }
            })
            .filter(|change| change.preset != Some(change.value))
            .collect()
    }

    /// Rejects a name that can't be shown in one line.
    pub(super) fn check_name(&self) -> Result<(), ScenarioError> {
        match &self.name {
            Some(name)
                if name.trim().is_empty()
                    || name.chars().count() > MOST_CHARACTERS
                    || name.chars().any(char::is_control) =>
            {
                Err(ScenarioError::Name { got: name.clone(), most: MOST_CHARACTERS })
            }
            Some(_) | None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::Scenario;

    fn changes(text: &str) -> String {
        let changes = Scenario::parse(text, "test.toml").unwrap().structure.changes();
        changes.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
    }

    #[test]
    fn changes_are_those_from_what_the_preset_states() {
        insta::assert_snapshot!(changes(""), @"");
        insta::assert_snapshot!(changes("[structure.set]\n'link2.stiffness_nm_rad' = 128000.0\n'link2.mass_kg' = 40\n'link1.damping_nm_s_rad' = 20.5"), @"link1.damping_nm_s_rad = 20.5 (preset 0.9), link2.mass_kg = 40 (preset 50.58)");
        insta::assert_snapshot!(changes("structure = { gravity_m_s2 = 9.81, set = { 'link1.mass_kg' = 40, 'link1.centre_of_mass_m' = 0.1, 'link1.inertia_kg_m2' = 0.15, 'link2.mass_kg' = 50.58 } }"), @"gravity_m_s2 = 9.81 (preset 0), link1.centre_of_mass_m = 0.1, link1.inertia_kg_m2 = 0.15, link1.mass_kg = 40");
        let table1 = "structure = { preset = 'irb1600-table1', set = { 'link2.inertia_kg_m2' = 1.5 } }";
        insta::assert_snapshot!(changes(table1), @"link2.inertia_kg_m2 = 1.5 (preset 0.0009)");
        insta::assert_snapshot!(changes("structure.set = { 'link2.inertia_kg_m2' = 1.5 }"), @"");
    }

    #[test]
    fn a_name_that_no_line_can_show_is_refused() {
        let says =
            |name: &str| Scenario::parse(&format!("structure.name = {name}"), "test.toml").unwrap_err().to_string();
        insta::assert_snapshot!(says("' '"), @r#"structure.name is " ": it must be 1 to 60 characters, none of them a control character"#);
        insta::assert_snapshot!(says(r#""a\u001b[2J""#), @r#"structure.name is "a\u{1b}[2J": it must be 1 to 60 characters, none of them a control character"#);
        insta::assert_snapshot!(says(&format!("'{}'", "a".repeat(61))), @r#"structure.name is "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa": it must be 1 to 60 characters, none of them a control character"#);
    }
}
