//! The kinds of messages, one a frame identifier.

use core::fmt;

use crate::frame::Id;
use crate::network::{Network, Node};
use crate::timing::{HEARTBEAT_PERIOD_NS, HELLO_PERIOD_NS};

/// The kind of a message. Every kind has its own identifier, sender, data id and counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum MessageKind {
    /// [`OperatorCommand`](super::OperatorCommand).
    Operator,
    /// [`ForceCommand`](super::ForceCommand).
    Force,
    /// [`TorqueCommand`](super::TorqueCommand).
    Torque,
    /// [`ImpedanceHead`](super::ImpedanceHead).
    Head,
    /// [`Acceleration`](super::Acceleration) at point B.
    AccelerometerB,
    /// [`Acceleration`](super::Acceleration) at point C.
    AccelerometerC,
    /// [`Hello`](super::Hello) of the plant.
    PlantHello,
    /// [`Hello`](super::Hello) of the exciter.
    ExciterHello,
    /// [`Heartbeat`](super::Heartbeat) of the plant.
    PlantHeartbeat,
    /// [`Heartbeat`](super::Heartbeat) of the exciter.
    ExciterHeartbeat,
    /// [`Emergency`](super::Emergency) of the plant.
    PlantEmergency,
    /// [`Emergency`](super::Emergency) of the exciter.
    ExciterEmergency,
}

/// When a message is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cycle {
    /// Once a sample.
    Sample,
    /// At a fixed period, and at once when what it tells has changed.
    Period {
        /// The period in nanoseconds.
        period_ns: u64,
    },
    /// When there is something to tell.
    Event,
}

impl MessageKind {
    /// How many kinds there are.
    pub const COUNT: usize = 12;

    /// Every kind, in the order of the discriminants.
    pub const ALL: [MessageKind; MessageKind::COUNT] = [
        MessageKind::Operator,
        MessageKind::Force,
        MessageKind::Torque,
        MessageKind::Head,
        MessageKind::AccelerometerB,
        MessageKind::AccelerometerC,
        MessageKind::PlantHello,
        MessageKind::ExciterHello,
        MessageKind::PlantHeartbeat,
        MessageKind::ExciterHeartbeat,
        MessageKind::PlantEmergency,
        MessageKind::ExciterEmergency,
    ];

    /// The 11-bit identifier of its frames.
    pub const fn id(self, network: Network) -> u16 {
        match self {
            MessageKind::PlantHeartbeat | MessageKind::ExciterHeartbeat => 0x700 + self.sender().id() as u16,
            MessageKind::PlantEmergency | MessageKind::ExciterEmergency => 0x080 + self.sender().id() as u16,
            _ => network.base() + self as u16,
        }
    }

    /// The kind of the frames with this identifier, if it is one of the protocol's.
    pub fn from_id(network: Network, id: Id) -> Option<MessageKind> {
        let Id::Standard(id) = id else { return None };
        MessageKind::ALL.into_iter().find(|kind| kind.id(network) == id)
    }

    /// The E2E data id, or `None` for a heartbeat, which CANopen leaves unprotected.
    ///
    /// The data ids share their high byte: two of them differ in one byte, so a message sent under the identifier of another
    /// always has a wrong CRC. They don't depend on the base identifier.
    pub const fn data_id(self) -> Option<u16> {
        Some(match self {
            MessageKind::Operator => 0x5201,
            MessageKind::Force => 0x5202,
            MessageKind::Torque => 0x5203,
            MessageKind::Head => 0x5204,
            MessageKind::AccelerometerB => 0x5205,
            MessageKind::AccelerometerC => 0x5206,
            MessageKind::PlantHello => 0x5207,
            MessageKind::ExciterHello => 0x5208,
            MessageKind::PlantEmergency => 0x5209,
            MessageKind::ExciterEmergency => 0x520A,
            MessageKind::PlantHeartbeat | MessageKind::ExciterHeartbeat => return None,
        })
    }

