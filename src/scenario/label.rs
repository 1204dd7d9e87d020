//! How an arm is called in headers and figures.

use core::fmt::Write;

use toml::{Table, Value};

use super::ArmSection;
use crate::arm::Preset;

impl ArmSection {
    /// The preset, and every parameter that differs from it with the preset's value:
    /// `irb1600-fitted with mass2_kg = 40 (preset 50.58)`.
    pub fn label(&self) -> String {
        self.label_without(&[])
    }

    /// The same without parameters of these names, which vary.
    pub fn label_without(&self, varied: &[&str]) -> String {
        let mut text = self.preset.clone();
        let mut separator = " with ";
        for difference in self.differences().iter().filter(|difference| !varied.contains(&difference.name.as_str())) {
            let Difference { name, value, preset } = difference;
            let preset = preset.as_ref().map_or(String::from("none"), Value::to_string);
            let _infallible = write!(text, "{separator}{name} = {value} (preset {preset})");
            separator = ", ";
        }
        text
    }

    /// The parameters that differ from the preset's. Of a preset that can't be read there are none, so that all do.
    fn differences(&self) -> Vec<Difference> {
        let preset = self.preset.parse::<Preset>().and_then(Preset::parameters);
        let preset = preset.ok().and_then(|parameters| Table::try_from(parameters).ok()).unwrap_or_default();
        flat(&self.parameters)
            .into_iter()
            .map(|(name, value)| Difference { preset: preset.get(&name).cloned(), name, value })
            .filter(|difference| difference.preset.as_ref().is_none_or(|preset| !equal(preset, &difference.value)))
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
    use crate::scenario::Scenario;

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
    fn parameters_with_the_presets_value_are_the_presets() {
        let table1 = "arm = { preset = 'irb1600-table1', parameters = { inertia2_kg_m2 = 1.5 } }";
        insta::assert_snapshot!(label(table1), @"irb1600-table1 with inertia2_kg_m2 = 1.5 (preset 0.0009)");
        insta::assert_snapshot!(label("arm = { parameters = { inertia2_kg_m2 = 1.5 } }"), @"irb1600-fitted");
    }
}
