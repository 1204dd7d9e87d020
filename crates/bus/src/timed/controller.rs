//! One node's controller on the wire: mailboxes, inbox and error counters.

use std::collections::VecDeque;

use resonarm_protocol::Frame;

use crate::{Filter, Received, accepts};

/// Frames not yet received that an end keeps.
const INBOX: usize = 1024;
/// Number of times that 11 recessive bits must have been on the bus until a controller that is bus-off takes part
/// again.
const RECOVERY: u64 = 128;

/// State of a controller on the bus (ISO 11898-1, fault confinement).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorState {
    /// The controller takes part, and destroys a frame in which it sees an error.
    Active,
    /// The controller takes part, can't destroy the frames of others, and waits before it sends again.
    Passive,
    /// The controller takes no part.
    BusOff,
}

/// A controller's error counters, by the rules of ISO 11898-1 for errors of the wire, which its sender sees first.
///
/// | event | transmit errors | receive errors |
/// | --- | ---: | ---: |
/// | an error in a frame that it sends | +8 | |
/// | a frame that it sends is not acknowledged while it is passive | +0 | |
/// | an error in a frame of another | | +1 |
/// | a frame sent | −1, not below 0 | |
/// | a frame received | | −1, not below 0; from 128 on to 119 |
///
/// It is passive from 128 of either on, and bus-off from 256 transmit errors on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ErrorCounters {
    /// Transmit error counter (TEC of ISO 11898-1).
    pub transmit: u16,
    /// Receive errors, at most 255.
    pub receive: u16,
}

impl ErrorCounters {
    /// The state that follows from the counters.
    pub const fn state(self) -> ErrorState {
        match (self.transmit, self.receive) {
            (256.., _) => ErrorState::BusOff,
            (128.., _) | (_, 128..) => ErrorState::Passive,
            _ => ErrorState::Active,
        }
    }

    pub(super) fn sent(&mut self) {
        self.transmit = self.transmit.saturating_sub(1);
    }

    pub(super) fn received(&mut self) {
        // ISO 11898-1 allows any value from 119 to 127 here: one good frame makes a passive receiver active again.
        self.receive = if self.receive > 127 { 119 } else { self.receive.saturating_sub(1) };
    }

    pub(super) fn transmit_error(&mut self, cause: ErrorCause) {
        // The exception of ISO 11898-1: a passive node that is alone on the bus is never acknowledged, and must not
        // go bus-off for it.
        if cause == ErrorCause::Bit || self.state() == ErrorState::Active {
            self.transmit += 8;
        }
    }

    pub(super) fn receive_error(&mut self) {
        // A receiver is passive from 128 on however large the counter is, and controllers have 8 bits for it.
        self.receive = (self.receive + 1).min(255);
    }
}

/// Cause that destroyed a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorCause {
    /// A bit was not what was sent.
    Bit,
    /// No other node acknowledged the frame.
    Acknowledgement,
}

/// Outcome of a frame, as one of the nodes sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The node's own frame was sent.
    Sent(Frame),
    /// A frame was destroyed.
    Destroyed {
        /// Frame that was destroyed.
        frame: Frame,
        /// Error that destroyed the frame.
        cause: ErrorCause,
        /// Whether it was the node's own.
        is_own: bool,
    },
}

/// One node on the wire.
pub(super) struct Controller {
    /// Frames to send, first in, first out, and when they were put there, ns.
    pub mailboxes: VecDeque<(Frame, u64)>,
    capacity: usize,
    pub inbox: VecDeque<Received>,
    pub filters: Vec<Filter>,
    pub dropped: u64,
    pub counters: ErrorCounters,
    /// Until when a passive controller waits before it sends again, ns.
    pub suspended_until_ns: u64,
    /// Bus-off: how often 11 recessive bits are still to come.
    pub recovery: Option<u64>,
    /// Whether this end is in use.
    pub is_open: bool,
    /// Outcomes of frames, if somebody fetches them.
    pub outcomes: Option<Vec<Outcome>>,
}

impl Controller {
    pub fn new(mailboxes: usize) -> Controller {
        Controller {
            mailboxes: VecDeque::with_capacity(mailboxes),
            capacity: mailboxes,
            inbox: VecDeque::with_capacity(INBOX),
            filters: Vec::new(),
            dropped: 0,
            counters: ErrorCounters::default(),
            suspended_until_ns: 0,
            recovery: None,
            is_open: true,
            outcomes: None,
        }
    }

