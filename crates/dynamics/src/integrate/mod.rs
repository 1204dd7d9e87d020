//! Fixed-step one-step methods for the arm. No allocation; bounded work per step.
//!
//! A step from tₙ to tₙ + h evaluates the load ([`Excitation`]) at the times of its stages: a held command is the same
//! at all of them (zero-order hold), a sine is exact inside the step.

mod collocation;
mod dop853;
mod double_double;
mod error;
pub(crate) mod explicit;
mod exponential;
mod gauss_legendre;
mod scheme;

pub(crate) use dop853::DOP853;
pub use error::IntegrateError;
pub use scheme::{Scheme, UnknownScheme};

use alloc::boxed::Box;

use collocation::Collocation;
use explicit::Rk4Step;

use crate::arm::external::External;
use crate::arm::kernel::{Coefficients, Motion};
use crate::arm::{Arm, Load, State};

/// The load as a function of time.
pub trait Excitation {
    /// The load at the time `t_s`, s since the start of the simulation.
    fn load(&self, t_s: f64) -> Load;

    /// Whether the load is the same at all times, so that one evaluation is enough.
    fn is_constant(&self) -> bool {
        false
    }
}

/// A load held over the step.
impl Excitation for Load {
    fn load(&self, _t_s: f64) -> Load {
        *self
    }

    fn is_constant(&self) -> bool {
        true
    }
}

/// amplitude · sin(2πft): the excitation of Eqs. (31) and (32).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sine {
    /// The peak load.
    pub amplitude: Load,
    /// f, Hz.
    pub frequency_hz: f64,
}

impl Excitation for Sine {
    fn load(&self, t_s: f64) -> Load {
        self.amplitude.scaled(libm::sin(core::f64::consts::TAU * (self.frequency_hz * t_s)))
    }
}

/// The least ωh of the fastest mode that is accepted: below it rounding, 2⁻⁵³ of the state in every step, adds more
/// than 1e-7 to the damping ratio, and far below it no step changes anything.
const LEAST_PHASE_RAD: f64 = 1.0 / (1_u32 << 30) as f64;

/// A scheme with a valid step for a given arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Integrator {
    scheme: Scheme,
    step_s: f64,
    method: Method,
}

/// The constants of a scheme.
#[derive(Clone, Debug, PartialEq)]
enum Method {
    Rk4(Rk4Step<f64>),
    Dop853,
    TwoStages(Box<Collocation<2>>),
    ThreeStages(Box<Collocation<3>>),
    FourStages(Box<Collocation<4>>),
}

impl Method {
    fn new(scheme: Scheme, arm: &Arm, step_s: f64) -> Method {
        match scheme {
            Scheme::Rk4 => Method::Rk4(Rk4Step::new(step_s)),
            Scheme::Dop853 => Method::Dop853,
            Scheme::Gl4 => Method::TwoStages(Box::new(gauss_legendre::GL4.collocation(arm, step_s))),
            Scheme::Gl6 => Method::ThreeStages(Box::new(gauss_legendre::GL6.collocation(arm, step_s))),
            Scheme::Exponential => {
                let nodes = gauss_legendre::GL6.nodes();
                Method::ThreeStages(Box::new(exponential::collocation(&nodes, 1.0, arm, step_s)))
            }
            Scheme::Exponential8 => {
                let nodes = gauss_legendre::four_nodes();
                Method::FourStages(Box::new(exponential::collocation(&nodes, 0.5, arm, step_s)))
            }
        }
    }
}

