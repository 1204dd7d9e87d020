//! The parameter sets that come with the program.

use alloc::string::ToString;
use core::fmt;
use core::str::FromStr;

use serde::Deserialize;

use super::{ArmError, Parameters};

/// A parameter set that comes with the program, as a TOML file in `crates/dynamics/src/arm/presets/`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// `irb1600-table1`: Table 1 as printed, and l2 = 0.6 m, our assumption.
    Irb1600Table1,
    /// `irb1600-fitted`: Table 1 with I_S2 = 1.5 kg·m², which the paper's figures demand, and l2 = 0.6 m, our
    /// assumption.
    #[default]
    Irb1600Fitted,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PresetFile {
    parameters: Parameters,
}

impl Preset {
    /// Every preset.
    pub const ALL: [Preset; 2] = [Preset::Irb1600Table1, Preset::Irb1600Fitted];

    /// Its name.
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

    /// The parameters in the preset's file.
    ///
    /// # Errors
    /// [`ArmError::PresetText`] if the file is not valid; tests check that every preset is.
    pub fn parameters(self) -> Result<Parameters, ArmError> {
        let unreadable = |error: toml::de::Error| ArmError::PresetText { name: self.name(), reason: error.to_string() };
        Ok(toml::from_str::<PresetFile>(self.text()).map_err(unreadable)?.parameters)
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Preset {
    type Err = ArmError;

    fn from_str(name: &str) -> Result<Preset, ArmError> {
        Preset::ALL.into_iter().find(|preset| preset.name() == name).ok_or_else(|| ArmError::UnknownPreset {
            got: name.to_string(),
            known: Preset::ALL.map(Preset::name).join(", "),
        })
    }
}
