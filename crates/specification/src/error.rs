//! Errors of specifications and of verdicts.

use alloc::string::String;

use thiserror::Error;

use resonarm_modal::spectra::SpectraError;
use resonarm_numeric::number::{rounded, short};

/// Place of a value in the file of a specification.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("[{section}] `{key}`")]
pub struct Place {
    /// Section of the file.
    pub section: &'static str,
    /// Key of the value, or of the list.
    pub key: &'static str,
}

impl Place {
    /// Checks an element of a list: `what` says what it means.
    pub(crate) fn check(
        self,
        number: usize,
        what: &'static str,
        got: f64,
        is_valid: bool,
        expected: &'static str,
    ) -> Result<(), SpecificationError> {
        let element = SpecificationError::Element { place: self, number, what, got, expected };
        if is_valid { Ok(()) } else { Err(element) }
    }

    /// Checks an element of a list that must be positive.
    pub(crate) fn check_positive(self, number: usize, what: &'static str, got: f64) -> Result<(), SpecificationError> {
        self.check(number, what, got, got > 0.0 && got.is_finite(), "a positive number")
    }

    /// Checks the last of a number of levels below the full one, dB: a test ends at its full level.
    pub(crate) fn check_last_level(self, levels: usize, last_db: Option<f64>) -> Result<(), SpecificationError> {
        match last_db {
            Some(got) => self.check(levels, "the last level, dB,", got, got == 0.0, "0, the full level"),
            None => Err(SpecificationError::TooShort { place: self, got: 0, least: 1 }),
        }
    }
}

/// Reason why a text is not a specification.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SpecificationError {
    /// A number is outside its valid range.
    #[error("{place} is {got}: it must be {expected}", got = short(.got))]
    Value {
        /// Place of the number.
        place: Place,
        /// Number that was given.
        got: f64,
        /// Valid values, in words.
        expected: &'static str,
    },
    /// A number of a list is outside its valid range.
    #[error("{place}, number {number}: {what} is {got}: it must be {expected}", got = short(.got))]
    Element {
        /// Place of the list.
        place: Place,
        /// Number of the element, from 1.
        number: usize,
        /// Meaning of the number.
        what: &'static str,
        /// Number that was given.
        got: f64,
        /// Valid values, in words.
        expected: &'static str,
    },
    /// A list has too few elements.
    #[error("{place} has {got} elements: it must have at least {least}")]
    TooShort {
        /// Place of the list.
        place: Place,
        /// Number of elements that was given.
        got: usize,
        /// Least number of elements.
        least: usize,
    },
    /// Two lists belong together and have different lengths.
    #[error("[{section}] `{}` has {} elements and `{}` has {}: they must have the same number", keys[0], got[0], keys[1], got[1])]
    Lengths {
        /// Section of the file.
        section: &'static str,
        /// Keys of the lists.
        keys: [&'static str; 2],
        /// Numbers of elements that were given.
        got: [usize; 2],
    },
    /// A section or a key is missing, or does not apply to this kind of test.
    #[error("[{section}]{} {fault}: {why}", key.map_or(String::new(), |key| alloc::format!(" `{key}`")))]
    Presence {
        /// Section of the file.
        section: &'static str,
        /// Key that is missing or does not apply; `None` if it is the whole section.
        key: Option<&'static str>,
        /// That it is missing, or does not apply.
        fault: &'static str,
        /// Reason why, in words.
        why: &'static str,
    },
    /// Keys exclude each other, or one of them is needed.
    #[error("[{section}]: exactly one of {} is needed, got {got}", keys.join(", "))]
    OneOf {
        /// Section of the file.
        section: &'static str,
        /// Keys of which one is needed.
        keys: &'static [&'static str],
        /// Number of them that was given.
        got: usize,
    },
    /// A slope has no level that it could start from.
    #[error("{place}, number {number}: a slope with {slope} needs a point [Hz, level] {side} it")]
    Slope {
        /// Place of the list.
        place: Place,
        /// Number of the element, from 1.
        number: usize,
        /// Key of the slope's frequency.
        slope: &'static str,
        /// Side on which the point is missing.
        side: &'static str,
    },
    /// A pulse changes the velocity by too little for verdicts, which are relative to the change.
    #[error(
        "{place}: the velocity change over peak and duration is {}: it must be at least 0.01 in size; use [srs] for a record without one",
        short(.got)
    )]
    NoVelocityChange {
        /// Place of the pulse.
        place: Place,
        /// Velocity change over peak and duration.
        got: f64,
    },
    /// A line of a CSV file is not as it must be.
    #[error("{file}, line {line}: `{got}` {fault}: expected {expected}")]
    Csv {
        /// Name of the file.
        file: String,
        /// Number of the line, from 1.
        line: usize,
        /// Text of the line, shortened.
        got: String,
        /// What the line lacks, in words.
        fault: &'static str,
        /// What it must have, in words.
        expected: &'static str,
    },
    /// A file of breakpoints or of a pulse can't be read.
    #[error("{file}: {message}")]
    File {
        /// Name of the file.
        file: String,
        /// Reason why the file could not be read, in words.
        message: String,
    },
}

