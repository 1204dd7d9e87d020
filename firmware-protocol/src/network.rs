//! Where the messages lie among the 2048 identifiers of a network, and who speaks.

use core::fmt;

/// The base identifier of a network that nothing else was chosen for.
pub const DEFAULT_BASE: u16 = 0x200;

/// The smallest base identifier.
pub const BASE_MIN: u16 = 0x180;

/// The largest base identifier.
pub const BASE_MAX: u16 = 0x570;

/// A block of identifiers: the process messages are `base + 0` to `base + 7`.
///
/// The base is a multiple of `0x10` in [`BASE_MIN`]`..=`[`BASE_MAX`]: the range in which CANopen (CiA 301, predefined
/// connection set) has its process data objects. NMT, SYNC, TIME, SDO, LSS and the heartbeats of other nodes stay free.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Network {
    base: u16,
}

/// Why a base identifier can't be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkError {
    /// The base is outside [`BASE_MIN`]`..=`[`BASE_MAX`].
    OutOfRange {
        /// The base given.
        got: u16,
    },
    /// The base is not a multiple of `0x10`.
    Unaligned {
        /// The base given.
        got: u16,
    },
}

impl fmt::Display for NetworkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NetworkError::OutOfRange { got } => {
                write!(f, "base identifier {got:#05X} is outside {BASE_MIN:#05X} to {BASE_MAX:#05X}")
            }
            NetworkError::Unaligned { got } => {
                write!(f, "base identifier {got:#05X} is not a multiple of 0x10: take {:#05X}", got & !0xF)
            }
        }
    }
}

impl core::error::Error for NetworkError {}

impl Network {
    /// The network whose process messages start at `base`.
    ///
    /// # Errors
    /// [`NetworkError`] if `base` is out of range or not a multiple of `0x10`.
    pub const fn new(base: u16) -> Result<Network, NetworkError> {
        if base < BASE_MIN || base > BASE_MAX {
            return Err(NetworkError::OutOfRange { got: base });
        }
        if base & 0xF != 0 {
            return Err(NetworkError::Unaligned { got: base });
        }
        Ok(Network { base })
    }

    /// The first identifier of the block.
    pub const fn base(self) -> u16 {
        self.base
    }
}

impl Default for Network {
    /// The network at [`DEFAULT_BASE`].
    fn default() -> Network {
        Network { base: DEFAULT_BASE }
    }
}

/// A node of the network. The discriminant is its CANopen node id.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Node {
    /// The arm with its sensors.
    Plant = 1,
    /// The controller that commands the exciter.
    Exciter = 2,
}

impl Node {
    /// Both nodes.
    pub const ALL: [Node; 2] = [Node::Plant, Node::Exciter];

    /// The CANopen node id.
    pub const fn id(self) -> u8 {
        self as u8
    }

    /// The node of a CANopen node id, if it is one of this protocol.
    pub const fn from_id(id: u8) -> Option<Node> {
        match id {
            1 => Some(Node::Plant),
            2 => Some(Node::Exciter),
            _ => None,
        }
    }

    /// The other node.
    pub const fn partner(self) -> Node {
        match self {
            Node::Plant => Node::Exciter,
            Node::Exciter => Node::Plant,
        }
    }
}

impl fmt::Display for Node {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Node::Plant => "plant",
            Node::Exciter => "exciter",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn the_base_is_a_multiple_of_16_in_the_range_of_process_data() {
        for base in 0..=u16::MAX {
            let fits = (0x180..=0x570).contains(&base) && base % 16 == 0;
            assert_eq!(Network::new(base).map(Network::base).ok(), fits.then_some(base));
        }
        assert_eq!(Network::new(DEFAULT_BASE), Ok(Network::default()));
    }

    #[test]
    fn says_what_is_wrong_with_a_base() {
        let said = |base| Network::new(base).map_err(|error| error.to_string());
        assert_eq!(said(0x580), Err("base identifier 0x580 is outside 0x180 to 0x570".to_string()));
        assert_eq!(said(0x205), Err("base identifier 0x205 is not a multiple of 0x10: take 0x200".to_string()));
    }

    #[test]
    fn node_ids_go_there_and_back() {
        for node in Node::ALL {
            assert_eq!(Node::from_id(node.id()), Some(node));
            assert_ne!(node.partner(), node);
            assert_eq!(node.partner().partner(), node);
        }
        assert_eq!(Node::from_id(0), None);
        assert_eq!(Node::from_id(3), None);
    }
}
