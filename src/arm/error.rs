//! What no arm can be.

use alloc::string::String;

use thiserror::Error;

/// Why a set of numbers is not an arm.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ArmError {
    /// A parameter is outside what is physically possible.
    #[error("arm parameter `{name}` is {got}: it must be {expected}")]
    Parameter {
        /// The parameter, as it is called in a scenario.
        name: &'static str,
        /// What was given.
        got: f64,
        /// What would do.
        expected: &'static str,
    },
    /// A pose angle is not a usable number.
    #[error("pose angle `{name}` is {got}: it must be a number from -360 to 360 degrees")]
    Pose {
        /// The angle, as it is called in a scenario.
        name: &'static str,
        /// What was given, degrees.
        got: f64,
    },
    /// The springs can't hold the arm's weight in this pose.
    #[error(
        "the joints can't hold the arm's weight at {gravity_m_s2} m/s²: no stable equilibrium is found from this pose; \
         raise the stiffnesses or lower the masses"
    )]
    Collapse {
        /// The acceleration of gravity, m/s².
        gravity_m_s2: f64,
    },
    /// No preset has this name.
    #[error("there is no preset `{got}`: the presets are {known}")]
    UnknownPreset {
        /// What was given.
        got: String,
        /// The names there are.
        known: String,
    },
    /// A preset's text can't be read.
    #[error("preset `{name}`: {reason}")]
    PresetText {
        /// The preset.
        name: &'static str,
        /// What the TOML reader says.
        reason: String,
    },
}
