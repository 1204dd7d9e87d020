//! Writes frames into a recording, one by one.

use core::mem;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use resonarm::can_log::{LogFormat, LoggedFrame};
use resonarm::import::{DISORDER_NS, FrameLog, ImportError, ImportOptions, SampleClock, import_converted};
use resonarm::recording::{Direction, Existing, Naming};

use crate::protocol::FrameParts;
use crate::scenario::Scenario;
use crate::{errors, values};

/// Makes a recording of a log in one of the program's formats, which was converted from `original`, a name and a
/// format. Returns what was imported.
#[pyfunction]
#[pyo3(signature = (log, format, output, original, *, scenario, interface, by_sync, overwrite))]
#[expect(clippy::too_many_arguments, reason = "keywords of Python")]
pub fn import_log<'py>(
    py: Python<'py>,
    log: PathBuf,
    format: &str,
    output: PathBuf,
    original: (PathBuf, String),
    scenario: Option<&Scenario>,
    interface: Option<String>,
    by_sync: bool,
    overwrite: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let known = LogFormat::ALL.into_iter().find(|known| known.name() == format);
    let format = known.ok_or_else(|| errors::value(format!("format is {format:?}: expected candump, asc or blf")))?;
    // The recording must replace neither the log nor a file that the scenario was read from.
    let mut read = scenario.map_or(Vec::new(), Scenario::files);
    read.push(original.0.clone());
    if read.iter().any(|file| resonarm::same_file(file, &output)) {
        let output = errors::printable(output.display());
        return Err(errors::value(format!("{output} is the log that is read: give another file for the recording")));
    }
    let options = ImportOptions {
        scenario: scenario.map(|scenario| scenario.inner.clone()),
        interface,
        existing: if overwrite { Existing::Overwrite } else { Existing::Refuse },
        clock: if by_sync { SampleClock::Sync } else { SampleClock::TimeStamps },
    };
    let original = (original.0.as_path(), original.1.as_str());
    let imported = py.detach(|| import_converted(&log, original, format, &output, &options)).map_err(refused)?;
    values::document(py, &imported)
}

/// A recording that has only frames; begun when no earlier frame than those so far can arrive.
#[pyclass(frozen, module = "resonarm._resonarm")]
pub struct LogWriter {
    path: PathBuf,
    log: Mutex<Log>,
}

enum Log {
    /// The frames so far.
    Waiting(Vec<LoggedFrame>),
    /// The recording has begun.
    Begun(Box<FrameLog>),
}

impl Log {
    /// Adds a frame to the recording.
    fn push(&mut self, path: &Path, logged: LoggedFrame) -> Result<(), ImportError> {
        let waiting = match self {
            Log::Begun(log) => return log.push(&logged).map(drop),
            Log::Waiting(waiting) => waiting,
        };
        let first_ns = waiting.first().map_or(logged.time_ns, |first| first.time_ns);
        let early_ns = first_ns.saturating_sub(logged.time_ns);
        if early_ns > DISORDER_NS {
            return Err(ImportError::Order { log: path.to_path_buf(), frame: waiting.len() as u64 + 1, early_ns });
        }
        // Frames are out of order by at most DISORDER_NS. So behind a frame that is this much later than the first,
        // none can come that is earlier than the first.
        let is_late = logged.time_ns > first_ns + DISORDER_NS;
        waiting.push(logged);
        if is_late { self.begin(path) } else { Ok(()) }
    }

    /// Begins the recording with the earliest of the waiting frames, if there are any.
    fn begin(&mut self, path: &Path) -> Result<(), ImportError> {
        let Log::Waiting(waiting) = self else { return Ok(()) };
        let Some(earliest) = waiting.iter().min_by_key(|logged| logged.time_ns) else { return Ok(()) };
        let options = ImportOptions {
            scenario: None,
            interface: None,
            existing: Existing::Overwrite,
            clock: SampleClock::default(),
        };
        let mut log = FrameLog::create(path, "python-can", earliest, (path, Naming::FirstRecord), &options)?;
        for logged in waiting.iter() {
            log.push(logged)?;
        }
        *self = Log::Begun(Box::new(log));
        Ok(())
    }
}

fn refused(error: ImportError) -> PyErr {
    match error {
        ImportError::Recording(error) => errors::recording(error),
        error => errors::value(error),
    }
}

#[pymethods]
impl LogWriter {
    /// Creates the file at this path, or replaces it.
    #[new]
    fn new(path: PathBuf) -> LogWriter {
        LogWriter { path, log: Mutex::new(Log::Waiting(Vec::new())) }
    }

    /// Writes a frame received at a time of the UNIX epoch, ns.
    fn write(&self, frame: FrameParts, unix_ns: u64, received: bool, interface: String) -> PyResult<()> {
        let direction = if received { Direction::Received } else { Direction::Sent };
        let interface = Some(interface).filter(|name| !name.is_empty());
        let logged = LoggedFrame { time_ns: unix_ns, interface, direction: Some(direction), frame: frame.frame()? };
        self.log.lock().unwrap_or_else(PoisonError::into_inner).push(&self.path, logged).map_err(refused)
    }

    /// Ends the recording; returns the number of frames in it.
    fn finish(&self, py: Python<'_>) -> PyResult<u64> {
        let mut log = self.log.lock().unwrap_or_else(PoisonError::into_inner);
        // A short log may still wait for an earlier frame.
        log.begin(&self.path).map_err(refused)?;
        match mem::replace(&mut *log, Log::Waiting(Vec::new())) {
            Log::Begun(log) => py.detach(|| log.finish()).map(|(frames, _)| frames).map_err(refused),
            Log::Waiting(_) => Ok(0),
        }
    }
}
