//! The laws of elements, as a scenario names them.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Law of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ElementKind {
    /// A spring of force k3 x³ + k5 x⁵.
    Cubic,
    /// Backlash, or a stop on both sides.
    Gap,
    /// A contact on one side: of Kelvin and Voigt, or, with `dissipation_s_m`, of Hunt and Crossley.
    Contact,
    /// Elastic Coulomb friction (Jenkins element): a spring in series with a slider.
    Friction,
    /// Friction of the LuGre model.
    Lugre,
    /// A spring, a damper, or both.
    Linear,
    /// Coulomb friction smoothed by a hyperbolic tangent of the velocity.
    Tanh,
    /// Forces with a polynomial potential over several displacements.
    Polynomial,
}

/// The name of the law in a scenario.
impl fmt::Display for ElementKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}
