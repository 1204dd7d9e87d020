//! A bus that takes nothing for a while.

use core::time::Duration;

use super::ScriptedClock;
use resonarm_bus::{Bus, BusError, Filter, Received, Sent, Statistics};
use resonarm_protocol::Frame;
use resonarm_realtime::Clock;

/// A bus whose transmit queue is full for a while, and which always has something unread.
pub(super) struct JammedBus {
    pub clock: ScriptedClock,
    pub until_ns: u64,
    pub sent: u64,
}

impl Bus for JammedBus {
    fn name(&self) -> String {
        String::from("jammed")
    }

    fn send(&mut self, _frame: &Frame) -> Result<Sent, BusError> {
        if self.clock.now_ns() < self.until_ns {
            return Ok(Sent::QueueFull);
        }
        self.sent += 1;
        Ok(Sent::Queued)
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        Ok(None)
    }

    fn wait(&mut self, _timeout: Duration) -> Result<bool, BusError> {
        Ok(true)
    }

    fn set_filters(&mut self, _filters: &[Filter]) -> Result<(), BusError> {
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        Statistics::default()
    }

    fn close(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}
