//! The two threads between the queues and python-can.
//!
//! A receiver sits in `recv` with a timeout; python-can's drivers give up the GIL while they wait. A sender parks
//! without the GIL until a frame is queued. One thread for both would have to leave `recv` to look for frames to send,
//! and each frame would wait for up to that timeout. `send` and `recv` of one bus in two threads is what python-can's
//! `Notifier` and `ThreadSafeBus` rely on; everything else (`set_filters`, `shutdown`) is done by the receiver
//! between two `recv`, as the locks of `ThreadSafeBus` demand.

use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;
use std::sync::{Arc, Condvar, Mutex, PoisonError, mpsc};
use std::thread::{self, JoinHandle};

use pyo3::prelude::*;
use resonarm_protocol::Frame;
use rtrb::{Consumer, Producer};

use super::message::{self, ErrorFrames, Incoming};
use crate::error::{Operation, PythonCanError, exception};
use resonarm_bus::Filter;
use resonarm_bus::socketcan::{MEMINFO_BYTES, drops_in};

/// Time for which `recv` may keep the receiver: the delay at most of `set_filters` and `close`.
const RECEIVE_TIMEOUT: Duration = Duration::from_millis(50);
/// The pause after `recv` failed, so that a dead adapter does not take a whole core.
const REST_AFTER_FAILURE: Duration = Duration::from_millis(10);
/// The pause before a frame that met a full transmit queue is tried again.
const REST_AFTER_FULL: Duration = Duration::from_millis(1);
/// Number of times, over all frames, that a full transmit queue is tried again once the bus is being closed.
pub(super) const ATTEMPTS_WHEN_CLOSING: u32 = 1000;

/// An open python-can bus, and what is known of its interface.
pub(super) struct Driver {
    pub(super) bus: Py<PyAny>,
    pub(super) message_class: Py<PyAny>,
    /// The Python socket that the driver reads from, where the kernel counts what it lost on it.
    pub(super) socket: Option<Py<PyAny>>,
    pub(super) error_frames: ErrorFrames,
}

/// What a wait for a message brought.
pub(super) enum Taken {
    /// No message came in time.
    Nothing,
    /// A message for which ISO 11898-1 has no frame.
    NoFrame,
    Message(Incoming),
}

impl Driver {
    /// Sends a message that [`message::from_frame`] has made.
    pub(super) fn send(&self, message: &Bound<'_, PyAny>) -> PyResult<()> {
        self.bus.bind(message.py()).call_method1("send", (message,)).map(drop)
    }

    /// Waits for one message.
    pub(super) fn receive(&self, py: Python<'_>, timeout: Duration) -> PyResult<Taken> {
        let message = self.bus.bind(py).call_method1("recv", (timeout.as_secs_f64(),))?;
        if message.is_none() {
            return Ok(Taken::Nothing);
        }
        Ok(message::to_incoming(&message, self.error_frames)?.map_or(Taken::NoFrame, Taken::Message))
    }

    pub(super) fn set_filters(&self, py: Python<'_>, filters: &[Filter]) -> Result<(), PythonCanError> {
        let list = message::filter_list(py, filters);
        let set = list.and_then(|list| self.bus.bind(py).call_method1("set_filters", (list,)));
        set.map(drop).map_err(|error| exception(py, Operation::SetFilters, error))
    }

    pub(super) fn shutdown(&self, py: Python<'_>) -> Result<(), PythonCanError> {
        let shut = self.bus.bind(py).call_method0("shutdown");
        shut.map(drop).map_err(|error| exception(py, Operation::Close, error))
    }
}

/// Whether the driver only asks to be tried later. python-can has no class for this: its `socketcan` gives `ENOBUFS` or
/// `EAGAIN` in `error_code`, or, where `select` says that the socket is not writable, this message.
pub(super) fn is_queue_full(py: Python<'_>, error: &PyErr) -> bool {
    let value = error.value(py);
    let code: Option<i32> = value.getattr("error_code").and_then(|code| code.extract()).ok();
    matches!(code, Some(libc::ENOBUFS | libc::EAGAIN)) || value.to_string() == "Transmit buffer full"
}

/// The frames that found the receive queue of a Python socket full, since it was opened.
pub(super) fn kernel_drops(socket: &Bound<'_, PyAny>) -> PyResult<u64> {
    let option = (libc::SOL_SOCKET, libc::SO_MEMINFO, MEMINFO_BYTES);
    let counters: Vec<u8> = socket.call_method1("getsockopt", option)?.extract()?;
    Ok(drops_in(&counters)?)
}

