//! Doubts and warnings of the estimator in words, with the names of degrees of freedom.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use serde::Serialize;

use resonarm_modal::{Doubt, Warning};
use resonarm_numeric::number::rounded;

/// A doubt or a warning.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Remark {
    /// What it is, in one word for programs.
    pub reason: &'static str,
    /// What it is, with its numbers, for people.
    pub text: String,
}

/// Names of degrees of freedom; their numbers are their places.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Names(Vec<String>);

impl Names {
    /// Returns the number of a name, which gets one if it has none.
    pub fn number(&mut self, name: &str) -> usize {
        self.find(name).unwrap_or_else(|| {
            self.0.push(String::from(name));
            self.0.len() - 1
        })
    }

    pub fn find(&self, name: &str) -> Option<usize> {
        self.0.iter().position(|known| known == name)
    }

    pub fn of(&self, number: usize) -> String {
        self.0.get(number).cloned().unwrap_or_default()
    }
}

/// States a doubt: why no deviations are stated.
pub(super) fn of_doubt(doubt: &Doubt, names: &Names) -> Remark {
    let (reason, text) = match doubt {
        Doubt::AboveInstrument { dof, is_reference, ratio, others } => {
            let what = if *is_reference { "force" } else { "acceleration" };
            let at = names.of(*dof);
            let others = match others {
                0 => String::new(),
                1 => String::from(", and that of another reading is above 1.5 times"),
                count => format!(", and those of {count} other readings are above 1.5 times"),
            };
            (
                "above-instrument",
                format!(
                    "the residual of the {what} at {at} is {ratio:.1} times the noise of its instrument{others}: the structure \
                     did not vibrate linearly (reduce the force), or a mode is missing"
                ),
            )
        }
        Doubt::NotWhite { frequency_hz, ratio } => (
            "not-white",
            format!(
                "the residual at {frequency_hz:.2} Hz is {ratio:.1} times its median: a mode is missing there, or the structure \
                 did not vibrate linearly (reduce the force)"
            ),
        ),
        Doubt::Uncertain { ratio } => (
            "uncertain",
            format!("its damping ratio is uncertain by {} %: record for longer", rounded(&(100.0 * ratio), 0)),
        ),
        Doubt::TooShort { lines } => (
            "too-short",
            format!(
                "its half-power bandwidth has {lines:.2} lines of the spectrum, but at least 0.3 are needed: record for longer"
            ),
        ),
        Doubt::NoisyReference { dof, share } => (
            "force-in-noise",
            format!(
                "noise is {} % of the power of the force at {} there, more than 1 %: raise the force, or excite for longer",
                rounded(&(100.0 * share), 1),
                names.of(*dof)
            ),
        ),
        Doubt::Close { frequency_hz, distance } => (
            "close",
            format!(
                "the mode at {frequency_hz:.3} Hz is {distance:.1} standard deviations away, less than 2: record for longer, or \
                 excite another point"
            ),
        ),
        Doubt::Nonlinear { z } => (
            "nonlinear",
            format!("the structure is not linear: between the levels a mode shifts by {z:.1} standard deviations"),
        ),
    };
    Remark { reason, text }
}

/// Returns the remark that states a warning, with the names of channels and modes.
pub(super) fn of_warning(warning: &Warning, names: &Names) -> Remark {
    let (reason, text) = match warning {
        Warning::Complex { collinearity, phase_deviation_deg } => (
            "complex-shape",
            format!(
                "its shape is complex (modal phase collinearity {collinearity:.3}, mean phase deviation {phase_deviation_deg:.1}°): \
                 the damping couples modes, or the mode is one of noise"
            ),
        ),
        Warning::DrivingPoint { dof, phase_deg } => (
            "driving-point",
            format!(
                "the acceleration at {} is opposite to the force (phase {phase_deg:.0}°), so the scale of its shape is wrong: check \
                 the signs of the sensors, and whether both are at one point",
                names.of(*dof)
            ),
        ),
    };
    Remark { reason, text }
}
