//! The destination of a run's records.

use resonarm_files::recording::{Channel, Record};

/// The destination of a run's records.
#[derive(Debug)]
pub(super) enum RecordSink {
    /// The run is not recorded.
    Off,
    /// A recording that may lose records rather than delay the loop; losses are counted.
    Lossy(Channel),
    /// A recording that gets every record; a loop in virtual time waits for it.
    Whole(Channel),
    /// A list from which the caller that steps the run takes the records.
    Kept(Vec<Record>),
}

impl RecordSink {
    /// Sets the start of the run on the loop's clock, ns. Must be called before the first record.
    pub fn begin(&mut self, clock_ns: u64) {
        match self {
            RecordSink::Off | RecordSink::Kept(_) => {}
            RecordSink::Lossy(channel) | RecordSink::Whole(channel) => channel.begin(clock_ns),
        }
    }

    /// Records `record`. If the recording has failed, which its recorder reports, records are discarded, and the run
    /// continues.
    pub fn record(&mut self, record: &Record) {
        match self {
            RecordSink::Off => {}
            RecordSink::Lossy(channel) => _ = channel.push(record),
            RecordSink::Whole(channel) => {
                if channel.push_blocking(record).is_err() {
                    // A failed recording would fail at every further record, and each time wait for nothing.
                    *self = RecordSink::Off;
                }
            }
            RecordSink::Kept(records) => records.push(*record),
        }
    }

    /// Returns the records that were kept since the last call.
    pub fn take_kept(&mut self) -> Vec<Record> {
        match self {
            RecordSink::Kept(records) => core::mem::take(records),
            RecordSink::Off | RecordSink::Lossy(_) | RecordSink::Whole(_) => Vec::new(),
        }
    }

    /// Returns a sink with a copy of the kept records; empty for a sink of another kind.
    pub fn copy_of_kept(&self) -> RecordSink {
        match self {
            RecordSink::Kept(records) => RecordSink::Kept(records.clone()),
            RecordSink::Off | RecordSink::Lossy(_) | RecordSink::Whole(_) => RecordSink::Off,
        }
    }
}
