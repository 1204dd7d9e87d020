//! The messages: valid values, and their encoding in bytes.

mod acceleration;
mod capabilities;
mod command;
mod emergency;
mod fd;
mod heartbeat;
mod hello;
mod impedance_head;
mod measured;
mod operator;
mod payload;
mod refusal;
mod sensors;
mod signals;

pub use acceleration::Acceleration;
pub use capabilities::{Capabilities, SamplesPerFrame};
pub use command::{ForceCommand, TorqueCommand};
pub use emergency::{Emergency, EmergencyCode, Trip};
pub use heartbeat::Heartbeat;
pub use hello::{Hello, Mismatch, PROTOCOL_VERSION, Version};
pub use impedance_head::ImpedanceHead;
pub use measured::Measured;
pub use operator::{OperatorCommand, OperatorRequest};
pub use refusal::Refusal;
pub use sensors::{SensorPair, SensorValues, Sensors};
pub use signals::SignalError;

pub(crate) use payload::Payload;

use crate::error::{DecodeError, EncodeError};
use crate::kind::MessageKind;
use crate::network::Node;

/// A decoded message of the protocol.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// The operator arms, disarms or resets a node.
    Operator(OperatorCommand),
    /// The exciter commands the force at the tip.
    Force(ForceCommand),
    /// The exciter commands the torques at the joints.
    Torque(TorqueCommand),
    /// The plant's impedance head: the force at the tip, point C.
    Head(ImpedanceHead),
    /// The plant's accelerometer at point B.
    AccelerometerB(Acceleration),
    /// The plant's accelerometer at point C, which is also the acceleration of the impedance head.
    AccelerometerC(Acceleration),
    /// The plant's version, profile and rate.
    PlantHello(Hello),
    /// The exciter's version, profile and the rate it expects.
    ExciterHello(Hello),
    /// A node reports its state.
    Heartbeat(Heartbeat),
    /// A node's fault, refusal to arm, or notice.
    Emergency(Emergency),
    /// All of the plant's instruments at one sample (FD profile).
    Sensors(Sensors),
    /// All of the plant's instruments at two samples (FD profile).
    SensorPair(SensorPair),
    /// A node's capabilities (FD profile).
    Capabilities(Capabilities),
}

impl Message {
    /// The kind of the message: its identifier, sender and protection.
    pub const fn kind(&self) -> MessageKind {
        match self {
            Message::Operator(_) => MessageKind::Operator,
            Message::Force(_) => MessageKind::Force,
            Message::Torque(_) => MessageKind::Torque,
            Message::Head(_) => MessageKind::Head,
            Message::AccelerometerB(_) => MessageKind::AccelerometerB,
            Message::AccelerometerC(_) => MessageKind::AccelerometerC,
            Message::PlantHello(_) => MessageKind::PlantHello,
            Message::ExciterHello(_) => MessageKind::ExciterHello,
            Message::Heartbeat(Heartbeat { node: Node::Plant, .. }) => MessageKind::PlantHeartbeat,
            Message::Heartbeat(Heartbeat { node: Node::Exciter, .. }) => MessageKind::ExciterHeartbeat,
            Message::Emergency(Emergency { node: Node::Plant, .. }) => MessageKind::PlantEmergency,
            Message::Emergency(Emergency { node: Node::Exciter, .. }) => MessageKind::ExciterEmergency,
            Message::Sensors(_) => MessageKind::Sensors,
            Message::SensorPair(_) => MessageKind::SensorPair,
            Message::Capabilities(Capabilities { node: Node::Plant, .. }) => MessageKind::PlantCapabilities,
            Message::Capabilities(Capabilities { node: Node::Exciter, .. }) => MessageKind::ExciterCapabilities,
        }
    }

