//! The interface of a system to harmonic balance and Floquet theory.

use nalgebra::{Matrix2, Vector2};

/// Position, velocity and acceleration of both degrees of freedom at one instant, and the phase of the excitation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// x, for the arm α, rad.
    pub position: Vector2<f64>,
    /// ẋ, rad/s.
    pub velocity: Vector2<f64>,
    /// ẍ, rad/s².
    pub acceleration: Vector2<f64>,
    /// sin Ωt.
    pub sine: f64,
    /// cos Ωt.
    pub cosine: f64,
}

/// The unbalanced force at an instant and its derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Linearisation {
    /// r, zero along a motion of the system.
    pub unbalance: Vector2<f64>,
    /// S = ∂r/∂x.
    pub by_position: Matrix2<f64>,
    /// G = ∂r/∂ẋ.
    pub by_velocity: Matrix2<f64>,
    /// M = ∂r/∂ẍ, invertible.
    pub by_acceleration: Matrix2<f64>,
}

/// A natural frequency and its damping.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinearMode {
    /// ω, rad/s.
    pub frequency_rad_s: f64,
    /// ζ.
    pub damping_ratio: f64,
    /// The mode shape φ, of unit length.
    pub shape: Vector2<f64>,
}

/// A system of two degrees of freedom under a harmonic excitation: r(x, ẋ, ẍ, Ωt; p) = 0.
///
/// A system of one degree of freedom has a second, uncoupled one.
pub trait Oscillator {
    /// Names a parameter p that can be varied.
    type Parameter: Copy + core::fmt::Debug + PartialEq;

    /// The value of a parameter.
    fn parameter(&self, which: Self::Parameter) -> f64;

    /// Sets a parameter; returns whether such a system exists. If not, it stays unchanged.
    #[must_use]
    fn set_parameter(&mut self, which: Self::Parameter, value: f64) -> bool;

    /// The unit of a parameter, for messages; empty if it has none.
    fn unit(&self, _which: Self::Parameter) -> &'static str {
        ""
    }

    /// r.
    fn unbalance(&self, at: &Instant) -> Vector2<f64>;

    /// r and its derivatives by the motion.
    fn linearise(&self, at: &Instant) -> Linearisation;

    /// ∂r/∂p.
    fn by_parameter(&self, which: Self::Parameter, at: &Instant) -> Vector2<f64>;

    /// A typical stiffness (force per unit of x), positive: residuals are measured in it.
    fn stiffness_scale(&self) -> f64;

    /// The modes of the linear part, the slower first.
    fn modes(&self) -> [LinearMode; 2];
}
