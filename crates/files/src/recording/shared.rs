//! State that the recorder, its channels and its thread share, and the recorder's commands to the thread.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, OnceLock};

use super::error::RecordingError;
use super::slots::Slot;

/// State that the recorder, its channels and its thread share.
#[derive(Debug)]
pub(super) struct Shared {
    pub path: PathBuf,
    pub failure: OnceLock<RecordingError>,
    /// Time of the run loop's clock at the start of the run, ns.
    pub start_clock_ns: AtomicU64,
}

impl Shared {
    /// Returns the reason for which the thread accepts no more records.
    pub fn error(&self) -> RecordingError {
        match self.failure.get() {
            Some(error) => error.clone(),
            None => RecordingError::WriterDied { path: self.path.clone() },
        }
    }
}

/// Command of the recorder to its thread.
#[derive(Debug)]
pub(super) enum Control {
    /// A channel was opened.
    Open(Source),
    /// Write the pending records, and end.
    End(Ending),
}

/// The ending of a recording.
#[derive(Debug)]
pub(super) enum Ending {
    /// The run is complete; these statistics are written at the end.
    Whole(BTreeMap<String, String>),
    /// The recording was made from others that are not whole; these statistics and their description are written at the
    /// end.
    Partial { statistics: BTreeMap<String, String>, made_from: BTreeMap<String, String> },
    /// The recording was abandoned: it must not look whole.
    GivenUp,
}

/// The receiving end of a channel.
#[derive(Debug)]
pub(super) struct Source {
    pub name: String,
    pub records: rtrb::Consumer<Slot>,
    pub lost: Arc<AtomicU64>,
    pub lost_reported: u64,
}

impl Source {
    /// Makes the receiving end of the channel `name`.
    pub fn new(name: String, records: rtrb::Consumer<Slot>, lost: Arc<AtomicU64>) -> Source {
        Source { name, records, lost, lost_reported: 0 }
    }
}
