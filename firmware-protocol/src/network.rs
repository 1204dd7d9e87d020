//! The messages' identifiers in a network, and its nodes.

use core::fmt;

/// The default base identifier of a network.
pub const DEFAULT_BASE: u16 = 0x200;

/// The smallest base identifier.
pub const BASE_MIN: u16 = 0x180;

/// The largest base identifier.
pub const BASE_MAX: u16 = 0x570;

/// The largest node id (CiA 301).
pub const NODE_ID_MAX: u8 = 127;

/// The frames of a network's commands and samples. All other messages are the same in both profiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Profile {
    /// Classical CAN: 8 bytes, a frame for each instrument, 16-bit counts, E2E Profile 11.
    #[default]
    Classic = 0,
    /// CAN FD: up to 64 bytes, one frame for a whole sample, IEEE 754 single precision, E2E Profile 5.
    Fd = 1,
}

impl Profile {
    /// Both profiles of the protocol.
    pub const ALL: [Profile; 2] = [Profile::Classic, Profile::Fd];

    /// The name in a scenario and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Profile::Classic => "classic",
            Profile::Fd => "fd",
        }
    }
}

/// A name that is not a profile's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownProfile;

impl fmt::Display for UnknownProfile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [classic, fd] = Profile::ALL.map(Profile::name);
        write!(f, "the profiles are {classic} and {fd}")
    }
}

impl core::error::Error for UnknownProfile {}

impl core::str::FromStr for Profile {
    type Err = UnknownProfile;

    /// The profile with this name ([`Profile::name`]).
    fn from_str(name: &str) -> Result<Profile, UnknownProfile> {
        Profile::ALL.into_iter().find(|profile| profile.name() == name).ok_or(UnknownProfile)
    }
}

impl fmt::Display for Profile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// One plant and one exciter on a bus: the identifiers of their messages, their node ids, and their profile.
///
/// The base is a multiple of `0x10` in [`BASE_MIN`]`..=`[`BASE_MAX`]: the range in which CANopen (CiA 301, predefined
/// connection set) has its process data objects. NMT, SYNC, TIME, SDO, LSS and the heartbeats of other nodes stay free.
/// Several networks share a bus if their bases and all node ids differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Network {
    base: u16,
    plant_id: u8,
    exciter_id: u8,
    profile: Profile,
}

/// Error of an invalid network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkError {
    /// The base is outside [`BASE_MIN`]`..=`[`BASE_MAX`].
    OutOfRange {
        /// Base identifier that was given.
        got: u16,
    },
    /// The base is not a multiple of `0x10`.
    Unaligned {
        /// Base identifier that was given.
        got: u16,
    },
    /// A node id is outside `1..=`[`NODE_ID_MAX`].
    NodeId {
        /// Node to which the id was given.
        node: Node,
        /// The node id given.
        got: u8,
    },
    /// Both nodes have the same node id.
    SameNodeId {
        /// The node id given.
        got: u8,
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
            NetworkError::NodeId { node, got } => {
                write!(f, "node id {got} of the {node} is outside 1 to {NODE_ID_MAX}")
            }
            NetworkError::SameNodeId { got } => {
                write!(f, "plant and exciter both have the node id {got}: give them different ones")
            }
        }
    }
}

impl core::error::Error for NetworkError {}

impl Network {
    /// The network of the nodes 1 and 2 in the classic profile, whose process messages start at `base`.
    ///
    /// # Errors
    /// [`NetworkError`] if `base` is out of range or not a multiple of `0x10`.
    pub const fn new(base: u16) -> Result<Network, NetworkError> {
        if base < BASE_MIN || base > BASE_MAX {
            return Err(NetworkError::OutOfRange { got: base });
        }
        // The block of 16 identifiers at the largest base ends at 0x57F, before CANopen's SDO at 0x580.
        if base & 0xF != 0 {
            return Err(NetworkError::Unaligned { got: base });
        }
        Ok(Network { base, plant_id: 1, exciter_id: 2, profile: Profile::Classic })
    }

