//! The emergency: why a node has faulted or refuses to arm, or a notice without a fault.

use core::fmt;

use super::hello::Mismatch;
use super::payload::Payload;
use super::refusal::Refusal;
use crate::error::DecodeError;
use crate::kind::MessageKind;
use crate::network::Node;

/// The subject of an emergency. `SPEC.md` defines the `detail` of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum EmergencyCode {
    /// Plant: no valid command in time. Detail: [`Refusal::detail`].
    CommandTimeout = 1,
    /// Exciter: no whole sample in time. Detail: the last sample answered.
    SensorTimeout = 2,
    /// The partner's heartbeat timed out. Detail: the partner's number ([`Node::number`]).
    HeartbeatLost = 3,
    /// The partner's heartbeat says that it has faulted or booted. Detail: the partner's number.
    PartnerFault = 4,
    /// The partner's hello is missing or doesn't fit. Detail: the [`Mismatch`].
    Incompatible = 5,
    /// Exciter: its control loop asked for a command that can't be sent. Detail: 0.
    CommandOutOfRange = 6,
    /// Plant: the integrator of the simulation failed. Detail: 0.
    SimulationFailed = 7,
    /// The node's loop missed ticks, and is set to fault on it. Detail: how many, at most 65535.
    Overrun = 8,
    /// The node could not send: bus off, or no frame sent in time. Detail: frames not sent, at most 65535.
    BusLoss = 9,
    /// Exciter: a sample index outside its window, or too many older or repeated ones. Detail: the index received.
    SampleSequence = 10,
    /// Plant, no fault: its schedule has moved by missed sample periods. Detail: how many, at most 65535.
    ScheduleSlipped = 11,
    /// No fault: the node leaves the bus. Detail: sample periods until the load is zero (plant), 0 (exciter).
    Leaving = 12,
    /// Another node sends a message of this one: it has the same node id or base. Detail: the identifier.
    SecondSender = 13,
    /// Plant: the exciter at the arm has switched off, at its own limit or that of the travel. Detail: the [`Trip`].
    ExciterTripped = 14,
    /// Plant on a user protocol: a message asked for a stop. It is not on the wire of this protocol, so that it is not
    /// in [`EmergencyCode::ALL`]. Detail: 0.
    StopRequested = 15,
}

impl EmergencyCode {
    /// Every code of this protocol.
    pub const ALL: [EmergencyCode; 14] = [
        EmergencyCode::CommandTimeout,
        EmergencyCode::SensorTimeout,
        EmergencyCode::HeartbeatLost,
        EmergencyCode::PartnerFault,
        EmergencyCode::Incompatible,
        EmergencyCode::CommandOutOfRange,
        EmergencyCode::SimulationFailed,
        EmergencyCode::Overrun,
        EmergencyCode::BusLoss,
        EmergencyCode::SampleSequence,
        EmergencyCode::ScheduleSlipped,
        EmergencyCode::Leaving,
        EmergencyCode::SecondSender,
        EmergencyCode::ExciterTripped,
    ];

    /// The code for a number on the wire, if there is one.
    pub fn from_code(code: u16) -> Option<EmergencyCode> {
        EmergencyCode::ALL.into_iter().find(|known| *known as u16 == code)
    }

    /// Whether it is a notice: sent without a fault.
    pub const fn is_notice(self) -> bool {
        matches!(self, EmergencyCode::ScheduleSlipped | EmergencyCode::Leaving)
    }
}

impl fmt::Display for EmergencyCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            EmergencyCode::CommandTimeout => "no valid command in time",
            EmergencyCode::SensorTimeout => "no sensor data in time",
            EmergencyCode::HeartbeatLost => "no heartbeat of the partner in time",
            EmergencyCode::PartnerFault => "the partner has faulted or started again",
            EmergencyCode::Incompatible => "the partner is incompatible",
            EmergencyCode::CommandOutOfRange => "a command beyond the range of its signal",
            EmergencyCode::SimulationFailed => "the simulation failed",
            EmergencyCode::Overrun => "ticks were missed",
            EmergencyCode::BusLoss => "bus-off, or frames could not be sent",
            EmergencyCode::SampleSequence => "a sample index out of sequence",
            EmergencyCode::ScheduleSlipped => "the schedule slipped by missed sample periods",
            EmergencyCode::Leaving => "the node leaves the bus",
            EmergencyCode::SecondSender => "another node sends this node's messages",
            EmergencyCode::ExciterTripped => "the exciter has tripped",
            EmergencyCode::StopRequested => "a message asked for a stop",
        })
    }
}

