//! The kinds of records that are exported.

use core::fmt;
use core::str::FromStr;

use thiserror::Error;

use crate::recording::Topic;

/// A kind of records.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum RecordingPart {
    /// States of the arm and the load held from each sample to the next.
    States,
    /// Readings of the instruments at the samples.
    Samples,
    /// The frames on the bus.
    Frames,
    /// Punctuality of the real-time loop.
    Ticks,
    /// Events of the run, such as changes of state and faults.
    Events,
}

impl RecordingPart {
    /// All kinds of records.
    pub const ALL: [RecordingPart; 5] = [
        RecordingPart::States,
        RecordingPart::Samples,
        RecordingPart::Frames,
        RecordingPart::Ticks,
        RecordingPart::Events,
    ];

    /// Returns the name, as flags and files have it.
    pub const fn name(self) -> &'static str {
        match self {
            RecordingPart::States => "states",
            RecordingPart::Samples => "samples",
            RecordingPart::Frames => "frames",
            RecordingPart::Ticks => "ticks",
            RecordingPart::Events => "events",
        }
    }

    /// Returns the names of some kinds, in a list.
    pub(super) fn names(parts: &[RecordingPart]) -> String {
        parts.iter().map(|part| part.name()).collect::<Vec<_>>().join(", ")
    }

    /// Returns the topic with these records.
    pub const fn topic(self) -> Topic {
        match self {
            RecordingPart::States => Topic::States,
            RecordingPart::Samples => Topic::Samples,
            RecordingPart::Frames => Topic::Frames,
            RecordingPart::Ticks => Topic::Ticks,
            RecordingPart::Events => Topic::Events,
        }
    }
}

impl fmt::Display for RecordingPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for RecordingPart {
    type Err = UnknownRecordingPart;

    fn from_str(text: &str) -> Result<RecordingPart, UnknownRecordingPart> {
        RecordingPart::ALL.into_iter().find(|part| part.name() == text).ok_or(UnknownRecordingPart)
    }
}

/// Error of a text that is not the name of a [`RecordingPart`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("it must be one of {}", RecordingPart::names(&RecordingPart::ALL))]
pub struct UnknownRecordingPart;
