//! A phase walk as a scenario states it, and the gain of its loop.

use alloc::format;
use alloc::string::String;
use core::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::control::cancellation::CancelHarmonics;
use crate::control::loop_poles::{self, Loop};
use crate::control::mode_model::{ModeModel, ModeNumber, NoSuchMode, SeenMode};
use crate::excitation::ExcitationError;
use crate::rig::{Load, Sampling};
use resonarm_numeric::number::short;

/// Least number of samples per period, since harmonics up to the fifth are read.
const SAMPLES_A_PERIOD: f64 = 11.0;
/// Largest relative deviation of the frequency from that of the mode.
pub(super) const BAND: f64 = 0.1;
/// Ratio of the filter's bandwidth to the gain of the loop.
pub(super) const FILTER_RATE: f64 = 5.0;

/// A walk along a straight line in lag and load: the response at constant load, or the backbone at a lag of 90°
/// and growing load.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhaseWalkSpec {
    /// Amplitude and direction of the load at the last point.
    pub amplitude: Load,
    /// Mode whose resonance is traversed.
    #[serde(default)]
    pub mode_number: ModeNumber,
    /// Number of points, from 3 to 10000.
    #[serde(default = "default_points")]
    pub points: usize,
    /// Load at the first point over that at the last, above 0, at most 1. By default the load is constant.
    #[serde(default = "default_from_part", skip_serializing_if = "is_one")]
    pub from_part: f64,
    /// Lag of the response behind the load at the first point, degrees, above 0 and below `to_lag_deg`. Far
    /// below the resonance the lag is 0, at the resonance 90. With growing load it may equal `to_lag_deg`.
    #[serde(default = "default_from_lag_deg")]
    pub from_lag_deg: f64,
    /// Lag at the last point, degrees, below 180.
    #[serde(default = "default_to_lag_deg")]
    pub to_lag_deg: f64,
    /// Harmonics of the force in the head that are cancelled. A point settles only with each of them below 0.2
    /// % of the fundamental.
    #[serde(default, skip_serializing_if = "CancelHarmonics::is_none")]
    pub cancel_harmonics: CancelHarmonics,
}

fn default_points() -> usize {
    25
}

fn default_from_part() -> f64 {
    1.0
}

// serde requires a reference in this signature.
#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

fn default_from_lag_deg() -> f64 {
    10.0
}

fn default_to_lag_deg() -> f64 {
    170.0
}

/// Reason why a walk is not possible.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum PhaseWalkError {
    /// The amplitude of the load is not valid.
    #[error("control.amplitude: {0}")]
    Amplitude(#[from] ExcitationError),
    /// A number is outside its valid range.
    #[error("control: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Value {
        /// Key of the number.
        name: &'static str,
        /// Value that was given.
        got: f64,
        /// Valid values, in words.
        expected: &'static str,
    },
    /// The structure does not have this mode, or the mode has no resonance.
    #[error("control: {0}")]
    NoSuchMode(#[from] NoSuchMode),
    /// Harmonics are to be cancelled, and the load is a torque.
    #[error(
        "control: `cancel_harmonics` uses the impedance head, which measures no torque: leave it out, or give forces"
    )]
    NoForce,
    /// The load does not drive the mode.
    #[error("control: this load does not drive mode {mode}: choose another direction")]
    NotDriven {
        /// Number of the mode, from 1.
        mode: u8,
    },
    /// The sample rate is too low for the mode.
    #[error(
        "control: the sample rate of {rate_hz} Hz is too low for a mode at {frequency_hz:.2} Hz: it must be at least {} Hz",
        libm::ceil(SAMPLES_A_PERIOD * .frequency_hz), rate_hz = short(.rate_hz)
    )]
    Rate {
        /// Sample rate that was given, Hz.
        rate_hz: f64,
        /// Frequency of the mode, Hz.
        frequency_hz: f64,
    },
    /// A frequency is too far from that of the mode, where the loop has no model of the arm.
    #[error(
        "control: `{name}` is {got_hz}: it must be within a tenth of the mode's {mode_hz:.2} Hz, from {:.2} to {:.2} Hz",
        (1.0 - BAND) * mode_hz, (1.0 + BAND) * mode_hz, got_hz = short(.got_hz)
    )]
    Far {
        /// Key of the frequency.
        name: &'static str,
        /// Value that was given, Hz.
        got_hz: f64,
        /// Frequency of the mode, Hz.
        mode_hz: f64,
    },
    /// The control loop is unstable at every gain that was tried.
    #[error(
        "control: no gain stabilises the control loop on mode {mode}{}; choose another direction of the load or a higher rate",
        .other_hz.map_or(String::new(), |hz| format!(" in this pose: the other mode, at {hz:.2} Hz, takes part"))
    )]
    Unstable {
        /// Number of the mode, from 1.
        mode: u8,
        /// Frequency of the most prominent other mode, Hz, if there is one.
        other_hz: Option<f64>,
    },
}

/// Checks a number, whose key is `name`.
pub(super) fn check(
    name: &'static str,
    got: f64,
    is_valid: bool,
    expected: &'static str,
) -> Result<(), PhaseWalkError> {
    if is_valid { Ok(()) } else { Err(PhaseWalkError::Value { name, got, expected }) }
}

