//! Meaning of a user protocol's messages for the plant.

use alloc::sync::Arc;
use alloc::vec::Vec;

pub use super::protection::{Form, Protection, ProtectionCheck, ProtectionFault};
use nalgebra::Vector3;

use crate::rig::{Load, MOST_CHANNELS};
use crate::structure::States;
use resonarm_protocol::{EmergencyCode, FrameFormat, Id, NodeState};
use resonarm_wire::layout::Number;
use resonarm_wire::multiplex::Presence;
use resonarm_wire::signal::Signal;

/// Messages of a user protocol, each identifier once.
#[derive(Clone, Debug)]
pub struct Mapping {
    /// Messages that the plant receives.
    pub incoming: Vec<Incoming>,
    /// Messages that the plant sends, in the order of sending.
    pub outgoing: Vec<Outgoing>,
    /// Way in which the plant is armed.
    pub arming: Arming,
    /// Frames that answer a sample in lockstep.
    pub lockstep: Lockstep,
}

/// Way in which a plant is armed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arming {
    /// The plant is armed by a message with [`Action::Arm`].
    Message,
    /// The plant is armed by the operator at the plant.
    Operator,
    /// The plant is armed by its first commands, if their load is below a hundredth of the exciter's limits; once, and
    /// never after a fault.
    ZeroCommand,
}

/// Frames that answer a sample in lockstep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lockstep {
    /// One frame of each command message, received after the sample was sent.
    Command,
    /// The message marked as [`Incoming::is_sync`]; the commands received before it act.
    Sync,
}

/// A signal, with the payloads that contain it.
#[derive(Clone, Debug)]
pub struct MappedSignal {
    /// Place and scaling of the signal.
    pub signal: Signal,
    /// Payloads that contain the signal, if it is multiplexed.
    pub presence: Presence,
}

impl MappedSignal {
    /// Returns its finite value in a payload; `None` if the payload is multiplexed to others.
    ///
    /// # Errors
    /// [`Unreadable`] if the payload ends before it, or it is NaN or infinite.
    pub fn read(&self, payload: &[u8]) -> Result<Option<f64>, Unreadable> {
        match self.presence.is_in(payload) {
            Some(true) => {}
            Some(false) => return Ok(None),
            None => return Err(Unreadable::Short),
        }
        match self.signal.decode(payload) {
            Some(value) if value.is_finite() => Ok(Some(value)),
            Some(value) => Err(Unreadable::NotFinite(value)),
            None => Err(Unreadable::Short),
        }
    }
}

/// Reason why a signal has no value in a payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unreadable {
    /// The payload ends before the signal.
    Short,
    /// The value is NaN or infinite.
    NotFinite(f64),
}

/// A message that the plant receives.
#[derive(Clone, Debug)]
pub struct Incoming {
    /// Name of the message.
    pub name: Arc<str>,
    /// Identifier of its frames.
    pub id: Id,
    /// Format in which a controller sends it.
    pub format: FrameFormat,
    /// Length of its payload, bytes.
    pub length: usize,
    /// Counter and checksum of the message.
    pub protection: Protection,
    /// Index of the drive that it is for, from 0. Each drive is armed separately.
    pub drive: usize,
    /// Loads that it carries.
    pub commands: Vec<CommandSignal>,
    /// Time for which they are valid in real time, ns of listening.
    pub timeout_ns: u64,
    /// Requests that it carries.
    pub events: Vec<EventSignal>,
    /// Whether it answers samples in lockstep, and triggers [`Trigger::Sync`].
    pub is_sync: bool,
}

impl Incoming {
    /// Returns the form of its frames. A message that only stops or disarms, and carries no signal, does so at
    /// any length: a stop must not be missed because of bytes that mean nothing.
    pub fn form(&self) -> Form {
        let only_stops = |event: &EventSignal| {
            let stops = |(_, action): &(f64, Action)| matches!(action, Action::Stop | Action::Disarm);
            event.signal.is_none() && event.actions.iter().all(stops)
        };
        let is_bare = self.commands.is_empty() && !self.is_sync && !self.events.is_empty();
        // Every condition counts: a message that also arms or commands must have its exact form.
        let length = if is_bare && self.events.iter().all(only_stops) { usize::MAX } else { self.length };
        Form { format: self.format, length }
    }

    /// Checks that every signal that it uses can be read in a payload.
    ///
    /// # Errors
    /// [`Unreadable`] of the first that can't.
    pub fn check(&self, payload: &[u8]) -> Result<(), Unreadable> {
        let events = self.events.iter().filter_map(|event| event.signal.as_ref());
        let mut used = events.chain(self.commands.iter().map(|command| &command.signal));
        used.try_for_each(|signal| signal.read(payload).map(drop))
    }