/// Returns the error of a missing section or key, with the reason why it is needed.
pub(crate) const fn missing(section: &'static str, key: Option<&'static str>, why: &'static str) -> SpecificationError {
    SpecificationError::Presence { section, key, fault: "is missing", why }
}

/// Returns the error of a section or a key that does not apply, with the reason.
pub(crate) const fn idle(section: &'static str, key: Option<&'static str>, why: &'static str) -> SpecificationError {
    SpecificationError::Presence { section, key, fault: "does not apply", why }
}

/// Reason why a record can't be judged.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum VerdictError {
    /// The spectra can't be estimated.
    #[error(transparent)]
    Spectra(#[from] SpectraError),
    /// The sample rate is too low for the specification.
    #[error(
        "the specification reaches {} Hz, and the record has {} samples a second: it needs at least {}",
        short(.highest_hz), short(.rate_hz), short(.least_hz)
    )]
    Rate {
        /// Highest frequency of the specification, Hz.
        highest_hz: f64,
        /// Sample rate of the record, Hz.
        rate_hz: f64,
        /// Least sample rate, Hz.
        least_hz: f64,
    },
    /// The record is shorter than what one estimate takes.
    #[error("the record has {} s: it must have at least {} s", short(.got_s), short(.least_s))]
    TooShort {
        /// Length of the record, s.
        got_s: f64,
        /// Least length that a verdict needs, s.
        least_s: f64,
    },
    /// There is no channel to judge, or the channels have different lengths.
    #[error("there is no channel to judge, or the channels have different numbers of samples")]
    Channels,
    /// No line is left between the edges of the profile.
    #[error(
        "no line is left between {} and {} Hz: lines are {} Hz apart, and two at each edge are left out; use a smaller `lines_hz`",
        short(.from_hz), short(.to_hz), short(.spacing_hz)
    )]
    NoLines {
        /// Lowest frequency of the profile, Hz.
        from_hz: f64,
        /// Highest frequency of the profile, Hz.
        to_hz: f64,
        /// Spacing of the lines, Hz.
        spacing_hz: f64,
    },
    /// No sweep is in the record.
    #[error(
        "no sweep between {} and {} Hz is in the record: expected one sinusoid whose frequency runs through at least half of the octaves, at about the specified rate",
        rounded(.from_hz, 2), rounded(.to_hz, 2)
    )]
    NoSweep {
        /// Lowest judged frequency, Hz.
        from_hz: f64,
        /// Highest judged frequency, Hz.
        to_hz: f64,
    },
    /// No shot is in the record.
    #[error("no shot is in the record: expected a pulse after a silence; the largest one of the specified shape has {} % of the specified peak", short(.largest_percent))]
    NoShot {
        /// Largest amplitude of the pulse that fits, % of the peak.
        largest_percent: f64,
    },
}
