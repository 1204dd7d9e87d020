//! AUTOSAR E2E Profile 11, variant 11A, of classical frames: CRC in byte 0, counter in the low nibble of byte 1, the
//! whole 16-bit data id in the CRC and not on the wire (AUTOSAR FO PRS E2EProtocol, "Profile 11"). The high nibble of
//! byte 1 is payload.
//!
//! The CRC is the polynomial x⁸ + x⁴ + x³ + x² + 1 (0x1D, SAE J1850), over: data id low byte, data id high byte, bytes
//! 1 to n−1 of the message. SAE J1850 starts at 0xFF and inverts the result; Profile 11 undoes both (it calls the CRC
//! with 0xFF as a *continued* start value, which the CRC library inverts to 0x00, and inverts the result again), so
//! the result is the plain remainder: start 0x00, no final XOR. The polynomial is primitive, of period 255 bits,
//! so every error of one or two bits changes the remainder. So does every burst of up to 7 bits; not of 8, for the CRC
//! precedes the bytes it covers, and a burst over the end of byte 0 is not a burst to the polynomial.

/// `TABLES[k][b]`: the remainder of byte b followed by k zero bytes.
///
/// A remainder is linear: that of three bytes is the sum, modulo 2, of the remainders of each with zeros in place of
/// the others. So three bytes are processed at once, with independent look-ups.
const TABLES: [[u8; 256]; 3] = {
    let mut tables = [[0; 256]; 3];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u8;
        let mut zeros = 0;
        while zeros < tables.len() {
            let mut bit = 0;
            while bit < 8 {
                crc = if crc & 0x80 != 0 { crc << 1 ^ 0x1D } else { crc << 1 };
                bit += 1;
            }
            // Eight more shifts of this remainder append a zero byte: they give the entry of the next table.
            tables[zeros][byte] = crc;
            zeros += 1;
        }
        byte += 1;
    }
    tables
};

/// The CRC of a message with this data id: over the data id and all of `data` but byte 0, which is the CRC itself.
pub const fn crc(data_id: u16, data: &[u8; 8]) -> u8 {
    let [low, high] = data_id.to_le_bytes();
    let [_, a, b, c, d, e, f, g] = *data;
    // Two bytes of the data id and seven of the frame: three steps of three bytes, without a rest.
    step(step(step(0, low, high, a), b, c, d), e, f, g)
}

const fn step(crc: u8, a: u8, b: u8, c: u8) -> u8 {
    // The remainder so far has eight bits, so it adds to the first of the three bytes alone.
    TABLES[2][(crc ^ a) as usize] ^ TABLES[1][b as usize] ^ TABLES[0][c as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gives_the_crc_that_independent_implementations_give() {
        assert_eq!(crc(0x123, &[0; 8]), 0xCC);
        // Variant 11C (nibble): the low byte of the data id, a zero, and the high nibble sent in byte 1.
        assert_eq!(crc(0x23, &[0, 0x10, 0, 0, 0, 0, 0, 0]), 0x2A);
    }

    #[test]
    fn the_crc_does_not_cover_itself() {
        assert_eq!(crc(0x123, &[0xFF, 1, 2, 3, 4, 5, 6, 7]), crc(0x123, &[0, 1, 2, 3, 4, 5, 6, 7]));
    }

    #[test]
    fn every_error_of_one_or_two_bits_changes_the_crc() {
        let residue = |data: &[u8; 8]| crc(0x5201, data) ^ data[0];
        let sent = [0, 0x5A, 1, 2, 3, 4, 5, 6];
        for one in 0..64 {
            // Bits of byte 0 are those of the CRC itself, which the comparison covers, too.
            for two in 0..64 {
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
