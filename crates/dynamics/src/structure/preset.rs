//! The chains that come with the program.

use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;
use core::str::FromStr;

use serde::Deserialize;

use super::error::StructureError;
use super::parameter::Parameter;
use super::parameter_values::values_of_links;
use super::spec::{ChainSpec, Link};

/// A chain that comes with the program, as a TOML file in `crates/dynamics/src/structure/presets/`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// `irb1600-table1`: Table 1 of the paper as printed, and l2 = 0.6 m, our assumption.
    Irb1600Table1,
    /// `irb1600-fitted`: Table 1 with I_S2 = 1.5 kg·m², which the paper's figures demand, and l2 = 0.6 m, our
    /// assumption.
    #[default]
    Irb1600Fitted,
}

/// Content of the TOML file of a preset.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PresetFile {
    /// Names of parameters that the source of the preset does not state.
    #[serde(default)]
    unstated: Vec<String>,
    /// The links, with the keys of `[structure]` in a scenario.
    links: Vec<Link>,
}

impl Preset {
    /// All presets that come with the program.
    pub const ALL: [Preset; 2] = [Preset::Irb1600Table1, Preset::Irb1600Fitted];

    /// Name of the preset, as a scenario has it.
    pub const fn name(self) -> &'static str {
        match self {
            Preset::Irb1600Table1 => "irb1600-table1",
            Preset::Irb1600Fitted => "irb1600-fitted",
        }
    }

    /// The preset's file, comments included.
    pub const fn text(self) -> &'static str {
        match self {
            Preset::Irb1600Table1 => include_str!("presets/irb1600-table1.toml"),
            Preset::Irb1600Fitted => include_str!("presets/irb1600-fitted.toml"),
        }
    }

    /// The chain in the preset's file, without gravity.
    ///
    /// # Errors
    /// [`StructureError::PresetText`] if the file is not valid; tests check that every preset is.
    pub fn chain(self) -> Result<ChainSpec, StructureError> {
        let unreadable = |reason: String| StructureError::PresetText { name: self.name(), reason };
        let PresetFile { unstated, mut links } =
            toml::from_str(self.text()).map_err(|error: toml::de::Error| unreadable(error.to_string()))?;
        let parameters: Vec<Parameter> = values_of_links(&mut links).map(|(parameter, _)| parameter).collect();
        let named = |name: &String| parameters.iter().find(|parameter| parameter.to_string() == *name).copied();
        let parameter = |name: &String| named(name).ok_or_else(|| unreadable(name.clone()));
        let unstated = unstated.iter().map(parameter).collect::<Result<_, _>>()?;
        Ok(ChainSpec { links, gravity_m_s2: 0.0, unstated })
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Preset {
    type Err = StructureError;

    fn from_str(name: &str) -> Result<Preset, StructureError> {
        Preset::ALL.into_iter().find(|preset| preset.name() == name).ok_or_else(|| StructureError::UnknownPreset {
            got: name.to_string(),
            known: Preset::ALL.map(Preset::name).join(", "),
        })
    }
}
