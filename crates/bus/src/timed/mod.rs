//! A bus on which frames take their time: every bit of a frame, its stuff bits and the intermission, in simulated time.
//!
//! - A frame starts when the bus is free. Of those that wait then, the lowest identifier wins; the others try again.
//! - Each node sends its frames first in, first out, from a few mailboxes; full ones are [`Sent::QueueFull`].
//! - A frame is received at the end of its last bit, before the three bits of intermission.
//! - With a bit error rate, a bit that is not what was sent ends a frame with an error frame, and it is sent again.
//!   Error counters, the passive state, bus-off and recovery follow ISO 11898-1.
//! - The sender sees the error at its bit and sends an error flag of 6 bits, dominant if it is active. Others see it
//!   there only if that bit breaks a rule, otherwise by the flag: at the sixth equal bit at the latest. Then they send
//!   theirs, so that the flags together take 6 to 12 bits; the delimiter of 8 bits and the intermission follow.
//! - A frame that no other node acknowledges is sent again and again, as on a real bus.
//!
//! All nodes see the same bit at the same time: the wire has no length, and no error is seen by one receiver alone. Bit
//! rates and sample points have no tolerance.
//!
//! The ends share one state behind a lock. In a free run one loop has all ends and doesn't wait for it; in lockstep two
//! threads do. It is not for a real-time loop.

mod controller;
mod wire;

use core::time::Duration;
use std::sync::Arc;
use std::sync::{Mutex, MutexGuard, PoisonError};

use resonarm_protocol::Frame;
use resonarm_protocol::bits::{BitRates, Bits};

pub use controller::{ErrorCause, ErrorCounters, ErrorState, Outcome};

use self::wire::Wire;
use super::{Bus, Filter, Received, Sent, Statistics, VirtualBus};
use crate::error::BusError;
use resonarm_realtime::Clock;

/// Mailboxes of the common small controllers (bxCAN).
pub const MAILBOXES: usize = 3;
/// Name of the bus.
const NAME: &str = "timed";
/// Longest sleep between two looks at the inbox in [`Bus::wait`], ns: another thread may send.
const LOOK_NS: u64 = 100_000;

/// The parameters of a bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spec {
    /// Bit rates of arbitration and data phase.
    pub rates: BitRates,
    /// Frames that each node keeps to send.
    pub mailboxes: usize,
    /// The probability that a bit is not what was sent, 0 to less than 1.
    pub bit_error_rate: f64,
    /// Seed of the bit errors.
    pub seed: u64,
}

impl Spec {
    /// A bus without bit errors, with [`MAILBOXES`].
    pub const fn new(rates: BitRates) -> Spec {
        Spec { rates, mailboxes: MAILBOXES, bit_error_rate: 0.0, seed: 0 }
    }
}

/// The traffic on the bus so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Number of frames sent completely.
    pub frames: u64,
    /// Frames that an error ended.
    pub error_frames: u64,
    /// All bits of both, with error frames and intermissions. With [`Bits::time_ns`] it is how long the bus was busy.
    pub bits: Bits,
}

/// A bus with `nodes` ends, in the time of `clock`.
pub fn hub<C: Clock + Clone>(nodes: usize, spec: &Spec, clock: &C) -> Vec<TimedBus<C>> {
    let wire = Arc::new(Mutex::new(Wire::new(nodes, spec)));
    (0..nodes).map(|node| TimedBus::new(&wire, node, clock)).collect()
}

/// A bus with two ends, as [`hub`] makes it.
pub fn pair<C: Clock + Clone>(spec: &Spec, clock: &C) -> [TimedBus<C>; 2] {
    let wire = Arc::new(Mutex::new(Wire::new(2, spec)));
    [0, 1].map(|node| TimedBus::new(&wire, node, clock))
}

/// One end of the bus that [`hub`] makes.
pub struct TimedBus<C> {
    wire: Arc<Mutex<Wire>>,
    node: usize,
    clock: C,
    statistics: Statistics,
    is_open: bool,
}

impl<C: Clock + Clone> TimedBus<C> {
    fn new(wire: &Arc<Mutex<Wire>>, node: usize, clock: &C) -> TimedBus<C> {
        let wire = Arc::clone(wire);
        let clock = clock.clone();
        TimedBus { wire, node, clock, statistics: Statistics::default(), is_open: true }
    }
}

