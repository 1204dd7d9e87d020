//! Encodes messages to frames.

use crate::content::Content;
use crate::error::EncodeError;
use crate::frame::Frame;
use crate::kind::MessageKind;
use crate::message::Message;
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

    /// The frame of a message. Every call uses the next counter of the message, so each frame must be sent, once and
    /// in order; to send a message again, make another frame.
    ///
    /// # Errors
    /// [`EncodeError`] if a value can't be sent or the profile has no such message; the counter stays as it was.
    pub fn frame(&mut self, message: &Message) -> Result<Frame, EncodeError> {
        let content = Content::new(self.network, message)?;
        let frame = self.next(&content);
        self.sent(content.kind());
        Ok(frame)
    }

    /// The frame of a message with its next counter.
    pub(crate) fn next(&self, content: &Content) -> Frame {
        content.frame(self.counters[content.kind() as usize])
    }

    /// The counter of a kind of message is used.
    pub(crate) fn sent(&mut self, kind: MessageKind) {
        if let Some(protection) = kind.form(self.network.profile()).and_then(|form| form.protection) {
            let counter = &mut self.counters[kind as usize];
            *counter = protection.counter_after(*counter);
        }
    }
}
