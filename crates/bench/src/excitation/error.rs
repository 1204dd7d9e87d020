//! Errors of excitations, and the checks of their numbers.

use thiserror::Error;

use crate::rig::Load;
use resonarm_numeric::number::{rounded, short};

/// Largest number of samples that are stored: 70 minutes at 1 kHz.
const MOST_SAMPLES: u32 = 1 << 22;

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
        "excitation: a step of {dwell_s} s leaves no time to read the response after settling ({settle_s} s) and the \
         ramps ({ramp_s} s): make the step longer, or settling and ramps shorter", dwell_s = rounded(.dwell_s, 3), settle_s = short(.settle_s), ramp_s = short(.ramp_s))]
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
    #[error("excitation: `spectrum` goes from {before_hz} to {hz} Hz: its frequencies must increase", before_hz = short(.before_hz), hz = short(.hz))]
    BreakpointOrder {
        /// Frequency of a breakpoint, Hz.
        before_hz: f64,
        /// Frequency of the next, Hz.
        hz: f64,
    },
    /// The spectrum does not end where its band ends.
    #[error("excitation: `{name}` is {band_hz}, but the breakpoint of `spectrum` there is at {hz} Hz: they must be equal", band_hz = short(.band_hz), hz = short(.hz))]
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
    #[error(
        "excitation: the load file was not read: it is read only with a scenario file, from that file's folder; read the scenario from a file"
    )]
    FileNotRead,
    /// The load file has points closer than the samples, which would alias.
    #[error("excitation: the load file has points {step_s} s apart, closer than the samples ({period_s} s): filter it and resample it at the sample rate first", step_s = short(.step_s), period_s = short(.period_s))]
    FileTooDense {
        /// Time between the two points, s.
        step_s: f64,
        /// Sample period of the scenario, s.
        period_s: f64,
    },
    /// A frequency is too high for the sample rate.
    #[error("excitation: the frequency {frequency_hz} Hz is too high for the sample rate of {rate_hz} Hz: it must be below half of that", frequency_hz = short(.frequency_hz), rate_hz = short(.rate_hz))]
    AboveNyquist {
        /// Highest frequency of the excitation, Hz.
        frequency_hz: f64,
        /// Sample rate of the scenario, Hz.
        rate_hz: f64,
    },
}

/// Checks a number, whose key is `name`.
pub(super) fn check(
    name: &'static str,
    got: f64,
    is_valid: bool,
    expected: &'static str,
) -> Result<(), ExcitationError> {
    if is_valid { Ok(()) } else { Err(ExcitationError::Value { name, got, expected }) }
}

pub(super) fn positive(name: &'static str, got: f64) -> Result<(), ExcitationError> {
    check(name, got, got.is_finite() && got > 0.0, "a positive number")
}

pub(super) fn not_negative(name: &'static str, got: f64) -> Result<(), ExcitationError> {
    check(name, got, got.is_finite() && got >= 0.0, "zero or a positive number")
}

/// Returns the length `name` in samples, rounded up.
pub(super) fn samples(name: &'static str, length_s: f64, rate_hz: f64) -> Result<usize, ExcitationError> {
    let samples = libm::ceil(length_s * rate_hz);
    if samples >= 1.0 && samples <= f64::from(MOST_SAMPLES) {
        Ok(samples as usize)
    } else {
        Err(ExcitationError::Length { length: name, samples, most: MOST_SAMPLES })
    }
}

/// Checks a peak load: it is finite and not 0, and of one kind.
pub(crate) fn check_amplitude(amplitude: &Load) -> Result<(), ExcitationError> {
    for (name, got) in Load::NAMES.into_iter().zip(amplitude.parts()) {
        check(name, got, got.is_finite(), "a number")?;
    }
    match (amplitude.has_force(), amplitude.has_torque()) {
        (true, true) => Err(ExcitationError::Amplitude(
            "forces and torques are both given: a command carries only one kind; set the other to 0",
        )),
        (false, false) => Err(ExcitationError::Amplitude(
            "the amplitude is 0: set `exciter_x`, `exciter_y` or `exciter_z`, or a torque such as `joint1`",
        )),
        _ => Ok(()),
    }
}