/// Returns the amplitude of a load, N or N·m.
pub(super) fn size(amplitude: &Load) -> f64 {
    // One of the two is zero, as `check_amplitude` requires, so that the sum of unlike units is never formed.
    libm::hypot(amplitude.force_n.norm(), amplitude.torque_nm.norm())
}

impl PhaseWalkSpec {
    /// Returns a walk through mode 1 with the default number of points and lags.
    pub fn new(amplitude: Load) -> PhaseWalkSpec {
        PhaseWalkSpec {
            amplitude,
            mode_number: ModeNumber::default(),
            points: default_points(),
            from_part: default_from_part(),
            from_lag_deg: default_from_lag_deg(),
            to_lag_deg: default_to_lag_deg(),
            cancel_harmonics: CancelHarmonics::NONE,
        }
    }

    /// Returns the backbone of mode 1: responses at a lag of 90° to loads from a tenth of `amplitude` up to it.
    pub fn backbone(amplitude: Load) -> PhaseWalkSpec {
        PhaseWalkSpec { from_part: 0.1, from_lag_deg: 90.0, to_lag_deg: 90.0, ..PhaseWalkSpec::new(amplitude) }
    }

    /// Returns the amplitude of the load at the last point, N or N·m.
    pub fn load(&self) -> f64 {
        size(&self.amplitude)
    }

    /// Checks the lags and the loads of the walk.
    pub(super) fn check(&self) -> Result<(), PhaseWalkError> {
        let PhaseWalkSpec { from_part, from_lag_deg, to_lag_deg, .. } = *self;
        check("from_lag_deg", from_lag_deg, from_lag_deg > 0.0 && from_lag_deg < 180.0, "above 0 and below 180")?;
        check("from_part", from_part, from_part > 0.0 && from_part <= 1.0, "above 0 and at most 1")?;
        // A walk must go somewhere: the lag grows, or the load does at a constant lag.
        let moves = to_lag_deg > from_lag_deg || (from_part < 1.0 && to_lag_deg == from_lag_deg);
        check("to_lag_deg", to_lag_deg, moves && to_lag_deg < 180.0, "above `from_lag_deg` and below 180")
    }

    /// Returns the position of a point along the walk, 0 to 1.
    fn share(&self, point: usize) -> f64 {
        point as f64 / (self.points - 1) as f64
    }

    /// Returns the lag at a point, rad.
    pub(super) fn lag_rad(&self, point: usize) -> f64 {
        (self.from_lag_deg + (self.to_lag_deg - self.from_lag_deg) * self.share(point)).to_radians()
    }

    /// Returns the amplitude of the load at a point, N or N·m.
    pub(super) fn load_at(&self, point: usize) -> f64 {
        self.load() * (self.from_part + (1.0 - self.from_part) * self.share(point))
    }
}

/// Returns the gain g of the loop for this mode, 1/s.
pub(super) fn gain_1_s(model: &ModeModel, mode_number: ModeNumber, sampling: &Sampling) -> Result<f64, PhaseWalkError> {
    let rate_hz = sampling.rate_hz;
    let mode = u8::from(mode_number);
    let frequency_hz = model.mode.angular_frequency_rad_s / TAU;
    if !model.mode.modal_mass.is_finite() {
        return Err(PhaseWalkError::NotDriven { mode });
    }
    if rate_hz < SAMPLES_A_PERIOD * frequency_hz {
        return Err(PhaseWalkError::Rate { rate_hz, frequency_hz });
    }
    let other_hz = model.others().first().map(|other| other.angular_frequency_rad_s / TAU);
    stable_gain_1_s(model, sampling).ok_or(PhaseWalkError::Unstable { mode, other_hz })
}

/// Returns the largest gain g for which the loop is stable with a margin, 1/s.
///
/// Tries g = 0.072 ω₀ 2^(−k/2), the largest first; the filter's bandwidth 5 g is then at most a third of the
/// frequency. The loop must be stable with the command up to two samples late, and no motion may decay more
/// slowly than at half the rate of the slowest mode alone.
fn stable_gain_1_s(model: &ModeModel, sampling: &Sampling) -> Option<f64> {
    const LARGEST: f64 = 0.072;
    const TRIES: i32 = 12;
    const LATE: usize = 2;
    let omega_rad_s = model.mode.angular_frequency_rad_s;
    let decay_1_s = |mode: &SeenMode| mode.damping_ratio * mode.angular_frequency_rad_s;
    // No loop makes the other modes decay faster than they do alone, so half of the slowest is asked of the
    // whole.
    let alone = model.others().iter().map(decay_1_s).fold(decay_1_s(&model.mode), f64::min);
    let gains = (0..TRIES).map(|k| LARGEST * omega_rad_s * libm::exp2(-0.5 * f64::from(k)));
    // Steps of √2 from the largest gain down: the first stable one is within a factor of √2 of the best.
    gains.into_iter().find(|gain_1_s| {
        (0..=LATE).all(|delay| {
            let control = Loop {
                model: *model,
                sampling: *sampling,
                adaptation: FILTER_RATE * gain_1_s / sampling.rate_hz,
                gain_1_s: *gain_1_s,
                omega_rad_s,
                delay,
            };
            loop_poles::slowest_decay_1_s(&control) > 0.5 * alone
        })
    })
}
