//! Control laws as a scenario states them.

use alloc::boxed::Box;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Controller;
use super::force_control::{ForceControl, ForceControlError, ForceControlSpec};
use super::mode_model::Modelled;
use super::phase_walk::{PhaseWalk, PhaseWalkError, PhaseWalkSpec, ResponseControlSpec};
use super::test_control::{TestControlError, TestControlSpec, TestController, TestLaw};
use crate::rig::{Load, Sampling};

/// Control law of the exciter, with its settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "law", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ControlSpec {
    /// Traces the response at constant load through a resonance, stable or not, or the backbone.
    PhaseWalk(PhaseWalkSpec),
    /// Plays a dwell or a staircase of sines, and brings the fundamental of the force in the impedance head to
    /// its amplitude.
    ForceControl(ForceControlSpec),
    /// Steps a sine, and finds the load that holds one amplitude of the response at every frequency.
    ResponseControl(ResponseControlSpec),
    /// Controls a random test by its specification.
    Random(TestControlSpec),
    /// Controls a swept sine by its specification.
    SweptSine(TestControlSpec),
    /// Plays shocks by their specification.
    Shock(TestControlSpec),
}

/// Reason why a controller can't be built.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ControlError {
    /// The phase walk or the response control is not possible.
    #[error(transparent)]
    PhaseWalk(#[from] PhaseWalkError),
    /// The force control is not possible.
    #[error(transparent)]
    ForceControl(#[from] ForceControlError),
    /// The test can't be controlled.
    #[error(transparent)]
    Test(#[from] TestControlError),
}

impl ControlSpec {
    /// Returns the amplitude of the largest load that the law is meant to hold.
    pub fn amplitude(&self) -> &Load {
        match self {
            ControlSpec::PhaseWalk(spec) => &spec.amplitude,
            ControlSpec::ForceControl(spec) => &spec.amplitude,
            ControlSpec::ResponseControl(spec) => &spec.amplitude,
            ControlSpec::Random(spec) | ControlSpec::SweptSine(spec) | ControlSpec::Shock(spec) => &spec.amplitude,
        }
    }

    /// Returns the law and its settings if a test is controlled by a specification.
    pub fn test(&self) -> Option<(TestLaw, &TestControlSpec)> {
        match self {
            ControlSpec::Random(spec) => Some((TestLaw::Random, spec)),
            ControlSpec::SweptSine(spec) => Some((TestLaw::SweptSine, spec)),
            ControlSpec::Shock(spec) => Some((TestLaw::Shock, spec)),
            ControlSpec::PhaseWalk(_) | ControlSpec::ForceControl(_) | ControlSpec::ResponseControl(_) => None,
        }
    }

    /// Returns the settings if a test is controlled by a specification, to hand over what was read.
    pub fn test_mut(&mut self) -> Option<&mut TestControlSpec> {
        match self {
            ControlSpec::Random(spec) | ControlSpec::SweptSine(spec) | ControlSpec::Shock(spec) => Some(spec),
            ControlSpec::PhaseWalk(_) | ControlSpec::ForceControl(_) | ControlSpec::ResponseControl(_) => None,
        }
    }

    /// Builds the controller for the modelled structure, with readings at this `sampling` and an exciter with
    /// the limit `limit`, N or N·m. A test needs no model of the structure: [`TestController::new`] builds its controller.
    ///
    /// # Errors
    /// [`ControlError`] names the impossible setting.
    pub fn controller(
        &self,
        of: Modelled<'_>,
        sampling: Sampling,
        limit: f64,
    ) -> Result<Box<dyn Controller>, ControlError> {
        let test = |law, spec| -> Result<Box<dyn Controller>, ControlError> {
            Ok(Box::new(TestController::new(law, spec, sampling.rate_hz, limit, of.c_is_driven)?))
        };
        Ok(match self {
            ControlSpec::PhaseWalk(spec) => Box::new(PhaseWalk::new(*spec, of, sampling, limit)?),
            ControlSpec::ForceControl(spec) => Box::new(ForceControl::new(spec, of, sampling, limit)?),
            ControlSpec::ResponseControl(spec) => Box::new(PhaseWalk::new(*spec, of, sampling, limit)?),
            ControlSpec::Random(spec) => test(TestLaw::Random, spec)?,
            ControlSpec::SweptSine(spec) => test(TestLaw::SweptSine, spec)?,
            ControlSpec::Shock(spec) => test(TestLaw::Shock, spec)?,
        })
    }
}
