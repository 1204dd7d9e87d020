//! What the messages of a user's protocol mean to the plant.

use alloc::sync::Arc;
use alloc::vec::Vec;

pub use super::protection::{Form, Protection, ProtectionCheck, ProtectionFault};
use crate::rig::Load;
use crate::rig::MOST_CHANNELS;
use resonarm_protocol::{EmergencyCode, FrameFormat, Id, NodeState};
use resonarm_wire::layout::Number;
use resonarm_wire::multiplex::Presence;
use resonarm_wire::signal::Signal;

/// The messages of a wire, each identifier once.
#[derive(Clone, Debug)]
pub struct Mapping {
    /// The messages that the plant takes.
    pub incoming: Vec<Incoming>,
    /// The messages that the plant sends, in the order in which they are sent.
    pub outgoing: Vec<Outgoing>,
    /// How the plant is armed.
    pub arming: Arming,
    /// What answers a sample in lockstep.
    pub lockstep: Lockstep,
}

/// How a plant is armed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arming {
    /// By a message: [`Action::Arm`].
    Message,
    /// By the operator at the plant.
    Operator,
    /// By the first commands, if their load is below a hundredth of the exciter's limits; once, and never after a
    /// fault.
    ZeroCommand,
}

/// What answers a sample in lockstep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lockstep {
    /// One frame of each command message, received after the sample was sent.
    Command,
    /// The message marked as [`Incoming::is_sync`]; the commands received before it act.
    Sync,
}

/// A signal, and in which payloads it is.
#[derive(Clone, Debug)]
pub struct MappedSignal {
    /// The signal.
    pub signal: Signal,
    /// Where it is multiplexed.
    pub presence: Presence,
}

impl MappedSignal {
    /// Its finite value in a payload; `None` if the payload is multiplexed to others.
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

/// Why a signal has no value in a payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unreadable {
    /// The payload ends before it.
    Short,
    /// It is NaN or infinite.
    NotFinite(f64),
}

/// A message that the plant takes.
#[derive(Clone, Debug)]
pub struct Incoming {
    /// Name of the message.
    pub name: Arc<str>,
    /// Its identifier.
    pub id: Id,
    /// The format in which a controller sends it.
    pub format: FrameFormat,
    /// Its length, bytes.
    pub length: usize,
    /// Its counter and checksum.
    pub protection: Protection,
    /// The number of the drive that it is for, from 0: each drive is armed by itself.
    pub drive: usize,
    /// The loads in it.
    pub commands: Vec<CommandSignal>,
    /// For how long they are valid in real time, ns of listening.
    pub timeout_ns: u64,
    /// What else it asks for.
    pub events: Vec<EventSignal>,
    /// Whether it is the message that answers samples in lockstep, and asks for [`Trigger::Sync`].
    pub is_sync: bool,
}

impl Incoming {
    /// The form of its frames. A message that only stops or disarms, and has nothing to read, does so at any length: a
    /// stop must not be missed for bytes that say nothing.
    pub fn form(&self) -> Form {
        let only_stops = |event: &EventSignal| {
            let stops = |(_, action): &(f64, Action)| matches!(action, Action::Stop | Action::Disarm);
            event.signal.is_none() && event.actions.iter().all(stops)
        };
        let is_bare = self.commands.is_empty() && !self.is_sync && !self.events.is_empty();
        let length = if is_bare && self.events.iter().all(only_stops) { usize::MAX } else { self.length };
        Form { format: self.format, length }
    }

    /// Whether every signal that it uses can be read in a payload.
    ///
    /// # Errors
    /// [`Unreadable`] of the first that can't.
    pub fn check(&self, payload: &[u8]) -> Result<(), Unreadable> {
        let events = self.events.iter().filter_map(|event| event.signal.as_ref());
        let mut used = events.chain(self.commands.iter().map(|command| &command.signal));
        used.try_for_each(|signal| signal.read(payload).map(drop))
    }

    /// The load in a payload; `None` if the message has none, or the payload is multiplexed to others.
    ///
    /// # Errors
    /// [`Unreadable`] of the first signal that can't be read.
    pub fn load(&self, payload: &[u8]) -> Result<Option<Load>, Unreadable> {
        let mut sum = Load::default();
        for command in &self.commands {
            let Some(value) = command.signal.read(payload)? else { return Ok(None) };
            let Load { torque_nm, force_n } = command.input.load(command.scale * value + command.offset);
            sum = Load { torque_nm: sum.torque_nm + torque_nm, force_n: sum.force_n + force_n };
        }
        Ok((!self.commands.is_empty()).then_some(sum))
    }
}

