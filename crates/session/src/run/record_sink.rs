//! Where the records of a run go.

use resonarm_files::recording::{Channel, Record};

/// Where the records of a run go.
#[derive(Debug)]
pub(super) enum RecordSink {
    /// The run is not recorded.
    Off,
    /// To a recording that may lose records rather than hold up the loop; losses are counted.
    Lossy(Channel),
    /// To a recording that gets every record, for which a loop in virtual time waits.
    Whole(Channel),
    /// Kept, for whoever steps the run to take.
    Kept(Vec<Record>),
}

impl RecordSink {
    /// Tells when the run began: what the run loop's clock read then, ns. To be called before the first record.
    pub fn begin(&mut self, clock_ns: u64) {
        match self {
            RecordSink::Off | RecordSink::Kept(_) => {}
            RecordSink::Lossy(channel) | RecordSink::Whole(channel) => channel.begin(clock_ns),
        }
    }

    /// Records `record`. If the recording has failed, which its recorder tells, what comes goes nowhere: the run goes
    /// on.
    pub fn record(&mut self, record: &Record) {
        let failed = match self {
            RecordSink::Off => false,
            RecordSink::Lossy(channel) => {
                channel.push(record);
                false
            }
            // A failed recording would fail at every further record, and each time wait for nothing.
            RecordSink::Whole(channel) => channel.push_blocking(record).is_err(),
            RecordSink::Kept(records) => {
                records.push(*record);
                false
            }
        };
        if failed {
            *self = RecordSink::Off;
        }
    }

    /// The records that were kept since the last call.
    pub fn take_kept(&mut self) -> Vec<Record> {
        match self {
            RecordSink::Kept(records) => core::mem::take(records),
            RecordSink::Off | RecordSink::Lossy(_) | RecordSink::Whole(_) => Vec::new(),
        }
    }

    /// A sink that keeps what this one has kept; one of another kind keeps nothing.
    pub fn copy_of_kept(&self) -> RecordSink {
        match self {
            RecordSink::Kept(records) => RecordSink::Kept(records.clone()),
            RecordSink::Off | RecordSink::Lossy(_) | RecordSink::Whole(_) => RecordSink::Off,
        }
    }
}
