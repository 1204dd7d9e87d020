//! A bus and a clock, as the cases need them.

use core::time::Duration;

use super::{Case, Evidence, Finding};
use crate::bus::{Bus, BusError, Sent};
use crate::protocol::Frame;
use crate::realtime::{Clock, SystemClock};

/// What came of a wish to take a node off the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusOff {
    /// Its controller is bus-off.
    Done,
    /// Only its own controller can go bus-off.
    Impossible,
}

/// One end of a bus, with the time on it. In tests it steps a node in virtual time.
pub trait Wire {
    /// The time, ns of any clock that only goes forward.
    fn now_ns(&self) -> u64;

    /// Sends a frame.
    ///
    /// # Errors
    /// [`BusError`] if the bus can't.
    fn send(&mut self, frame: &Frame) -> Result<(), BusError>;

    /// The next frame, or `None` when it is `until_ns` and none has come.
    ///
    /// # Errors
    /// [`BusError`] if the bus is gone.
    fn receive(&mut self, until_ns: u64) -> Result<Option<Frame>, BusError>;

    /// Has the controller of the node under test go bus-off for a time, ns: on a bus in virtual time.
    fn take_off(&mut self, _for_ns: u64) -> BusOff {
        BusOff::Impossible
    }
}

/// A bus in real time.
pub struct BusWire<'b> {
    bus: &'b mut dyn Bus,
    clock: SystemClock,
    /// What records the frames, if anything does.
    pub evidence: Option<Evidence>,
}

impl<'b> BusWire<'b> {
    /// The end of a bus, with the monotonic clock.
    pub fn new(bus: &'b mut dyn Bus, evidence: Option<Evidence>) -> BusWire<'b> {
        BusWire { bus, clock: SystemClock, evidence }
    }

    /// Records that a case begins.
    pub fn begin(&mut self, case: &Case) {
        if let Some(evidence) = &mut self.evidence {
            evidence.begin(case);
        }
    }

    /// Records that it has ended.
    pub fn end(&mut self, case: &Case, finding: &Finding) {
        if let Some(evidence) = &mut self.evidence {
            evidence.end(case, finding);
        }
    }
}

/// How long a full transmit queue is waited for, ns.
const FULL_NS: u64 = 100_000_000;

impl Wire for BusWire<'_> {
    fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let give_up_ns = self.now_ns() + FULL_NS;
        // A frame that can't be sent is lost, as on any bus: the cases say what became of it.
        while self.bus.send(frame)? == Sent::QueueFull {
            if self.now_ns() >= give_up_ns {
                return Ok(());
            }
            self.clock.sleep_until_ns(self.now_ns() + 1_000_000);
        }
        if let Some(evidence) = &mut self.evidence {
            evidence.sent(frame);
        }
        Ok(())
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Frame>, BusError> {
        loop {
            if let Some(received) = self.bus.receive()? {
                if let Some(evidence) = &mut self.evidence {
                    evidence.received(received);
                }
                return Ok(Some(received.frame));
            }
            let left_ns = until_ns.saturating_sub(self.now_ns());
            if left_ns == 0 {
                return Ok(None);
            }
            self.bus.wait(Duration::from_nanos(left_ns))?;
        }
    }
}
