//! Ctrl-C stays with this program.
//!
//! The interpreter is started without signal handlers, but CPython's built-in module `_signal`, which half of its
//! library imports, takes SIGINT over when it is first imported and finds the default disposition
//! (`Modules/signalmodule.c`). From then on Ctrl-C would set a flag that nobody looks at.

use core::ptr;
use std::io;

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

/// Starts the interpreter if none runs, imports `_signal`, once and for all, and leaves SIGINT as it was.
pub(super) fn start_python() -> PyResult<()> {
    static STARTED: PyOnceLock<()> = PyOnceLock::new();
    // Read before the interpreter starts, since the import of `_signal` is what changes it.
    let before = disposition()?;
    Python::attach(|py| {
        let import = || -> PyResult<()> {
            py.import("_signal")?;
            Ok(restore(&before)?)
        };
        STARTED.get_or_try_init(py, import).copied()
    })
}

/// Returns the present handling of SIGINT.
#[allow(unsafe_code, reason = "sigaction(2) has no safe wrapper among the dependencies")]
fn disposition() -> io::Result<libc::sigaction> {
    // SAFETY: all zeros are a valid `sigaction`, a plain C structure; the call only writes through the pointer, which
    // is valid for it.
    let (status, action) = unsafe {
        let mut action = core::mem::zeroed();
        (libc::sigaction(libc::SIGINT, ptr::null(), &mut action), action)
    };
    if status == 0 { Ok(action) } else { Err(io::Error::last_os_error()) }
}

#[allow(unsafe_code, reason = "sigaction(2) has no safe wrapper among the dependencies")]
fn restore(action: &libc::sigaction) -> io::Result<()> {
    // SAFETY: the pointer is valid for reads; the handler in it was installed in this process before.
    let status = unsafe { libc::sigaction(libc::SIGINT, action, ptr::null_mut()) };
    if status == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}
