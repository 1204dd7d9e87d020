//! Messages to frames.

use crate::e2e;
use crate::error::EncodeError;
use crate::frame::Frame;
use crate::message::{Message, MessageKind};
use crate::network::Network;

/// Makes the frames of one node: protects each message and keeps its counter.
#[derive(Clone, Debug)]
pub struct Transmitter {
    network: Network,
    counters: [u8; MessageKind::COUNT],
}

impl Transmitter {
    /// A transmitter whose counters all start at 0.
    pub const fn new(network: Network) -> Transmitter {
        Transmitter { network, counters: [0; MessageKind::COUNT] }
    }

    /// The network it sends to.
    pub const fn network(&self) -> Network {
        self.network
    }

    /// The frame of a message. Every call takes the next counter of the message, so each frame must be sent, once and in
    /// order; to send a message again, make another frame.
    ///
    /// # Errors
    /// [`EncodeError`] if a value can't be sent; the counter stays as it was.
    pub fn frame(&mut self, message: &Message) -> Result<Frame, EncodeError> {
        let payload = message.encode()?;
        let kind = message.kind();
        let id = kind.id(self.network);
        let [a, b, c, d, e, f] = payload.bytes;
        let Some(data_id) = kind.data_id() else {
            return Ok(Frame::standard(id, [a]));
        };
        let counter = self.counters[kind as usize];
        self.counters[kind as usize] = e2e::counter_after(counter);
        let mut data = [0, payload.flags << 4 | counter, a, b, c, d, e, f];
        data[0] = e2e::crc(data_id, &data);
        Ok(Frame::standard(id, data))
    }
}
