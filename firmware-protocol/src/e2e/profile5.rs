//! AUTOSAR E2E Profile 5, of CAN FD frames: CRC-16 in the bytes 0 and 1 (little-endian), counter in byte 2, the 16-bit
//! data id in the CRC and not on the wire (AUTOSAR FO PRS E2EProtocol, "Profile 5", offset 0).
//!
//! The CRC is CRC-16/IBM-3740 (CCITT with start value 0xFFFF): polynomial x¹⁶ + x¹² + x⁵ + 1 (0x1021), most significant
//! bit first, no final XOR, over: bytes 2 to n−1 of the message, data id low byte, data id high byte. The polynomial
//! has the factor x + 1, so it finds every odd number of wrong bits; its period of 32767 bits exceeds the longest
//! message, so it finds every two.

/// `TABLES[k][b]`: the remainder of byte b followed by k zero bytes.
///
/// A remainder is linear: that of four bytes is the sum, modulo 2, of the remainders of each with zeros in place of the
/// others. So four bytes are processed at once, with independent look-ups; byte by byte each waits
/// for the one before, which doubles the time of the longest frame.
const TABLES: [[u16; 256]; 4] = {
    let mut tables = [[0; 256]; 4];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = (byte as u16) << 8;
        let mut zeros = 0;
        while zeros < tables.len() {
            let mut bit = 0;
            while bit < 8 {
                crc = if crc & 0x8000 != 0 { crc << 1 ^ 0x1021 } else { crc << 1 };
                bit += 1;
            }
            tables[zeros][byte] = crc;
            zeros += 1;
        }
        byte += 1;
    }
    tables
};

/// The CRC of a message with this data id: over all of `data` but bytes 0 and 1, which are the CRC itself, and
/// the data id.
pub const fn crc(data_id: u16, data: &[u8]) -> u16 {
    let mut crc: u16 = 0xFFFF;
    let mut left = if let [_, _, content @ ..] = data { content } else { &[] };
    while let [a, b, c, d, behind @ ..] = left {
        // The remainder so far has 16 bits, so it adds to the first two of the four bytes.
        let [high, low] = crc.to_be_bytes();
        crc = TABLES[3][(high ^ *a) as usize]
            ^ TABLES[2][(low ^ *b) as usize]
            ^ TABLES[1][*c as usize]
            ^ TABLES[0][*d as usize];
        left = behind;
    }
    // Frames of 16, 32 and 64 bytes have 14, 30 and 62 bytes behind the CRC: two are left over from the steps of
    // four.
    while let [byte, behind @ ..] = left {
        crc = step(crc, *byte);
        left = behind;
    }
    let [low, high] = data_id.to_le_bytes();
    step(step(crc, low), high)
}

const fn step(crc: u16, byte: u8) -> u16 {
    crc << 8 ^ TABLES[0][((crc >> 8) as u8 ^ byte) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of CRC-16/IBM-3740 over "123456789", of which the last two bytes stand for the data id.
    #[test]
    fn gives_the_check_value_of_the_crc() {
        assert_eq!(crc(u16::from_le_bytes(*b"89"), b"\0\x001234567"), 0x29B1);
    }

    /// The example of the AUTOSAR document: eight zero bytes, data id 0x1234.
    #[test]
    fn gives_the_crc_of_the_standard_s_example() {
        assert_eq!(crc(0x1234, &[0; 8]), 0xCA1C);
    }

    #[test]
    fn every_error_of_one_or_two_bits_changes_the_crc() {
        // The longest message, and so all distances between two wrong bits that can occur.
        const LENGTH: usize = 64;
        let residue = |data: &[u8; LENGTH]| crc(0x520B, data) ^ u16::from_le_bytes([data[0], data[1]]);
        let sent = core::array::from_fn(|k| k as u8);
        for one in 0..8 * LENGTH {
            for two in 0..=one {
                let mut data = sent;
                data[one / 8] ^= 1 << (one % 8);
                if two != one {
                    data[two / 8] ^= 1 << (two % 8);
                }
                assert_ne!(residue(&data), residue(&sent), "bits {one} and {two}");
            }
        }
    }
}
