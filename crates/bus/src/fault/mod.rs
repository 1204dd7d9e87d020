//! Faults of the network: any bus with loss, delays, corrupted content, a babbling node, bus-off or a cut line.
//!
//! A fault belongs to one end. Its random numbers are of a stream of the scenario's seed, one for each fault and
//! direction, so that the same frames at the same times have the same faults. Faults of a direction act on each frame
//! in the order in which they are stated.

mod line;
mod spec;

use core::ops::Range;
use core::time::Duration;

use resonarm_protocol::{Frame, Id, Node};

pub use spec::{FaultDirection, FaultError, FaultKind, FaultNode, FaultSpec, MOST_FAULTS, check};

use self::line::{Line, stream};
use super::{Bus, Filter, Received, Sent, Statistics, VirtualBus, one_by_one};
use crate::controller::{ControllerErrors, ControllerState};
use crate::error::BusError;
use resonarm_numeric::noise::Noise;
use resonarm_realtime::Clock;

/// Frames taken from the bus beneath in one go.
const AT_ONCE: usize = 256;
/// Time to wait before a full transmit queue beneath is tried again, ns.
const RETRY_NS: u64 = 100_000;

/// An end of a bus with faults. Without faults it is that end.
pub struct Faulty<B, C> {
    bus: B,
    clock: C,
    /// Time at which the bus was opened, from which times count, ns.
    start_ns: u64,
    outgoing: Line,
    incoming: Line,
    babble: Vec<Babble>,
    bus_off_ns: Vec<Range<u64>>,
    /// Whether the node's controller was bus-off when it was looked at last, and how often it became so.
    is_off: bool,
    bus_offs: u64,
    /// Whether it has no faults.
    is_sound: bool,
    received: u64,
    sent: u64,
    queue_full: u64,
    is_open: bool,
}

impl<B: Bus, C: Clock> Faulty<B, C> {
    /// `bus` with those of `faults` that `node` has; times count from now. The faults are such as [`check`] takes.
    pub fn new(bus: B, clock: C, faults: &[FaultSpec], node: Node, seed: u64) -> Faulty<B, C> {
        let own: Vec<_> = faults.iter().enumerate().filter(|(_, fault)| Node::from(fault.node) == node).collect();
        let babble = own.iter().filter_map(|(index, fault)| Babble::new(fault, *index, seed)).collect();
        let off = own.iter().filter(|(_, fault)| fault.kind == FaultKind::BusOff);
        let bus_off_ns = off.map(|(_, fault)| fault.span_ns()).collect();
        Faulty {
            start_ns: clock.now_ns(),
            outgoing: Line::new(&own, FaultDirection::Send, seed),
            incoming: Line::new(&own, FaultDirection::Receive, seed),
            bus,
            clock,
            babble,
            bus_off_ns,
            is_off: false,
            bus_offs: 0,
            is_sound: own.is_empty(),
            received: 0,
            sent: 0,
            queue_full: 0,
            is_open: true,
        }
    }

    /// The time since it was opened, ns. Without faults it is not needed, and no clock is read.
    fn now_ns(&self) -> u64 {
        if self.is_sound { 0 } else { self.clock.now_ns().saturating_sub(self.start_ns) }
    }

    /// The node's controller may be bus-off: then waiting and incoming frames are lost.
    fn check(&mut self, now_ns: u64) -> Result<(), BusError> {
        if !self.is_open {
            return Err(BusError::Closed);
        }
        let was_off = self.is_off;
        self.is_off = self.bus_off_ns.iter().any(|span| span.contains(&now_ns));
        if !self.is_off {
            return Ok(());
        }
        // Only the change counts: the same bus-off is looked at many times.
        self.bus_offs += u64::from(!was_off);
        self.outgoing.clear();
        self.incoming.clear();
        for _ in 0..AT_ONCE {
            // Bounded, so that a sender that is faster than this loop can't hold the caller here.
            if self.bus.receive()?.is_none() {
                break;
            }
        }
        Err(BusError::BusOff { interface: self.bus.name() })
    }

