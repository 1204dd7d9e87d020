//! python-can's bus on the calling thread, without threads and queues between.
//!
//! A frame that goes over two threads costs two wake-ups each way; here the caller calls python-can itself.

use core::cell::Cell;
use core::sync::atomic::Ordering;
use core::time::Duration;
use std::sync::Arc;

use pyo3::ffi;
use pyo3::prelude::*;
use resonarm_protocol::Frame;

use super::bridge::{Driver, Shared, Taken, is_queue_full, kernel_drops};
use super::message::{self, Incoming};
use crate::error::{Operation, PythonCanError, exception};
use resonarm_bus::deadline::Deadline;
use resonarm_bus::socketcan::ControllerReports;
use resonarm_bus::{Filter, Sent};

/// The longest time that a driver is asked to wait at once: some refuse times of centuries.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// The bus, and the message that ended a wait.
pub(super) struct Direct {
    pub(super) driver: Arc<Driver>,
    pub(super) shared: Arc<Shared>,
    pub(super) came_in: Option<Incoming>,
}

impl Direct {
    /// Sends one frame, unless the driver's transmit queue is full.
    pub(super) fn send(&self, frame: &Frame) -> Result<Sent, PythonCanError> {
        keep_thread_state();
        Python::attach(|py| {
            let message = message::from_frame(self.driver.message_class.bind(py), frame);
            match message.and_then(|message| self.driver.send(&message)) {
                Ok(()) => Ok(Sent::Queued),
                Err(error) if is_queue_full(py, &error) => Ok(Sent::QueueFull),
                Err(error) => Err(exception(py, Operation::Send, error)),
            }
        })
    }

    /// The next incoming message, if any.
    pub(super) fn receive(&mut self) -> Result<Option<Incoming>, PythonCanError> {
        match self.came_in.take() {
            None => self.take(Duration::ZERO),
            came_in => Ok(came_in),
        }
    }

    /// Waits for a message that is given out, and counts the error frames before it.
    pub(super) fn wait(&mut self, timeout: Duration, reports: &mut ControllerReports) -> Result<bool, PythonCanError> {
        let deadline = Deadline::after(timeout);
        while self.came_in.is_none() {
            let left = deadline.remaining();
            match self.take(left.min(LONGEST_WAIT))? {
                Some(incoming) if incoming.is_given_out() => self.came_in = Some(incoming),
                Some(incoming) => incoming.note(reports),
                None if left.is_zero() => break,
                None => {}
            }
        }
        Ok(self.came_in.is_some())
    }

    /// The next message, if one comes in time. Those that are no frames are left out.
    fn take(&self, timeout: Duration) -> Result<Option<Incoming>, PythonCanError> {
        keep_thread_state();
        Python::attach(|py| {
            let mut timeout = timeout;
            loop {
                let taken = self.driver.receive(py, timeout);
                match taken.map_err(|error| exception(py, Operation::Receive, error))? {
                    Taken::Nothing => return Ok(None),
                    Taken::Message(incoming) => return Ok(Some(incoming)),
                    Taken::NoFrame => self.shared.discarded.fetch_add(1, Ordering::Relaxed),
                };
                // The frames after it have arrived, too.
                timeout = Duration::ZERO;
            }
        })
    }

    pub(super) fn set_filters(&self, filters: &[Filter]) -> Result<(), PythonCanError> {
        Python::attach(|py| self.driver.set_filters(py, filters))
    }

    /// Counts what the kernel has lost up to now. If it can't say, the count stays.
    pub(super) fn count_drops(&self) {
        let Some(socket) = &self.driver.socket else { return };
        if let Ok(dropped) = Python::attach(|py| kernel_drops(socket.bind(py))) {
            self.shared.dropped_beneath.store(dropped, Ordering::Relaxed);
        }
    }

    pub(super) fn close(self) -> Result<(), PythonCanError> {
        // While the socket is still open: the count of the kernel goes with it.
        self.count_drops();
        Python::attach(|py| self.driver.shutdown(py))
    }
}

/// Keeps what the interpreter knows of the calling thread from one call to the next, without its lock: made anew for
/// each frame, its stack alone takes two system calls and a page fault. It stays until the process ends, one a thread.
#[allow(unsafe_code, reason = "pyo3 keeps a thread's state within a scope alone, and a caller's methods share none")]
fn keep_thread_state() {
    std::thread_local! { static IS_KEPT: Cell<bool> = const { Cell::new(false) } }
    // SAFETY: the interpreter runs, or there were no bus. `PyGILState_Ensure` takes its lock and `PyEval_SaveThread`
    // gives it back; the state's counter stays at 1 or more, as no release matches this call. A thread that holds the
    // lock has a state already, and keeps both.
    unsafe {
        if !IS_KEPT.replace(true) {
            match ffi::PyGILState_Ensure() {
                ffi::PyGILState_STATE::PyGILState_UNLOCKED => drop(ffi::PyEval_SaveThread()),
                held => ffi::PyGILState_Release(held),
            }
        }
    }
}
