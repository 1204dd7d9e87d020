//! Features that a user protocol lacks for Resonarm's controllers, and the consequences.

use alloc::vec::Vec;

use thiserror::Error;

use crate::control::NeededReading;
use crate::structure::ChannelName;
use resonarm_protocol::Id;

/// Reason why no exciter of Resonarm can drive a plant by a protocol.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ExciterLack {
    /// Only an operator can arm the plant.
    #[error(
        "[wire] `arm = \"operator\"`: no message arms the plant, so the emulated exciter can't arm it; give an \
         event with `arm`, or `arm = \"zero-command\"`"
    )]
    Operator,
    /// No event arms a drive.
    #[error(
        "[wire] has no event that arms drive {drive}, which takes commands: give one with `arm` and `drive = {drive}`"
    )]
    Arming {
        /// Index of the drive, from 0.
        drive: usize,
    },
    /// No event disarms a drive.
    #[error(
        "[wire] has no event that disarms drive {drive}: the emulated exciter could end only by silence, a fault; give one with \
         `disarm` and `drive = {drive}`"
    )]
    Disarming {
        /// Index of the drive, from 0.
        drive: usize,
    },
    /// No readings come by themselves.
    #[error(
        "[wire] has no readings that are sent periodically, so the emulated exciter has nothing to answer: give a \
         [[wire.readings]] with `every`, `period_s` or `on = \"sync\"`"
    )]
    NoSamples,
    /// The controller needs readings that the protocol does not carry with every sample.
    #[error(
        "the controller reads {}, but no message of every sample carries {}: give a [[wire.readings]] with `every = 1` \
         and that `quantity`",
        needed.join(", "), if needed.len() == 1 { "it" } else { "them" }
    )]
    Readings {
        /// Names of the readings.
        needed: Vec<ChannelName>,
    },
    /// The controller needs readings that the native protocol does not carry.
    #[error(
        "the controller reads {}, and Resonarm's protocol carries the impedance head, b and c alone: leave the limit in \
         [limits.sensors] out, or map a protocol of your own by [wire]",
        needed.join(", ")
    )]
    NativeReadings {
        /// Names of the readings.
        needed: Vec<ChannelName>,
    },
    /// The controller needs readings, which CANopen drives do not have.
    #[error(
        "the controller reads {}, but CANopen drives report only angles and torques: give an [excitation], without \
         [limits.sensors]",
        needed.join(", ")
    )]
    Drives {
        /// Names of the readings.
        needed: Vec<ChannelName>,
    },
    /// The load has a part that the native protocol does not carry.
    #[error(
        "the exciter's load has {part}, but Resonarm's protocol carries only torque1_nm, torque2_nm, force_x_n and \
         force_y_n: change the excitation, or map a user protocol by [wire]"
    )]
    Native {
        /// Part of the load that can't be commanded, with its unit.
        part: ChannelName,
    },
    /// The load has a part that no drive exerts.
    #[error("the exciter's load has more {part} than any drive of wire.drives can exert: change the excitation")]
    Torque {
        /// Part of the load that can't be commanded, with its unit.
        part: ChannelName,
    },
    /// The load has a part that no signal commands.
    #[error(
        "the exciter's load has more {part} than any signal of [[wire.commands]] can command: map it there, or change \
         the excitation"
    )]
    Load {
        /// Part of the load that can't be commanded, with its unit.
        part: ChannelName,
    },
    /// Signals that must be in one payload are multiplexed apart.
    #[error("message 0x{:X}: its loads are multiplexed apart, so no payload has all of them: map them in one", id.raw())]
    Multiplexed {
        /// Identifier of the message.
        id: Id,
    },
    /// The signal of an event can't represent one of its values.
    #[error(
        "message 0x{:X}: a signal in [[wire.events]] can't represent {value}, one of the values given for it: give \
         one that it can represent, or widen the signal",
        id.raw()
    )]
    Value {
        /// Identifier of the message.
        id: Id,
        /// Value that can't be represented.
        value: f64,
    },
    /// Every value of an event's signal requests something, so there is none to rest on.
    #[error("message 0x{:X}: every value of a signal in [[wire.events]] is a request: leave at least one value out of `arm`, `disarm` and `reset`", id.raw())]
    Rest {
        /// Identifier of the message.
        id: Id,
    },
}

/// Limitation of an exciter on a user protocol.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ExciterRemark {
    /// Readings that it does not receive.
    #[error("no message of every answered sample carries {}: the exciter reads NaN for it", unread.join(", "))]
    Unread {
        /// Names of the readings.
        unread: Vec<ChannelName>,
    },
    /// Samples that it does not receive.
    #[error("readings are sent every {every} samples, so the exciter answers only that often")]
    Sparse {
        /// Number of samples from one reading to the next.
        every: u64,
    },
    /// The plant's state is not sent.
    #[error(
        "no reading carries the plant's `state`: the exciter takes the plant as armed once it has requested it, and notices a fault only as silence"
    )]
    State,
    /// Readings have neither an index nor a counter.
    #[error("readings have neither `sample` nor a counter: the exciter does not notice lost samples")]
    Index,
}

/// Returns the names of readings.
pub(super) fn names(readings: &[NeededReading]) -> Vec<ChannelName> {
    readings.iter().map(|reading| reading.name).collect()
}