/// The cause of an exciter's trip: the detail of [`EmergencyCode::ExciterTripped`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum Trip {
    /// The simulated shaker's own limit of stroke, current or voltage.
    Shaker = 0,
    /// The exciter's largest travel was exceeded.
    Travel = 1,
}

impl Trip {
    /// All causes, in the order of their numbers.
    pub const ALL: [Trip; 2] = [Trip::Shaker, Trip::Travel];

    /// The trip for a `detail`, if there is one.
    pub fn from_detail(detail: u16) -> Option<Trip> {
        Trip::ALL.into_iter().find(|known| *known as u16 == detail)
    }
}

impl fmt::Display for Trip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Trip::Shaker => "the shaker's stroke, current or voltage",
            Trip::Travel => "the travel",
        })
    }
}

/// A node reports why it has faulted, or a notice ([`EmergencyCode::is_notice`]). With [`EmergencyCode::Incompatible`]
/// in the state pre-operational: why it refuses to arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Emergency {
    /// Node that reports the emergency.
    pub node: Node,
    /// Code that says what has happened.
    pub code: EmergencyCode,
    /// More about it; the meaning depends on the code.
    pub detail: u16,
    /// The index, modulo 2¹⁶, of the sample at which it was detected.
    pub sample: u16,
}

impl fmt::Display for Emergency {
    /// Code and detail in words:
    /// `plant, code 1: no valid command in time (12 rejected, the last because …), at sample 300`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Emergency { node, code, detail, sample } = *self;
        write!(f, "{node}, code {}: {code}", code as u16)?;
        match code {
            EmergencyCode::CommandTimeout => match Refusal::from_detail(detail) {
                // Nothing was rejected, or for a reason that this version does not know.
                (0, _) | (_, None) => {}
                (255, Some(refusal)) => write!(f, " (255 or more were rejected, the last because {refusal})")?,
                (count, Some(refusal)) => write!(f, " ({count} rejected, the last because {refusal})")?,
            },
            EmergencyCode::Incompatible => {
                if let Some(mismatch) = Mismatch::from_detail(detail) {
                    write!(f, " ({mismatch})")?;
                }
            }
            EmergencyCode::ExciterTripped => {
                if let Some(trip) = Trip::from_detail(detail) {
                    write!(f, " ({trip})")?;
                }
            }
            EmergencyCode::Overrun | EmergencyCode::ScheduleSlipped => write!(f, " ({detail})")?,
            EmergencyCode::BusLoss => write!(f, " ({detail} frames)")?,
            EmergencyCode::SampleSequence => write!(f, " (index {detail})")?,
            EmergencyCode::SecondSender => write!(f, " (identifier {detail:#05X})")?,
            EmergencyCode::SensorTimeout
            | EmergencyCode::HeartbeatLost
            | EmergencyCode::PartnerFault
            | EmergencyCode::CommandOutOfRange
            | EmergencyCode::SimulationFailed
            | EmergencyCode::Leaving
            | EmergencyCode::StopRequested => {}
        }
        write!(f, ", at sample {sample}")
    }
}

impl Emergency {
    pub(crate) const fn encode(&self) -> Payload {
        Payload::from_words(0, [self.code as u16, self.detail, self.sample])
    }

    pub(crate) fn decode(kind: MessageKind, payload: &Payload) -> Result<Emergency, DecodeError> {
        payload.check_flags(kind, 0)?;
        let [code, detail, sample] = payload.words();
        let unknown = DecodeError::UnknownValue { kind, signal: "code", got: code };
        Ok(Emergency { node: kind.sender(), code: EmergencyCode::from_code(code).ok_or(unknown)?, detail, sample })
    }
}
