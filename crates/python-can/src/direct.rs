//! python-can's bus on the calling thread, without threads and queues between.
//!
//! A frame that goes over two threads costs two wake-ups each way; here the caller calls python-can itself.

use alloc::sync::Arc;
use core::cell::Cell;
use core::sync::atomic::Ordering;
use core::time::Duration;

use pyo3::ffi;
use pyo3::prelude::*;
use resonarm_protocol::Frame;

use super::bridge::{Shared, is_queue_full, kernel_drops};
use super::error::Operation;
use super::message::{ErrorFrames, Incoming};
use super::{PythonCanError, exception, message};
use resonarm_bus::deadline::Deadline;
use resonarm_bus::socketcan::ControllerReports;
use resonarm_bus::{Filter, Sent};

/// The longest time that a driver is asked to wait at once: some refuse times of centuries.
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// The bus, and the message that ended a wait.
pub(super) struct Direct {
    pub(super) bus: Arc<Py<PyAny>>,
    pub(super) message_class: Py<PyAny>,
    /// Socket that the driver reads from, on which the kernel counts the frames it lost.
    pub(super) socket: Option<Py<PyAny>>,
    pub(super) error_frames: ErrorFrames,
    pub(super) shared: Arc<Shared>,
    pub(super) came_in: Option<Incoming>,
}

impl Direct {
    /// Sends one frame, unless the driver's transmit queue is full.
    pub(super) fn send(&self, frame: &Frame) -> Result<Sent, PythonCanError> {
        keep_thread_state();
        Python::attach(|py| {
            let message = message::from_frame(self.message_class.bind(py), frame);
            match message.and_then(|message| self.bus.bind(py).call_method1("send", (message,))) {
                Ok(_none) => Ok(Sent::Queued),
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
            let take = |timeout_s: f64| {
                let message = self.bus.bind(py).call_method1("recv", (timeout_s,))?;
                let is_message = !message.is_none();
                let incoming = if is_message { message::to_incoming(&message, self.error_frames)? } else { None };
                Ok((is_message, incoming))
            };
            let mut timeout_s = timeout.as_secs_f64();
            loop {
                match take(timeout_s).map_err(|error| exception(py, Operation::Receive, error))? {
                    (true, None) => self.shared.discarded.fetch_add(1, Ordering::Relaxed),
                    (_, incoming) => return Ok(incoming),
                };
                // The frames after it have arrived, too.
                timeout_s = 0.0;
            }
        })
    }

    pub(super) fn set_filters(&self, filters: &[Filter]) -> Result<(), PythonCanError> {
        Python::attach(|py| {
            let list = message::filter_list(py, filters);
            let set = list.and_then(|list| self.bus.bind(py).call_method1("set_filters", (list,)));
            set.map(drop).map_err(|error| exception(py, Operation::SetFilters, error))
        })
    }

    /// Counts what the kernel has lost up to now. If it can't say, the count stays.
    pub(super) fn count_drops(&self) {
        let Some(socket) = &self.socket else { return };
        if let Ok(dropped) = Python::attach(|py| kernel_drops(socket.bind(py))) {
            self.shared.dropped_beneath.store(dropped, Ordering::Relaxed);
        }
    }

    pub(super) fn close(self) -> Result<(), PythonCanError> {
        // While the socket is still open: the count of the kernel goes with it.
        self.count_drops();
        Python::attach(|py| {
            let shut = self.bus.bind(py).call_method0("shutdown");
            shut.map(drop).map_err(|error| exception(py, Operation::Close, error))
        })
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
