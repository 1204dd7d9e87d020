//! Errors of the library as Python's exceptions, with the library's messages.

use core::fmt::Display;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::create_exception;
use pyo3::exceptions::{
    PyException, PyFileExistsError, PyFileNotFoundError, PyIsADirectoryError, PyOSError, PyPermissionError,
    PyValueError,
};
use pyo3::prelude::*;
use resonarm::analysis::time_domain::TimeDomainError;
use resonarm::analysis::{AnalysisError, FrfError};
use resonarm::bus::BusError;
use resonarm::realtime::SpinError;
use resonarm::recording::RecordingError;
use resonarm::replay::ReplayError;
use resonarm::run::RunError;
use resonarm::scenario::{ScenarioError, StructureSectionError};
use resonarm::signals::SignalError;

create_exception!(resonarm, ResonarmError, PyException, "A valid request could not be fulfilled.");

/// The exception that ended the work of a controller, or the step of a structure, if one did.
pub type Raised = Arc<Mutex<Option<PyErr>>>;

/// The exception that a call of Python raised, if one did.
pub fn taken(raised: &Raised) -> Option<PyErr> {
    raised.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// Escapes control characters, which a file or its name may contain, so that the text can be printed on a terminal.
pub fn printable(text: impl Display) -> String {
    let mut found = String::new();
    for character in text.to_string().chars() {
        match character {
            // Messages of several lines stay so.
            '\n' => found.push('\n'),
            _ if character.is_control() => found.extend(character.escape_unicode()),
            _ => found.push(character),
        }
    }
    found
}

/// The same for Python.
#[pyfunction]
#[pyo3(name = "printable")]
pub fn printable_text(text: &str) -> String {
    printable(text)
}

/// An invalid value: `ValueError`.
pub fn value(error: impl Display) -> PyErr {
    PyValueError::new_err(printable(error))
}

/// A valid request that failed: `ResonarmError`.
pub fn failed(error: impl Display) -> PyErr {
    ResonarmError::new_err(printable(error))
}

/// A refusal of the system: the `OSError` of its kind.
fn refused(kind: io::ErrorKind, error: &impl Display) -> PyErr {
    let message = printable(error);
    match kind {
        io::ErrorKind::NotFound => PyFileNotFoundError::new_err(message),
        io::ErrorKind::AlreadyExists => PyFileExistsError::new_err(message),
        io::ErrorKind::PermissionDenied => PyPermissionError::new_err(message),
        io::ErrorKind::IsADirectory => PyIsADirectoryError::new_err(message),
        _ => PyOSError::new_err(message),
    }
}

/// The exception for an error of a scenario.
pub fn scenario(error: ScenarioError) -> PyErr {
    match &error {
        ScenarioError::Read { source, .. } | ScenarioError::ReadLoad { source, .. } => refused(source.kind(), &error),
        ScenarioError::Structure(StructureSectionError::Read { kind, .. }) => refused(*kind, &error),
        _ => value(error),
    }
}

/// The exception for an error of reading the channels of a recording.
pub fn signals(error: SignalError) -> PyErr {
    match error {
        SignalError::Export(error) => failed(error),
        error => value(error),
    }
}

/// The exception for an error of a frequency response.
pub fn frf(error: FrfError) -> PyErr {
    match error {
        FrfError::Frequency { .. } => value(error),
        _ => failed(error),
    }
}

/// The exception for an error of an analysis.
pub fn analysis(error: AnalysisError) -> PyErr {
    match error {
        AnalysisError::Interval { .. } => value(error),
        _ => failed(error),
    }
}

/// Returns the exception for an error of responses followed through time.
pub fn time_domain(error: TimeDomainError) -> PyErr {
    match error {
        TimeDomainError::Step { .. } | TimeDomainError::Stopped => failed(error),
        _ => value(error),
    }
}

/// The exception for an error of a recording.
pub fn recording(error: RecordingError) -> PyErr {
    match &error {
        RecordingError::Exists { .. } => refused(io::ErrorKind::AlreadyExists, &error),
        RecordingError::Open { source, .. }
        | RecordingError::Create { source, .. }
        | RecordingError::Write { source, .. } => refused(source.kind(), &error),
        RecordingError::NotMcap { .. } | RecordingError::NotARecording { .. } | RecordingError::NotAFile { .. } => {
            value(error)
        }
        _ => failed(error),
    }
}

/// The exception for a run that can't begin, or ended early.
pub fn run(error: RunError) -> PyErr {
    match error {
        RunError::Scenario(error) => scenario(error),
        RunError::Recording(error) | RunError::NotRecorded(error) => recording(error),
        RunError::Bus(error) => bus(error),
        RunError::PlantSpec(_)
        | RunError::Rate(_)
        | RunError::Speed(_)
        | RunError::FreeHasNoBus
        | RunError::BitErrors { .. }
        | RunError::Spin(SpinError::Text { .. } | SpinError::TooLong { .. })
        | RunError::TimedInRealTime { .. } => value(error),
        // PermissionError, which the system itself would cause where it refuses a priority.
        RunError::NoRealTimeThread { .. } => refused(io::ErrorKind::PermissionDenied, &error),
        _ => failed(error),
    }
}

/// The exception for an error of a bus: `OSError`, or `ValueError` for an invalid address.
pub fn bus(error: BusError) -> PyErr {
    match error {
        BusError::Address { .. } => value(error),
        _ => PyOSError::new_err(printable(error)),
    }
}

/// The exception for an error of a resimulation.
pub fn replay(error: ReplayError) -> PyErr {
    match error {
        ReplayError::Recording(error) => recording(error),
        _ => failed(error),
    }
}