    /// Sends the frames that are due, and those of a babbling node. `false` if the transmit queue beneath is full.
    fn pump(&mut self, now_ns: u64) -> Result<bool, BusError> {
        // As with a cut cable: without an acknowledgement the controller keeps its frames, until its queue is full.
        if self.outgoing.is_down(now_ns) {
            return Ok(false);
        }
        for babble in &mut self.babble {
            if let Some(frame) = babble.poll(now_ns) {
                self.bus.send(&frame)?;
            }
        }
        while let Some(held) = self.outgoing.peek(now_ns) {
            // The frame stays in the line until the bus has taken it, so a full queue loses nothing.
            if self.bus.send(&held.frame)? == Sent::QueueFull {
                return Ok(false);
            }
            self.outgoing.pop(now_ns);
        }
        Ok(true)
    }

    /// Takes in the frames received beneath.
    fn take_in(&mut self, now_ns: u64) -> Result<(), BusError> {
        for _ in 0..AT_ONCE {
            // What finds no room stays on the bus beneath, whose own queue bounds it and counts what is lost.
            if !self.incoming.has_room() {
                break;
            }
            let Some(received) = self.bus.receive()? else { break };
            self.incoming.put(now_ns, received);
        }
        Ok(())
    }

    /// Returns the time at which something happens here by itself, ns since the bus was opened.
    fn next_ns(&self) -> u64 {
        let babble = self.babble.iter().map(|babble| babble.next_ns).min();
        [self.outgoing.next_due_ns(), self.incoming.next_due_ns(), babble]
            .into_iter()
            .flatten()
            .min()
            .unwrap_or(u64::MAX)
    }
}

impl<B: Bus, C: Clock + Send> Bus for Faulty<B, C> {
    fn name(&self) -> String {
        self.bus.name()
    }

    fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        if self.outgoing.is_sound() {
            return self.send_all(&mut core::slice::from_ref(frame));
        }
        let now_ns = self.now_ns();
        self.check(now_ns)?;
        if !self.pump(now_ns)? || !self.outgoing.has_room() {
            self.queue_full += 1;
            return Ok(Sent::QueueFull);
        }
        self.outgoing.put(now_ns, Received { frame: *frame, timestamp_ns: None });
        self.sent += 1;
        self.pump(now_ns)?;
        Ok(Sent::Queued)
    }

    fn send_all(&mut self, frames: &mut &[Frame]) -> Result<Sent, BusError> {
        if !self.outgoing.is_sound() {
            return one_by_one(self, frames);
        }
        let now_ns = self.now_ns();
        self.check(now_ns)?;
        // On a sound line nothing waits: what it pumps is the babble's.
        self.pump(now_ns)?;
        let before = frames.len();
        let outcome = self.bus.send_all(frames);
        self.sent += (before - frames.len()) as u64;
        outcome
    }

    fn receive(&mut self) -> Result<Option<Received>, BusError> {
        let now_ns = self.now_ns();
        self.check(now_ns)?;
        self.pump(now_ns)?;
        let next = if self.incoming.is_sound() {
            self.bus.receive()?
        } else {
            self.take_in(now_ns)?;
            self.incoming.pop(now_ns)
        };
        self.received += u64::from(next.is_some());
        Ok(next)
    }

    fn wait(&mut self, timeout: Duration) -> Result<bool, BusError> {
        if self.is_sound {
            self.check(0)?;
            return self.bus.wait(timeout);
        }
        let end_ns = self.now_ns().saturating_add(u64::try_from(timeout.as_nanos()).unwrap_or(u64::MAX));
        loop {
            let now_ns = self.now_ns();
            self.check(now_ns)?;
            let retry_ns = if self.pump(now_ns)? { now_ns } else { now_ns + RETRY_NS };
            if !self.incoming.is_sound() {
                self.take_in(now_ns)?;
                if self.incoming.peek(now_ns).is_some() {
                    return Ok(true);
                }
            }
            // A frame that is due but found no room beneath would make this wait zero. The time to retry keeps the
            // loop from spinning on it.
            let until_ns = end_ns.min(self.next_ns().max(retry_ns));
            let has_come = self.bus.wait(Duration::from_nanos(until_ns.saturating_sub(now_ns)))?;
            if has_come && self.incoming.is_sound() {
                return Ok(true);
            }
            if now_ns >= end_ns {
                // Frames that the faults lose or delay must not prolong the wait, however many come.
                if has_come {
                    self.take_in(now_ns)?;
                }
                return Ok(self.incoming.peek(now_ns).is_some());
            }
        }
    }

    fn set_filters(&mut self, filters: &[Filter]) -> Result<(), BusError> {
        self.bus.set_filters(filters)
    }

    fn work_on_caller(&mut self) -> Result<(), BusError> {
        self.bus.work_on_caller()
    }

    fn check_fd(&self) -> Result<(), BusError> {
        self.bus.check_fd()
    }

    fn statistics(&self) -> Statistics {
        let Statistics { dropped, malformed, queue_full, errors, .. } = self.bus.statistics();
        Statistics {
            received: self.received,
            sent: self.sent,
            dropped: dropped + self.incoming.dropped,
            malformed,
            queue_full: queue_full + self.queue_full,
            errors: ControllerErrors { bus_off: errors.bus_off + self.bus_offs, ..errors },
        }
    }

    fn controller(&self) -> ControllerState {
        self.bus.controller()
    }

    /// Frames that still wait are sent at once.
    fn close(&mut self) -> Result<(), BusError> {
        if self.is_open {
            self.pump(u64::MAX)?;
        }
        self.is_open = false;
        self.bus.close()
    }
}

