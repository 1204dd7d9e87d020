//! The kinds of messages, one per frame identifier.

use core::fmt;

use crate::e2e::Protection;
use crate::frame::{FrameFormat, Id};
use crate::network::{Network, Node, Profile};
use crate::timing::{HEARTBEAT_PERIOD_NS, HELLO_PERIOD_NS};

/// The kind of a message. Every kind has its own identifier, sender, data id and counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum MessageKind {
    /// Message [`OperatorCommand`](super::OperatorCommand) to either node.
    Operator,
    /// Message [`ForceCommand`](super::ForceCommand) of the exciter.
    Force,
    /// Message [`TorqueCommand`](super::TorqueCommand) of the exciter.
    Torque,
    /// Message [`ImpedanceHead`](super::ImpedanceHead) of the plant.
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
    /// Message [`Sensors`](super::Sensors) of the plant.
    Sensors,
    /// Message [`SensorPair`](super::SensorPair) of the plant.
    SensorPair,
    /// [`Capabilities`](super::Capabilities) of the plant.
    PlantCapabilities,
    /// [`Capabilities`](super::Capabilities) of the exciter.
    ExciterCapabilities,
}

/// The form of the frames of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form {
    /// The format in which they are sent. A receiver accepts a CAN FD frame with and without bit rate switch.
    pub format: FrameFormat,
    /// Their length in bytes.
    pub length: usize,
    /// Their protection; `None` for a heartbeat.
    pub protection: Option<Protection>,
}

impl Form {
    const HEARTBEAT: Form = Form { format: FrameFormat::Classic, length: 1, protection: None };
    const CLASSIC: Form = Form { format: FrameFormat::Classic, length: 8, protection: Some(Protection::Profile11) };

    const fn fd(length: usize) -> Form {
        // ESI is set by the CAN controller, when it is error passive; no message asks for it.
        let format = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
        Form { format, length, protection: Some(Protection::Profile5) }
    }

    /// Whether a frame of this format may hold the message.
    pub const fn takes(&self, format: FrameFormat) -> bool {
        matches!(
            // BRS and ESI are not compared: an FD frame without bit rate switch must be taken, too.
            (self.format, format),
            (FrameFormat::Classic, FrameFormat::Classic) | (FrameFormat::Fd { .. }, FrameFormat::Fd { .. })
        )
    }
}

/// Time at which a message is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cycle {
    /// The message is sent once per sample.
    Sample,
    /// The message is sent at a fixed period, and at once when its content has changed.
    Period {
        /// The period in nanoseconds.
        period_ns: u64,
    },
    /// The message is sent when an event occurs.
    Event,
}