    /// The network with these node ids, 1 to [`NODE_ID_MAX`].
    ///
    /// # Errors
    /// [`NetworkError`] if one is out of range or both are the same.
    pub const fn with_node_ids(self, plant_id: u8, exciter_id: u8) -> Result<Network, NetworkError> {
        if plant_id == 0 || plant_id > NODE_ID_MAX {
            return Err(NetworkError::NodeId { node: Node::Plant, got: plant_id });
        }
        if exciter_id == 0 || exciter_id > NODE_ID_MAX {
            return Err(NetworkError::NodeId { node: Node::Exciter, got: exciter_id });
        }
        if plant_id == exciter_id {
            return Err(NetworkError::SameNodeId { got: plant_id });
        }
        Ok(Network { plant_id, exciter_id, ..self })
    }

    /// The network with this profile.
    pub const fn with_profile(self, profile: Profile) -> Network {
        Network { profile, ..self }
    }

    /// The first identifier of the block.
    pub const fn base(self) -> u16 {
        self.base
    }

    /// The CANopen node id of a node.
    pub const fn node_id(self, node: Node) -> u8 {
        match node {
            Node::Plant => self.plant_id,
            Node::Exciter => self.exciter_id,
        }
    }

    /// Returns the profile, which says in what frames commands and samples are sent.
    pub const fn profile(self) -> Profile {
        self.profile
    }
}

impl Default for Network {
    /// The network at [`DEFAULT_BASE`], of the nodes 1 and 2, in the classic profile.
    fn default() -> Network {
        Network { base: DEFAULT_BASE, plant_id: 1, exciter_id: 2, profile: Profile::Classic }
    }
}

/// A node of a network, by its role. The discriminant is its number in messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Node {
    /// The arm with its sensors.
    Plant = 1,
    /// The controller that commands the exciter.
    Exciter = 2,
}

impl Node {
    /// Both nodes of the network.
    pub const ALL: [Node; 2] = [Node::Plant, Node::Exciter];

    /// The node's number in messages, independent of its node id.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The node with this number, if there is one.
    pub fn from_number(number: u8) -> Option<Node> {
        Node::ALL.into_iter().find(|node| node.number() == number)
    }

    /// Returns the other node of the network.
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
    fn errors_describe_what_is_wrong_with_a_base() {
        let said = |base| Network::new(base).map_err(|error| error.to_string());
        assert_eq!(said(0x580), Err("base identifier 0x580 is outside 0x180 to 0x570".to_string()));
        assert_eq!(said(0x205), Err("base identifier 0x205 is not a multiple of 0x10: take 0x200".to_string()));
    }

    #[test]
    fn node_ids_are_two_of_1_to_127() {
        for plant_id in 0..=u8::MAX {
            for exciter_id in 0..=u8::MAX {
                let fits = plant_id != exciter_id && (1..=127).contains(&plant_id) && (1..=127).contains(&exciter_id);
                let network = Network::default().with_node_ids(plant_id, exciter_id);
                let ids = network.map(|network| Node::ALL.map(|node| network.node_id(node)));
                assert_eq!(ids.ok(), fits.then_some([plant_id, exciter_id]));
            }
        }
        let said = |plant_id, exciter_id| {
            Network::default().with_node_ids(plant_id, exciter_id).map_err(|error| error.to_string())
        };
        assert_eq!(said(0, 2), Err("node id 0 of the plant is outside 1 to 127".to_string()));
        assert_eq!(said(3, 128), Err("node id 128 of the exciter is outside 1 to 127".to_string()));
        assert_eq!(said(3, 3), Err("plant and exciter both have the node id 3: give them different ones".to_string()));
    }

    #[test]
    fn numbers_of_nodes_convert_in_both_directions() {
        for node in Node::ALL {
            assert_eq!(Node::from_number(node.number()), Some(node));
            assert_ne!(node.partner(), node);
            assert_eq!(node.partner().partner(), node);
        }
        assert_eq!(Node::from_number(0), None);
        assert_eq!(Node::from_number(3), None);
    }
}