    /// The node that sends it. Operator commands come from the exciter's side of the network.
    pub const fn sender(self) -> Node {
        match self {
            MessageKind::Head
            | MessageKind::AccelerometerB
            | MessageKind::AccelerometerC
            | MessageKind::PlantHello
            | MessageKind::PlantHeartbeat
            | MessageKind::PlantEmergency => Node::Plant,
            MessageKind::Operator
            | MessageKind::Force
            | MessageKind::Torque
            | MessageKind::ExciterHello
            | MessageKind::ExciterHeartbeat
            | MessageKind::ExciterEmergency => Node::Exciter,
        }
    }

    /// When it is sent.
    pub const fn cycle(self) -> Cycle {
        match self {
            MessageKind::Force
            | MessageKind::Torque
            | MessageKind::Head
            | MessageKind::AccelerometerB
            | MessageKind::AccelerometerC => Cycle::Sample,
            MessageKind::PlantHello | MessageKind::ExciterHello => Cycle::Period { period_ns: HELLO_PERIOD_NS },
            MessageKind::PlantHeartbeat | MessageKind::ExciterHeartbeat => {
                Cycle::Period { period_ns: HEARTBEAT_PERIOD_NS }
            }
            MessageKind::Operator | MessageKind::PlantEmergency | MessageKind::ExciterEmergency => Cycle::Event,
        }
    }

    /// The length of its frames in bytes: 1 for a heartbeat, 8 for everything else.
    #[expect(clippy::len_without_is_empty, reason = "no message is empty")]
    pub const fn len(self) -> usize {
        if self.data_id().is_some() { 8 } else { 1 }
    }

    /// The name of its message in `resonarm.dbc`.
    pub const fn name(self) -> &'static str {
        match self {
            MessageKind::Operator => "OperatorCommand",
            MessageKind::Force => "ForceCommand",
            MessageKind::Torque => "TorqueCommand",
            MessageKind::Head => "ImpedanceHead",
            MessageKind::AccelerometerB => "AccelerometerB",
            MessageKind::AccelerometerC => "AccelerometerC",
            MessageKind::PlantHello => "PlantHello",
            MessageKind::ExciterHello => "ExciterHello",
            MessageKind::PlantHeartbeat => "PlantHeartbeat",
            MessageKind::ExciterHeartbeat => "ExciterHeartbeat",
            MessageKind::PlantEmergency => "PlantEmergency",
            MessageKind::ExciterEmergency => "ExciterEmergency",
        }
    }
}

impl fmt::Display for MessageKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::e2e;

    #[test]
    fn the_discriminant_is_the_place_in_all() {
        for (place, kind) in MessageKind::ALL.into_iter().enumerate() {
            assert_eq!(kind as usize, place);
        }
    }

    #[test]
    fn every_kind_has_its_own_identifier_in_every_network() {
        for base in (0x180..=0x570).step_by(16) {
            let network = Network::new(base).unwrap();
            let kinds: std::vec::Vec<_> =
                (0..0x800).filter_map(|id| MessageKind::from_id(network, Id::Standard(id))).collect();
            assert_eq!(kinds.len(), MessageKind::COUNT);
            for kind in MessageKind::ALL {
                assert_eq!(MessageKind::from_id(network, Id::Standard(kind.id(network))), Some(kind));
                assert_eq!(MessageKind::from_id(network, Id::Extended(kind.id(network).into())), None);
            }
        }
    }

    #[test]
    fn a_message_under_the_identifier_of_another_has_a_wrong_crc() {
        let content = [0, 3, 1, 4, 1, 5, 9, 2];
        let crcs: std::collections::BTreeSet<u8> =
            MessageKind::ALL.iter().filter_map(|kind| kind.data_id()).map(|id| e2e::crc(id, &content)).collect();
        assert_eq!(crcs.len(), 10);
    }
}
