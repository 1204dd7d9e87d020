//! Commands that a plant must reject, and samples that an exciter must.

use resonarm_protocol::e2e::{profile5, profile11};
use resonarm_protocol::{
    DEFAULT_BASE, Frame, FrameError, FrameFormat, Id, MessageKind, Network, Node, Profile, Transmitter,
};

/// Damage to an otherwise valid frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Damage {
    /// One bit, a different one in each frame: the CRC is wrong.
    Bit,
    /// The counter of the frame before.
    Repeated,
    /// The counter is as if four frames were lost before it.
    Jump,
    /// The data id of another network.
    DataId,
    /// A CAN FD frame instead of a classical one, or the other way round.
    Format,
    /// One byte less, or in CAN FD the next shorter length.
    Length,
    /// A bit that belongs to no signal is set.
    ReservedBit,
    /// The first value is not available, or not a number.
    NotAvailable,
    /// A 29-bit identifier with the same number.
    Extended,
    /// The identifier of a network with another base; everything else is right.
    Base,
}

impl Damage {
    pub const ALL: [Damage; 10] = [
        Damage::Bit,
        Damage::Repeated,
        Damage::Jump,
        Damage::DataId,
        Damage::Format,
        Damage::Length,
        Damage::ReservedBit,
        Damage::NotAvailable,
        Damage::Extended,
        Damage::Base,
    ];

    /// Returns the damaged frame. `make` makes the frame with a transmitter; `n` counts the damaged ones.
    pub fn apply(self, ends: &mut Ends, n: u64, make: impl Fn(&mut Transmitter) -> Option<Frame>) -> Option<Frame> {
        match self {
            Damage::Repeated => return make(&mut ends.before.clone()),
            Damage::Jump => {
                // Five steps after the one before: 2 to 4 count as losses.
                for _ in 0..4 {
                    make(&mut ends.transmitter)?;
                }
                return make(&mut ends.transmitter);
            }
            Damage::DataId => {
                // One transmitter for all such frames: its counter counts on, so that the data id alone is wrong.
                ends.other.get_or_insert_with(|| Transmitter::new(other_network(ends.transmitter.network())));
                return make(ends.other.as_mut()?);
            }
            _ => {}
        }
        let frame = make(&mut ends.transmitter)?;
        self.spoil(ends.transmitter.network(), &frame, n).ok()
    }

    fn spoil(self, network: Network, frame: &Frame, n: u64) -> Result<Frame, FrameError> {
        let mut data = frame.data().to_vec();
        let is_classic = frame.format() == FrameFormat::Classic;
        let bits = 8 * data.len() as u64;
        match self {
            Damage::Bit => {
                let bit = (n % bits) as usize;
                // Modulo the length of the frame, so that every bit has its turn, those of the CRC and the counter
                // included.
                data[bit / 8] ^= 1 << (bit % 8);
            }
            Damage::ReservedBit if is_classic => data[1] |= 0x80,
            Damage::ReservedBit => data[3] |= 0x80,
            Damage::NotAvailable if is_classic => data[2..4].copy_from_slice(&i16::MIN.to_le_bytes()),
            Damage::NotAvailable => data[8..12].copy_from_slice(&f32::NAN.to_le_bytes()),
            // 12 bytes are the next shorter length of CAN FD below the 16 of a command.
            Damage::Length => data.truncate(if is_classic { 7 } else { 12 }),
            Damage::Extended => return Frame::new(Id::Extended(frame.id().raw()), frame.format(), &data),
            Damage::Base => {
                return Frame::new(Id::Standard(frame.id().raw() as u16 ^ base_bits(network)), frame.format(), &data);
            }
            Damage::Format if is_classic => {
                return Frame::new(
                    frame.id(),
                    FrameFormat::Fd { bit_rate_switch: true, error_state_indicator: false },
                    &data,
                );
            }
            Damage::Format => return Frame::classic(frame.id(), &data[..8]),
            Damage::Repeated | Damage::Jump | Damage::DataId => {}
        }
        // These have to be rejected for their content, so their CRC must be right.
        if let (Damage::ReservedBit | Damage::NotAvailable, Some(data_id)) = (self, data_id(network, frame)) {
            protect(&mut data, data_id);
        }
        Frame::new(frame.id(), frame.format(), &data)
    }
}

fn data_id(network: Network, frame: &Frame) -> Option<u16> {
    MessageKind::from_id(network, frame.id())?.data_id(network)
}

/// The bits in which the identifiers of a network with another base differ: the default base, or the one beside it. A
/// node that accepts any base, or the default one besides its own, accepts it.
fn base_bits(network: Network) -> u16 {
    // A base is a multiple of 10h, so the next one is the nearest network that can be.
    let other = if network.base() == DEFAULT_BASE { DEFAULT_BASE + 0x10 } else { DEFAULT_BASE };
    network.base() ^ other
}

/// Writes the CRC for the other bytes.
pub(super) fn protect(data: &mut [u8], data_id: u16) {
    // The CRC of profile 11 is in byte 0, that of profile 5 in bytes 0 and 1, the low byte first.
    if let Ok(eight) = <[u8; 8]>::try_from(&*data) {
        data[0] = profile11::crc(data_id, &eight);
    } else {
        let crc = profile5::crc(data_id, data);
        data[..2].copy_from_slice(&crc.to_le_bytes());
    }
}

/// The transmitters of the tester.
#[derive(Clone, Debug)]
pub(super) struct Ends {
    pub transmitter: Transmitter,
    /// Transmitter as it was before the last frame that can be repeated.
    pub before: Transmitter,
    other: Option<Transmitter>,
}

impl Ends {
    pub fn new(network: Network) -> Ends {
        Ends { transmitter: Transmitter::new(network), before: Transmitter::new(network), other: None }
    }
}

/// A network with the same identifiers of commands and samples but other data ids: the plant's node id differs.
fn other_network(network: Network) -> Network {
    let [plant, exciter] = [network.node_id(Node::Plant), network.node_id(Node::Exciter)];
    // Two of the three ids are taken at most, so one is free.
    let free = (1..=3).find(|id| *id != plant && *id != exciter).unwrap_or(plant);
    network.with_node_ids(free, exciter).unwrap_or(network)
}

/// Whether the damaged frame is one that a classical interface can't send.
pub(super) fn needs_fd(damage: Damage, profile: Profile) -> bool {
    damage == Damage::Format && profile == Profile::Classic
}
