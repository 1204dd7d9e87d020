//! A control law as a scenario states it.

use alloc::boxed::Box;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{
    Controller, ForceControl, ForceControlError, ForceControlSpec, Modelled, PhaseWalk, PhaseWalkError, PhaseWalkSpec,
    ResponseControlSpec,
};
use crate::excitation::Amplitude;
use crate::rig::Sampling;

/// The control law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "law", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ControlSpec {
    /// Traces the response at constant load through a resonance, stable or not, or the backbone.
    PhaseWalk(PhaseWalkSpec),
    /// Plays a dwell or a staircase of sines, and brings the fundamental of the force in the impedance head to its
    /// amplitude.
    ForceControl(ForceControlSpec),
    /// Steps a sine, and finds the load that holds one amplitude of the response at every frequency.
    ResponseControl(ResponseControlSpec),
}

/// Why a controller can't be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ControlError {
    /// An error of the phase walk.
    #[error(transparent)]
    PhaseWalk(#[from] PhaseWalkError),
    /// An error of the force control.
    #[error(transparent)]
    ForceControl(#[from] ForceControlError),
}

impl ControlSpec {
    /// Amplitude of the largest load that it is meant to hold.
    pub fn amplitude(&self) -> &Amplitude {
        match self {
            ControlSpec::PhaseWalk(spec) => &spec.amplitude,
            ControlSpec::ForceControl(spec) => &spec.amplitude,
            ControlSpec::ResponseControl(spec) => &spec.amplitude,
        }
    }

    /// The controller for a structure as it is modelled, with readings at this `sampling` and an exciter with the limit
    /// `limit`, N or N·m.
    ///
    /// # Errors
    /// [`ControlError`] names the impossible setting.
    pub fn controller(
        &self,
        of: Modelled<'_>,
        sampling: Sampling,
        limit: f64,
    ) -> Result<Box<dyn Controller>, ControlError> {
        Ok(match self {
            ControlSpec::PhaseWalk(spec) => Box::new(PhaseWalk::new(*spec, of, sampling, limit)?),
            ControlSpec::ForceControl(spec) => Box::new(ForceControl::new(spec, of, sampling, limit)?),
            ControlSpec::ResponseControl(spec) => Box::new(PhaseWalk::at_one_amplitude(*spec, of, sampling, limit)?),
        })
    }
}
