//! Messages to frames.

use crate::e2e::{Protection, profile5, profile11};
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

    /// The frame of a message. Every call takes the next counter of the message, so each frame must be sent, once and
    /// in order; to send a message again, make another frame.
    ///
    /// # Errors
    /// [`EncodeError`] if a value can't be sent or the profile has no such message; the counter stays as it was.
    pub fn frame(&mut self, message: &Message) -> Result<Frame, EncodeError> {
        let kind = message.kind();
        let id = kind.id(self.network);
        let form = kind.form(self.network.profile()).ok_or(EncodeError::OtherProfile { kind })?;
        let (Some(protection), Some(data_id)) = (form.protection, kind.data_id(self.network)) else {
            return Ok(Frame::of_form(id, &form, &message.encode()?.bytes));
        };
        let counter = self.counters[kind as usize];
        let frame = match protection {
            Protection::Profile11 => {
                let payload = message.encode()?;
                let [a, b, c, d, e, f] = payload.bytes;
                let mut data = [0, payload.flags << 4 | counter, a, b, c, d, e, f];
                data[0] = profile11::crc(data_id, &data);
                Frame::of_form(id, &form, &data)
            }
            Protection::Profile5 => {
                let mut data = message.encode_fd()?;
                data[2] = counter;
                let crc = profile5::crc(data_id, &data[..form.length]);
                data[..2].copy_from_slice(&crc.to_le_bytes());
                Frame::of_form(id, &form, &data)
            }
        };
        self.counters[kind as usize] = protection.counter_after(counter);
        Ok(frame)
    }
}