    /// Returns the load in a payload; `None` if the message has none, or the payload is multiplexed to others.
    ///
    /// # Errors
    /// [`Unreadable`] of the first signal that can't be read.
    pub fn load(&self, payload: &[u8]) -> Result<Option<Load>, Unreadable> {
        let mut sum = Load::default();
        for command in &self.commands {
            let Some(value) = command.signal.read(payload)? else { return Ok(None) };
            sum = sum + command.input.load(command.scale * value + command.offset);
        }
        Ok((!self.commands.is_empty()).then_some(sum))
    }
}

/// A load in a message: scale · value + offset, in N or N·m.
#[derive(Clone, Debug)]
pub struct CommandSignal {
    /// Signal of the load.
    pub signal: MappedSignal,
    /// Load for one unit of the signal, N or N·m.
    pub scale: f64,
    /// Load at the value 0, N or N·m.
    pub offset: f64,
    /// Place where the load acts.
    pub input: LoadInput,
}

impl CommandSignal {
    /// Returns the value of the signal for its part of a load: (part − offset)/scale.
    pub fn value(&self, load: &Load) -> f64 {
        (self.input.part(load) - self.offset) / self.scale
    }
}

/// Place and direction in which a load acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadInput {
    /// Torque at a joint, counted from 0 at the base.
    Torque(usize),
    /// Force at the exciter along x.
    ForceX,
    /// Force at the exciter along y.
    ForceY,
    /// Force at the exciter along z.
    ForceZ,
    /// Force at the exciter along this unit vector, which is that of a shaker.
    Along([f64; 2]),
}

impl LoadInput {
    /// Returns the load of `value` N or N·m.
    pub fn load(self, value: f64) -> Load {
        match self {
            LoadInput::Torque(joint) => Load::at_joint(joint, value),
            LoadInput::ForceX => Load::force_n(value, 0.0),
            LoadInput::ForceY => Load::force_n(0.0, value),
            LoadInput::ForceZ => Load { force_n: Vector3::new(0.0, 0.0, value), ..Load::default() },
            LoadInput::Along([x, y]) => Load::force_n(value * x, value * y),
        }
    }

    /// Returns its part of a load, N or N·m: the inverse of [`LoadInput::load`] for a load that it can produce
    /// alone.
    pub fn part(self, load: &Load) -> f64 {
        let Load { torque_nm, force_n } = load;
        match self {
            LoadInput::Torque(joint) => torque_nm.get(joint).copied().unwrap_or(0.0),
            LoadInput::ForceX => force_n.x,
            LoadInput::ForceY => force_n.y,
            LoadInput::ForceZ => force_n.z,
            LoadInput::Along([x, y]) => force_n.x * x + force_n.y * y,
        }
    }
}

/// A signal, or a whole message, that makes requests.
#[derive(Clone, Debug)]
pub struct EventSignal {
    /// Name of the signal; empty for a whole message.
    pub name: Arc<str>,
    /// Signal of the requests; `None` if every frame of the message makes the only request.
    pub signal: Option<MappedSignal>,
    /// Frames in which a value counts.
    pub counts: Counts,
    /// Values with the requests that they make.
    pub actions: Vec<(f64, Action)>,
    /// Values of which it must have one before commands of its drive are accepted; empty without such a
    /// condition.
    pub required: Vec<f64>,
}

/// Frames in which a value makes its request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counts {
    /// The value counts when the signal changes to it, or is received for the first time; for signals that are sent
    /// continuously.
    OnChange,
    /// The value counts in every frame; for messages that are sent once.
    InEveryFrame,
}

/// Request of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Arms the drive of the message.
    Arm,
    /// Disarms the drive of the message.
    Disarm,
    /// Clears a fault of the plant.
    Reset,
    /// Stops at once, with a fault.
    Stop,
}

/// A message that the plant sends.
#[derive(Clone, Debug)]
pub struct Outgoing {
    /// Identifier of its frames.
    pub id: Id,
    /// Format of its frames.
    pub format: FrameFormat,
    /// Payload before the signals are written into it; its length is that of the message.
    pub payload: Vec<u8>,
    /// Counter and checksum of the message.
    pub protection: Protection,
    /// Index of the drive whose state it reports.
    pub drive: usize,
    /// Trigger by which the message is sent.
    pub trigger: Trigger,
    /// Whether it is also sent on request: by a remote frame, or a frame without data.
    pub is_on_request: bool,
    /// Signals that it carries.
    pub signals: Vec<ReadingSignal>,
}

