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
    /// Message [`OperatorCommand`](crate::message::OperatorCommand) to either node.
    Operator,
    /// Message [`ForceCommand`](crate::message::ForceCommand) of the exciter.
    Force,
    /// Message [`TorqueCommand`](crate::message::TorqueCommand) of the exciter.
    Torque,
    /// Message [`ImpedanceHead`](crate::message::ImpedanceHead) of the plant.
    Head,
    /// [`Acceleration`](crate::message::Acceleration) at point B.
    AccelerometerB,
    /// [`Acceleration`](crate::message::Acceleration) at point C.
    AccelerometerC,
    /// [`Hello`](crate::message::Hello) of the plant.
    PlantHello,
    /// [`Hello`](crate::message::Hello) of the exciter.
    ExciterHello,
    /// [`Heartbeat`](crate::message::Heartbeat) of the plant.
    PlantHeartbeat,
    /// [`Heartbeat`](crate::message::Heartbeat) of the exciter.
    ExciterHeartbeat,
    /// [`Emergency`](crate::message::Emergency) of the plant.
    PlantEmergency,
    /// [`Emergency`](crate::message::Emergency) of the exciter.
    ExciterEmergency,
    /// Message [`Sensors`](crate::message::Sensors) of the plant.
    Sensors,
    /// Message [`SensorPair`](crate::message::SensorPair) of the plant.
    SensorPair,
    /// [`Capabilities`](crate::message::Capabilities) of the plant.
    PlantCapabilities,
    /// [`Capabilities`](crate::message::Capabilities) of the exciter.
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

    /// The 11-bit identifier of its frames.
    pub const fn id(self, network: Network) -> u16 {
        match self.row().identifier {
            AfterBase(offset) => network.base() + offset,
            WithNodeId(first) => first + network.node_id(self.sender()) as u16,
        }
    }

    /// The kind of the frames with this identifier, if it is the protocol's.
    pub fn from_id(network: Network, id: Id) -> Option<MessageKind> {
        // A frame with a 29-bit identifier is never a message (SPEC.md, section 1).
        let Id::Standard(id) = id else { return None };
        // The block first: it has the messages of every sample, and costs a subtraction and a look-up. The messages
        // with node ids have the discriminants 8 to 11 and no place in it, so that the last four lie four lower.
        match id.checked_sub(network.base()) {
            Some(offset @ 0..=7) => Some(MessageKind::ALL[usize::from(offset)]),
            Some(offset @ 8..=11) => Some(MessageKind::ALL[usize::from(offset) + 4]),
            _ => MessageKind::ALL[8..12].iter().find(|kind| kind.id(network) == id).copied(),
        }
    }

    /// The E2E data id, or `None` for a heartbeat, which CANopen leaves unprotected.
    ///
    /// The low byte is the message's and the high byte the network's: `0x51` and the plant's node id. So a message
    /// under the identifier of another, and the same message of another network, differ in one byte, and the CRC is
    /// always wrong. The data ids don't depend on the base identifier.
    pub const fn data_id(self, network: Network) -> Option<u16> {
        match self.row().data_id {
            // At most 0x51 + 127 = 0xD0, so the sum fits the high byte.
            Some(low) => Some((0x51 + network.node_id(Node::Plant) as u16) << 8 | low as u16),
            None => None,
        }
    }

    /// The form of its frames in a profile, or `None` if the profile has no such message.
    pub const fn form(self, profile: Profile) -> Option<Form> {
        self.row().forms[profile as usize]
    }

    /// The node that sends it. Operator commands come from the exciter's side of the network.
    pub const fn sender(self) -> Node {
        self.row().sender
    }

    /// Returns when the message is sent.
    pub const fn cycle(self) -> Cycle {
        self.row().cycle
    }

    /// The name of its message in the DBC.
    pub const fn name(self) -> &'static str {
        self.row().name
    }

    const fn row(self) -> &'static Row {
        &TABLE[self as usize]
    }
}

