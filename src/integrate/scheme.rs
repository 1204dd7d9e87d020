//! The schemes by name.

use alloc::string::{String, ToString};
use core::fmt;
use core::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A one-step method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scheme {
    /// `rk4`: the classical Runge–Kutta method of order 4 (W. Kutta 1901). Explicit; stable to ωh = 2√2, with a damping
    /// ratio of its own of (ωh)⁵/144.
    Rk4,
    /// `gl4`: Gauss–Legendre with two stages, order 4 (J. C. Butcher 1964). Implicit, symmetric, symplectic: no damping
    /// of its own, relative frequency error −(ωh)⁴/720.
    Gl4,
    /// `gl6`: Gauss–Legendre with three stages, order 6 (J. C. Butcher 1964). As `gl4`, with −(ωh)⁶/100800.
    #[default]
    Gl6,
}

impl Scheme {
    /// Every scheme.
    pub const ALL: [Scheme; 3] = [Scheme::Rk4, Scheme::Gl4, Scheme::Gl6];

    /// The name by which it is asked for.
    pub const fn name(self) -> &'static str {
        match self {
            Scheme::Rk4 => "rk4",
            Scheme::Gl4 => "gl4",
            Scheme::Gl6 => "gl6",
        }
    }

    /// The order p: the global error falls as h^p.
    pub const fn order(self) -> u32 {
        match self {
            Scheme::Rk4 | Scheme::Gl4 => 4,
            Scheme::Gl6 => 6,
        }
    }

    /// The largest ωh of the fastest mode that is accepted: the bound of stability 2√2 for `rk4`; the Gauss–Legendre
    /// schemes are stable at every step, and are asked for one step a period, 2π.
    pub const fn phase_limit_rad(self) -> f64 {
        match self {
            Scheme::Rk4 => 2.0 * core::f64::consts::SQRT_2,
            Scheme::Gl4 | Scheme::Gl6 => core::f64::consts::TAU,
        }
    }
}

impl fmt::Display for Scheme {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// No scheme has this name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("there is no integration scheme `{got}`: the schemes are {known}")]
pub struct UnknownScheme {
    /// What was given.
    pub got: String,
    /// The names there are.
    pub known: String,
}

impl FromStr for Scheme {
    type Err = UnknownScheme;

    fn from_str(name: &str) -> Result<Scheme, UnknownScheme> {
        Scheme::ALL
            .into_iter()
            .find(|scheme| scheme.name() == name)
            .ok_or_else(|| UnknownScheme { got: name.to_string(), known: Scheme::ALL.map(Scheme::name).join(", ") })
    }
}
