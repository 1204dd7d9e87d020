//! Frames written into a recording, one by one.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use resonarm::can_log::LoggedFrame;
use resonarm::import::{FrameLog, ImportError, ImportOptions};
use resonarm::recording::{Direction, Existing};

use crate::errors;
use crate::protocol::FrameParts;

/// A recording of frames alone; begun with the first.
#[pyclass(frozen, module = "resonarm._resonarm")]
pub struct LogWriter {
    path: PathBuf,
    log: Mutex<Option<FrameLog>>,
}

fn refused(error: ImportError) -> PyErr {
    match error {
        ImportError::Recording(error) => errors::recording(error),
        error => errors::value(error),
    }
}

#[pymethods]
impl LogWriter {
    /// Of the file of this path, over what is there.
    #[new]
    fn new(path: PathBuf) -> LogWriter {
        LogWriter { path, log: Mutex::new(None) }
    }

    /// Writes a frame that was seen at a time of the UNIX epoch, ns.
    fn write(&self, frame: FrameParts, unix_ns: u64, received: bool, interface: String) -> PyResult<()> {
        let direction = if received { Direction::Received } else { Direction::Sent };
        let interface = Some(interface).filter(|name| !name.is_empty());
        let logged = LoggedFrame { time_ns: unix_ns, interface, direction: Some(direction), frame: frame.frame()? };
        let mut log = self.log.lock().unwrap_or_else(PoisonError::into_inner);
        if log.is_none() {
            let options = ImportOptions { scenario: None, interface: None, existing: Existing::Overwrite };
            let begun = FrameLog::create(&self.path, "python-can", &logged, &self.path, &options);
            *log = Some(begun.map_err(refused)?);
        }
        if let Some(log) = log.as_mut() {
            log.push(&logged).map_err(refused)?;
        }
        Ok(())
    }

    /// Ends the recording; how many frames are in it.
    fn finish(&self, py: Python<'_>) -> PyResult<u64> {
        let log = self.log.lock().unwrap_or_else(PoisonError::into_inner).take();
        py.detach(|| log.map_or(Ok(0), FrameLog::finish)).map_err(refused)
    }
}
