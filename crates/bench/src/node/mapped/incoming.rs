//! The messages that a mapped plant takes.

use alloc::vec;
use alloc::vec::Vec;

use super::mapping::{Action, Counts, Incoming, MappedSignal, Short};
use crate::node::FrameCheck;
use resonarm_dynamics::arm::Load;
use resonarm_protocol::Frame;
use resonarm_protocol::node::Listening;
use resonarm_wire::counter::{CounterCheck, Step};

/// A message with what was received of it.
#[derive(Clone, Debug)]
pub(super) struct Receiver {
    pub message: Incoming,
    counter: CounterCheck,
    /// The last value of each event's signal.
    values: Vec<Option<f64>>,
    /// The load received last, until it is judged.
    pending: Option<Load>,
    /// Its share of the load that acts.
    taken: Load,
    /// When that was received, or the drive was armed, in time listened.
    taken_ns: u64,
}

impl Receiver {
    pub fn new(message: Incoming) -> Receiver {
        let values = vec![None; message.events.len()];
        let (counter, taken) = (CounterCheck::new(), Load::default());
        Receiver { message, counter, values, pending: None, taken, taken_ns: 0 }
    }

    /// Whether it commands a load.
    pub fn is_command(&self) -> bool {
        !self.message.commands.is_empty()
    }

    /// Checks checksum, counter and every signal that is used, before any of them asks for something.
    ///
    /// # Errors
    /// The check that failed: the frame must not be used.
    pub fn check(&mut self, frame: &Frame) -> Result<(), FrameCheck> {
        let (payload, protection) = (frame.data(), &self.message.protection);
        if let Some(checksum) = &protection.checksum {
            checksum.check(frame.id(), payload).map_err(|_wrong| FrameCheck::Checksum)?;
        }
        if let Some(counter) = &protection.counter {
            let value = counter.read(payload).ok_or(FrameCheck::Length)?;
            match self.counter.check(counter, value) {
                Ok(Step::First | Step::Next) => {}
                Ok(Step::Lost { frames }) if frames <= protection.most_lost => {}
                Ok(Step::Lost { .. }) | Err(_) => return Err(FrameCheck::Counter),
            }
        }
        let events = self.message.events.iter().filter_map(|event| event.signal.as_ref());
        let mut used = events.chain(self.message.commands.iter().map(|command| &command.signal));
        used.try_for_each(|signal| value(signal, payload).map(drop))
    }

    /// What event `index` of the message asks for in this payload.
    ///
    /// # Errors
    /// As [`Receiver::check`], which finds all of them.
    pub fn action(&mut self, index: usize, payload: &[u8]) -> Result<Option<Action>, FrameCheck> {
        let event = &self.message.events[index];
        let Some(signal) = &event.signal else { return Ok(event.actions.first().map(|(_, action)| *action)) };
        let Some(value) = value(signal, payload)? else { return Ok(None) };
        let before = self.values[index].replace(value);
        let counts = event.counts == Counts::InEveryFrame || before != Some(value);
        let asked = event.actions.iter().find(|(asking, _)| *asking == value).map(|(_, action)| *action);
        Ok(asked.filter(|_| counts))
    }

    /// Whether every signal that must have a certain value has it.
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
        let mut load = Load::default();
        for command in &self.message.commands {
            let Some(value) = value(&command.signal, payload)? else { return Ok(false) };
            load = plus(load, command.input.load(command.scale * value + command.offset));
        }
        self.pending = Some(load);
        Ok(true)
    }

    /// Whether a load waits to be judged.
    pub fn is_new(&self) -> bool {
        self.pending.is_some()
    }

    /// Its share of the load that is judged.
    pub fn share(&self) -> Load {
        self.pending.unwrap_or(self.taken)
    }

    /// The load that waited has been judged.
    pub fn judged(&mut self, is_taken: bool, listening: &Listening) {
        if let Some(load) = self.pending.take().filter(|_| is_taken) {
            (self.taken, self.taken_ns) = (load, listening.listened_ns());
        }
    }

    /// Commands no load any more; a new one is valid for its time from now on.
    pub fn restart(&mut self, listening: &Listening) {
        (self.pending, self.taken, self.taken_ns) = (None, Load::default(), listening.listened_ns());
    }

    /// Whether its load is older than its timeout.
    pub fn is_timed_out(&self, timeout_ns: u64, listening: &Listening) -> bool {
        listening.has_passed(self.taken_ns, timeout_ns)
    }

    /// When to check that next, ns.
    pub fn deadline_ns(&self, timeout_ns: u64, listening: &Listening) -> u64 {
        listening.next_look_ns(self.taken_ns, timeout_ns)
    }
}

/// The finite value of a signal; `None` if the payload is multiplexed to others.
fn value(signal: &MappedSignal, payload: &[u8]) -> Result<Option<f64>, FrameCheck> {
    match signal.decode(payload).map_err(|Short| FrameCheck::Length)? {
        Some(value) if !value.is_finite() => Err(FrameCheck::Value),
        value => Ok(value),
    }
}

/// The sum.
pub(super) fn plus(one: Load, other: Load) -> Load {
    Load { torque_nm: one.torque_nm + other.torque_nm, force_n: one.force_n + other.force_n }
}