impl<C: Clock> TimedBus<C> {
    /// The traffic on the bus so far.
    pub fn traffic(&self) -> Traffic {
        self.now().traffic
    }

    /// Returns the outcomes of frames since the last call, as this end sees them; recorded from the first call on.
    pub fn take_outcomes(&mut self) -> Vec<Outcome> {
        self.now().controllers[self.node].outcomes.replace(Vec::new()).unwrap_or_default()
    }

    /// The error counters of this end's controller.
    pub fn error_counters(&self) -> ErrorCounters {
        self.now().controllers[self.node].counters
    }

    fn lock(&self) -> MutexGuard<'_, Wire> {
        // Nothing panics while it is held, and if it did, another end could still use it.
        self.wire.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The wire as it is now.
    fn now(&self) -> MutexGuard<'_, Wire> {
        let mut wire = self.lock();
        wire.advance(self.clock.now_ns());
        wire
    }

    fn check_open(&self) -> Result<(), BusError> {
        if self.is_open { Ok(()) } else { Err(BusError::Closed) }
    }

    fn bus_off(&self) -> BusError {
        BusError::BusOff { interface: String::from(NAME) }
    }
}

impl<C: Clock + Send> Bus for TimedBus<C> {
    fn name(&self) -> String {
        String::from(NAME)
    }

    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        self.check_open()?;
        let mut wire = self.now();
        let controller = &mut wire.controllers[self.node];
        if controller.recovery.is_some() {
            drop(wire);
            return Err(self.bus_off());
        }
        let is_queued = controller.queue(self.clock.now_ns(), frame);
        drop(wire);
        self.statistics.sent += u64::from(is_queued);
        self.statistics.queue_full += u64::from(!is_queued);
        Ok(if is_queued { Sent::Queued } else { Sent::QueueFull })
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        self.check_open()?;
        let mut wire = self.now();
        let controller = &mut wire.controllers[self.node];
        let next = controller.inbox.pop_front();
        let is_off = controller.recovery.is_some();
        drop(wire);
        // Frames that came before bus-off are given out first.
        if next.is_none() && is_off {
            return Err(self.bus_off());
        }
        self.statistics.received += u64::from(next.is_some());
        Ok(next)
    }

    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError> {
        self.check_open()?;
        let end_ns = self.clock.now_ns().saturating_add(u64::try_from(timeout.as_nanos()).unwrap_or(u64::MAX));
        loop {
            let mut wire = self.now();
            if !wire.controllers[self.node].inbox.is_empty() {
                return Ok(true);
            }
            let now_ns = self.clock.now_ns();
            let next_ns = wire.next_event_ns(now_ns).unwrap_or(u64::MAX);
            drop(wire);
            if now_ns >= end_ns {
                return Ok(false);
            }
            self.clock.sleep_until_ns(end_ns.min(next_ns).min(now_ns + LOOK_NS));
        }
    }

    fn set_filters(&mut self, filters: &[Filter]) -> Result<(), BusError> {
        self.check_open()?;
        self.now().controllers[self.node].filters = filters.to_vec();
        Ok(())
    }

    fn statistics(&self) -> Statistics {
        Statistics { dropped: self.lock().controllers[self.node].dropped, ..self.statistics }
    }

    fn close(&mut self) -> Result<(), BusError> {
        self.check_open()?;
        self.is_open = false;
        let mut wire = self.now();
        let controller = &mut wire.controllers[self.node];
        controller.is_open = false;
        controller.inbox.clear();
        Ok(())
    }
}

impl<C> Drop for TimedBus<C> {
    /// A dropped end acknowledges nothing.
    fn drop(&mut self) {
        self.wire.lock().unwrap_or_else(PoisonError::into_inner).controllers[self.node].is_open = false;
    }
}

impl<C: Clock + Send> VirtualBus for TimedBus<C> {
    fn next_event_ns(&mut self) -> Option<u64> {
        self.lock().next_event_ns(self.clock.now_ns())
    }
}

#[cfg(test)]
mod tests;