impl<B: VirtualBus, C: Clock + Send> VirtualBus for Faulty<B, C> {
    /// A frame that is due and waits for room on the bus is sent with an event of that bus.
    fn next_event_ns(&mut self) -> Option<u64> {
        let now_ns = self.now_ns();
        let is_to_come = |next_ns: &u64| *next_ns > now_ns && *next_ns < u64::MAX;
        let own_ns = Some(self.next_ns()).filter(is_to_come).map(|next_ns| next_ns + self.start_ns);
        [own_ns, self.bus.next_event_ns()].into_iter().flatten().min()
    }
}

/// A babbling node: a frame at `from`, and then at every period.
struct Babble {
    ids: Vec<Id>,
    /// Number of frames that have been due so far.
    turns: u64,
    rate_hz: f64,
    span_ns: Range<u64>,
    /// Time at which the next frame is due, ns; never, once the fault is over.
    next_ns: u64,
    content: Noise,
}

impl Babble {
    fn new(spec: &FaultSpec, index: usize, seed: u64) -> Option<Babble> {
        let rate_hz = spec.rate_hz.filter(|_| spec.kind == FaultKind::Babble)?;
        let mut ids = spec.identifiers();
        if ids.is_empty() {
            // The lowest identifier wins every arbitration, which is the worst that a babbling node can do.
            ids.push(Id::Standard(0));
        }
        let span_ns = spec.span_ns();
        let content = stream(seed, index, FaultDirection::Send);
        Some(Babble { ids, turns: 0, rate_hz, next_ns: span_ns.start, span_ns, content })
    }

    /// The frame that is due. Those before it that were not fetched in time are left out.
    fn poll(&mut self, now_ns: u64) -> Option<Frame> {
        if now_ns < self.next_ns || self.next_ns == u64::MAX {
            return None;
        }
        let since_s = now_ns.min(self.span_ns.end).saturating_sub(self.span_ns.start) as f64 * 1e-9;
        // Counted by the time since the start. Adding up periods would add up their rounding errors, too.
        self.turns = (libm::floor(since_s * self.rate_hz) as u64).max(self.turns) + 1;
        let next_ns = self.span_ns.start.saturating_add(spec::nanoseconds(self.turns as f64 / self.rate_hz));
        self.next_ns = if self.span_ns.contains(&next_ns) { next_ns } else { u64::MAX };
        let id = self.ids[(self.turns - 1) as usize % self.ids.len()];
        let is_over = now_ns >= self.span_ns.end;
        Frame::classic(id, &self.content.bits().to_le_bytes()).ok().filter(|_| !is_over)
    }
}

#[cfg(test)]
mod tests;
