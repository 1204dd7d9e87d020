//! The parameters of a forced arm that can be varied, with names, symbols and units.

use alloc::string::{String, ToString};
use core::fmt;
use core::str::FromStr;

use thiserror::Error;

use resonarm_dynamics::arm::Parameters;

/// A parameter of a forced arm that can be varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ArmParameter {
    /// `amplitude`: the factor on the load: with a load of one unit, the amplitude in N·m or N.
    Amplitude,
    /// `beta1_deg`: β1, degrees.
    Beta1Deg,
    /// `beta2_deg`: β2, degrees.
    Beta2Deg,
    /// `inertia1_kg_m2`: I_A1, kg·m².
    Inertia1,
    /// `inertia2_kg_m2`: I_S2, kg·m².
    Inertia2,
    /// `mass2_kg`: m2, kg.
    Mass2,
    /// `length1_m`: l1, m.
    Length1,
    /// `length2_m`: l2, m.
    Length2,
    /// `centre2_m`: lc2, m.
    Centre2,
    /// `stiffness1_nm_rad`: k1, N·m/rad.
    Stiffness1,
    /// `stiffness2_nm_rad`: k2, N·m/rad.
    Stiffness2,
    /// `damping1_nm_s_rad`: d1, N·m·s/rad.
    Damping1,
    /// `damping2_nm_s_rad`: d2, N·m·s/rad.
    Damping2,
}

/// No parameter has this name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("there is no parameter `{0}`")]
pub struct UnknownArmParameter(pub String);

impl ArmParameter {
    /// All of them.
    pub const ALL: [ArmParameter; 13] = [
        Self::Amplitude,
        Self::Beta1Deg,
        Self::Beta2Deg,
        Self::Inertia1,
        Self::Inertia2,
        Self::Mass2,
        Self::Length1,
        Self::Length2,
        Self::Centre2,
        Self::Stiffness1,
        Self::Stiffness2,
        Self::Damping1,
        Self::Damping2,
    ];

    /// The name in scenarios and on the command line.
    pub const fn name(self) -> &'static str {
        self.words().0
    }

    /// The symbol in print.
    pub const fn symbol(self) -> &'static str {
        self.words().1
    }

    /// The unit; empty for the amplitude, whose unit is that of its load.
    pub const fn unit(self) -> &'static str {
        self.words().2
    }

    /// Name, symbol and unit.
    const fn words(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::Amplitude => ("amplitude", "A", ""),
            Self::Beta1Deg => ("beta1_deg", "β₁", "°"),
            Self::Beta2Deg => ("beta2_deg", "β₂", "°"),
            Self::Inertia1 => ("inertia1_kg_m2", "I_A1", "kg·m²"),
            Self::Inertia2 => ("inertia2_kg_m2", "I_S2", "kg·m²"),
            Self::Mass2 => ("mass2_kg", "m₂", "kg"),
            Self::Length1 => ("length1_m", "l₁", "m"),
            Self::Length2 => ("length2_m", "l₂", "m"),
            Self::Centre2 => ("centre2_m", "lc2", "m"),
            Self::Stiffness1 => ("stiffness1_nm_rad", "k₁", "N·m/rad"),
            Self::Stiffness2 => ("stiffness2_nm_rad", "k₂", "N·m/rad"),
            Self::Damping1 => ("damping1_nm_s_rad", "d₁", "N·m·s/rad"),
            Self::Damping2 => ("damping2_nm_s_rad", "d₂", "N·m·s/rad"),
        }
    }

    /// Its field among the physical parameters; none for the load and the pose.
    pub(super) fn field(self, parameters: &mut Parameters) -> Option<&mut f64> {
        Some(match self {
            Self::Amplitude | Self::Beta1Deg | Self::Beta2Deg => return None,
            Self::Inertia1 => &mut parameters.inertia1_kg_m2,
            Self::Inertia2 => &mut parameters.inertia2_kg_m2,
            Self::Mass2 => &mut parameters.mass2_kg,
            Self::Length1 => &mut parameters.length1_m,
            Self::Length2 => &mut parameters.length2_m,
            Self::Centre2 => &mut parameters.centre2_m,
            Self::Stiffness1 => &mut parameters.stiffness1_nm_rad,
            Self::Stiffness2 => &mut parameters.stiffness2_nm_rad,
            Self::Damping1 => &mut parameters.damping1_nm_s_rad,
            Self::Damping2 => &mut parameters.damping2_nm_s_rad,
        })
    }
}

impl fmt::Display for ArmParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ArmParameter {
    type Err = UnknownArmParameter;

    fn from_str(name: &str) -> Result<ArmParameter, UnknownArmParameter> {
        let found = ArmParameter::ALL.into_iter().find(|which| which.name() == name);
        found.ok_or_else(|| UnknownArmParameter(name.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_dynamics::arm::Preset;

    /// The names of the physical parameters are those of their fields, so that a scenario and the command line agree.
    #[test]
    fn names_are_those_of_a_scenario() {
        let parameters = Preset::Irb1600Fitted.parameters().unwrap();
        let fields = toml::to_string(&parameters).unwrap();
        let names: alloc::vec::Vec<&str> = fields.lines().filter_map(|line| line.split(" = ").next()).collect();
        let physical = ArmParameter::ALL.into_iter().filter(|which| which.field(&mut parameters.clone()).is_some());
        assert_eq!(physical.map(ArmParameter::name).collect::<alloc::vec::Vec<_>>(), names);
        assert!(ArmParameter::ALL.into_iter().all(|which| which.name().parse() == Ok(which)));
        insta::assert_snapshot!("mass1_kg".parse::<ArmParameter>().unwrap_err(), @"there is no parameter `mass1_kg`");
    }
}
