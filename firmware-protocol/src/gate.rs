//! The gate of a plant: the checks that a command must pass before it acts on the arm.

use crate::message::Refusal;
use crate::state::NodeState;

/// Whether a quantity keeps its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// The quantity is within its limit, or there is no limit.
    Within,
    /// The quantity exceeds its limit.
    Beyond,
}

/// The plant's state against its limits for a command received.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandCheck {
    /// The load, against what the exciter can produce by its limits and its direction.
    pub range: Limit,
    /// The sample periods that the change from the load held to this one takes at the largest rate of change; 0
    /// without such a limit.
    pub change_periods: f64,
    /// Distance from rest of the point that the exciter acts on, against the largest travel.
    pub travel: Limit,
}

/// Judges every command that a plant receives: `SPEC.md`, section 8, "Commands rejected".
///
/// A command passes if the plant is operational and within its travel, if it answers a sample that is neither too old
/// nor in the future, newer than the one that the last accepted command answers, if the exciter can produce
/// it, and if it doesn't change the load too fast. A [`Receiver`](crate::Receiver) has already checked the frame.
#[derive(Clone, Copy, Debug)]
pub struct CommandGate {
    age_limit: u64,
    answered: Option<u64>,
    /// The sample that the last command in sequence answers, accepted or not.
    judged: Option<u64>,
}

impl CommandGate {
    /// A change may exceed the limit by this fraction: loads are differences of rounded numbers.
    const ROUNDING: f64 = 1e-9;

    /// A gate for commands that answer a sample at most `command_age_ns` of samples old, rounded down, at `rate_hz`
    /// samples a second.
    pub const fn new(command_age_ns: u64, rate_hz: u16) -> CommandGate {
        // Rounded down: a sample that is older by a part of a period is too old.
        let age_limit = command_age_ns.saturating_mul(rate_hz as u64) / 1_000_000_000;
        CommandGate { age_limit, answered: None, judged: None }
    }

    /// Arms the plant: no sample has been answered since.
    pub const fn arm(&mut self) {
        self.answered = None;
        self.judged = None;
    }

    /// The sample that the last accepted command answers, since arming.
    pub const fn answered(&self) -> Option<u64> {
        self.answered
    }

    /// Accepts a command that answers the sample of index `index`, or returns why not. The plant is in `state` and last
    /// sent `sample`, counted without the modulus of the wire.
    ///
    /// With the age a = (sample − index) mod 2¹⁶ the sample answered is sample − a. A future one has an age of
    /// nearly 2¹⁶, which is beyond any limit; one before the first sample does not exist.
    ///
    /// A change has n = s − s' sample periods of time, at least 1, where s is the sample answered and s' that of the
    /// last command in sequence, accepted or not, since arming; the first has 1. So lost commands give the next one
    /// time, and rejected ones don't: a rejected jump is not accepted later, when its load would have been reached at
    /// the largest rate. As s' is never before the sample answered last, the sum of all accepted changes is within
    /// that rate.
    ///
    /// # Errors
    /// The first reason, in this order: state, travel, age, sequence, range, rate of
    /// change. A rejected command leaves the sample unanswered.
    pub fn take(&mut self, state: NodeState, sample: u64, index: u16, check: &CommandCheck) -> Result<(), Refusal> {
        if state != NodeState::Operational {
            return Err(Refusal::NotArmed);
        }
        // Before the age and the sequence: beyond its travel the plant trips at any command, whatever sample that
        // answers.
        if check.travel == Limit::Beyond {
            return Err(Refusal::Travel);
        }
        let age = u64::from((sample as u16).wrapping_sub(index));
        // `sample` has lost nothing to the modulus, so a subtraction that underflows means a sample that never was.
        let answered = sample.checked_sub(age).filter(|_| age <= self.age_limit).ok_or(Refusal::Late)?;
        match self.answered {
            Some(last) if answered < last => return Err(Refusal::OutOfOrder),
            Some(last) if answered == last => return Err(Refusal::Repeated),
            _ => {}
        }
        // From here on the command is in sequence. It counts as judged even if it is rejected below, so that a
        // rejected jump gives the next command no time.
        let periods = self.judged.replace(answered).map_or(1, |before| answered.saturating_sub(before).max(1));
        if check.range == Limit::Beyond {
            return Err(Refusal::OutOfRange);
        }
        let most = periods as f64 * (1.0 + CommandGate::ROUNDING);
        // A change that is not a number is never allowed.
        (check.change_periods <= most).then_some(()).ok_or(Refusal::RateOfChange)?;
        self.answered = Some(answered);
        Ok(())
    }
}
