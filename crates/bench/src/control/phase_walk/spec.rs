//! A phase walk as a scenario states it, and the gain of its loop.

use alloc::format;
use alloc::string::String;
use core::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::control::loop_poles::{self, Loop};
use crate::control::{CancelHarmonics, ModeModel, ModeNumber, NoSuchMode, SeenMode};
use crate::excitation::{Amplitude, ExcitationError};
use crate::rig::Sampling;
use resonarm_numeric::number::short;

/// Most points of a walk, since each is stored.
pub(super) const MOST_POINTS: usize = 10_000;
/// Least number of samples per period: harmonics up to the fifth are read.
const SAMPLES_A_PERIOD: f64 = 11.0;
/// Largest deviation of the frequency from the mode's, relative.
pub(super) const BAND: f64 = 0.1;
/// Bandwidth of the filter over the gain of the loop.
pub(super) const FILTER_RATE: f64 = 5.0;

/// A walk along a straight line in lag and load: the response at constant load, or the backbone at a lag of 90° and
/// growing load.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhaseWalkSpec {
    /// Amplitude and direction of the load at the last point.
    pub amplitude: Amplitude,
    /// The mode whose resonance is walked through.
    #[serde(default)]
    pub mode_number: ModeNumber,
    /// Number of points, from 3 to 10000.
    #[serde(default = "default_points")]
    pub points: usize,
    /// Load at the first point over that at the last, above 0, at most 1: by default the load is the same at every
    /// point.
    #[serde(default = "default_from_part", skip_serializing_if = "is_one")]
    pub from_part: f64,
    /// Lag of the response behind the load at the first point, degrees, above 0 and below `to_lag_deg`. Far below the
    /// resonance it is 0, in it 90. With growing load it may be the same as `to_lag_deg`.
    #[serde(default = "default_from_lag_deg")]
    pub from_lag_deg: f64,
    /// The same at the last point, degrees, below 180.
    #[serde(default = "default_to_lag_deg")]
    pub to_lag_deg: f64,
    /// Harmonics of the force in the head that are brought to zero: a point settles only with each below 0.2 % of the
    /// fundamental.
    #[serde(default, skip_serializing_if = "CancelHarmonics::is_none")]
    pub cancel_harmonics: CancelHarmonics,
}

fn default_points() -> usize {
    25
}

fn default_from_part() -> f64 {
    1.0
}

// serde prescribes the signature.
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

/// Why a walk is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum PhaseWalkError {
    /// The load is impossible.
    #[error("control.amplitude: {0}")]
    Amplitude(#[from] ExcitationError),
    /// A number is impossible.
    #[error("control: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Value {
        /// Name of the value in a scenario.
        name: &'static str,
        /// The given value.
        got: f64,
        /// The allowed values.
        expected: &'static str,
    },
    /// The structure does not have this mode.
    #[error("control: {0}")]
    NoSuchMode(#[from] NoSuchMode),
    /// There is no force with harmonics to cancel.
    #[error(
        "control: `cancel_harmonics` is closed on the impedance head, which reads no torque: leave it out, or give forces"
    )]
    NoForce,
    /// The load does not move the mode.
    #[error("control: this load does not drive mode {mode}: choose another direction")]
    NotDriven {
        /// The mode's number.
        mode: u8,
    },
    /// There are too few samples for the mode.
    #[error(
        "control: {rate_hz} samples a second are too few for a mode at {frequency_hz:.2} Hz: at least {} are needed",
        libm::ceil(SAMPLES_A_PERIOD * .frequency_hz), rate_hz = short(.rate_hz)
    )]
    Rate {
        /// Sample rate, Hz.
        rate_hz: f64,
        /// The mode's frequency, Hz.
        frequency_hz: f64,
    },
    /// A frequency is too far from the mode's: the loop has no model of the arm there.
    #[error(
        "control: `{name}` is {got_hz}: it must be within a tenth of the mode's {mode_hz:.2} Hz, from {:.2} to {:.2} Hz",
        (1.0 - BAND) * mode_hz, (1.0 + BAND) * mode_hz, got_hz = short(.got_hz)
    )]
    Far {
        /// Name of the value in a scenario.
        name: &'static str,
        /// The given value, Hz.
        got_hz: f64,
        /// The mode's frequency, Hz.
        mode_hz: f64,
    },
    /// The control loop would be unstable at every gain that was tried.
    #[error(
        "control: no gain makes the loop stable on mode {mode}{}; choose another direction of the load or a higher rate",
        .other_hz.map_or(String::new(), |hz| format!(" in this pose: the other mode, at {hz:.2} Hz, takes part"))
    )]
    Unstable {
        /// The mode's number.
        mode: u8,
        /// The frequency of the most prominent other mode, if there is one, Hz.
        other_hz: Option<f64>,
    },
}

