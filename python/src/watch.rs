//! Does long work while checking for signals of the system.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;

use pyo3::prelude::*;

use crate::{errors, logging};

/// Interval of checks for signals of the system.
const LOOK: Duration = Duration::from_millis(50);

/// Does `work` on a separate thread, without the interpreter's lock. A signal whose handler raises, such as Ctrl-C,
/// calls `stop`; the exception is returned after the work has ended.
pub fn watched<T: Send>(py: Python<'_>, stop: &(dyn Fn() + Sync), work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let mut interrupted = None;
    let result = py.detach(|| {
        // A channel tells the end, since joining a thread has no time limit.
        let (ended, end) = sync_channel(1);
        thread::scope(|scope| {
            let work = scope.spawn(move || {
                let result = work();
                // The other side waits for it.
                let _ = ended.send(());
                result
            });
            // Only the main thread of Python handles signals, and only when it asks for them: so the work is on the
            // other one.
            while end.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if let Err(error) = Python::attach(|py| py.check_signals()) {
                    stop();
                    interrupted = Some(error);
                }
            }
            work.join()
        })
    });
    logging::hand_over(py)?;
    interrupted.map_or_else(|| joined(result), Err)
}

/// As [`watched`], of work that asks again and again whether to stop.
pub fn stoppable<T: Send>(py: Python<'_>, work: impl FnOnce(&(dyn Fn() -> bool + Sync)) -> T + Send) -> PyResult<T> {
    let stopped = AtomicBool::new(false);
    watched(py, &|| stopped.store(true, Ordering::Relaxed), || work(&|| stopped.load(Ordering::Relaxed)))
}

/// The value that a thread returned.
pub fn joined<T>(result: thread::Result<T>) -> PyResult<T> {
    result.map_err(|_panic| {
        errors::failed("the thread of the run has ended in a panic; its message is on standard error")
    })
}
