//! [`Frame`] for the drivers of microcontrollers: the trait of crate `embedded-can`.

use embedded_can::{ExtendedId, StandardId};

use crate::frame::{Frame, FrameFormat, Id};

/// A driver makes classical frames; [`Frame::new`] makes CAN FD frames. For a CAN FD frame `is_data_frame` is true
/// and `dlc` returns its length in bytes, as for every frame.
impl embedded_can::Frame for Frame {
    fn new(id: impl Into<embedded_can::Id>, data: &[u8]) -> Option<Frame> {
        Frame::classic(own(id.into()), data).ok()
    }

    fn new_remote(id: impl Into<embedded_can::Id>, dlc: usize) -> Option<Frame> {
        // Of the data only the length counts. The trait has no error: `get` makes `None` of more than 8 bytes.
        Frame::new(own(id.into()), FrameFormat::Remote, [0; 8].get(..dlc)?).ok()
    }

    fn is_extended(&self) -> bool {
        matches!(Frame::id(self), Id::Extended(_))
    }

    fn is_remote_frame(&self) -> bool {
        self.format() == FrameFormat::Remote
    }

    fn id(&self) -> embedded_can::Id {
        // Every identifier fits its format, so the zeros are never used.
        match Frame::id(self) {
            Id::Standard(id) => embedded_can::Id::Standard(StandardId::new(id).unwrap_or(StandardId::ZERO)),
            Id::Extended(id) => embedded_can::Id::Extended(ExtendedId::new(id).unwrap_or(ExtendedId::ZERO)),
        }
    }

    fn dlc(&self) -> usize {
        self.len()
    }

    fn data(&self) -> &[u8] {
        Frame::data(self)
    }
}

fn own(id: embedded_can::Id) -> Id {
    match id {
        embedded_can::Id::Standard(id) => Id::Standard(id.as_raw()),
        embedded_can::Id::Extended(id) => Id::Extended(id.as_raw()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Heartbeat, Message, Network, Node, NodeState, Receiver, Transmitter};
    use embedded_can::Frame as _;

    /// Takes a frame apart and makes it again, as a driver does.
    fn through_a_driver(frame: &Frame) -> Option<Frame> {
        let id = embedded_can::Frame::id(frame);
        if frame.is_remote_frame() {
            embedded_can::Frame::new_remote(id, frame.dlc())
        } else {
            embedded_can::Frame::new(id, embedded_can::Frame::data(frame))
        }
    }

    #[test]
    fn a_message_survives_a_driver() {
        let network = Network::default();
        let message = Message::Heartbeat(Heartbeat { node: Node::Plant, state: NodeState::Operational });
        let frame = Transmitter::new(network).frame(&message).unwrap();
        let got = through_a_driver(&frame).unwrap();
        assert_eq!((got, got.is_standard(), got.is_data_frame(), got.dlc()), (frame, true, true, 1));
        assert_eq!(Receiver::new(network).accept(&got), Ok(Some(message)));
    }

    #[test]
    fn remote_frames_and_long_identifiers_survive_too() {
        for text in ["123#R5", "1FFFFFFF#0102030405060708", "00000000#"] {
            let frame: Frame = text.parse().unwrap();
            assert_eq!(through_a_driver(&frame), Some(frame), "{text}");
        }
        let id = StandardId::new(1).unwrap();
        assert_eq!(<Frame as embedded_can::Frame>::new(id, &[0; 9]), None);
        assert_eq!(<Frame as embedded_can::Frame>::new_remote(id, 9), None);
    }
}