    /// Notes what became of a frame.
    pub fn note(&mut self, outcome: Outcome) {
        if let Some(outcomes) = &mut self.outcomes {
            outcomes.push(outcome);
        }
    }

    /// Takes a frame to send, if there is room.
    pub fn queue(&mut self, now_ns: u64, frame: &Frame) -> bool {
        let has_room = self.mailboxes.len() < self.capacity;
        if has_room {
            self.mailboxes.push_back((*frame, now_ns));
        }
        has_room
    }

    /// Whether it acknowledges the frames of others.
    pub fn listens(&self) -> bool {
        self.is_open && self.recovery.is_none()
    }

    pub fn take(&mut self, frame: &Frame) {
        // Before the filters: a controller checks and acknowledges every frame, whether or not its node wants it.
        self.counters.received();
        if !accepts(&self.filters, frame) {
            return;
        }
        if self.inbox.len() == INBOX {
            self.dropped += 1;
        } else {
            self.inbox.push_back(Received { frame: *frame, timestamp_ns: None });
        }
    }

    /// Leaves the bus if there were too many errors; its frames to send are lost.
    pub fn judge(&mut self) {
        if self.counters.state() == ErrorState::BusOff && self.recovery.is_none() {
            self.mailboxes.clear();
            self.recovery = Some(RECOVERY);
        }
    }

    /// 11 recessive bits were on the bus, so often.
    pub fn idle(&mut self, times: u64) {
        match self.recovery {
            Some(left) if left > times => self.recovery = Some(left - times),
            // After the recovery both counters begin at 0 (ISO 11898-1).
            Some(_) => (self.recovery, self.counters) = (None, ErrorCounters::default()),
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BIT: ErrorCause = ErrorCause::Bit;

    fn after(events: &[fn(&mut ErrorCounters)]) -> (u16, u16, ErrorState) {
        let mut counters = ErrorCounters::default();
        events.iter().for_each(|event| event(&mut counters));
        (counters.transmit, counters.receive, counters.state())
    }

    #[test]
    fn counters_follow_the_rules_of_the_standard() {
        let failed: fn(&mut ErrorCounters) = |c| c.transmit_error(BIT);
        let alone: fn(&mut ErrorCounters) = |c| c.transmit_error(ErrorCause::Acknowledgement);
        let heard: fn(&mut ErrorCounters) = |c| c.receive_error();
        let sent: fn(&mut ErrorCounters) = |c| c.sent();
        let received: fn(&mut ErrorCounters) = |c| c.received();
        use ErrorState::{Active, BusOff, Passive};
        assert_eq!(after(&[sent, received]), (0, 0, Active));
        assert_eq!(after(&[failed, failed, sent, heard]), (15, 1, Active));
        assert_eq!(after(&[failed; 15]), (120, 0, Active));
        assert_eq!(after(&[failed; 16]), (128, 0, Passive));
        assert_eq!(after(&[&[failed; 16][..], &[sent]].concat()), (127, 0, Active));
        assert_eq!(after(&[failed; 31]), (248, 0, Passive));
        assert_eq!(after(&[failed; 32]), (256, 0, BusOff));
        // Without anybody to acknowledge, a controller becomes passive and stays so.
        assert_eq!(after(&[alone; 1000]), (128, 0, Passive));
        assert_eq!(after(&[heard; 127]), (0, 127, Active));
        assert_eq!(after(&[heard; 128]), (0, 128, Passive));
        assert_eq!(after(&[heard; 300]), (0, 255, Passive));
        assert_eq!(after(&[&[heard; 300][..], &[received]].concat()), (0, 119, Active));
    }

    #[test]
    fn bus_off_ends_after_128_times_11_recessive_bits_with_counters_at_zero() {
        let mut controller = Controller::new(3);
        controller.counters = ErrorCounters { transmit: 256, receive: 5 };
        controller.judge();
        controller.idle(127);
        assert!(!controller.listens());
        controller.idle(1);
        assert!(controller.listens());
        assert_eq!(controller.counters, ErrorCounters::default());
    }
}
