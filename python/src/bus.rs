//! A bus in memory, as Python sees it.

use core::time::Duration;
use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use resonarm::bus::memory::{self, MemoryBus, MemoryReceiver, MemorySender};

use crate::errors;
use crate::protocol::{FrameParts, Parts, parts};

/// Frames of each other end that an end keeps until it receives them: a few seconds of a bench at 1 kHz, for
/// listeners that are slower than simulated time.
const CAPACITY: usize = 1 << 14;
/// Interval of checks for signals of the system.
const LOOK_S: f64 = 0.05;

/// A bus inside this process.
#[pyclass(frozen, module = "resonarm._resonarm")]
pub struct Hub {
    ends: Mutex<Vec<MemoryBus>>,
}

#[pymethods]
impl Hub {
    /// A bus with this number of ends.
    #[new]
    fn new(ends: usize) -> Hub {
        Hub { ends: Mutex::new(memory::hub(ends, CAPACITY)) }
    }

    /// One of its ends, each given once.
    fn end(&self) -> PyResult<BusEnd> {
        let end = self.ends.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let end = end.ok_or_else(|| errors::failed("all ends of this bus in memory are in use"))?;
        Ok(BusEnd { whole: Mutex::new(Some(end)), sender: Mutex::new(None), receiver: Mutex::new(None) })
    }
}

/// One end of a bus in memory. Sending doesn't wait for a thread that receives.
#[pyclass(frozen, module = "resonarm._resonarm")]
pub struct BusEnd {
    whole: Mutex<Option<MemoryBus>>,
    sender: Mutex<Option<MemorySender>>,
    receiver: Mutex<Option<MemoryReceiver>>,
}

fn closed() -> PyErr {
    errors::bus(resonarm::bus::BusError::Closed)
}

impl BusEnd {
    /// The whole end, for a node.
    pub fn take(&self) -> PyResult<MemoryBus> {
        self.whole.lock().unwrap_or_else(PoisonError::into_inner).take().ok_or_else(closed)
    }

    /// Splits the end before it is used from Python.
    fn split(&self) {
        if let Some(bus) = self.whole.lock().unwrap_or_else(PoisonError::into_inner).take() {
            let (sender, receiver) = bus.split();
            *self.sender.lock().unwrap_or_else(PoisonError::into_inner) = Some(sender);
            *self.receiver.lock().unwrap_or_else(PoisonError::into_inner) = Some(receiver);
        }
    }
}

#[pymethods]
impl BusEnd {
    /// Sends a frame to every other end.
    fn send(&self, frame: FrameParts) -> PyResult<()> {
        self.split();
        let frame = frame.frame()?;
        let mut sender = self.sender.lock().unwrap_or_else(PoisonError::into_inner);
        sender.as_mut().ok_or_else(closed)?.send(&frame);
        Ok(())
    }

    /// The next frame, waiting for this time, s, or without one forever; `None` if there is none.
    #[pyo3(signature = (timeout_s = None))]
    fn receive(&self, py: Python<'_>, timeout_s: Option<f64>) -> PyResult<Option<Parts>> {
        self.split();
        let mut left_s = timeout_s.unwrap_or(f64::INFINITY).max(0.0);
        loop {
            // In parts, between which Ctrl-C is noticed.
            let part_s = left_s.min(LOOK_S);
            let received = py.detach(|| {
                let mut receiver = self.receiver.lock().unwrap_or_else(PoisonError::into_inner);
                let receiver = receiver.as_mut().ok_or_else(closed)?;
                // A frame that is waiting needs no system call.
                let next = receiver.receive();
                Ok::<_, PyErr>(match next {
                    None if part_s > 0.0 && receiver.wait(Duration::from_secs_f64(part_s)) => receiver.receive(),
                    next => next,
                })
            })?;
            left_s -= part_s;
            if received.is_some() || left_s <= 0.0 {
                return Ok(received.map(|frame| parts(&frame)));
            }
            py.check_signals()?;
        }
    }

    /// Frames lost because they were not received in time.
    #[getter]
    fn dropped(&self) -> u64 {
        let receiver = self.receiver.lock().unwrap_or_else(PoisonError::into_inner);
        receiver.as_ref().map_or(0, MemoryReceiver::dropped)
    }

    /// Leaves the bus: closes this end.
    fn close(&self) {
        self.split();
        *self.sender.lock().unwrap_or_else(PoisonError::into_inner) = None;
        *self.receiver.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}
