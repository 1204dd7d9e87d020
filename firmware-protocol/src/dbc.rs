//! The DBC that the layouts come from, and its hash.

/// The text of `resonarm.dbc`.
pub const DBC_TEXT: &str = include_str!("../resonarm.dbc");

/// The CRC-32/ISO-HDLC (that of zlib and Ethernet) of the bytes of `resonarm.dbc`. A hello carries its low 24 bits.
pub const DBC_HASH: u32 = crc32(DBC_TEXT.as_bytes());

/// CRC-32/ISO-HDLC: reflected polynomial 0xEDB88320, start and final XOR 0xFFFFFFFF.
const fn crc32(bytes: &[u8]) -> u32 {
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

    #[test]
    fn the_hash_is_the_crc_of_zlib() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
        assert_eq!(crc32(b""), 0);
    }

    #[test]
    fn the_file_has_unix_line_ends_and_is_ascii() {
        assert!(!DBC_TEXT.contains('\r'), "another line end would give another hash");
        assert!(DBC_TEXT.is_ascii());
        assert!(DBC_TEXT.ends_with('\n'));
    }
}