impl Integrator {
    /// Checks that the scheme is stable for `arm` at `rate_hz` steps a second, and computes what is constant.
    ///
    /// The exponential schemes linearise `arm` at rest; steps of another arm keep the order, but are not exact in the
    /// linear part.
    ///
    /// # Errors
    /// [`IntegrateError::Rate`] if the rate is not a positive number, [`IntegrateError::RateTooLow`] with the lowest
    /// valid rate if the arm's second mode needs a higher one, [`IntegrateError::RateTooHigh`] if rounding outweighs a
    /// step.
    pub fn new(scheme: Scheme, rate_hz: f64, arm: &Arm) -> Result<Integrator, IntegrateError> {
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(IntegrateError::Rate { got_hz: rate_hz });
        }
        let fastest_rad_s = arm.angular_frequencies_rad_s()[1];
        let needed_hz = libm::ceil(fastest_rad_s / scheme.phase_limit_rad());
        if rate_hz < needed_hz {
            return Err(IntegrateError::RateTooLow { scheme, got_hz: rate_hz, needed_hz });
        }
        let most_hz = libm::floor(fastest_rad_s / LEAST_PHASE_RAD);
        if rate_hz > most_hz {
            return Err(IntegrateError::RateTooHigh { got_hz: rate_hz, most_hz });
        }
        let step_s = 1.0 / rate_hz;
        Ok(Integrator { scheme, step_s, method: Method::new(scheme, arm, step_s) })
    }

    /// The scheme.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// The step h, s.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The state one step after `state`, which is at the time `t_s`.
    ///
    /// # Errors
    /// [`IntegrateError::NoConvergence`] or [`IntegrateError::Unbalanced`] if an implicit scheme can't make the step
    /// well even in 256 parts, [`IntegrateError::NotFinite`] if the result is not a number. The given state stays
    /// unchanged.
    // Inlined, so that the state of a short step stays in registers from step to step.
    #[inline(always)]
    pub fn step(
        &self,
        arm: &Arm,
        t_s: f64,
        state: &State,
        excitation: &impl Excitation,
    ) -> Result<State, IntegrateError> {
        let h_s = self.step_s;
        let next = match &self.method {
            Method::Rk4(_) if arm.attachment().is_some() => {
                attached(&explicit::RK4, arm, (t_s, h_s), state, excitation)
            }
            Method::Dop853 if arm.attachment().is_some() => attached(&DOP853, arm, (t_s, h_s), state, excitation),
            Method::Rk4(h) => {
                let at = |part: f64| External::new(&arm.coefficients, &excitation.load(t_s + part * h_s));
                explicit::rk4_single(&arm.coefficients, h, &state.into(), &[at(0.0), at(0.5), at(1.0)])
            }
            Method::Dop853 => {
                let loads = DOP853.c.map(|part| excitation.load(t_s + part * h_s));
                dop853(&arm.coefficients, h_s, &state.into(), &loads)
            }
            Method::TwoStages(method) => Motion::from(&method.step(arm, t_s, state, excitation)?),
            Method::ThreeStages(method) => Motion::from(&method.step(arm, t_s, state, excitation)?),
            Method::FourStages(method) => Motion::from(&method.step(arm, t_s, state, excitation)?),
        };
        let next = State::from(next);
        if next.is_finite() { Ok(next) } else { Err(IntegrateError::NotFinite { t_s: t_s + h_s }) }
    }
}

/// A step of an explicit method of an arm with an attachment.
#[cold]
fn attached<const S: usize>(
    tableau: &explicit::Tableau<S>,
    arm: &Arm,
    (t_s, h_s): (f64, f64),
    state: &State,
    excitation: &impl Excitation,
) -> Motion<f64> {
    explicit::step_by(tableau, h_s, &state.into(), |i, stage| {
        let load = excitation.load(t_s + tableau.c[i] * h_s);
        arm.acceleration(&State::from(*stage), &load).into()
    })
}

// Once for all kinds of excitation.
#[inline(never)]
fn dop853(arm: &Coefficients<f64>, h_s: f64, motion: &Motion<f64>, loads: &[Load; 12]) -> Motion<f64> {
    let external = loads.each_ref().map(|load| External::new(arm, load));
    explicit::step(&DOP853, arm, h_s, motion, &external)
}

#[cfg(test)]
mod tests;
