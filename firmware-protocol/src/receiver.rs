//! Decodes frames to messages.

use crate::e2e::{Protection, Supervision, profile5, profile11};
use crate::error::DecodeError;
use crate::frame::Frame;
use crate::kind::MessageKind;
use crate::message::{Heartbeat, Message, Payload};
use crate::network::{Network, Node};
use crate::state::NodeState;

/// Receives the frames of a network: checks form, protection and content of each, and supervises the counters.
#[derive(Clone, Debug)]
pub struct Receiver {
    network: Network,
    supervisions: [Supervision; MessageKind::COUNT],
    lost: u64,
}

impl Receiver {
    /// A receiver that accepts the first counter of every message.
    pub const fn new(network: Network) -> Receiver {
        Receiver { network, supervisions: [Supervision::new(); MessageKind::COUNT], lost: 0 }
    }

    /// Returns the network whose frames are decoded.
    pub const fn network(&self) -> Network {
        self.network
    }

    /// Returns how many frames were lost since the start, by the counters, except those whose loss broke the sequence.
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// The message in a frame, or `None` if the frame is not the protocol's.
    ///
    /// Checked in this order: format, length, CRC, counter, content. A node's boot-up heartbeat restarts the
    /// supervision of all its messages.
    ///
    /// # Errors
    /// [`DecodeError`] if the frame has an identifier of the protocol and is not valid. Its content must not be used.
    pub fn accept(&mut self, frame: &Frame) -> Result<Option<Message>, DecodeError> {
        let Some(kind) = MessageKind::from_id(self.network, frame.id()) else { return Ok(None) };
        let form = kind.form(self.network.profile()).ok_or(DecodeError::OtherProfile { kind })?;
        if !form.takes(frame.format()) {
            return Err(DecodeError::Format { kind, got: frame.format() });
        }
        if frame.len() != form.length {
            return Err(DecodeError::Length { kind, got: frame.len(), expected: form.length });
        }
        // The message is not taken out of its result: messages are long, and each move copies one.
        let decoded = match form.protection.zip(kind.data_id(self.network)) {
            None => Message::decode(kind, &unprotected(frame.data())),
            Some((Protection::Profile11, data_id)) => {
                Message::decode(kind, &self.profile11(kind, data_id, frame.data())?)
            }
            Some((Protection::Profile5, data_id)) => {
                self.profile5(kind, data_id, frame.data())?;
                Message::decode_fd(kind, frame.data())
            }
        };
        if let Ok(Message::Heartbeat(Heartbeat { node, state: NodeState::BootUp })) = decoded {
            self.restart(node);
        }
        decoded.map(Some)
    }

    /// Restarts the supervision of all messages of `node`: the next frame of each is accepted with any
    /// counter.
    fn restart(&mut self, node: Node) {
        for kind in MessageKind::ALL {
            if kind.sender() == node {
                self.supervisions[kind as usize] = Supervision::new();
            }
        }
    }

    /// The payload of a classical frame, checked.
    fn profile11(&mut self, kind: MessageKind, data_id: u16, data: &[u8]) -> Result<Payload, DecodeError> {
        let protection = Protection::Profile11;
        let mut bytes = [0; 8];
        // `accept` has checked the length: all messages of Profile 11 have 8 bytes.
        bytes.copy_from_slice(data);
        let got = bytes[0].into();
        let expected = profile11::crc(data_id, &bytes).into();
        if got != expected {
            return Err(DecodeError::Crc { kind, got, expected, protection });
        }
        // After the CRC: a counter that was damaged on the way must not move the supervision.
        self.supervise(kind, protection, bytes[1] & 0xF)?;
        let [_, flags, bytes @ ..] = bytes;
        Ok(Payload { flags: flags >> 4, bytes })
    }

    /// Checks a CAN FD frame.
    fn profile5(&mut self, kind: MessageKind, data_id: u16, data: &[u8]) -> Result<(), DecodeError> {
        let protection = Protection::Profile5;
        let got = u16::from_le_bytes([data[0], data[1]]);
        let expected = profile5::crc(data_id, data);
        if got != expected {
            return Err(DecodeError::Crc { kind, got, expected, protection });
        }
        self.supervise(kind, protection, data[2])
    }

    fn supervise(&mut self, kind: MessageKind, protection: Protection, counter: u8) -> Result<(), DecodeError> {
        let checked = self.supervisions[kind as usize].check(protection, counter);
        let lost = checked.map_err(|fault| DecodeError::Counter { kind, fault, got: counter })?;
        // A sequence that broke says nothing about how many frames were lost, so those are not counted.
        self.lost += u64::from(lost);
        Ok(())
    }
}

/// The payload of a heartbeat.
fn unprotected(data: &[u8]) -> Payload {
    Payload { flags: 0, bytes: [data[0], 0, 0, 0, 0, 0] }
}
