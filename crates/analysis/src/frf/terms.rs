//! Drive, response and quantity of a frequency response, with names, labels and units.

use alloc::string::{String, ToString};
use core::fmt;
use core::str::FromStr;

use nalgebra::Complex;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Where the arm is driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Drive {
    /// Torque at joint 1, N·m.
    Torque1,
    /// Torque at joint 2, N·m.
    Torque2,
    /// Force at the tip C along x of the base frame, N.
    ForceX,
    /// Force at the tip C along y of the base frame, N.
    ForceY,
}

impl Drive {
    /// Every drive.
    pub const ALL: [Drive; 4] = [Drive::Torque1, Drive::Torque2, Drive::ForceX, Drive::ForceY];

    /// The name, as the command line and documents have it.
    pub const fn name(self) -> &'static str {
        match self {
            Drive::Torque1 => "torque1",
            Drive::Torque2 => "torque2",
            Drive::ForceX => "force-x",
            Drive::ForceY => "force-y",
        }
    }

    /// In words, for figures.
    pub const fn label(self) -> &'static str {
        match self {
            Drive::Torque1 => "torque at joint 1",
            Drive::Torque2 => "torque at joint 2",
            Drive::ForceX => "force at C along x",
            Drive::ForceY => "force at C along y",
        }
    }

    /// The unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Drive::Torque1 | Drive::Torque2 => "N·m",
            Drive::ForceX | Drive::ForceY => "N",
        }
    }
}

/// Where the response is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Response {
    /// α1, deflection of joint 1, rad.
    Alpha1,
    /// α2, deflection of joint 2, rad.
    Alpha2,
    /// Displacement of the elbow B along x of the base frame, m.
    BX,
    /// Displacement of the elbow B along y of the base frame, m.
    BY,
    /// Displacement of the tip C along x of the base frame, m.
    CX,
    /// Displacement of the tip C along y of the base frame, m.
    CY,
}

impl Response {
    /// Every response.
    pub const ALL: [Response; 6] =
        [Response::Alpha1, Response::Alpha2, Response::BX, Response::BY, Response::CX, Response::CY];

    /// The name, as the command line and documents have it.
    pub const fn name(self) -> &'static str {
        match self {
            Response::Alpha1 => "alpha1",
            Response::Alpha2 => "alpha2",
            Response::BX => "b-x",
            Response::BY => "b-y",
            Response::CX => "c-x",
            Response::CY => "c-y",
        }
    }

    /// The symbol, for figures.
    pub const fn symbol(self) -> &'static str {
        match self {
            Response::Alpha1 => "α₁",
            Response::Alpha2 => "α₂",
            Response::BX => "B x",
            Response::BY => "B y",
            Response::CX => "C x",
            Response::CY => "C y",
        }
    }

    /// The unit of the motion: rad of an angle, m of a displacement.
    pub const fn unit(self) -> &'static str {
        if self.is_angle() { "rad" } else { "m" }
    }

    /// Whether the motion is an angle, not a displacement.
    pub const fn is_angle(self) -> bool {
        matches!(self, Response::Alpha1 | Response::Alpha2)
    }
}

/// Which time derivative of the response is divided by the drive.
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
    /// Every quantity.
    pub const ALL: [Quantity; 3] = [Quantity::Receptance, Quantity::Mobility, Quantity::Accelerance];

    /// The name by ISO 7626-1, on the command line and in documents.
    pub const fn name(self) -> &'static str {
        match self {
            Quantity::Receptance => "receptance",
            Quantity::Mobility => "mobility",
            Quantity::Accelerance => "accelerance",
        }
    }

    /// The unit of this derivative of a response.
    pub const fn unit(self, response: Response) -> &'static str {
        match (self, response.is_angle()) {
            (Quantity::Receptance, true) => "rad",
            (Quantity::Receptance, false) => "m",
            (Quantity::Mobility, true) => "rad/s",
            (Quantity::Mobility, false) => "m/s",
            (Quantity::Accelerance, true) => "rad/s²",
            (Quantity::Accelerance, false) => "m/s²",
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

/// A text is not the name of a drive, response or quantity.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("there is no {what} `{got}`: it must be one of {known}")]
pub struct UnknownTerm {
    /// Drive, response or quantity.
    pub what: &'static str,
    /// The given value.
    pub got: String,
    /// The existing names.
    pub known: String,
}

impl UnknownTerm {
    fn new(what: &'static str, got: &str, known: &[&str]) -> UnknownTerm {
        UnknownTerm { what, got: got.to_string(), known: known.join(", ") }
    }
}

impl fmt::Display for Drive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Display for Response {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Drive {
    type Err = UnknownTerm;

    fn from_str(name: &str) -> Result<Drive, UnknownTerm> {
        let found = Drive::ALL.into_iter().find(|drive| drive.name() == name);
        found.ok_or_else(|| UnknownTerm::new("drive", name, &Drive::ALL.map(Drive::name)))
    }
}

impl FromStr for Response {
    type Err = UnknownTerm;

    fn from_str(name: &str) -> Result<Response, UnknownTerm> {
        let found = Response::ALL.into_iter().find(|response| response.name() == name);
        found.ok_or_else(|| UnknownTerm::new("response", name, &Response::ALL.map(Response::name)))
    }
}

impl FromStr for Quantity {
    type Err = UnknownTerm;

    fn from_str(name: &str) -> Result<Quantity, UnknownTerm> {
        let found = Quantity::ALL.into_iter().find(|quantity| quantity.name() == name);
        found.ok_or_else(|| UnknownTerm::new("quantity", name, &Quantity::ALL.map(Quantity::name)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reading a name returns the value that was written, on the command line and in documents.
    #[test]
    fn names_are_those_of_documents() {
        fn each<T: Copy + PartialEq + fmt::Debug + fmt::Display + FromStr<Err = UnknownTerm> + Serialize>(all: &[T]) {
            for term in all {
                let name = term.to_string();
                assert_eq!(name.parse().as_ref(), Ok(term));
                assert_eq!(serde_json::to_value(term).unwrap(), name);
            }
        }
        each(&Drive::ALL);
        each(&Response::ALL);
        each(&Quantity::ALL);
    }

    #[test]
    fn says_which_names_there_are() {
        insta::assert_snapshot!("torque3".parse::<Drive>().unwrap_err(), @"there is no drive `torque3`: it must be one of torque1, torque2, force-x, force-y");
        insta::assert_snapshot!("elbow".parse::<Response>().unwrap_err(), @"there is no response `elbow`: it must be one of alpha1, alpha2, b-x, b-y, c-x, c-y");
        insta::assert_snapshot!("inertance".parse::<Quantity>().unwrap_err(), @"there is no quantity `inertance`: it must be one of receptance, mobility, accelerance");
    }
}
