//! How an arm is called in headers and figures.

use core::fmt::Write;

use toml::{Table, Value};

use super::{ArmSection, ScenarioError};
use resonarm_dynamics::arm::Preset;

/// The most characters of a name: as many as stand in a figure's width beside the pose.
const MOST_CHARACTERS: usize = 60;

impl ArmSection {
    /// The arm's name; without one [`ArmSection::description`].
    pub fn label(&self) -> String {
        self.label_without(&[])
    }

    /// The same without parameters of these names, which vary.
    pub fn label_without(&self, varied: &[&str]) -> String {
        self.name.clone().unwrap_or_else(|| self.description_without(varied))
    }

    /// The same in few words, for one line: how many parameters differ from the preset's, not which.
    pub fn short_label_without(&self, varied: &[&str]) -> String {
        let count = self.differences_without(varied).len();
        match (&self.name, count) {
            (Some(name), _) => name.clone(),
            (None, 0) => self.preset.clone(),
            (None, 1) => format!("{} with 1 changed parameter", self.preset),
            (None, _) => format!("{} with {count} changed parameters", self.preset),
        }
    }

    /// The preset, and every parameter that differs from it with the preset's value:
    /// `irb1600-fitted with mass2_kg = 40 (preset 50.58)`.
    pub fn description(&self) -> String {
        self.description_without(&[])
    }

    /// The same without parameters of these names, which vary.
    pub fn description_without(&self, varied: &[&str]) -> String {
        let mut text = self.preset.clone();
        let mut separator = " with ";
        for difference in self.differences_without(varied) {
            let Difference { name, value, preset } = difference;
            let preset = preset.map_or(String::from("none"), |value| value.to_string());
            let _infallible = write!(text, "{separator}{name} = {value} (preset {preset})");
            separator = ", ";
        }
        text
    }

    /// Checks that the name can be shown in a line.
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

    /// The parameters that differ from the preset's, without those of these names. Of a preset that can't be read there
    /// are none, so that all do.
    fn differences_without(&self, varied: &[&str]) -> Vec<Difference> {
        let preset = self.preset.parse::<Preset>().and_then(Preset::parameters);
        let preset = preset.ok().and_then(|parameters| Table::try_from(parameters).ok()).unwrap_or_default();
        flat(&self.parameters)
            .into_iter()
            .map(|(name, value)| Difference { preset: preset.get(&name).cloned(), name, value })
            .filter(|difference| difference.preset.as_ref().is_none_or(|preset| !equal(preset, &difference.value)))
            .filter(|difference| !varied.contains(&difference.name.as_str()))
            .collect()
    }
}

/// A parameter that is not the preset's.
struct Difference {
    name: String,
    value: Value,
    preset: Option<Value>,
}

/// The parameters, those of gravity among them under their own names.
fn flat(parameters: &Table) -> Vec<(String, Value)> {
    let mut all = Vec::new();
    for (name, value) in parameters {
        match value {
            Value::Table(inner) => all.extend(flat(inner)),
            value => all.push((name.clone(), value.clone())),
        }
    }
    all
}

/// Whether both are the same number: TOML tells 128000 from 128000.0.
fn equal(a: &Value, b: &Value) -> bool {
    let number = |value: &Value| value.as_float().or(value.as_integer().map(|whole| whole as f64));
    number(a) == number(b)
}

#[cfg(test)]
mod tests {
    use crate::Scenario;

    fn label(text: &str) -> String {
        Scenario::parse(text, "test.toml").unwrap().arm.label()
    }

    #[test]
    fn an_arm_of_ones_own_is_not_called_by_the_preset_alone() {
        insta::assert_snapshot!(label(""), @"irb1600-fitted");
        insta::assert_snapshot!(label("[arm]\nparameters = { stiffness2_nm_rad = 128000.0, mass2_kg = 40, damping1_nm_s_rad = 20.5 }"), @"irb1600-fitted with damping1_nm_s_rad = 20.5 (preset 0.9), mass2_kg = 40 (preset 50.58)");
        insta::assert_snapshot!(label("[arm.parameters]\nmass2_kg = 50.58\ngravity = { gravity_m_s2 = 9.81, mass1_kg = 40, centre1_m = 0.3 }"), @"irb1600-fitted with centre1_m = 0.3 (preset none), gravity_m_s2 = 9.81 (preset none), mass1_kg = 40 (preset none)");
    }

    #[test]
    fn an_arm_with_a_name_is_called_by_it() {
        let named = "arm = { name = 'lab arm', parameters = { mass2_kg = 40, length1_m = 0.6 } }";
        let arm = Scenario::parse(named, "test.toml").unwrap().arm;
        assert_eq!((arm.label().as_str(), arm.short_label_without(&[]).as_str()), ("lab arm", "lab arm"));
        insta::assert_snapshot!(arm.description(), @"irb1600-fitted with length1_m = 0.6 (preset 0.63), mass2_kg = 40 (preset 50.58)");
        let unnamed = super::ArmSection { name: None, ..arm };
        insta::assert_snapshot!(unnamed.short_label_without(&[]), @"irb1600-fitted with 2 changed parameters");
        insta::assert_snapshot!(unnamed.short_label_without(&["mass2_kg"]), @"irb1600-fitted with 1 changed parameter");
        insta::assert_snapshot!(unnamed.short_label_without(&["mass2_kg", "length1_m"]), @"irb1600-fitted");
    }

    #[test]
    fn a_name_that_no_line_can_show_is_refused() {
        let says = |name: &str| Scenario::parse(&format!("arm.name = {name}"), "test.toml").unwrap_err().to_string();
        insta::assert_snapshot!(says("' '"), @r#"arm.name is " ": it must be 1 to 60 characters, none of them a control character"#);
        insta::assert_snapshot!(says(r#""a\u001b[2J""#), @r#"arm.name is "a\u{1b}[2J": it must be 1 to 60 characters, none of them a control character"#);
        insta::assert_snapshot!(says(&format!("'{}'", "a".repeat(61))), @r#"arm.name is "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa": it must be 1 to 60 characters, none of them a control character"#);
    }

    #[test]
    fn parameters_with_the_presets_value_are_the_presets() {
        let table1 = "arm = { preset = 'irb1600-table1', parameters = { inertia2_kg_m2 = 1.5 } }";
        insta::assert_snapshot!(label(table1), @"irb1600-table1 with inertia2_kg_m2 = 1.5 (preset 0.0009)");
        insta::assert_snapshot!(label("arm = { parameters = { inertia2_kg_m2 = 1.5 } }"), @"irb1600-fitted");
    }
}