impl Outgoing {
    /// Returns the form of its frames.
    pub fn form(&self) -> Form {
        Form { format: self.format, length: self.payload.len() }
    }
}

/// Trigger by which a message is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trigger {
    /// The message is sent after this number of samples, at least 1.
    Every(u64),
    /// The message is sent after this time, ns of the clock.
    Period(u64),
    /// The message is sent at each message marked as [`Incoming::is_sync`].
    Sync,
    /// The message is sent on request and at no other time.
    Request,
}

/// A signal that the plant writes.
#[derive(Clone, Debug)]
pub struct ReadingSignal {
    /// Place and scaling of the signal.
    pub signal: MappedSignal,
    /// Value that it carries.
    pub source: Source,
}

impl ReadingSignal {
    /// Returns what a payload states about a reading of the plant; `None` if the signal carries something else,
    /// or is not in it.
    ///
    /// # Errors
    /// [`Unreadable`] if the payload ends before it, or it is NaN or infinite.
    pub fn reading(&self, payload: &[u8]) -> Result<Option<Said>, Unreadable> {
        let Some(got) = self.signal.read(payload)? else { return Ok(None) };
        let Source::Value { value, scale, offset } = &self.source else { return Ok(None) };
        let signal = &self.signal.signal;
        Ok(match *value {
            // A plant limits a value to the ends of the signal, so a value at an end may be clipped. A
            // floating-point signal has no such ends.
            Value::Reading(place) => {
                let is_at_end = signal.layout().number() != Number::Float && signal.range().contains(&got);
                Some(Said::Value { place, value: (got - offset) / scale, is_at_end })
            }
            Value::Clipped(place) => Some(Said::Clipped { place, is_clipped: got != 0.0 }),
            Value::State(_) | Value::Load(_) => None,
        })
    }
}

/// Statement of a signal about a reading, by the reading's index among the outputs of the structure, as in
/// [`Value::Reading`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Said {
    /// The value of the reading.
    Value {
        /// Index of the reading.
        place: usize,
        /// Value in its SI unit.
        value: f64,
        /// Whether the signal is at an end of its range, where a plant limits it.
        is_at_end: bool,
    },
    /// Whether the reading was clipped.
    Clipped {
        /// Index of the reading.
        place: usize,
        /// Whether it was beyond the range of its sensor.
        is_clipped: bool,
    },
}

/// Value that a signal carries.
#[derive(Clone, Debug)]
pub enum Source {
    /// scale · value + offset of a value of the plant, in the unit of the signal.
    Value {
        /// Value of the plant.
        value: Value,
        /// Units of the signal for one unit of the value.
        scale: f64,
        /// Value of the signal at 0.
        offset: f64,
    },
    /// A number for each state of the drive: boot-up, pre-operational, operational, fault.
    State([f64; 4]),
    /// A number for the latched fault: that of its code, or else `other`; `none` without a fault.
    Reason {
        /// Number without a fault.
        none: f64,
        /// Number of a fault that has none of its own.
        other: f64,
        /// Numbers of faults by their codes.
        codes: Vec<(EmergencyCode, f64)>,
    },
    /// Index of the sample, modulo a number.
    Sample {
        /// Modulus, one more than the largest index.
        modulus: f64,
    },
}

/// A value of the plant at the last published sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// A reading, by its index among the outputs of the structure; [`OUTPUTS`](crate::structure::OUTPUTS) come
    /// first.
    Reading(usize),
    /// 1 if the reading was clipped at the range of its sensor, else 0.
    Clipped(usize),
    /// A state of the structure, by its index among the states.
    State(usize),
    /// A held load, by its index in [`LOADS`](crate::structure::LOADS).
    Load(usize),
}

/// Values of the plant at a sample.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Values {
    pub sample: u64,
    pub readings: [f64; MOST_CHANNELS],
    pub clipped: [bool; MOST_CHANNELS],
    pub states: States,
    pub load: Load,
}

impl Values {
    pub fn get(&self, value: Value) -> f64 {
        match value {
            Value::Reading(place) => self.readings.get(place).copied().unwrap_or(0.0),
            Value::Clipped(place) => self.clipped.get(place).map_or(0.0, |clipped| f64::from(u8::from(*clipped))),
            Value::State(place) => self.states.get(place).copied().unwrap_or(0.0),
            Value::Load(place) => self.load.parts().get(place).copied().unwrap_or(0.0),
        }
    }
}

/// Returns the index of a state in the numbers of [`Source::State`].
pub(super) const fn place(state: NodeState) -> usize {
    match state {
        NodeState::BootUp => 0,
        NodeState::PreOperational => 1,
        NodeState::Operational => 2,
        NodeState::Fault => 3,
    }
}
