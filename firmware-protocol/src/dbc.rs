//! The DBC files that define the layouts, their hashes, and the DBC for another base and other node ids.

use core::fmt::{self, Write};

use crate::frame::Id;
use crate::kind::MessageKind;
use crate::network::{Network, Node, Profile};

/// The text of a profile's DBC, at the default base identifier and node ids: `resonarm.dbc` or `resonarm-fd.dbc`.
pub const fn text(profile: Profile) -> &'static str {
    match profile {
        Profile::Classic => include_str!("../resonarm.dbc"),
        Profile::Fd => include_str!("../resonarm-fd.dbc"),
    }
}

/// The CRC-32/ISO-HDLC (that of zlib and Ethernet) of the bytes of [`text`]. A hello carries its low 24 bits. It
/// identifies the layouts, so it is the same for every base and all node ids.
pub const fn hash(profile: Profile) -> u32 {
    // A constant, so that the compiler hashes the files and firmware holds only the results.
    const HASHES: [u32; 2] = [crc32(text(Profile::Classic).as_bytes()), crc32(text(Profile::Fd).as_bytes())];
    HASHES[profile as usize]
}

/// Words with which [`text`] describes its identifiers, and itself as the text whose hash a hello carries.
const AT_DEFAULTS: &str = "at the default base identifier 0x200 (512) and the default node ids";
const HASHED: &str = "the bytes of this file";

/// The DBC of a network: [`text`] with the network's identifiers, node ids and data ids, and with comments that say so.
///
/// Identifiers follow `BO_`, `SG_`, `VAL_` and `SIG_VALTYPE_`, each of which begins a line or follows `CM_` or the
/// name of an attribute.
#[derive(Clone, Copy, Debug)]
pub struct Dbc(pub Network);

impl fmt::Display for Dbc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for line in text(self.0.profile()).lines() {
            self.line(f, line)?;
            f.write_char('\n')?;
        }
        Ok(())
    }
}

impl Dbc {
    fn line(&self, f: &mut fmt::Formatter<'_>, line: &str) -> fmt::Result {
        // The only line whose number is a node id and not an identifier.
        if let Some(node) = line.strip_prefix("BA_ \"NodeId\" BU_ ") {
            let node = if node.starts_with("Plant") { Node::Plant } else { Node::Exciter };
            let name = if node == Node::Plant { "Plant" } else { "Exciter" };
            return write!(f, "BA_ \"NodeId\" BU_ {name} {};", self.0.node_id(node));
        }
        let Some((before, kind, after)) = identifier(self.0.profile(), line) else { return self.comment(f, line) };
        write!(f, "{before}{}", kind.id(self.0))?;
        match kind.data_id(self.0) {
            Some(data_id) if before.starts_with("BA_ \"E2EDataId\"") => write!(f, " {data_id};"),
            _ => self.comment(f, after),
        }
    }

    /// Text without identifiers: what it says of the file that the hash is of is said of this one.
    fn comment(&self, f: &mut fmt::Formatter<'_>, text: &str) -> fmt::Result {
        let network = self.0;
        // At the defaults the file stays as distributed, byte for byte: the hash in a hello is that of these bytes.
        if network == Network::default().with_profile(network.profile()) {
            return f.write_str(text);
        }
        let name = if network.profile() == Profile::Classic { "resonarm.dbc" } else { "resonarm-fd.dbc" };
        match (text.split_once(AT_DEFAULTS), text.split_once(HASHED)) {
            (Some((before, after)), _) => {
                let base = network.base();
                let plant = network.node_id(Node::Plant);
                let exciter = network.node_id(Node::Exciter);
                write!(
                    f,
                    "{before}at the base identifier {base:#x} ({base}), node id {plant} of the plant and {exciter} of "
                )?;
                write!(f, "the exciter{after}")
            }
            (None, Some((before, after))) => {
                write!(f, "{before}the bytes of {name} as distributed, at the default identifiers{after}")
            }
            (None, None) => f.write_str(text),
        }
    }
}

/// The message whose identifier a line has, with the text before and after the identifier.
fn identifier(profile: Profile, line: &str) -> Option<(&str, MessageKind, &str)> {
    const BEFORE: [&str; 6] = ["BO_ ", "CM_ BO_ ", "CM_ SG_ ", "VAL_ ", "SIG_VALTYPE_ ", "BA_ \""];
    let word = BEFORE.into_iter().find(|word| line.starts_with(word))?;
    // An attribute's name stands before ` BO_ `. Attributes of a node or of the whole network have none, and stay as
    // they are.
    let start = if word.starts_with("BA_") { line.find(" BO_ ")? + " BO_ ".len() } else { word.len() };
    let (before, rest) = line.split_at(start);
    let digits = rest.find(|c: char| !c.is_ascii_digit())?;
    let (number, after) = rest.split_at(digits);
    let id = number.parse().ok()?;
    // The text has the identifiers of the default network, whatever network is written.
    let network = Network::default().with_profile(profile);
    let kind = MessageKind::from_id(network, Id::Standard(id))?;
    Some((before, kind, after))
}

/// CRC-32/ISO-HDLC: reflected polynomial 0xEDB88320, start and final XOR 0xFFFFFFFF.
const fn crc32(bytes: &[u8]) -> u32 {
    // Bit by bit, without a table: it runs only at compile time. A const fn has no `for`.
    let mut crc = u32::MAX;
    let mut i = 0;
    while i < bytes.len() {
        crc ^= bytes[i] as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 1 != 0 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 };
            bit += 1;
        }
        i += 1;
    }
    !crc
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn the_hash_is_the_crc_of_zlib() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
        assert_eq!(crc32(b""), 0);
    }

    #[test]
    fn the_files_have_unix_line_ends_and_are_ascii() {
        for profile in Profile::ALL {
            let text = text(profile);
            assert!(!text.contains('\r'), "another line end gives another hash");
            assert!(text.is_ascii());
            assert!(text.ends_with('\n'));
        }
    }

    #[test]
    fn the_file_of_another_network_describes_itself() {
        for (profile, name) in [(Profile::Classic, "resonarm.dbc"), (Profile::Fd, "resonarm-fd.dbc")] {
            let other = Network::new(0x300).unwrap().with_node_ids(3, 4).unwrap().with_profile(profile);
            let text = Dbc(other).to_string();
            assert!(!text.contains(AT_DEFAULTS) && !text.contains(HASHED), "{text}");
            let said =
                "at the base identifier 0x300 (768), node id 3 of the plant and 4 of the exciter. With another base";
            assert_eq!(text.matches(said).count(), 1);
            let of = std::format!("of the bytes of {name} as distributed, at the default identifiers.\";");
            assert_eq!(text.matches(&of).count(), 2);
        }
    }

    #[test]
    fn the_default_network_has_the_files() {
        for profile in Profile::ALL {
            assert_eq!(Dbc(Network::default().with_profile(profile)).to_string(), text(profile));
        }
    }
}
