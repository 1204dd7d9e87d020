//! The schemes by name.

use alloc::string::{String, ToString};
use core::fmt;
use core::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A one-step method by its name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scheme {
    /// `rk4`: the classical Runge–Kutta method of order 4 (W. Kutta, "Beitrag zur näherungsweisen Integration totaler
    /// Differentialgleichungen", 1901). Explicit; stable to ωh = 2√2, with a numerical damping ratio of (ωh)⁵/144 and a
    /// relative frequency error of −(ωh)⁴/120.
    Rk4,
    /// `dop853`: the method of order 8 of Dormand and Prince in the form of E. Hairer, S. P. Nørsett, G. Wanner,
    /// "Solving Ordinary Differential Equations I", 1993, with a fixed step. Explicit, twelve stages; stable to ωh =
    /// 5.96, with a numerical damping ratio of 2.26e-8 (ωh)⁹ and a relative frequency error of −6.4e-8 (ωh)⁸.
    Dop853,
    /// `gl4`: Gauss–Legendre with two stages, order 4 (J. C. Butcher, "Implicit Runge–Kutta Processes", Math. Comp. 18
    /// (1964)). Implicit and symmetric: no numerical damping, relative frequency error −(ωh)⁴/720.
    Gl4,
    /// `gl6`: Gauss–Legendre with three stages, order 6 (Butcher, too). As `gl4`, with −(ωh)⁶/100800.
    Gl6,
    /// `exponential`: exponential collocation at the three Gauss nodes, order 6 (M. Hochbruck, A. Ostermann,
    /// "Exponential Runge–Kutta methods for parabolic problems", Appl. Numer. Math. 53 (2005)). Implicit and symmetric;
    /// the linear arm at rest, with loads up to quadratic in time over a step, is exact at every step length: no
    /// numerical damping and no frequency error.
    Exponential,
    /// `exponential8`: the same at the four Gauss nodes, order 8, with loads up to cubic in time.
    #[default]
    Exponential8,
}

impl Scheme {
    /// All schemes, the explicit ones first.
    pub const ALL: [Scheme; 6] =
        [Scheme::Rk4, Scheme::Dop853, Scheme::Gl4, Scheme::Gl6, Scheme::Exponential, Scheme::Exponential8];

    /// Name of the scheme, as scenarios have it.
    pub const fn name(self) -> &'static str {
        match self {
            Scheme::Rk4 => "rk4",
            Scheme::Dop853 => "dop853",
            Scheme::Gl4 => "gl4",
            Scheme::Gl6 => "gl6",
            Scheme::Exponential => "exponential",
            Scheme::Exponential8 => "exponential8",
        }
    }

    /// The order p: the global error falls as h^p.
    pub const fn order(self) -> u32 {
        match self {
            Scheme::Rk4 | Scheme::Gl4 => 4,
            Scheme::Gl6 | Scheme::Exponential => 6,
            Scheme::Dop853 | Scheme::Exponential8 => 8,
        }
    }

    /// Integration steps a sample if a scenario doesn't set them. At 1 kHz the implicit schemes then keep the nonlinear
    /// terms of strong vibration to 1e-10 in the fitted arm.
    pub const fn steps_per_sample(self) -> u32 {
        match self {
            Scheme::Exponential8 => 2,
            Scheme::Rk4 | Scheme::Dop853 | Scheme::Gl4 | Scheme::Gl6 | Scheme::Exponential => 4,
        }
    }

    /// Whether a step forward and a step back return to the start, so that the scheme has no numerical damping. They do
    /// if both are made in the same number of parts, as in all but strong vibration.
    pub const fn is_symmetric(self) -> bool {
        match self {
            Scheme::Rk4 | Scheme::Dop853 => false,
            Scheme::Gl4 | Scheme::Gl6 | Scheme::Exponential | Scheme::Exponential8 => true,
        }
    }

    /// The largest ωh of the fastest mode that is accepted: the bound of stability for the explicit schemes, 2√2 for
    /// `rk4` and 5.96 for `dop853`; the others are stable at every step, and must make at least one step a period, 2π.
    pub const fn phase_limit_rad(self) -> f64 {
        match self {
            Scheme::Rk4 => 2.0 * core::f64::consts::SQRT_2,
            Scheme::Dop853 => 5.96,
            Scheme::Gl4 | Scheme::Gl6 | Scheme::Exponential | Scheme::Exponential8 => core::f64::consts::TAU,
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
#[error("there is no integration scheme `{got}`: expected one of {known}")]
pub struct UnknownScheme {
    /// Name that was given.
    pub got: String,
    /// Names of all schemes.
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
