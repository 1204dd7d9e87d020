//! An excitation as a scenario states it.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::arm::Load;
use crate::number::short;

/// Most frequencies of a stepped sine: each is kept ready to be played.
const MOST_STEPS: u32 = 100_000;

/// What to play: a waveform, how strong, and how gently it starts and ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExcitationSpec {
    /// The load at the crest.
    pub amplitude: Amplitude,
    /// Length of the raised-cosine start and end, s, not negative. Sines only. A sudden start rings the arm's own modes,
    /// which take about a minute to die out.
    #[serde(default)]
    pub ramp_s: f64,
    /// The shape in time.
    pub profile: Waveform,
}

/// The load at the crest: forces at C or torques at the joints, not both, since one command carries one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Amplitude {
    /// Force at C along x, N.
    #[serde(skip_serializing_if = "is_zero")]
    pub force_x_n: f64,
    /// Force at C along y, N.
    #[serde(skip_serializing_if = "is_zero")]
    pub force_y_n: f64,
    /// Torque at joint 1, N·m.
    #[serde(skip_serializing_if = "is_zero")]
    pub torque1_nm: f64,
    /// Torque at joint 2, N·m.
    #[serde(skip_serializing_if = "is_zero")]
    pub torque2_nm: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl Amplitude {
    /// As a load on the arm.
    pub fn load(&self) -> Load {
        Load { torque_nm: [self.torque1_nm, self.torque2_nm].into(), force_n: [self.force_x_n, self.force_y_n].into() }
    }

    /// Whether the load is torques at the joints (else forces at C).
    pub fn is_torque(&self) -> bool {
        self.torque1_nm != 0.0 || self.torque2_nm != 0.0
    }
}

/// A shape in time, with a crest of 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "waveform", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Waveform {
    /// One sine.
    Dwell {
        /// Frequency, Hz, positive.
        frequency_hz: f64,
        /// Length, s, positive.
        duration_s: f64,
        /// How long to wait before the response is read, s.
        settle_s: f64,
    },
    /// A staircase of sines; every step is whole periods long, so that the phase runs on.
    SteppedSine {
        /// Frequency of the first step, Hz, positive.
        from_hz: f64,
        /// Frequency of the last step, Hz, positive; below `from_hz` for a downward sweep.
        to_hz: f64,
        /// Number of steps, at least 1.
        steps: u32,
        /// Least length of a step, s, positive; rounded up to whole periods.
        dwell_s: f64,
        /// How much of each step to wait before its response is read, s.
        settle_s: f64,
    },
    /// A sine whose frequency runs evenly in time.
    SweptSine {
        /// Frequency at the start, Hz, positive.
        from_hz: f64,
        /// Frequency at the end, Hz, positive.
        to_hz: f64,
        /// Length, s, positive.
        duration_s: f64,
    },
    /// A half-sine pulse, as of an impact hammer, and silence after it.
    Impulse {
        /// Length of the pulse, s, positive.
        pulse_s: f64,
        /// Length of pulse and silence together, s, at least `pulse_s`.
        duration_s: f64,
    },
}

/// What can't be played.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ExcitationError {
    /// A number is impossible.
    #[error("excitation: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Value {
        /// The value, as it is called in a scenario.
        name: &'static str,
        /// What was given.
        got: f64,
        /// What would do.
        expected: &'static str,
    },
    /// Nothing to play, or forces and torques at once.
    #[error("excitation: {0}")]
    Amplitude(&'static str),
    /// A step ends before its response can be read.
    #[error(
        "excitation: a step of {dwell_s:.3} s leaves no time to read its response after settling ({settle_s} s) and the \
         ramps ({ramp_s} s): make the step longer or the others shorter", settle_s = short(.settle_s), ramp_s = short(.ramp_s))]
    NoWindow {
        /// Length of the step, s.
        dwell_s: f64,
        /// Settling, s.
        settle_s: f64,
        /// Ramp, s.
        ramp_s: f64,
    },
    /// A frequency that the samples can't carry.
    #[error("excitation: {frequency_hz} Hz can't be told at {rate_hz} samples a second: it must be below half of that", frequency_hz = short(.frequency_hz), rate_hz = short(.rate_hz))]
    AboveNyquist {
        /// The highest frequency asked for, Hz.
        frequency_hz: f64,
        /// The sample rate, Hz.
        rate_hz: f64,
    },
}

fn positive(name: &'static str, got: f64) -> Result<(), ExcitationError> {
    if got.is_finite() && got > 0.0 {
        Ok(())
    } else {
        Err(ExcitationError::Value { name, got, expected: "a positive number" })
    }
}

fn not_negative(name: &'static str, got: f64) -> Result<(), ExcitationError> {
    if got.is_finite() && got >= 0.0 {
        Ok(())
    } else {
        Err(ExcitationError::Value { name, got, expected: "zero or a positive number" })
    }
}

impl ExcitationSpec {
    /// Checks every number; `rate_hz` is the sample rate at which it will be played.
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
    fn check(&self) -> Result<(), ExcitationError> {
        let values = [
            ("force_x_n", self.force_x_n),
            ("force_y_n", self.force_y_n),
            ("torque1_nm", self.torque1_nm),
            ("torque2_nm", self.torque2_nm),
        ];
        for (name, got) in values {
            if !got.is_finite() {
                return Err(ExcitationError::Value { name, got, expected: "a number" });
            }
        }
        let force = self.force_x_n != 0.0 || self.force_y_n != 0.0;
        match (force, self.is_torque()) {
            (true, true) => Err(ExcitationError::Amplitude(
                "forces and torques at once: a command carries one kind; set one of them to 0",
            )),
            (false, false) => Err(ExcitationError::Amplitude(
                "the amplitude is 0: set `force_x_n`, `force_y_n`, `torque1_nm` or `torque2_nm`",
            )),
            _ => Ok(()),
        }
    }
}

impl Waveform {
    /// Checks the numbers; the highest frequency in it, Hz.
    fn check(&self) -> Result<f64, ExcitationError> {
        match *self {
            Waveform::Dwell { frequency_hz, duration_s, settle_s } => {
                positive("frequency_hz", frequency_hz)?;
                positive("duration_s", duration_s)?;
                not_negative("settle_s", settle_s)?;
                Ok(frequency_hz)
            }
            Waveform::SteppedSine { from_hz, to_hz, steps, dwell_s, settle_s } => {
                positive("from_hz", from_hz)?;
                positive("to_hz", to_hz)?;
                if !(1..=MOST_STEPS).contains(&steps) {
                    let (got, expected) = (f64::from(steps), "from 1 to 100000");
                    return Err(ExcitationError::Value { name: "steps", got, expected });
                }
                positive("dwell_s", dwell_s)?;
                not_negative("settle_s", settle_s)?;
                Ok(from_hz.max(to_hz))
            }
            Waveform::SweptSine { from_hz, to_hz, duration_s } => {
                positive("from_hz", from_hz)?;
                positive("to_hz", to_hz)?;
                positive("duration_s", duration_s)?;
                Ok(from_hz.max(to_hz))
            }
            Waveform::Impulse { pulse_s, duration_s } => {
                positive("pulse_s", pulse_s)?;
                if duration_s.is_finite() && duration_s >= pulse_s {
                    Ok(0.5 / pulse_s)
                } else {
                    Err(ExcitationError::Value { name: "duration_s", got: duration_s, expected: "at least `pulse_s`" })
                }
            }
        }
    }
}
