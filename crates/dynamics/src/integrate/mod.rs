//! Fixed-step one-step methods for a mechanical system ([`Dynamics`]). No allocation; bounded work per step.
//!
//! A step from tₙ to tₙ + h evaluates the load ([`Excitation`]) at the times of its stages: a held command is the same
//! at all of them (zero-order hold), a sine is exact inside the step.

mod collocation;
mod double_double;
mod dynamics;
mod error;
pub(crate) mod explicit;
mod exponential;
mod gauss_legendre;
mod motion;
mod scheme;
pub(crate) mod tableau;

pub use dynamics::{Dynamics, Excitation, Jacobian, Rates, SolveStages, StageEquation, StageLoads, Wide};
pub use error::IntegrateError;
pub use motion::Motion;
pub use scheme::{Scheme, UnknownScheme};

use alloc::boxed::Box;

use collocation::Collocation;
use tableau::{DOP853, RK4};

/// The least ωh of the fastest mode that is accepted: below it rounding, 2⁻⁵³ of the state in every step, adds more
/// than 1e-7 to the damping ratio, and far below it no step changes anything.
const LEAST_PHASE_RAD: f64 = 1.0 / (1_u32 << 30) as f64;

/// A scheme with a valid step for a given system of N coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Integrator<const N: usize = 2> {
    scheme: Scheme,
    step_s: f64,
    method: Method<N>,
}

/// The constants of a scheme. The explicit ones have none beside their tableaus.
#[derive(Clone, Debug, PartialEq)]
enum Method<const N: usize> {
    Rk4,
    Dop853,
    TwoStages(Box<Collocation<2, N>>),
    ThreeStages(Box<Collocation<3, N>>),
    FourStages(Box<Collocation<4, N>>),
}

impl<const N: usize> Method<N> {
    fn new(scheme: Scheme, of: &impl Dynamics<N>, step_s: f64) -> Method<N> {
        match scheme {
            Scheme::Rk4 => Method::Rk4,
            Scheme::Dop853 => Method::Dop853,
            Scheme::Gl4 => Method::TwoStages(Box::new(gauss_legendre::GL4.collocation(of, step_s))),
            Scheme::Gl6 => Method::ThreeStages(Box::new(gauss_legendre::GL6.collocation(of, step_s))),
            Scheme::Exponential => {
                let nodes = gauss_legendre::GL6.nodes();
                Method::ThreeStages(Box::new(exponential::collocation(&nodes, 1.0, of, step_s)))
            }
            Scheme::Exponential8 => {
                let nodes = gauss_legendre::four_nodes();
                Method::FourStages(Box::new(exponential::collocation(&nodes, 0.5, of, step_s)))
            }
        }
    }
}

impl<const N: usize> Integrator<N> {
    /// Checks that the scheme is stable for `dynamics` at `rate_hz` steps a second, and computes what is constant.
    ///
    /// The exponential schemes take the linear part of `dynamics`; steps of another system keep the order, but are not
    /// exact in the linear part.
    ///
    /// # Errors
    /// [`IntegrateError::Rate`] if the rate is not a positive number, [`IntegrateError::RateTooLow`] with the lowest
    /// valid rate if the fastest mode needs a higher one, [`IntegrateError::RateTooHigh`] if rounding outweighs a
    /// step.
    pub fn new(scheme: Scheme, rate_hz: f64, dynamics: &impl Dynamics<N>) -> Result<Integrator<N>, IntegrateError> {
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(IntegrateError::Rate { got_hz: rate_hz });
        }
        let fastest_rad_s = dynamics.fastest_rad_s();
        // Whole hertz, so that a message states a rate that is accepted.
        let needed_hz = libm::ceil(fastest_rad_s / scheme.phase_limit_rad());
        if rate_hz < needed_hz {
            return Err(IntegrateError::RateTooLow { scheme, got_hz: rate_hz, needed_hz });
        }
        let most_hz = libm::floor(fastest_rad_s / LEAST_PHASE_RAD);
        if rate_hz > most_hz {
            return Err(IntegrateError::RateTooHigh { got_hz: rate_hz, most_hz });
        }
        let step_s = 1.0 / rate_hz;
        Ok(Integrator { scheme, step_s, method: Method::new(scheme, dynamics, step_s) })
    }

    /// The scheme by which it steps.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// The step h, s.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The motion one step after `motion`, which is at the time `t_s`.
    ///
    /// # Errors
    /// [`IntegrateError::NoConvergence`] or [`IntegrateError::Unbalanced`] if an implicit scheme can't make the step
    /// well even in 256 parts, [`IntegrateError::NotFinite`] if the result is not a number. The given motion stays
    /// unchanged.
    // Inlined, so that the state of a short step stays in registers from step to step.
    #[inline(always)]
    pub fn step<D: Dynamics<N>>(
        &self,
        dynamics: &D,
        t_s: f64,
        motion: &Motion<f64, N>,
        excitation: &impl Excitation<D::Load>,
    ) -> Result<Motion<f64, N>, IntegrateError> {
        let h_s = self.step_s;
        let acceleration = |t_s: f64, stage: &Motion<f64, N>| dynamics.rates(stage, &excitation.load(t_s)).acceleration;
        let next = match &self.method {
            Method::Rk4 => explicit::step(&RK4, h_s, t_s, motion, acceleration),
            Method::Dop853 => explicit::step(&DOP853, h_s, t_s, motion, acceleration),
            Method::TwoStages(method) => method.step(dynamics, t_s, motion, excitation)?,
            Method::ThreeStages(method) => method.step(dynamics, t_s, motion, excitation)?,
            Method::FourStages(method) => method.step(dynamics, t_s, motion, excitation)?,
        };
        if next.is_finite() { Ok(next) } else { Err(IntegrateError::NotFinite { t_s: t_s + h_s }) }
    }
}

#[cfg(test)]
mod tests;
