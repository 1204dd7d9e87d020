//! Sequence of the periodic responses to hold: a load and a lag each, or one amplitude and a frequency each.

use core::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::LARGEST_AMPLITUDE;
use super::spec::{BAND, PhaseWalkError, PhaseWalkSpec, check, size};
use crate::control::cancellation::CancelHarmonics;
use crate::control::mode_model::{ModeModel, ModeNumber};
use crate::excitation::check_amplitude;
use crate::rig::Load;

/// Largest number of points, since each is stored.
const MOST_POINTS: usize = 10_000;

/// A stepped sine at which the response is controlled: at every frequency the load that holds one amplitude of the
/// followed coordinate, stable or not (T. Karaağaçlı, H. N. Özgüven, "Experimental Identification of Backbone Curves of
/// Strongly Nonlinear Systems by Using Response-Controlled Stepped-Sine Testing (RCT)", Vibration 3 (2020),
/// doi:10.3390/vibration3030019).
///
/// The followed coordinate is the displacement of accelerometer C along its motion in the mode, or that of B
/// where C moves less than a fifth as far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResponseControlSpec {
    /// Direction of the load, and the amplitude that is expected to suffice at every frequency: the exciter's reserve
    /// above it changes the response from one frequency to the next.
    pub amplitude: Load,
    /// Mode near whose frequency the sines are.
    #[serde(default)]
    pub mode_number: ModeNumber,
    /// Amplitude of the followed displacement at every frequency, m, above 0 and below 0.5.
    pub displacement_m: f64,
    /// First frequency, Hz, within a tenth of the mode's.
    pub from_hz: f64,
    /// Last frequency, Hz, with the same bounds; below the first for a sweep down.
    pub to_hz: f64,
    /// Number of frequencies, evenly spaced, from 3 to 10000.
    pub points: usize,
    /// Harmonics of the force in the head that are cancelled. A point settles only with each of them below 0.2
    /// % of the fundamental.
    #[serde(default, skip_serializing_if = "CancelHarmonics::is_none")]
    pub cancel_harmonics: CancelHarmonics,
}

/// Periodic responses to hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PhaseWalkPlan {
    /// Responses with given lags, at given loads.
    Walk(PhaseWalkSpec),
    /// Responses with one amplitude, at given frequencies.
    Response(ResponseControlSpec),
}

/// Target of one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wanted {
    /// Lag of the followed coordinate behind the load, rad, and amplitude of the load.
    Lag(f64, f64),
    /// Amplitude of the followed displacement, m, and angular frequency, rad/s.
    Amplitude(f64, f64),
}

impl From<PhaseWalkSpec> for PhaseWalkPlan {
    fn from(spec: PhaseWalkSpec) -> PhaseWalkPlan {
        PhaseWalkPlan::Walk(spec)
    }
}

impl From<ResponseControlSpec> for PhaseWalkPlan {
    fn from(spec: ResponseControlSpec) -> PhaseWalkPlan {
        PhaseWalkPlan::Response(spec)
    }
}

impl PhaseWalkPlan {
    pub(super) fn amplitude(&self) -> &Load {
        let (PhaseWalkPlan::Walk(PhaseWalkSpec { amplitude, .. })
        | PhaseWalkPlan::Response(ResponseControlSpec { amplitude, .. })) = self;
        amplitude
    }

    pub(super) fn mode_number(&self) -> ModeNumber {
        match self {
            PhaseWalkPlan::Walk(spec) => spec.mode_number,
            PhaseWalkPlan::Response(spec) => spec.mode_number,
        }
    }

    pub(super) fn points(&self) -> usize {
        let (PhaseWalkPlan::Walk(PhaseWalkSpec { points, .. })
        | PhaseWalkPlan::Response(ResponseControlSpec { points, .. })) = *self;
        points
    }

    pub(super) fn cancel_harmonics(&self) -> CancelHarmonics {
        match self {
            PhaseWalkPlan::Walk(spec) => spec.cancel_harmonics,
            PhaseWalkPlan::Response(spec) => spec.cancel_harmonics,
        }
    }

    /// Returns the largest amplitude of the load, N or N·m.
    pub(super) fn load(&self) -> f64 {
        size(self.amplitude())
    }

    /// Returns the largest load, by which the followed accelerometer is chosen, N or N·m. It is 0 in response
    /// control, where the amplitude is the same at every load.
    pub(super) fn largest_load(&self) -> f64 {
        match self {
            PhaseWalkPlan::Walk(_) => self.load(),
            PhaseWalkPlan::Response(_) => 0.0,
        }
    }

    /// Returns the load of amplitude 1.
    pub(super) fn unit_load(&self) -> Load {
        self.amplitude().scaled(1.0 / self.load())
    }

    /// Returns the target of a point.
    pub(super) fn wanted(&self, point: usize) -> Wanted {
        match self {
            PhaseWalkPlan::Walk(spec) => Wanted::Lag(spec.lag_rad(point), spec.load_at(point)),
            PhaseWalkPlan::Response(spec) => Wanted::Amplitude(spec.displacement_m, TAU * spec.frequency_hz(point)),
        }
    }

    /// Checks the numbers of the plan.
    pub(super) fn check(&self) -> Result<(), PhaseWalkError> {
        if self.amplitude().has_torque() && !self.cancel_harmonics().is_none() {
            return Err(PhaseWalkError::NoForce);
        }
        check_amplitude(self.amplitude())?;
        let points = self.points();
        check("points", points as f64, (3..=MOST_POINTS).contains(&points), "from 3 to 10000")?;
        match self {
            PhaseWalkPlan::Walk(spec) => spec.check(),
            PhaseWalkPlan::Response(spec) => spec.check(),
        }
    }

    /// Checks what depends on the mode.
    pub(super) fn check_mode(&self, model: &ModeModel) -> Result<(), PhaseWalkError> {
        // Only response control states frequencies. A walk finds its own, and is stopped by `BAND` while it
        // runs.
        let PhaseWalkPlan::Response(spec) = self else { return Ok(()) };
        let mode_hz = model.mode.angular_frequency_rad_s / TAU;
        for (name, got_hz) in [("from_hz", spec.from_hz), ("to_hz", spec.to_hz)] {
            // The loop's gain is computed for the mode's frequency and holds in a band around it.
            let within = (1.0 - BAND) * mode_hz..=(1.0 + BAND) * mode_hz;
            if !within.contains(&got_hz) {
                return Err(PhaseWalkError::Far { name, got_hz, mode_hz });
            }
        }
        Ok(())
    }
}

impl ResponseControlSpec {
    fn check(&self) -> Result<(), PhaseWalkError> {
        let is_valid = self.displacement_m > 0.0 && self.displacement_m < LARGEST_AMPLITUDE;
        check("displacement_m", self.displacement_m, is_valid, "above 0 and below 0.5")
    }

    fn frequency_hz(&self, point: usize) -> f64 {
        self.from_hz + (self.to_hz - self.from_hz) * (point as f64 / (self.points - 1) as f64)
    }
}