/// A row of the table of messages.
struct Row {
    name: &'static str,
    sender: Node,
    identifier: Identifier,
    cycle: Cycle,
    /// The forms in both profiles, by their numbers.
    forms: [Option<Form>; 2],
    /// The low byte of the data id.
    data_id: Option<u8>,
}

/// How the identifier of a message follows from the network.
enum Identifier {
    /// It is so many after the base.
    AfterBase(u16),
    /// It is this one plus the node id of the sender, as in CANopen.
    WithNodeId(u16),
}

// Short names, so that a row of the table below fits its line, as one of SPEC.md does.
use Cycle::{Event, Sample};
use Identifier::{AfterBase, WithNodeId};
use Node::{Exciter, Plant};

const AS_HELLO: Cycle = Cycle::Period { period_ns: HELLO_PERIOD_NS };
const AS_HEARTBEAT: Cycle = Cycle::Period { period_ns: HEARTBEAT_PERIOD_NS };
const ONE_BYTE: Option<Form> = Some(Form { format: FrameFormat::Classic, length: 1, protection: None });
const CLASSIC: Option<Form> =
    Some(Form { format: FrameFormat::Classic, length: 8, protection: Some(Protection::Profile11) });

const fn fd(length: usize) -> Option<Form> {
    // ESI is set by the CAN controller, when it is error passive; no message asks for it.
    let format = FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false };
    Some(Form { format, length, protection: Some(Protection::Profile5) })
}

const fn row(
    name: &'static str,
    sender: Node,
    identifier: Identifier,
    cycle: Cycle,
    forms: [Option<Form>; 2],
    data_id: Option<u8>,
) -> Row {
    Row { name, sender, identifier, cycle, forms, data_id }
}

/// The table of SPEC.md, section 1, in the order of the discriminants.
static TABLE: [Row; MessageKind::COUNT] = [
    row("OperatorCommand", Exciter, AfterBase(0), Event, [CLASSIC, CLASSIC], Some(0x01)),
    row("ForceCommand", Exciter, AfterBase(1), Sample, [CLASSIC, fd(16)], Some(0x02)),
    row("TorqueCommand", Exciter, AfterBase(2), Sample, [CLASSIC, fd(16)], Some(0x03)),
    row("ImpedanceHead", Plant, AfterBase(3), Sample, [CLASSIC, None], Some(0x04)),
    row("AccelerometerB", Plant, AfterBase(4), Sample, [CLASSIC, None], Some(0x05)),
    row("AccelerometerC", Plant, AfterBase(5), Sample, [CLASSIC, None], Some(0x06)),
    row("PlantHello", Plant, AfterBase(6), AS_HELLO, [CLASSIC, CLASSIC], Some(0x07)),
    row("ExciterHello", Exciter, AfterBase(7), AS_HELLO, [CLASSIC, CLASSIC], Some(0x08)),
    row("PlantHeartbeat", Plant, WithNodeId(0x700), AS_HEARTBEAT, [ONE_BYTE, ONE_BYTE], None),
    row("ExciterHeartbeat", Exciter, WithNodeId(0x700), AS_HEARTBEAT, [ONE_BYTE, ONE_BYTE], None),
    row("PlantEmergency", Plant, WithNodeId(0x080), Event, [CLASSIC, CLASSIC], Some(0x09)),
    row("ExciterEmergency", Exciter, WithNodeId(0x080), Event, [CLASSIC, CLASSIC], Some(0x0A)),
    row("Sensors", Plant, AfterBase(8), Sample, [None, fd(32)], Some(0x0B)),
    row("SensorPair", Plant, AfterBase(9), Sample, [None, fd(64)], Some(0x0C)),
    row("PlantCapabilities", Plant, AfterBase(10), AS_HELLO, [None, fd(16)], Some(0x0D)),
    row("ExciterCapabilities", Exciter, AfterBase(11), AS_HELLO, [None, fd(16)], Some(0x0E)),
];

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
        let content = [0, 3, 1, 4, 1, 5, 9, 2];
        let network = Network::default();
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