    /// The content of a message that is a classical frame.
    pub(crate) fn encode(&self) -> Result<Payload, EncodeError> {
        let kind = self.kind();
        match self {
            Message::Operator(command) => Ok(command.encode()),
            Message::Force(command) => command.encode(),
            Message::Torque(command) => command.encode(),
            Message::Head(head) => head.encode(),
            Message::AccelerometerB(acceleration) | Message::AccelerometerC(acceleration) => acceleration.encode(kind),
            Message::PlantHello(hello) | Message::ExciterHello(hello) => hello.encode(kind),
            Message::Heartbeat(heartbeat) => Ok(heartbeat.encode()),
            Message::Emergency(emergency) => Ok(emergency.encode()),
            Message::Sensors(_) | Message::SensorPair(_) | Message::Capabilities(_) => {
                Err(EncodeError::OtherProfile { kind })
            }
        }
    }

    /// The message of this kind in the payload of a classical frame whose length and protection are right.
    pub(crate) fn decode(kind: MessageKind, payload: &Payload) -> Result<Message, DecodeError> {
        match kind {
            MessageKind::Operator => OperatorCommand::decode(payload).map(Message::Operator),
            MessageKind::Force => ForceCommand::decode(payload).map(Message::Force),
            MessageKind::Torque => TorqueCommand::decode(payload).map(Message::Torque),
            MessageKind::Head => ImpedanceHead::decode(payload).map(Message::Head),
            MessageKind::AccelerometerB => Acceleration::decode(kind, payload).map(Message::AccelerometerB),
            MessageKind::AccelerometerC => Acceleration::decode(kind, payload).map(Message::AccelerometerC),
            MessageKind::PlantHello => Hello::decode(kind, payload).map(Message::PlantHello),
            MessageKind::ExciterHello => Hello::decode(kind, payload).map(Message::ExciterHello),
            MessageKind::PlantHeartbeat | MessageKind::ExciterHeartbeat => {
                Heartbeat::decode(kind, payload).map(Message::Heartbeat)
            }
            MessageKind::PlantEmergency | MessageKind::ExciterEmergency => {
                Emergency::decode(kind, payload).map(Message::Emergency)
            }
            MessageKind::Sensors
            | MessageKind::SensorPair
            | MessageKind::PlantCapabilities
            | MessageKind::ExciterCapabilities => Err(DecodeError::OtherProfile { kind }),
        }
    }

    /// The bytes of a message that is a CAN FD frame.
    pub(crate) fn encode_fd(&self) -> Result<fd::FdBytes, EncodeError> {
        let kind = self.kind();
        match self {
            Message::Force(c) => fd::command(kind, ForceCommand::SIGNALS, [c.force_x_n, c.force_y_n], c.sample),
            Message::Torque(c) => fd::command(kind, TorqueCommand::SIGNALS, [c.torque1_nm, c.torque2_nm], c.sample),
            Message::Sensors(sensors) => sensors.encode(),
            Message::SensorPair(pair) => pair.encode(),
            Message::Capabilities(capabilities) => capabilities.encode(kind),
            // Not reached: `MessageKind::form` gives Profile 5 to the messages above and to no other.
            _ => Err(EncodeError::OtherProfile { kind }),
        }
    }

    /// The message of this kind in a CAN FD frame whose length and protection are right.
    pub(crate) fn decode_fd(kind: MessageKind, bytes: &[u8]) -> Result<Message, DecodeError> {
        let reader = fd::FdReader { kind, bytes };
        match kind {
            MessageKind::Force => {
                let ([force_x_n, force_y_n], sample) = reader.command(ForceCommand::SIGNALS)?;
                Ok(Message::Force(ForceCommand { force_x_n, force_y_n, sample }))
            }
            MessageKind::Torque => {
                let ([torque1_nm, torque2_nm], sample) = reader.command(TorqueCommand::SIGNALS)?;
                Ok(Message::Torque(TorqueCommand { torque1_nm, torque2_nm, sample }))
            }
            MessageKind::Sensors => Sensors::decode(&reader).map(Message::Sensors),
            MessageKind::SensorPair => SensorPair::decode(&reader).map(Message::SensorPair),
            MessageKind::PlantCapabilities | MessageKind::ExciterCapabilities => {
                Capabilities::decode(&reader).map(Message::Capabilities)
            }
            _ => Err(DecodeError::OtherProfile { kind }),
        }
    }
}
