//! Messages that a mapped plant receives.

use alloc::vec;
use alloc::vec::Vec;

use super::mapping::{Action, Counts, Incoming, ProtectionCheck, ProtectionFault, Unreadable};
use crate::rig::Load;
use resonarm_protocol::Frame;
use resonarm_protocol::node::{FrameCheck, Listening};

/// A message with what has been received of it.
#[derive(Clone, Debug)]
pub(super) struct Receiver {
    pub message: Incoming,
    protection: ProtectionCheck,
    /// Last value of each event's signal.
    values: Vec<Option<f64>>,
    /// Last received load until it is judged.
    pending: Option<Load>,
    /// Part of the acting load that it commands.
    taken: Load,
    /// Time of its reception, or of arming the drive, ns of time listened.
    taken_ns: u64,
}

impl Receiver {
    pub fn new(message: Incoming) -> Receiver {
        let values = vec![None; message.events.len()];
        let protection = ProtectionCheck::new(message.form(), &message.protection);
        Receiver { message, protection, values, pending: None, taken: Load::default(), taken_ns: 0 }
    }

    /// Returns whether it commands a load.
    pub fn is_command(&self) -> bool {
        !self.message.commands.is_empty()
    }

    /// Checks format, length, checksum, counter and every used signal, before any of them takes effect.
    ///
    /// # Errors
    /// The check that failed: the frame must not be used.
    pub fn check(&mut self, frame: &Frame) -> Result<(), FrameCheck> {
        // Checksum and counter first: a damaged frame must not even be read.
        self.protection.lost(frame)?;
        Ok(self.message.check(frame.data())?)
    }

    /// Returns the request of event `index` in this payload.
    ///
    /// # Errors
    /// As [`Receiver::check`], which finds all of them.
    pub fn action(&mut self, index: usize, payload: &[u8]) -> Result<Option<Action>, FrameCheck> {
        let event = &self.message.events[index];
        let Some(signal) = &event.signal else { return Ok(event.actions.first().map(|(_, action)| *action)) };
        let Some(value) = signal.read(payload)? else { return Ok(None) };
        // The value is remembered even if it does not count, since the next one is compared with it.
        let before = self.values[index].replace(value);
        let counts = event.counts == Counts::InEveryFrame || before != Some(value);
        let asked = event.actions.iter().find(|(asking, _)| *asking == value).map(|(_, action)| *action);
        Ok(asked.filter(|_| counts))
    }

    /// Returns the last value of the signal of event `index`.
    pub fn value(&self, index: usize) -> Option<f64> {
        self.values.get(index).copied().flatten()
    }

    /// Returns whether every signal with required values has one of them.
    pub fn is_ready(&self) -> bool {
        let has = |required: &[f64], value: &Option<f64>| {
            required.is_empty() || value.is_some_and(|value| required.contains(&value))
        };
        self.message.events.iter().zip(&self.values).all(|(event, value)| has(&event.required, value))
    }

    /// Takes in the load of a payload; `false` if it is multiplexed to other signals.
    ///
    /// # Errors
    /// As [`Receiver::check`], which finds all of them.
    pub fn receive(&mut self, payload: &[u8]) -> Result<bool, FrameCheck> {
        let load = self.message.load(payload)?;
        // A payload without the load, multiplexed to other signals, leaves a waiting one.
        self.pending = load.or(self.pending);
        Ok(load.is_some())
    }

    /// Returns whether a load waits to be judged.
    pub fn is_new(&self) -> bool {
        self.pending.is_some()
    }

    /// Returns its part of the load that is judged.
    pub fn share(&self) -> Load {
        self.pending.unwrap_or(self.taken)
    }

    /// Notes that the waiting load has been judged.
    pub fn judged(&mut self, is_taken: bool, listening: &Listening) {
        if let Some(load) = self.pending.take().filter(|_| is_taken) {
            self.taken = load;
            self.taken_ns = listening.listened_ns();
        }
    }

    /// Commands no load any more, and restarts the timeout.
    pub fn restart(&mut self, listening: &Listening) {
        self.pending = None;
        self.taken = Load::default();
        self.taken_ns = listening.listened_ns();
    }

    /// Returns whether its load is older than its timeout.
    pub fn is_timed_out(&self, timeout_ns: u64, listening: &Listening) -> bool {
        listening.has_passed(self.taken_ns, timeout_ns)
    }

    /// Returns the time at which to check that next, ns.
    pub fn deadline_ns(&self, timeout_ns: u64, listening: &Listening) -> u64 {
        listening.next_look_ns(self.taken_ns, timeout_ns)
    }
}

impl From<Unreadable> for FrameCheck {
    fn from(unreadable: Unreadable) -> FrameCheck {
        match unreadable {
            Unreadable::Short => FrameCheck::Length,
            Unreadable::NotFinite(_) => FrameCheck::Value,
        }
    }
}

impl From<ProtectionFault> for FrameCheck {
    fn from(fault: ProtectionFault) -> FrameCheck {
        match fault {
            ProtectionFault::Format { .. } => FrameCheck::Format,
            ProtectionFault::Short { .. } | ProtectionFault::Long { .. } => FrameCheck::Length,
            ProtectionFault::Checksum(_) => FrameCheck::Checksum,
            ProtectionFault::Counter(_) | ProtectionFault::Lost { .. } => FrameCheck::Counter,
        }
    }
}
