//! Excitations as a scenario states them.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Waveform;
use crate::rig::Load;
use resonarm_numeric::number::{rounded, short};

/// An excitation: a waveform, its amplitude, and the length of its ramps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExcitationSpec {
    /// Peak load, also of noise and files: no sample is larger.
    pub amplitude: Amplitude,
    /// Length of the raised-cosine ramps, s, not negative. With bursts each burst has them; an impulse has none. A
    /// sudden start rings the arm's modes, which take about a minute to die out.
    #[serde(default)]
    pub ramp_s: f64,
    /// Shape of the excitation in time.
    pub profile: Waveform,
}

/// Peak load: forces of the exciter or torques at the joints, not both, since one command carries one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Amplitude {
    /// Force of the exciter along x, N.
    #[serde(rename = "exciter_x", skip_serializing_if = "is_zero")]
    pub force_x_n: f64,
    /// Force of the exciter along y, N.
    #[serde(rename = "exciter_y", skip_serializing_if = "is_zero")]
    pub force_y_n: f64,
    /// Force of the exciter along z, N.
    #[serde(rename = "exciter_z", skip_serializing_if = "is_zero")]
    pub force_z_n: f64,
    /// Torque at joint 1, N·m.
    #[serde(rename = "joint1", skip_serializing_if = "is_zero")]
    pub torque1_nm: f64,
    /// Torque at joint 2, N·m.
    #[serde(rename = "joint2", skip_serializing_if = "is_zero")]
    pub torque2_nm: f64,
    /// Torque at joint 3, N·m.
    #[serde(rename = "joint3", skip_serializing_if = "is_zero")]
    pub torque3_nm: f64,
    /// Torque at joint 4, N·m.
    #[serde(rename = "joint4", skip_serializing_if = "is_zero")]
    pub torque4_nm: f64,
    /// Torque at joint 5, N·m.
    #[serde(rename = "joint5", skip_serializing_if = "is_zero")]
    pub torque5_nm: f64,
    /// Torque at joint 6, N·m.
    #[serde(rename = "joint6", skip_serializing_if = "is_zero")]
    pub torque6_nm: f64,
    /// Torque at joint 7, N·m.
    #[serde(rename = "joint7", skip_serializing_if = "is_zero")]
    pub torque7_nm: f64,
    /// Torque at joint 8, N·m.
    #[serde(rename = "joint8", skip_serializing_if = "is_zero")]
    pub torque8_nm: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Amplitude {
    /// The keys of a scenario, in the order of [`LOADS`](crate::structure::LOADS).
    pub const KEYS: [&str; Load::PARTS] = [
        "joint1",
        "joint2",
        "joint3",
        "joint4",
        "joint5",
        "joint6",
        "joint7",
        "joint8",
        "exciter_x",
        "exciter_y",
        "exciter_z",
    ];

    /// Returns the amplitude as a load on the structure.
    pub fn load(&self) -> Load {
        Load::from_parts(&[
            self.torque1_nm,
            self.torque2_nm,
            self.torque3_nm,
            self.torque4_nm,
            self.torque5_nm,
            self.torque6_nm,
            self.torque7_nm,
            self.torque8_nm,
            self.force_x_n,
            self.force_y_n,
            self.force_z_n,
        ])
    }

    /// Returns the unit of the load.
    pub fn unit(&self) -> &'static str {
        if self.is_torque() { "N·m" } else { "N" }
    }

    /// Returns whether the load is torques at the joints and not a force of the exciter.
    pub fn is_torque(&self) -> bool {
        self.load().torque_nm.iter().any(|part| *part != 0.0)
    }
}

