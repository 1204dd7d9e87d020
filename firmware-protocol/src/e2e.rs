//! AUTOSAR E2E Profile 11, variant 11A: CRC in byte 0, counter in the low nibble of byte 1, the whole 16-bit data id
//! in the CRC and not on the wire (AUTOSAR FO PRS E2EProtocol, "Profile 11"). The high nibble of byte 1 is payload.
//!
//! The CRC is the polynomial x⁸ + x⁴ + x³ + x² + 1 (0x1D, SAE J1850), over: data id low byte, data id high byte, bytes
//! 1 to n−1 of the message. SAE J1850 starts at 0xFF and inverts the result; Profile 11 undoes both (it calls the CRC
//! with 0xFF as a *continued* start value, which the CRC library inverts to 0x00, and inverts the result again), so
//! what stands here is the plain remainder: start 0x00, no final XOR. The polynomial is primitive, of period 255 bits, so every
//! error of one or two bits changes the remainder. So does every burst of up to 7 bits; not of 8, for the CRC stands
//! before the bytes it covers, and a burst over the end of byte 0 is none to the polynomial.

/// The largest counter; the next is 0.
pub const COUNTER_MAX: u8 = 14;

/// The largest step of the counter that a receiver accepts: up to `MAX_DELTA_COUNTER - 1` frames may be lost in a row.
pub const MAX_DELTA_COUNTER: u8 = 4;

/// The remainder of one byte, for each byte.
const TABLE: [u8; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u8;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 0x80 != 0 { crc << 1 ^ 0x1D } else { crc << 1 };
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

/// The CRC of a message with this data id: over the data id and all of `data` but byte 0, where the CRC itself stands.
pub const fn crc(data_id: u16, data: &[u8; 8]) -> u8 {
    let [low, high] = data_id.to_le_bytes();
    let mut crc = TABLE[TABLE[low as usize] as usize ^ high as usize];
    let mut i = 1;
    while i < data.len() {
        crc = TABLE[(crc ^ data[i]) as usize];
        i += 1;
    }
    crc
}

/// The counter after `counter`: 0 to 14, then 0 again.
pub const fn counter_after(counter: u8) -> u8 {
    if counter >= COUNTER_MAX { 0 } else { counter + 1 }
}

/// What is wrong with the counter of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CounterFault {
    /// The counter is that of the message before: a repetition (or exactly 15 were lost).
    Repeated,
    /// The counter steps by more than [`MAX_DELTA_COUNTER`]: too many lost, or out of order.
    WrongSequence {
        /// The counter before.
        last: u8,
    },
    /// The counter is 15, which Profile 11 doesn't use.
    Invalid,
}

/// The counter supervision of one message: the check function of Profile 11.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Supervision {
    last: Option<u8>,
}

impl Supervision {
    /// Supervision that takes the first counter it sees, whatever it is.
    pub const fn new() -> Supervision {
        Supervision { last: None }
    }

    /// Checks the counter of a message whose CRC is right, and says how many messages were lost before it.
    ///
    /// δ = (counter − last) mod 15: 1 is the next, 2 to [`MAX_DELTA_COUNTER`] mean δ − 1 lost, 0 is a repetition, more
    /// is a wrong sequence. The counter becomes the last one in every case, so the receiver is in step again with the
    /// message after a wrong sequence.
    ///
    /// # Errors
    /// [`CounterFault`]: the message must not be used. An invalid counter (15) leaves the supervision as it was.
    pub const fn check(&mut self, counter: u8) -> Result<u8, CounterFault> {
        if counter > COUNTER_MAX {
            return Err(CounterFault::Invalid);
        }
        let Some(last) = self.last else {
            self.last = Some(counter);
            return Ok(0);
        };
        self.last = Some(counter);
        match (counter + COUNTER_MAX + 1 - last) % (COUNTER_MAX + 1) {
            0 => Err(CounterFault::Repeated),
            delta if delta <= MAX_DELTA_COUNTER => Ok(delta - 1),
            _ => Err(CounterFault::WrongSequence { last }),
        }
    }
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

    #[test]
    fn the_counter_goes_from_0_to_14() {
        let mut counter = 0;
        for expected in (1..=14).chain([0, 1]) {
            counter = counter_after(counter);
            assert_eq!(counter, expected);
        }
    }

    #[test]
    fn judges_every_pair_of_counters() {
        for last in 0..=14 {
            for counter in 0..=14 {
                let mut supervision = Supervision::new();
                assert_eq!(supervision.check(last), Ok(0));
                let lost = (counter + 15 - last) % 15;
                let expected = match lost {
                    0 => Err(CounterFault::Repeated),
                    1..=4 => Ok(lost - 1),
                    _ => Err(CounterFault::WrongSequence { last }),
                };
                assert_eq!(supervision.check(counter), expected, "{last} then {counter}");
                assert_eq!(supervision.check(counter_after(counter)), Ok(0), "in step again after {counter}");
            }
        }
    }

    #[test]
    fn counter_15_is_invalid_and_forgotten() {
        let mut supervision = Supervision::new();
        assert_eq!(supervision.check(15), Err(CounterFault::Invalid));
        assert_eq!(supervision, Supervision::new());
        assert_eq!(supervision.check(3), Ok(0));
        assert_eq!(supervision.check(15), Err(CounterFault::Invalid));
        assert_eq!(supervision.check(4), Ok(0));
    }
}
