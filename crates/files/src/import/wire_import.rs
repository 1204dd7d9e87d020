//! The result of an import of frames of a user protocol, with the missing data.

use std::collections::BTreeMap;

use resonarm_bench::structure::ChannelName;
use serde::Serialize;

/// Data gathered from the frames of a user protocol.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WireImport {
    /// Samples with readings in the recording.
    pub samples: u64,
    /// Readings that the user protocol does not carry every sample: if there is one, the recording has no readings.
    pub missing_readings: Vec<Missing>,
    /// Samples with states and loads in the recording.
    pub states: u64,
    /// States that the user protocol does not carry every sample, or for drives those that no frame has: if there is
    /// one, the recording has no states and loads.
    pub missing_states: Vec<Missing>,
    /// Gaps between the samples with readings, or without any, with states.
    pub gaps: u64,
    /// Samples in these gaps.
    pub missing_samples: u64,
    /// Samples left out because some of their frames are not in the log.
    pub incomplete_samples: u64,
    /// Frames left out since their checksum, counter or length is wrong, or a signal is not a number; by message.
    pub refused_frames: BTreeMap<String, u64>,
    /// Frames left out since they repeat a sample, or are more than [`DISORDER_NS`](super::DISORDER_NS) late.
    pub repeated_frames: u64,
    /// Frames lost, according to the counters of readings and commands.
    pub lost_frames: u64,
    /// Whether a message with readings has neither an index of the sample nor a counter, so that its frames are placed
    /// by their time stamps.
    pub is_placed_by_time: bool,
}

/// A channel that the user protocol does not carry every sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Missing {
    /// Name of the channel, as in recordings.
    pub channel: ChannelName,
    /// Whether the user protocol carries it sometimes; else it does not at all.
    pub is_carried: bool,
}

/// Counts the gaps between the samples of a recording: those of its readings, or without any, of its states.
#[derive(Debug, Default)]
pub(super) struct Gaps {
    last: Option<u64>,
}

impl Gaps {
    /// Counts the next sample, later than the one before.
    pub fn count(&mut self, sample: u64, found: &mut WireImport) {
        if let Some(missing @ 1..) = self.last.map(|last| sample - last - 1) {
            found.gaps += 1;
            found.missing_samples += missing;
        }
        self.last = Some(sample);
    }
}
