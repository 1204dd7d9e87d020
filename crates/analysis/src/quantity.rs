//! The quantities of a frequency response, as ISO 7626-1 names them.

use alloc::string::{String, ToString};
use core::fmt;
use core::str::FromStr;

use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The time derivative of the response that is divided by the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Displacement over force: H.
    Receptance,
    /// Velocity over force: iω H.
    Mobility,
    /// Acceleration over force: −ω² H.
    #[default]
    Accelerance,
}

impl Quantity {
    /// Every quantity, by rising order of the derivative.
    pub const ALL: [Quantity; 3] = [Quantity::Receptance, Quantity::Mobility, Quantity::Accelerance];

    /// The name by ISO 7626-1, on the command line and in documents.
    pub const fn name(self) -> &'static str {
        match self {
            Quantity::Receptance => "receptance",
            Quantity::Mobility => "mobility",
            Quantity::Accelerance => "accelerance",
        }
    }

    /// (iω)ⁿ for the nth derivative.
    pub(crate) fn factor(self, omega_rad_s: f64) -> Complex<f64> {
        match self {
            Quantity::Receptance => Complex::new(1.0, 0.0),
            Quantity::Mobility => Complex::new(0.0, omega_rad_s),
            Quantity::Accelerance => Complex::new(-omega_rad_s * omega_rad_s, 0.0),
        }
    }
}

/// Error of a text that is not the name of a quantity.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("there is no quantity `{got}`: it must be one of {known}", known = Quantity::ALL.map(Quantity::name).join(", "))]
pub struct UnknownQuantity {
    /// The text that was given.
    pub got: String,
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Quantity {
    type Err = UnknownQuantity;

    fn from_str(name: &str) -> Result<Quantity, UnknownQuantity> {
        let found = Quantity::ALL.into_iter().find(|quantity| quantity.name() == name);
        found.ok_or_else(|| UnknownQuantity { got: name.to_string() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reading a name returns the value that was written, on the command line and in documents.
    #[test]
    fn names_are_those_of_documents() {
        for quantity in Quantity::ALL {
            let name = quantity.to_string();
            assert_eq!(name.parse(), Ok(quantity));
            assert_eq!(serde_json::to_value(quantity).unwrap(), name);
        }
    }

    #[test]
    fn says_which_names_there_are() {
        insta::assert_snapshot!("inertance".parse::<Quantity>().unwrap_err(), @"there is no quantity `inertance`: it must be one of receptance, mobility, accelerance");
    }
}