/// A load in a message: scale · value + offset, in N or N·m.
#[derive(Clone, Debug)]
pub struct CommandSignal {
    /// The signal.
    pub signal: MappedSignal,
    /// N or N·m for one unit of the signal.
    pub scale: f64,
    /// N or N·m at 0.
    pub offset: f64,
    /// What it acts as.
    pub input: LoadInput,
}

impl CommandSignal {
    /// The value of the signal for its part of a load: (part − offset) / scale.
    pub fn value(&self, load: &Load) -> f64 {
        (self.input.part(load) - self.offset) / self.scale
    }
}

/// What acts on the arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadInput {
    /// Torque at joint 1.
    Torque1,
    /// Torque at joint 2.
    Torque2,
    /// Force at the tip along x.
    ForceX,
    /// Force at the tip along y.
    ForceY,
    /// Force at the tip along this unit vector: that of a shaker.
    Along([f64; 2]),
}

impl LoadInput {
    /// The load of one of its units, times `value`.
    pub fn load(self, value: f64) -> Load {
        match self {
            LoadInput::Torque1 => Load::torque_nm(value, 0.0),
            LoadInput::Torque2 => Load::torque_nm(0.0, value),
            LoadInput::ForceX => Load::force_n(value, 0.0),
            LoadInput::ForceY => Load::force_n(0.0, value),
            LoadInput::Along([x, y]) => Load::force_n(value * x, value * y),
        }
    }

    /// Its part of a load, N or N·m: the inverse of [`LoadInput::load`] for a load that it can make alone.
    pub fn part(self, load: &Load) -> f64 {
        let Load { torque_nm, force_n } = load;
        match self {
            LoadInput::Torque1 => torque_nm.x,
            LoadInput::Torque2 => torque_nm.y,
            LoadInput::ForceX => force_n.x,
            LoadInput::ForceY => force_n.y,
            LoadInput::Along([x, y]) => force_n.x * x + force_n.y * y,
        }
    }
}

/// A signal, or a whole message, that asks for something.
#[derive(Clone, Debug)]
pub struct EventSignal {
    /// The name of the signal; empty for a whole message.
    pub name: Arc<str>,
    /// The signal; `None`: every frame of the message asks for the only action.
    pub signal: Option<MappedSignal>,
    /// When it counts.
    pub counts: Counts,
    /// What its values ask for.
    pub actions: Vec<(f64, Action)>,
    /// Values of which it must have one before commands of its drive count; empty: no such condition.
    pub required: Vec<f64>,
}

/// When a value asks for its action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Counts {
    /// When the signal changes to it, or is received for the first time: for signals that are sent all the time.
    OnChange,
    /// In every frame: for messages that are sent once.
    InEveryFrame,
}

/// What a message asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// To arm the drive.
    Arm,
    /// To disarm the drive.
    Disarm,
    /// To clear a fault.
    Reset,
    /// To stop at once: a fault.
    Stop,
}

/// A message that the plant sends.
#[derive(Clone, Debug)]
pub struct Outgoing {
    /// Its identifier.
    pub id: Id,
    /// Its format.
    pub format: FrameFormat,
    /// Its payload before the signals are written into it; as long as the message.
    pub payload: Vec<u8>,
    /// Its counter and checksum.
    pub protection: Protection,
    /// The drive of whose state it says something.
    pub drive: usize,
    /// When it is sent.
    pub trigger: Trigger,
    /// Whether it is sent when it is asked for, too: by a remote frame, or one without data.
    pub is_on_request: bool,
    /// What is in it.
    pub signals: Vec<ReadingSignal>,
}

impl Outgoing {
    /// The form of its frames.
    pub fn form(&self) -> Form {
        Form { format: self.format, length: self.payload.len() }
    }
}

/// When a message is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trigger {
    /// Every so many samples, at least 1.
    Every(u64),
    /// Every so many nanoseconds of the clock.
    Period(u64),
    /// At each message marked as [`Incoming::is_sync`].
    Sync,
    /// On request alone.
    Request,
}

