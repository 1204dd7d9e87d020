//! Frames to messages.

use crate::e2e::{self, Supervision};
use crate::error::DecodeError;
use crate::frame::{Frame, FrameFormat};
use crate::message::{Heartbeat, Message, MessageKind, Payload};
use crate::network::{Network, Node};
use crate::state::NodeState;

/// Takes the frames of a network: checks form, protection and content of each, and supervises the counters.
#[derive(Clone, Debug)]
pub struct Receiver {
    network: Network,
    supervisions: [Supervision; MessageKind::COUNT],
    lost: u64,
}

impl Receiver {
    /// A receiver that takes the first counter it sees of every message.
    pub const fn new(network: Network) -> Receiver {
        Receiver { network, supervisions: [Supervision::new(); MessageKind::COUNT], lost: 0 }
    }

    /// The network it listens to.
    pub const fn network(&self) -> Network {
        self.network
    }

    /// How many frames the counters say were lost since the start, without those whose loss broke the sequence.
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// The message in a frame, or `None` if the frame is not one of this protocol.
    ///
    /// Checked in this order: format, length, CRC, counter, content. The boot-up heartbeat of a node starts the
    /// supervision of everything that the node sends anew.
    ///
    /// # Errors
    /// [`DecodeError`] if the frame has an identifier of the protocol and is not valid. Its content must not be used.
    pub fn accept(&mut self, frame: &Frame) -> Result<Option<Message>, DecodeError> {
        let Some(kind) = MessageKind::from_id(self.network, frame.id()) else { return Ok(None) };
        if frame.format() != FrameFormat::Classic {
            return Err(DecodeError::Format { kind, got: frame.format() });
        }
        let payload = match kind.data_id() {
            None => unprotected(kind, frame.data())?,
            Some(data_id) => self.protected(kind, data_id, frame.data())?,
        };
        let message = Message::decode(kind, &payload)?;
        if let Message::Heartbeat(Heartbeat { node, state: NodeState::BootUp }) = message {
            self.restart(node);
        }
        Ok(Some(message))
    }

    /// Starts the supervision of everything that `node` sends anew: the next frame of each message is taken with any
    /// counter.
    fn restart(&mut self, node: Node) {
        for kind in MessageKind::ALL {
            if kind.sender() == node {
                self.supervisions[kind as usize] = Supervision::new();
            }
        }
    }

    fn protected(&mut self, kind: MessageKind, data_id: u16, data: &[u8]) -> Result<Payload, DecodeError> {
        let Ok(data) = <&[u8; 8]>::try_from(data) else {
            return Err(DecodeError::Length { kind, got: data.len(), expected: kind.len() });
        };
        let (got, expected) = (data[0], e2e::crc(data_id, data));
        if got != expected {
            return Err(DecodeError::Crc { kind, got, expected });
        }
        let counter = data[1] & 0xF;
        let checked = self.supervisions[kind as usize].check(counter);
        let lost = checked.map_err(|fault| DecodeError::Counter { kind, fault, got: counter })?;
        self.lost += u64::from(lost);
        let [_, flags, bytes @ ..] = *data;
        Ok(Payload { flags: flags >> 4, bytes })
    }
}

fn unprotected(kind: MessageKind, data: &[u8]) -> Result<Payload, DecodeError> {
    match data {
        [byte] => Ok(Payload { flags: 0, bytes: [*byte, 0, 0, 0, 0, 0] }),
        _ => Err(DecodeError::Length { kind, got: data.len(), expected: kind.len() }),
    }
}
