//! The gate of a plant: what a command must pass before it acts on the arm.

use crate::{NodeState, Refusal};

/// Whether the plant's exciter can produce a load, as far as its limits and its direction go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadRange {
    /// It can.
    Within,
    /// It can't.
    Beyond,
}

/// Judges every command that a plant receives: `SPEC.md`, section 8, "Commands refused".
///
/// A command passes if the plant is operational, if it answers a sample that is neither too old nor still to come, nor
/// the one that the last command taken answers, nor one before it, and if the exciter can produce it. What the frame
/// itself must be, a [`Receiver`](crate::Receiver) has judged before.
#[derive(Clone, Copy, Debug)]
pub struct CommandGate {
    age_limit: u64,
    answered: Option<u64>,
}

impl CommandGate {
    /// A gate for commands that answer a sample at most `command_age_ns` of samples old, rounded down, at `rate_hz`
    /// samples a second.
    pub const fn new(command_age_ns: u64, rate_hz: u16) -> CommandGate {
        CommandGate { age_limit: command_age_ns.saturating_mul(rate_hz as u64) / 1_000_000_000, answered: None }
    }

    /// The plant is armed: no sample is answered since.
    pub const fn arm(&mut self) {
        self.answered = None;
    }

    /// The sample that the last command taken answers, since arming.
    pub const fn answered(&self) -> Option<u64> {
        self.answered
    }

    /// Takes a command that answers the sample of index `index`, or says why not. The plant is in `state` and sent
    /// `sample` last, counted without the modulus of the wire.
    ///
    /// With the age a = (sample − index) mod 2¹⁶ the sample answered is sample − a. One still to come has an age of
    /// nearly 2¹⁶, which is beyond any limit; one from before the first sample is none.
    ///
    /// # Errors
    /// The first reason, in the order of [`Refusal::ALL`]. A command that is refused changes nothing.
    pub fn take(&mut self, state: NodeState, sample: u64, index: u16, range: LoadRange) -> Result<(), Refusal> {
        if state != NodeState::Operational {
            return Err(Refusal::NotArmed);
        }
        let age = u64::from((sample as u16).wrapping_sub(index));
        let answered = sample.checked_sub(age).filter(|_| age <= self.age_limit).ok_or(Refusal::Late)?;
        match self.answered {
            Some(last) if answered < last => return Err(Refusal::OutOfOrder),
            Some(last) if answered == last => return Err(Refusal::Repeated),
            _ => {}
        }
        if range == LoadRange::Beyond {
            return Err(Refusal::OutOfRange);
        }
        self.answered = Some(answered);
        Ok(())
    }
}