/// A signal that the plant writes.
#[derive(Clone, Debug)]
pub struct ReadingSignal {
    /// The signal.
    pub signal: MappedSignal,
    /// What it says.
    pub source: Source,
}

impl ReadingSignal {
    /// What a payload says of a reading of the plant; `None` if the signal says something else, or is not in it.
    ///
    /// # Errors
    /// [`Unreadable`] if the payload ends before it, or it is NaN or infinite.
    pub fn reading(&self, payload: &[u8]) -> Result<Option<Said>, Unreadable> {
        let Some(got) = self.signal.read(payload)? else { return Ok(None) };
        let Source::Value { value, scale, offset } = &self.source else { return Ok(None) };
        let signal = &self.signal.signal;
        Ok(match *value {
            Value::Reading(place) => {
                let is_at_end = signal.layout().number() != Number::Float && signal.range().contains(&got);
                Some(Said::Value { place, value: (got - offset) / scale, is_at_end })
            }
            Value::Clipped(place) => Some(Said::Clipped { place, is_clipped: got != 0.0 }),
            Value::State(_) | Value::Load(_) => None,
        })
    }
}

/// What a signal says of a reading, by its place among the outputs of the structure, as in [`Value::Reading`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Said {
    /// Its value.
    Value {
        /// The place of the reading.
        place: usize,
        /// The value, in its SI unit.
        value: f64,
        /// Whether the signal is at an end of what it can represent, where a plant limits it.
        is_at_end: bool,
    },
    /// Whether it was beyond the range of its sensor.
    Clipped {
        /// The place of the reading.
        place: usize,
        /// Whether it was.
        is_clipped: bool,
    },
}

/// What a signal says.
#[derive(Clone, Debug)]
pub enum Source {
    /// scale · value + offset of a value of the plant, in the unit of the signal.
    Value {
        /// The value.
        value: Value,
        /// Units of the signal for one of the value's.
        scale: f64,
        /// The value of the signal at 0.
        offset: f64,
    },
    /// A number for each state of the drive: boot-up, pre-operational, operational, fault.
    State([f64; 4]),
    /// A number for the latched fault: that of its code, else `other`; `none` without a fault.
    Reason {
        /// Without a fault.
        none: f64,
        /// Of a fault that has no number here.
        other: f64,
        /// Of faults by their codes.
        codes: Vec<(EmergencyCode, f64)>,
    },
    /// The index of the sample, modulo this.
    Sample {
        /// One more than the largest index.
        modulus: f64,
    },
}

/// A value of the plant at the sample published last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// A reading, by its place among the outputs of the structure; [`OUTPUTS`](crate::structure::OUTPUTS) come first.
    Reading(usize),
    /// 1 if the reading was beyond the range of its sensor, else 0.
    Clipped(usize),
    /// A state of the structure, by its place among its states.
    State(usize),
    /// A load that is held, by its place in [`LOADS`](crate::structure::LOADS).
    Load(usize),
}

/// The values of the plant at a sample.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Values {
    pub sample: u64,
    pub readings: [f64; MOST_CHANNELS],
    pub clipped: [bool; MOST_CHANNELS],
    pub states: [f64; MOST_STATES],
    pub load: Load,
}

/// The most states of a structure that can be read.
pub(super) const MOST_STATES: usize = 16;

impl Values {
    pub fn get(&self, value: Value) -> f64 {
        let Load { torque_nm, force_n } = &self.load;
        match value {
            Value::Reading(place) => self.readings.get(place).copied().unwrap_or(0.0),
            Value::Clipped(place) => self.clipped.get(place).map_or(0.0, |clipped| f64::from(u8::from(*clipped))),
            Value::State(place) => self.states.get(place).copied().unwrap_or(0.0),
            Value::Load(place) => [torque_nm.x, torque_nm.y, force_n.x, force_n.y].get(place).copied().unwrap_or(0.0),
        }
    }
}

/// The place of a state in the numbers of [`Source::State`].
pub(super) const fn place(state: NodeState) -> usize {
    match state {
        NodeState::BootUp => 0,
        NodeState::PreOperational => 1,
        NodeState::Operational => 2,
        NodeState::Fault => 3,
    }
}
