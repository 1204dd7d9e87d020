//! The sequence of wanted motions: a load and a lag each, or one amplitude and a frequency each.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::spec::{BAND, MOST_POINTS, PhaseWalkSpec, size};
use super::{LARGEST_AMPLITUDE, PhaseWalkError};
use crate::control::{CancelHarmonics, ModeModel, ModeNumber};
use crate::excitation::Amplitude;
use resonarm_dynamics::arm::Load;

/// A stepped sine at which the response is controlled: at every frequency the load that holds one amplitude of the
/// followed coordinate, stable or not (T. Karaağaçlı, H. N. Özgüven, "Experimental Identification of Backbone Curves of
/// Strongly Nonlinear Systems by Using Response-Controlled Stepped-Sine Testing (RCT)", Vibration 3 (2020),
/// doi:10.3390/vibration3030019).
///
/// Of the arm the followed coordinate is the angle α1, or α1 + α2 where in the mode's shape link 1 turns less than a
/// fifth as far as link 2; of another structure it is the displacement of accelerometer C, or of B where C moves less
/// than a fifth as far ([`Followed`](crate::control::Followed)).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResponseControlSpec {
    /// Direction of the load, and the amplitude that is expected to suffice at every frequency: the exciter's reserve
    /// above it changes the response from one frequency to the next.
    pub amplitude: Amplitude,
    /// The mode near whose frequency the sines are.
    #[serde(default)]
    pub mode_number: ModeNumber,
    /// Amplitude of the followed angle at every frequency, rad, above 0 and below 0.5: of the arm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle_rad: Option<f64>,
    /// Amplitude of the followed displacement at every frequency, m, above 0 and below 0.5: of another structure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub displacement_m: Option<f64>,
    /// First frequency, Hz, within a tenth of the mode's.
    pub from_hz: f64,
    /// Last frequency, Hz, with the same bounds; below the first for a sweep down.
    pub to_hz: f64,
    /// Number of frequencies, evenly spaced, from 3 to 10000.
    pub points: usize,
    /// Harmonics of the force in the head that are brought to zero: a point settles only with each below 0.2 % of the
    /// fundamental.
    #[serde(default, skip_serializing_if = "CancelHarmonics::is_none")]
    pub cancel_harmonics: CancelHarmonics,
}

/// The motions to hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Plan {
    /// Motions of given lags, at given loads.
    Walk(PhaseWalkSpec),
    /// Motions of one amplitude, at given frequencies.
    Response(ResponseControlSpec),
}

/// The wanted motion of one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wanted {
    /// This lag of the followed coordinate behind the load, rad, and this amplitude of the load.
    Lag(f64, f64),
    /// This amplitude of the followed coordinate, rad or m, and this angular frequency, rad/s.
    Amplitude(f64, f64),
}

impl Plan {
    pub fn amplitude(&self) -> &Amplitude {
        match self {
            Plan::Walk(spec) => &spec.amplitude,
            Plan::Response(spec) => &spec.amplitude,
        }
    }

    pub fn mode_number(&self) -> ModeNumber {
        match self {
            Plan::Walk(spec) => spec.mode_number,
            Plan::Response(spec) => spec.mode_number,
        }
    }

    pub fn points(&self) -> usize {
        match self {
            Plan::Walk(spec) => spec.points,
            Plan::Response(spec) => spec.points,
        }
    }

    pub fn cancel_harmonics(&self) -> CancelHarmonics {
        match self {
            Plan::Walk(spec) => spec.cancel_harmonics,
            Plan::Response(spec) => spec.cancel_harmonics,
        }
    }

    /// The largest amplitude of the load at a point, N or N·m.
    pub fn load(&self) -> f64 {
        size(self.amplitude())
    }

    /// The load of amplitude 1.
    pub fn unit_load(&self) -> Load {
        self.amplitude().load().scaled(1.0 / self.load())
    }

    /// The wanted motion of point number `point`.
    pub fn wanted(&self, point: usize) -> Wanted {
        match self {
            Plan::Walk(spec) => Wanted::Lag(spec.lag_rad(point), spec.load_at(point)),
            Plan::Response(spec) => Wanted::Amplitude(spec.response(), TAU * spec.frequency_hz(point)),
        }
    }

    /// Checks every number.
    pub fn check(&self) -> Result<(), PhaseWalkError> {
        if self.amplitude().is_torque() && !self.cancel_harmonics().is_none() {
            return Err(PhaseWalkError::NoForce);
        }
        match self {
            Plan::Walk(spec) => spec.check(),
            Plan::Response(spec) => spec.check(),
        }
    }

    /// Checks what depends on the mode.
    pub fn check_mode(&self, model: &ModeModel) -> Result<(), PhaseWalkError> {
        let Plan::Response(spec) = self else { return Ok(()) };
        let (what, expected) = match model.followed.is_angle() {
            true => ("the angle of a link", "angle_rad"),
            false => ("the displacement of a point", "displacement_m"),
        };
        let got = spec.stated().first().map(|(name, _)| *name);
        if got != Some(expected) {
            return Err(PhaseWalkError::Followed { what, expected, got });
        }
        let mode_hz = model.mode.angular_frequency_rad_s / TAU;
        for (name, got_hz) in [("from_hz", spec.from_hz), ("to_hz", spec.to_hz)] {
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
        self.amplitude.check()?;
        let value = |name, got, expected| Err(PhaseWalkError::Value { name, got, expected });
        if !(3..=MOST_POINTS).contains(&self.points) {
            return value("points", self.points as f64, "from 3 to 10000");
        }
        if let [_, (name, got)] = self.stated()[..] {
            return value(name, got, "left out beside `angle_rad`");
        }
        match self.stated().into_iter().find(|(_, got)| !(*got > 0.0 && *got < LARGEST_AMPLITUDE)) {
            Some((name, got)) => value(name, got, "above 0 and below 0.5"),
            None => Ok(()),
        }
    }

    /// The amplitudes that are given, with their names in a scenario.
    fn stated(&self) -> Vec<(&'static str, f64)> {
        let both = [("angle_rad", self.angle_rad), ("displacement_m", self.displacement_m)];
        both.into_iter().filter_map(|(name, amplitude)| Some((name, amplitude?))).collect()
    }

    /// The amplitude of the followed coordinate; NaN if none is given.
    fn response(&self) -> f64 {
        self.response_with_unit().map_or(f64::NAN, |(amplitude, _)| amplitude)
    }

    /// The amplitude of the followed coordinate with its unit, rad or m, if one is given.
    pub fn response_with_unit(&self) -> Option<(f64, &'static str)> {
        let angle = self.angle_rad.map(|angle_rad| (angle_rad, "rad"));
        angle.or(self.displacement_m.map(|displacement_m| (displacement_m, "m")))
    }

    fn frequency_hz(&self, point: usize) -> f64 {
        self.from_hz + (self.to_hz - self.from_hz) * (point as f64 / (self.points - 1) as f64)
    }
}