/// Amplitude of a load, N or N·m.
pub(super) fn size(amplitude: &Amplitude) -> f64 {
    let load = amplitude.load();
    libm::hypot(load.force_n.norm(), load.torque_nm.norm())
}

impl PhaseWalkSpec {
    /// A walk through mode 1 with the default number of points and lags.
    pub fn new(amplitude: Amplitude) -> PhaseWalkSpec {
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

    /// The backbone of mode 1: motions that lag by 90° behind loads from a tenth of `amplitude` up to it.
    pub fn backbone(amplitude: Amplitude) -> PhaseWalkSpec {
        PhaseWalkSpec { from_part: 0.1, from_lag_deg: 90.0, to_lag_deg: 90.0, ..PhaseWalkSpec::new(amplitude) }
    }

    /// Amplitude of the load at the last point, N or N·m.
    pub fn load(&self) -> f64 {
        size(&self.amplitude)
    }

    /// Checks every number.
    pub(super) fn check(&self) -> Result<(), PhaseWalkError> {
        self.amplitude.check()?;
        let value = |name, got, expected| Err(PhaseWalkError::Value { name, got, expected });
        if !(3..=MOST_POINTS).contains(&self.points) {
            return value("points", self.points as f64, "from 3 to 10000");
        }
        if !(self.from_lag_deg > 0.0 && self.from_lag_deg < 180.0) {
            return value("from_lag_deg", self.from_lag_deg, "above 0 and below 180");
        }
        if !(self.from_part > 0.0 && self.from_part <= 1.0) {
            return value("from_part", self.from_part, "above 0 and at most 1");
        }
        let moves =
            self.to_lag_deg > self.from_lag_deg || (self.from_part < 1.0 && self.to_lag_deg == self.from_lag_deg);
        if !(moves && self.to_lag_deg < 180.0) {
            return value("to_lag_deg", self.to_lag_deg, "above `from_lag_deg` and below 180");
        }
        Ok(())
    }

    /// Position of point number `point` along the walk, 0 to 1.
    fn share(&self, point: usize) -> f64 {
        point as f64 / (self.points - 1) as f64
    }

    /// Lag at a point, rad.
    pub(super) fn lag_rad(&self, point: usize) -> f64 {
        (self.from_lag_deg + (self.to_lag_deg - self.from_lag_deg) * self.share(point)).to_radians()
    }

    /// Amplitude of the load at a point, N or N·m.
    pub(super) fn load_at(&self, point: usize) -> f64 {
        self.load() * (self.from_part + (1.0 - self.from_part) * self.share(point))
    }
}

/// The gain g of the loop on `model`, the mode of this number, 1/s.
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

/// The largest gain g for which the loop is stable with a margin, 1/s.
///
/// Tries g = 0.072 ω₀ 2^(−k/2): the filter's bandwidth 5 g is then a third of the frequency at most. The loop must be
/// stable with the command up to two samples late, and no motion may die out more slowly than at half the rate of the
/// slowest mode alone.
fn stable_gain_1_s(model: &ModeModel, sampling: &Sampling) -> Option<f64> {
    const LARGEST: f64 = 0.072;
    const TRIES: i32 = 12;
    const LATE: usize = 2;
    let omega_rad_s = model.mode.angular_frequency_rad_s;
    let decay_1_s = |mode: &SeenMode| mode.damping_ratio * mode.angular_frequency_rad_s;
    let alone = model.others().iter().map(decay_1_s).fold(decay_1_s(&model.mode), f64::min);
    let gains = (0..TRIES).map(|k| LARGEST * omega_rad_s * libm::exp2(-0.5 * f64::from(k)));
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