impl MessageKind {
    /// Number of kinds of messages, and the length of tables by kind.
    pub const COUNT: usize = 16;

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
        MessageKind::Sensors,
        MessageKind::SensorPair,
        MessageKind::PlantCapabilities,
        MessageKind::ExciterCapabilities,
    ];

    /// The messages at the base and the identifiers after it.
    const BLOCK: [MessageKind; 12] = [
        MessageKind::Operator,
        MessageKind::Force,
        MessageKind::Torque,
        MessageKind::Head,
        MessageKind::AccelerometerB,
        MessageKind::AccelerometerC,
        MessageKind::PlantHello,
        MessageKind::ExciterHello,
        MessageKind::Sensors,
        MessageKind::SensorPair,
        MessageKind::PlantCapabilities,
        MessageKind::ExciterCapabilities,
    ];

    /// The messages whose identifiers contain a node id.
    const OF_NODES: [MessageKind; 4] = [
        MessageKind::PlantHeartbeat,
        MessageKind::ExciterHeartbeat,
        MessageKind::PlantEmergency,
        MessageKind::ExciterEmergency,
    ];

    /// The 11-bit identifier of its frames.
    pub const fn id(self, network: Network) -> u16 {
        let of_node = network.node_id(self.sender()) as u16;
        match self {
            MessageKind::PlantHeartbeat | MessageKind::ExciterHeartbeat => 0x700 + of_node,
            MessageKind::PlantEmergency | MessageKind::ExciterEmergency => 0x080 + of_node,
            // The messages of nodes have the discriminants 8 to 11 and no place in the block, so these four lie four
            // lower in it.
            MessageKind::Sensors => network.base() + 8,
            MessageKind::SensorPair => network.base() + 9,
            MessageKind::PlantCapabilities => network.base() + 10,
            MessageKind::ExciterCapabilities => network.base() + 11,
            _ => network.base() + self as u16,
        }
    }

    /// The kind of the frames with this identifier, if it is the protocol's.
    pub fn from_id(network: Network, id: Id) -> Option<MessageKind> {
        // A frame with a 29-bit identifier is never a message (SPEC.md, section 1).
        let Id::Standard(id) = id else { return None };
        // The block first: it has the messages of every sample, and costs a subtraction and a look-up.
        let in_block = id.checked_sub(network.base()).and_then(|offset| MessageKind::BLOCK.get(usize::from(offset)));
        in_block.or_else(|| MessageKind::OF_NODES.iter().find(|kind| kind.id(network) == id)).copied()
    }

    /// The E2E data id, or `None` for a heartbeat, which CANopen leaves unprotected.
    ///
    /// The low byte is the message's and the high byte the network's: `0x51` and the plant's node id. So a message
    /// under the identifier of another, and the same message of another network, differ in one byte, and the CRC is
    /// always wrong. The data ids don't depend on the base identifier.
    pub const fn data_id(self, network: Network) -> Option<u16> {
        let number = match self {
            MessageKind::Operator => 0x01,
            MessageKind::Force => 0x02,
            MessageKind::Torque => 0x03,
            MessageKind::Head => 0x04,
            MessageKind::AccelerometerB => 0x05,
            MessageKind::AccelerometerC => 0x06,
            MessageKind::PlantHello => 0x07,
            MessageKind::ExciterHello => 0x08,
            MessageKind::PlantEmergency => 0x09,
            MessageKind::ExciterEmergency => 0x0A,
            MessageKind::Sensors => 0x0B,
            MessageKind::SensorPair => 0x0C,
            MessageKind::PlantCapabilities => 0x0D,
            MessageKind::ExciterCapabilities => 0x0E,
            MessageKind::PlantHeartbeat | MessageKind::ExciterHeartbeat => return None,
        };
        // At most 0x51 + 127 = 0xD0, so the sum fits the high byte.
        Some((0x51 + network.node_id(Node::Plant) as u16) << 8 | number)
    }

    /// The form of its frames in a profile, or `None` if the profile has no such message.
    pub const fn form(self, profile: Profile) -> Option<Form> {
        Some(match (self, profile) {
            (MessageKind::PlantHeartbeat | MessageKind::ExciterHeartbeat, _) => Form::HEARTBEAT,
            (MessageKind::Operator, _)
            | (MessageKind::PlantHello | MessageKind::ExciterHello, _)
            | (MessageKind::PlantEmergency | MessageKind::ExciterEmergency, _)
            | (MessageKind::Force | MessageKind::Torque, Profile::Classic)
            | (MessageKind::Head | MessageKind::AccelerometerB | MessageKind::AccelerometerC, Profile::Classic) => {
                Form::CLASSIC
            }
            (MessageKind::Force | MessageKind::Torque, Profile::Fd)
            | (MessageKind::PlantCapabilities | MessageKind::ExciterCapabilities, Profile::Fd) => Form::fd(16),
            (MessageKind::Sensors, Profile::Fd) => Form::fd(32),
            (MessageKind::SensorPair, Profile::Fd) => Form::fd(64),
            (MessageKind::Head | MessageKind::AccelerometerB | MessageKind::AccelerometerC, Profile::Fd)
            | (MessageKind::Sensors | MessageKind::SensorPair, Profile::Classic)
            | (MessageKind::PlantCapabilities | MessageKind::ExciterCapabilities, Profile::Classic) => return None,
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
            | MessageKind::PlantEmergency
            | MessageKind::Sensors
            | MessageKind::SensorPair
            | MessageKind::PlantCapabilities => Node::Plant,
            MessageKind::Operator
            | MessageKind::Force
            | MessageKind::Torque
            | MessageKind::ExciterHello
            | MessageKind::ExciterHeartbeat
            | MessageKind::ExciterEmergency
            | MessageKind::ExciterCapabilities => Node::Exciter,
        }
    }

    /// Returns when the message is sent.
    pub const fn cycle(self) -> Cycle {
        match self {
            MessageKind::Force
            | MessageKind::Torque
            | MessageKind::Head
            | MessageKind::AccelerometerB
            | MessageKind::AccelerometerC
            | MessageKind::Sensors
            | MessageKind::SensorPair => Cycle::Sample,
            MessageKind::PlantHello
            | MessageKind::ExciterHello
            | MessageKind::PlantCapabilities
            | MessageKind::ExciterCapabilities => Cycle::Period { period_ns: HELLO_PERIOD_NS },
            MessageKind::PlantHeartbeat | MessageKind::ExciterHeartbeat => {
                Cycle::Period { period_ns: HEARTBEAT_PERIOD_NS }
            }
            MessageKind::Operator | MessageKind::PlantEmergency | MessageKind::ExciterEmergency => Cycle::Event,
        }
    }

    /// The name of its message in the DBC.
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
            MessageKind::Sensors => "Sensors",
            MessageKind::SensorPair => "SensorPair",
            MessageKind::PlantCapabilities => "PlantCapabilities",
            MessageKind::ExciterCapabilities => "ExciterCapabilities",
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

    /// Data ids that differ in one byte give different CRCs, so it is enough that all are different and each pair
    /// of a network differs in its low byte only.
    #[test]
    fn all_data_ids_are_different() {
        let mut seen = std::collections::BTreeSet::new();
        for plant_id in 1..=127 {
            let network = Network::default().with_node_ids(plant_id, if plant_id == 127 { 1 } else { 127 }).unwrap();
            let ids: std::vec::Vec<u16> =
                MessageKind::ALL.into_iter().filter_map(|kind| kind.data_id(network)).collect();
            assert_eq!(ids.len(), MessageKind::COUNT - 2);
            assert!(ids.iter().all(|id| id >> 8 == ids[0] >> 8));
            assert!(ids.into_iter().all(|id| seen.insert(id)));
        }
    }

    #[test]
    fn a_message_under_the_identifier_of_another_has_a_wrong_crc() {
        let (content, network) = ([0, 3, 1, 4, 1, 5, 9, 2], Network::default());
        let ids = || MessageKind::ALL.into_iter().filter_map(|kind| kind.data_id(network));
        let crcs: std::collections::BTreeSet<u8> = ids().map(|id| e2e::profile11::crc(id, &content)).collect();
        assert_eq!(crcs.len(), ids().count());
        let crcs: std::collections::BTreeSet<u16> = ids().map(|id| e2e::profile5::crc(id, &content)).collect();
        assert_eq!(crcs.len(), ids().count());
    }

    #[test]
    fn every_message_has_a_form_in_a_profile() {
        for kind in MessageKind::ALL {
            let forms = Profile::ALL.map(|profile| kind.form(profile));
            assert!(forms.iter().any(Option::is_some), "{kind}");
            assert!(forms.iter().flatten().all(|form| form.protection.is_some() == (form.length > 1)), "{kind}");
        }
    }
}
