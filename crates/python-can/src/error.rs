//! Errors between here and an adapter that python-can drives.

use core::time::Duration;
use std::io;
use std::path::PathBuf;

use pyo3::prelude::*;
use resonarm_bus::BusError;
use thiserror::Error;

/// Errors of opening or using a bus through python-can.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PythonCanError {
    /// An option of the address is missing, given twice, or not allowed.
    #[error("python-can option `{key}`: {reason}")]
    Option {
        /// Name of the option in the address.
        key: String,
        /// Reason why the option is invalid, and how to fix it.
        reason: String,
    },
    /// The directory is no virtual environment.
    #[error(
        "`{path}` is not a Python virtual environment: {reason}; make one with `python3 -m venv {path}`, or unset VIRTUAL_ENV"
    )]
    VirtualEnvironment {
        /// The directory of the environment.
        path: PathBuf,
        /// Description of what the directory lacks.
        reason: String,
    },
    /// A virtual environment that was found, which other users could have made or changed.
    #[error(
        "the virtual environment `{path}` is not used, as `{place}` {reason}: its packages would run with your rights; set \
         VIRTUAL_ENV={path} if you trust it, or make one of your own"
    )]
    Untrusted {
        /// The directory of the environment.
        path: PathBuf,
        /// The file or directory that is not the user's alone.
        place: PathBuf,
        /// Reason why other users could change the place.
        reason: String,
    },
    /// The virtual environment belongs to another version of Python than the one built in.
    #[error(
        "the virtual environment `{path}` is for Python {environment}, but this program embeds Python {embedded}; \
         make one with `{python} -m venv DIRECTORY` and set VIRTUAL_ENV to it, or build again with PYO3_PYTHON={path}/bin/python3"
    )]
    Version {
        /// The directory of the environment.
        path: PathBuf,
        /// The version of the environment.
        environment: String,
        /// The version that is linked into this program.
        embedded: String,
        /// An interpreter of the embedded version.
        python: String,
    },
    /// Python is there, the package python-can is not.
    #[error("python-can is not installed in {environment}; install it with `{command}`")]
    Missing {
        /// Environment in which Python looked for the package.
        environment: String,
        /// The command that installs it where it will be found.
        command: String,
    },
    /// python-can has no interface of that name.
    #[error("python-can {version} has no interface `{interface}`; expected one of {known}")]
    UnknownInterface {
        /// Interface that was asked for.
        interface: String,
        /// The version of python-can.
        version: String,
        /// The names it knows, separated by commas.
        known: String,
    },
    /// The run has CAN FD frames, and the adapter was opened for classical ones.
    #[error(
        "the run has CAN FD frames, and python-can has opened the interface `{interface}` for classical frames only: add \
         fd=true to the address, with the bit rates that the interface asks for, or use an adapter for CAN FD"
    )]
    Classic {
        /// The interface of python-can.
        interface: String,
    },
    /// python-can or the driver beneath raised an exception.
    #[error("python-can could not {operation}: {kind}: {message}")]
    Exception {
        /// The operation of python-can that failed.
        operation: Operation,
        /// The class of the exception.
        kind: String,
        /// Message of the exception.
        message: String,
    },
    /// A bridge thread could not be started.
    #[error("could not start the thread that talks to python-can: {0}")]
    Thread(#[source] io::Error),
    /// The driver holds a bridge thread inside a call.
    #[error("python-can did not {operation} within {} s: the driver does not return; unplug the adapter or end this program", .waited.as_secs_f64())]
    Stuck {
        /// Operation that does not end.
        operation: Operation,
        /// Time that this end waited.
        waited: Duration,
    },
}

/// Operation that was asked of python-can.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// Finding and importing the package.
    Import,
    /// Opening the bus by `can.Bus(…)`.
    Open,
    /// Sending a frame by `send`.
    Send,
    /// Receiving a frame by `recv`.
    Receive,
    /// Setting filters by `set_filters`.
    SetFilters,
    /// Closing the bus by `shutdown`.
    Close,
}

impl core::fmt::Display for Operation {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Operation::Import => "be imported",
            Operation::Open => "open the bus",
            Operation::Send => "send",
            Operation::Receive => "receive",
            Operation::SetFilters => "set the filters",
            Operation::Close => "close the bus",
        })
    }
}

impl From<PythonCanError> for BusError {
    fn from(error: PythonCanError) -> BusError {
        BusError::PythonCan(Box::new(error))
    }
}

/// A Python exception: the name of its class, its message, and those of the exception it was raised from if they say
/// more.
pub(crate) fn exception(py: Python<'_>, operation: Operation, error: PyErr) -> PythonCanError {
    let kind = |error: &PyErr| error.get_type(py).name().map_or("Exception".to_string(), |name| name.to_string());
    let mut message = error.value(py).to_string();
    if let Some(cause) = error.cause(py)
        && let reason = cause.value(py).to_string()
        && !message.contains(&reason)
    {
        message = format!("{message} (from {}: {reason})", kind(&cause));
    }
    PythonCanError::Exception { operation, kind: kind(&error), message }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn says_how_to_fix_it() {
        let version = PythonCanError::Version {
            path: "/home/a/.venv".into(),
            environment: "3.12".into(),
            embedded: "3.11".into(),
            python: "/usr/bin/python3.11".into(),
        };
        insta::assert_snapshot!(version, @"the virtual environment `/home/a/.venv` is for Python 3.12, but this program embeds Python 3.11; make one with `/usr/bin/python3.11 -m venv DIRECTORY` and set VIRTUAL_ENV to it, or build again with PYO3_PYTHON=/home/a/.venv/bin/python3");
        let missing = PythonCanError::Missing {
            environment: "the virtual environment `/home/a/.venv` (Python 3.11.2)".into(),
            command: "/home/a/.venv/bin/python3 -m pip install python-can".into(),
        };
        insta::assert_snapshot!(missing, @"python-can is not installed in the virtual environment `/home/a/.venv` (Python 3.11.2); install it with `/home/a/.venv/bin/python3 -m pip install python-can`");
        let directory = PythonCanError::VirtualEnvironment {
            path: "/home/a/.venv".into(),
            reason: "it has no file `pyvenv.cfg`".into(),
        };
        insta::assert_snapshot!(directory, @"`/home/a/.venv` is not a Python virtual environment: it has no file `pyvenv.cfg`; make one with `python3 -m venv /home/a/.venv`, or unset VIRTUAL_ENV");
        let exception = PythonCanError::Exception {
            operation: Operation::Open,
            kind: "CanInitializationError".into(),
            message: "no such device".into(),
        };
        insta::assert_snapshot!(exception, @"python-can could not open the bus: CanInitializationError: no such device");
        let stuck = PythonCanError::Stuck { operation: Operation::Close, waited: Duration::from_millis(2500) };
        insta::assert_snapshot!(stuck, @"python-can did not close the bus within 2.5 s: the driver does not return; unplug the adapter or end this program");
    }
}
