//! The hello: a node's version, profile and rate, so that incompatible nodes never arm.

use core::fmt;

use super::payload::Payload;
use crate::dbc;
use crate::error::{DecodeError, EncodeError};
use crate::kind::MessageKind;
use crate::network::Profile;

/// The version of the protocol that this crate speaks: major in the high nibble, minor in the low one.
pub const PROTOCOL_VERSION: u8 = 0x12;

/// The version of the protocol. Nodes of the same major version are compatible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Version {
    /// Increases when a node of the old version would misunderstand; 0 to 15.
    pub major: u8,
    /// Increases with every other change; 0 to 15.
    pub minor: u8,
}

impl Version {
    /// The version in a byte: major in the high nibble, minor in the low one.
    pub const fn from_byte(byte: u8) -> Version {
        Version { major: byte >> 4, minor: byte & 0xF }
    }
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}

/// A node's version, profile and sample rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Hello {
    /// The version of the protocol.
    pub version: Version,
    /// The low 24 bits of the hash of the profile's DBC ([`dbc::hash`]).
    pub dbc_hash: u32,
    /// Profile of the network on which the node works.
    pub profile: Profile,
    /// The sample rate in hertz, 1 to 65535: the plant's own, or the one that the exciter expects.
    pub rate_hz: u16,
}

/// Reason for which two nodes are incompatible. The discriminant is the `detail` of
/// [`EmergencyCode::Incompatible`](super::EmergencyCode::Incompatible).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum Mismatch {
    /// No hello of the partner has been seen since it booted.
    NoHello = 0,
    /// The major versions differ.
    Version = 1,
    /// The layouts differ: the hashes of the DBC are not the same.
    DbcHash = 2,
    /// The nodes use different profiles.
    Profile = 3,
    /// The sample rates differ. A controller at the wrong rate would excite the wrong frequency.
    Rate = 4,
}

impl Mismatch {
    /// All reasons, in the order of their numbers.
    pub const ALL: [Mismatch; 5] =
        [Mismatch::NoHello, Mismatch::Version, Mismatch::DbcHash, Mismatch::Profile, Mismatch::Rate];

    /// The mismatch for a `detail`, if there is one.
    pub fn from_detail(detail: u16) -> Option<Mismatch> {
        Mismatch::ALL.into_iter().find(|known| *known as u16 == detail)
    }
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Mismatch::NoHello => "no hello seen",
            Mismatch::Version => "another major version of the protocol",
            Mismatch::DbcHash => "another DBC",
            Mismatch::Profile => "another profile",
            Mismatch::Rate => "another sample rate",
        })
    }
}

impl Hello {
    /// The bits of the hash that a hello carries.
    pub const DBC_HASH_MASK: u32 = 0xFF_FFFF;

    /// The flag bit for the FD profile.
    const FD: u8 = 1;

    /// The hello of this crate in a profile, at a sample rate in hertz.
    pub const fn new(profile: Profile, rate_hz: u16) -> Hello {
        Hello {
            version: Version::from_byte(PROTOCOL_VERSION),
            dbc_hash: dbc::hash(profile) & Hello::DBC_HASH_MASK,
            profile,
            rate_hz,
        }
    }

    /// Returns the reason for which a node with this hello is incompatible with one with the hello `partner`, if it is.
    pub fn mismatch(&self, partner: &Hello) -> Option<Mismatch> {
        // The order of SPEC.md, section 9: the profile before the hash, since a node of the other profile has
        // another hash as well.
        if self.version.major != partner.version.major {
            Some(Mismatch::Version)
        } else if self.profile != partner.profile {
            Some(Mismatch::Profile)
        } else if self.dbc_hash != partner.dbc_hash {
            Some(Mismatch::DbcHash)
        } else if self.rate_hz != partner.rate_hz {
            Some(Mismatch::Rate)
        } else {
            None
        }
    }

    pub(crate) fn encode(&self, kind: MessageKind) -> Result<Payload, EncodeError> {
        let within = |signal, got: u32, min, max| {
            if (min..=max).contains(&got) { Ok(()) } else { Err(EncodeError::Invalid { kind, signal, got, min, max }) }
        };
        within("version_major", self.version.major.into(), 0, 15)?;
        within("version_minor", self.version.minor.into(), 0, 15)?;
        within("dbc_hash", self.dbc_hash, 0, Hello::DBC_HASH_MASK)?;
        within("rate_hz", self.rate_hz.into(), 1, u16::MAX.into())?;
        let [hash0, hash1, hash2, _] = self.dbc_hash.to_le_bytes();
        let [rate0, rate1] = self.rate_hz.to_le_bytes();
        let version = self.version.major << 4 | self.version.minor;
        Ok(Payload { flags: self.profile as u8, bytes: [version, hash0, hash1, hash2, rate0, rate1] })
    }

    pub(crate) fn decode(kind: MessageKind, payload: &Payload) -> Result<Hello, DecodeError> {
        payload.check_flags(kind, Hello::FD)?;
        let [version, hash0, hash1, hash2, rate0, rate1] = payload.bytes;
        let rate_hz = u16::from_le_bytes([rate0, rate1]);
        if rate_hz == 0 {
            return Err(DecodeError::UnknownValue { kind, signal: "rate_hz", got: 0 });
        }
        Ok(Hello {
            version: Version::from_byte(version),
            dbc_hash: u32::from_le_bytes([hash0, hash1, hash2, 0]),
            profile: if payload.flags & Hello::FD == 0 { Profile::Classic } else { Profile::Fd },
            rate_hz,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_mismatches() {
        let ours = Hello::new(Profile::Classic, 1000);
        let other_major = Version { major: ours.version.major + 1, ..ours.version };
        let other_minor = Version { minor: ours.version.minor + 1, ..ours.version };
        let cases = [
            (ours, None),
            (Hello { version: other_minor, ..ours }, None),
            (Hello { version: other_major, ..ours }, Some(Mismatch::Version)),
            (Hello { dbc_hash: ours.dbc_hash ^ 1, ..ours }, Some(Mismatch::DbcHash)),
            (Hello { profile: Profile::Fd, ..ours }, Some(Mismatch::Profile)),
            (Hello { rate_hz: 1001, ..ours }, Some(Mismatch::Rate)),
        ];
        for (partner, expected) in cases {
            assert_eq!(ours.mismatch(&partner), expected);
            assert_eq!(partner.mismatch(&ours), expected);
        }
    }

    #[test]
    fn details_convert_in_both_directions() {
        for mismatch in Mismatch::ALL {
            assert_eq!(Mismatch::from_detail(mismatch as u16), Some(mismatch));
        }
        assert_eq!(Mismatch::from_detail(5), None);
    }
}