/// Reason why an excitation can't be played.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ExcitationError {
    /// A number is outside its valid range.
    #[error("excitation: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Value {
        /// Key of the number.
        name: &'static str,
        /// Value that was given.
        got: f64,
        /// Valid values, in words.
        expected: &'static str,
    },
    /// The amplitude is zero, or has forces and torques at once.
    #[error("excitation: {0}")]
    Amplitude(&'static str),
    /// A step ends before its response can be read.
    #[error(
        "excitation: a step of {dwell_s} s leaves no time to read its response after settling ({settle_s} s) and the \
         ramps ({ramp_s} s): make the step longer or the others shorter", dwell_s = rounded(.dwell_s, 3), settle_s = short(.settle_s), ramp_s = short(.ramp_s))]
    NoWindow {
        /// Length of the step, s.
        dwell_s: f64,
        /// Time to wait before the response is read, s.
        settle_s: f64,
        /// Length of the ramp, s.
        ramp_s: f64,
    },
    /// The band contains no frequency that can be played.
    #[error(
        "excitation: no multiple of {spacing_hz} Hz is between {from_hz} and {to_hz} Hz: make the band wider, or `{length}` longer", spacing_hz = short(.spacing_hz), from_hz = short(.from_hz), to_hz = short(.to_hz))]
    NoLine {
        /// Lowest frequency of the band, Hz.
        from_hz: f64,
        /// Highest frequency of the band, Hz.
        to_hz: f64,
        /// Spacing of the possible frequencies, Hz.
        spacing_hz: f64,
        /// Key of the length that determines this spacing.
        length: &'static str,
    },
    /// The spectrum has too few or too many breakpoints.
    #[error(
        "excitation: the number of breakpoints of `spectrum` is {got}: it must be from 2 to {most}, each `[hz, level]`"
    )]
    Breakpoints {
        /// Number of breakpoints that was given.
        got: usize,
        /// Largest number of breakpoints.
        most: usize,
    },
    /// A level of the spectrum is not positive.
    #[error("excitation: the level of `spectrum` at {hz} Hz is {level}: it must be a positive number", hz = short(.hz), level = short(.level))]
    Level {
        /// Frequency of the breakpoint, Hz.
        hz: f64,
        /// Level that was given.
        level: f64,
    },
    /// The frequencies of the breakpoints do not increase.
    #[error("excitation: `spectrum` goes from {before_hz} to {hz} Hz: its frequencies must rise", before_hz = short(.before_hz), hz = short(.hz))]
    BreakpointOrder {
        /// Frequency of a breakpoint, Hz.
        before_hz: f64,
        /// Frequency of the next, Hz.
        hz: f64,
    },
    /// The spectrum does not end where its band ends.
    #[error("excitation: `{name}` is {band_hz}, and the breakpoint of `spectrum` there is at {hz} Hz: they must be the same", band_hz = short(.band_hz), hz = short(.hz))]
    BreakpointEnd {
        /// Key of the end of the band.
        name: &'static str,
        /// Frequency of that end, Hz.
        band_hz: f64,
        /// Frequency of the first or last breakpoint, Hz.
        hz: f64,
    },
    /// The excitation has more samples than can be stored.
    #[error("excitation: `{length}` is {samples} samples long: it must be from 1 to {most}", samples = rounded(.samples, 0))]
    Length {
        /// Key of the length.
        length: &'static str,
        /// Number of samples of that length.
        samples: f64,
        /// Largest number of samples.
        most: u32,
    },
    /// The load file has not been read.
    #[error("excitation: the load file was not read: it is read with a scenario file, from that file's folder")]
    FileNotRead,
    /// The load file has points closer than the samples, which would alias.
    #[error("excitation: the load file has points {step_s} s apart, closer than samples ({period_s} s): filter and thin it out to the sample rate before", step_s = short(.step_s), period_s = short(.period_s))]
    FileTooDense {
        /// Time between the two points, s.
        step_s: f64,
        /// Sample period of the scenario, s.
        period_s: f64,
    },
    /// A frequency is too high for the sample rate.
    #[error("excitation: {frequency_hz} Hz is too high for {rate_hz} samples a second: it must be below half of that", frequency_hz = short(.frequency_hz), rate_hz = short(.rate_hz))]
    AboveNyquist {
        /// Highest frequency of the excitation, Hz.
        frequency_hz: f64,
        /// Sample rate of the scenario, Hz.
        rate_hz: f64,
    },
}

pub(super) fn positive(name: &'static str, got: f64) -> Result<(), ExcitationError> {
    if got.is_finite() && got > 0.0 {
        Ok(())
    } else {
        Err(ExcitationError::Value { name, got, expected: "a positive number" })
    }
}

pub(super) fn not_negative(name: &'static str, got: f64) -> Result<(), ExcitationError> {
    if got.is_finite() && got >= 0.0 {
        Ok(())
    } else {
        Err(ExcitationError::Value { name, got, expected: "zero or a positive number" })
    }
}

impl ExcitationSpec {
    /// Checks the numbers; `rate_hz` is the sample rate at which the excitation will be played.
    pub(super) fn check(&self, rate_hz: f64) -> Result<(), ExcitationError> {
        positive("rate_hz", rate_hz)?;
        not_negative("ramp_s", self.ramp_s)?;
        self.amplitude.check()?;
        let highest_hz = self.profile.check()?;
        if highest_hz >= 0.5 * rate_hz {
            return Err(ExcitationError::AboveNyquist { frequency_hz: highest_hz, rate_hz });
        }
        Ok(())
    }
}

impl Amplitude {
    pub(crate) fn check(&self) -> Result<(), ExcitationError> {
        for (name, got) in Amplitude::KEYS.into_iter().zip(self.load().parts()) {
            if !got.is_finite() {
                return Err(ExcitationError::Value { name, got, expected: "a number" });
            }
        }
        let force = self.load().force_n.iter().any(|part| *part != 0.0);
        match (force, self.is_torque()) {
            (true, true) => Err(ExcitationError::Amplitude(
                "forces and torques at once: a command carries one kind; set one of them to 0",
            )),
            (false, false) => Err(ExcitationError::Amplitude(
                "the amplitude is 0: set `exciter_x`, `exciter_y`, `exciter_z`, or a torque, as `joint1`",
            )),
            _ => Ok(()),
        }
    }
}