/// State shared by both threads and the bus.
#[derive(Default)]
pub(super) struct Shared {
    /// Whether this end is leaving, or its threads are.
    pub(super) closing: AtomicBool,
    /// The threads leave the bus open for the caller.
    pub(super) keeps_open: AtomicBool,
    /// Frames that met a full receive queue here.
    dropped: AtomicU64,
    /// Frames that met a full receive queue in the kernel.
    pub(super) dropped_beneath: AtomicU64,
    /// Messages that are no frame.
    pub(super) discarded: AtomicU64,
    guard: Mutex<()>,
    arrival: Condvar,
}

impl Shared {
    /// Frames that met a full receive queue.
    pub(super) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed) + self.dropped_beneath.load(Ordering::Relaxed)
    }

    /// Wakes a thread that waits in [`Shared::wait_while`]. With the lock no wake-up is missed.
    fn announce(&self) {
        // Taking the lock waits for a waiter that is between its check and its sleep, and would miss the
        // notification.
        drop(self.guard.lock().unwrap_or_else(PoisonError::into_inner));
        self.arrival.notify_all();
    }

    /// Sleeps as long as `idle` holds, for `timeout` at most.
    pub(super) fn wait_while(&self, timeout: Duration, mut idle: impl FnMut() -> bool) {
        let guard = self.guard.lock().unwrap_or_else(PoisonError::into_inner);
        drop(self.arrival.wait_timeout_while(guard, timeout, |()| idle()));
    }
}

/// Filters for the receiver to set, and where to answer.
pub(super) struct FilterRequest {
    pub(super) filters: Vec<Filter>,
    pub(super) reply: mpsc::SyncSender<Result<(), PythonCanError>>,
}

/// The sender: takes frames out of the queue and gives them to python-can.
pub(super) struct Sender {
    pub(super) driver: Arc<Driver>,
    pub(super) outgoing: Consumer<Frame>,
    pub(super) failures: Producer<PythonCanError>,
    pub(super) shared: Arc<Shared>,
    /// Attempts left of [`ATTEMPTS_WHEN_CLOSING`].
    pub(super) attempts: u32,
}

impl Sender {
    /// Runs until the bus is closing and the queue is empty.
    pub(super) fn run(mut self) {
        Python::attach(|py| {
            loop {
                // Read before the queue is emptied, so that everything queued before the closing is sent.
                let closing = self.shared.closing.load(Ordering::Acquire);
                while let Ok(frame) = self.outgoing.pop() {
                    if let Err(error) = self.send(py, &frame) {
                        // A full ring holds older failures, which are nearer to the cause.
                        let _ = self.failures.push(exception(py, Operation::Send, error));
                        self.shared.announce();
                    }
                }
                if closing {
                    break;
                }
                // A frame queued since the last `pop` is not left behind: an `unpark` before `park` lets it return at
                // once.
                py.detach(thread::park);
            }
        });
    }

    /// Sends one frame, and again as long as the driver's transmit queue is full. The queue here then fills up, and the
    /// caller meets `QueueFull`.
    fn send(&mut self, py: Python<'_>, frame: &Frame) -> PyResult<()> {
        // Made once, and sent again as it is: only the driver was not ready for it.
        let message = message::from_frame(self.driver.message_class.bind(py), frame)?;
        loop {
            match self.driver.send(&message) {
                Err(error) if self.attempts > 0 && is_queue_full(py, &error) => {
                    // Attempts count while closing only. Until then a full queue is waited for.
                    self.attempts -= u32::from(self.shared.closing.load(Ordering::Acquire));
                    py.detach(|| thread::park_timeout(REST_AFTER_FULL));
                }
                outcome => return outcome,
            }
        }
    }
}

/// The receiver: takes messages from python-can and puts frames and error frames into the queue.
pub(super) struct Receiver {
    pub(super) driver: Arc<Driver>,
    pub(super) incoming: Producer<Incoming>,
    pub(super) failures: Producer<PythonCanError>,
    pub(super) requests: mpsc::Receiver<FilterRequest>,
    pub(super) shared: Arc<Shared>,
}

