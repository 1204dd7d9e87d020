//! Messages to be sent: a frame without counter and CRC.

use crate::e2e::{Protection, profile5, profile11};
use crate::error::EncodeError;
use crate::frame::Frame;
use crate::kind::MessageKind;
use crate::message::Message;
use crate::network::Network;

/// The content of a message on the wire. A [`Message`] is larger, for two samples in a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Content {
    kind: MessageKind,
    /// Protection of the message, with its data id.
    protection: Option<(Protection, u16)>,
    /// Counter and CRC are zero.
    frame: Frame,
}

impl Message {
    /// Whether the message can be sent in a network.
    ///
    /// # Errors
    /// [`EncodeError`] names the value that can't be sent, or says that the profile has no such message.
    pub fn check(&self, network: Network) -> Result<(), EncodeError> {
        Content::new(network, self).map(|_| ())
    }
}

impl Content {
    /// # Errors
    /// [`EncodeError`] if a value can't be sent or the profile has no such message.
    #[inline]
    pub fn new(network: Network, message: &Message) -> Result<Content, EncodeError> {
        let kind = message.kind();
        let form = kind.form(network.profile()).ok_or(EncodeError::OtherProfile { kind })?;
        let mut data = [0; 64];
        match form.protection {
            Some(Protection::Profile5) => data = message.encode_fd()?,
            Some(Protection::Profile11) => {
                let payload = message.encode()?;
                // Byte 0 and the low nibble of byte 1 stay free for CRC and counter, which are known only when the
                // frame is sent.
                data[1] = payload.flags << 4;
                data[2..8].copy_from_slice(&payload.bytes);
            }
            None => data[0] = message.encode()?.bytes[0],
        }
        let protection = form.protection.zip(kind.data_id(network));
        let frame = Frame::of_message(kind.id(network), form.format, form.length, data);
        Ok(Content { kind, protection, frame })
    }

    /// The kind of the message.
    pub const fn kind(&self) -> MessageKind {
        self.kind
    }

    /// The frame with a counter, protected.
    #[inline]
    pub fn frame(&self, counter: u8) -> Frame {
        let mut frame = self.frame;
        let length = frame.len();
        let bytes = frame.bytes_mut();
        match self.protection {
            Some((Protection::Profile11, data_id)) => {
                // The counter goes in first: the CRC covers it.
                bytes[1] |= counter;
                if let Some(data) = bytes.first_chunk() {
                    bytes[0] = profile11::crc(data_id, data);
                }
            }
            Some((Protection::Profile5, data_id)) => {
                bytes[2] = counter;
                let crc = profile5::crc(data_id, &bytes[..length]);
                bytes[..2].copy_from_slice(&crc.to_le_bytes());
            }
            None => {}
        }
        frame
    }
}