impl Receiver {
    /// Runs until the bus is closing, waits for the sender to empty its queue, and shuts the python-can bus down unless
    /// the caller continues to use it.
    pub(super) fn run(mut self, sender: JoinHandle<()>) -> Result<(), PythonCanError> {
        Python::attach(|py| {
            while !self.shared.closing.load(Ordering::Acquire) {
                if let Ok(FilterRequest { filters, reply }) = self.requests.try_recv() {
                    // The caller may have lost its patience and be gone.
                    let _ = reply.send(self.driver.set_filters(py, &filters));
                }
                match self.receive(py) {
                    Ok(true) => self.shared.announce(),
                    Ok(false) => {}
                    Err(error) => {
                        let _ = self.failures.push(exception(py, Operation::Receive, error));
                        self.shared.announce();
                        py.detach(|| thread::park_timeout(REST_AFTER_FAILURE));
                    }
                }
            }
            // The sender does not panic; if it did, the bus would still have to be shut down.
            let _ = py.detach(|| sender.join());
            if self.shared.keeps_open.load(Ordering::Acquire) {
                return Ok(());
            }
            self.driver.shutdown(py)
        })
    }

    /// Waits for one message. `true` if something was queued.
    fn receive(&mut self, py: Python<'_>) -> PyResult<bool> {
        // Before a message is taken, so that none is lost if this fails.
        if let Some(socket) = &self.driver.socket {
            let dropped = kernel_drops(socket.bind(py))?;
            self.shared.dropped_beneath.store(dropped, Ordering::Relaxed);
        }
        let lost = match self.driver.receive(py, RECEIVE_TIMEOUT)? {
            Taken::Nothing => return Ok(false),
            Taken::NoFrame => &self.shared.discarded,
            Taken::Message(incoming) => match self.incoming.push(incoming) {
                Ok(()) => return Ok(true),
                Err(_full) => &self.shared.dropped,
            },
        };
        lost.fetch_add(1, Ordering::Relaxed);
        Ok(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use pyo3::types::PyModule;
    use resonarm_protocol::Id;
    use rtrb::RingBuffer;

    /// A driver whose transmit queue is full for the first `full` calls, and which refuses the identifier 0.
    const DRIVER: &core::ffi::CStr = cr#"
from types import SimpleNamespace

class Driver:
    def __init__(self, full):
        self.full, self.sent = full, []

    def send(self, message):
        if self.full > 0:
            self.full -= 1
            error = OSError("Failed to transmit: No buffer space available")
            error.error_code = 105
            raise error
        if message.arbitration_id == 0:
            raise ValueError("not this one")
        self.sent.append(message.arbitration_id)
"#;

    /// Queues frames of these identifiers for a driver, closes, runs the sender to its end, and returns what the driver
    /// got and the failures.
    fn send(full: u32, ids: &[u16]) -> (Vec<u16>, Vec<String>) {
        let (mut queue, outgoing) = RingBuffer::new(ids.len());
        let (failures, mut failed) = RingBuffer::new(16);
        ids.iter().for_each(|&id| queue.push(Frame::classic(Id::Standard(id), &[]).unwrap()).unwrap());
        let driver = Arc::new(Python::attach(|py| {
            let module = PyModule::from_code(py, DRIVER, c"driver.py", c"driver").unwrap();
            let bus = module.getattr("Driver").unwrap().call1((full,)).unwrap().unbind();
            let message_class = module.getattr("SimpleNamespace").unwrap().unbind();
            Driver { bus, message_class, socket: None, error_frames: ErrorFrames::Other }
        }));
        let shared = Arc::new(Shared::default());
        shared.closing.store(true, Ordering::Release);
        let sender = Arc::clone(&driver);
        Sender { driver: sender, outgoing, failures, shared, attempts: ATTEMPTS_WHEN_CLOSING }.run();
        let sent = Python::attach(|py| driver.bus.getattr(py, "sent").unwrap().extract(py).unwrap());
        (sent, core::iter::from_fn(|| failed.pop().ok()).map(|failure| failure.to_string()).collect())
    }

    #[test]
    fn tries_again_while_the_transmit_queue_is_full() {
        assert_eq!(send(3, &[1, 2]), (vec![1, 2], vec![]));
    }

    #[test]
    fn loses_a_refused_frame_and_says_so() {
        let (sent, failures) = send(0, &[1, 0, 2]);
        assert_eq!(sent, [1, 2]);
        insta::assert_snapshot!(failures.join("\n"), @"python-can could not send: ValueError: not this one");
    }

    #[test]
    fn gives_up_when_closing() {
        let (sent, failures) = send(u32::MAX, &[1, 2]);
        assert!(sent.is_empty(), "{sent:?}");
        assert_eq!(failures.len(), 2);
        insta::assert_snapshot!(failures[0], @"python-can could not send: OSError: Failed to transmit: No buffer space available");
    }
}
