//! Algorithms over the bytes: CRC, sum, exclusive or.

use alloc::boxed::Box;
use core::fmt;

use super::ChecksumError;

/// A cyclic redundancy check.
///
/// The bytes are a polynomial over the integers modulo 2, the first bit the highest power; the CRC is the remainder of
/// its product with xʷ by the generator polynomial of degree w. A start value other than 0 adds a multiple of a power
/// of x, which finds missing zeros at the front. Remainders are linear: that of the register r followed by a byte b is
/// the remainder of the top byte of r, plus b, from a table of 256, added to what is left of r. With `reflect` the
/// least significant bit of each byte, and of the result, is the highest power: everything is mirrored, the register
/// shifts to the right.
#[derive(Clone, PartialEq, Eq)]
pub struct Crc {
    width: u8,
    polynomial: u64,
    start: u64,
    xor_out: u64,
    reflect: bool,
    table: Box<[u64; 256]>,
}

impl Crc {
    /// A CRC of `width` bits, 1 to 64, in the usual parameters: the generator `polynomial` without its highest power,
    /// most significant bit first also if `reflect`; the `start` value of the register; `xor_out`, added to the result;
    /// `reflect`, whether bytes and result are mirrored.
    ///
    /// # Errors
    /// [`ChecksumError::Width`], [`ChecksumError::Parameter`] if a value has more bits than the CRC.
    pub fn new(width: u8, polynomial: u64, start: u64, xor_out: u64, reflect: bool) -> Result<Crc, ChecksumError> {
        let mask = mask(width)?;
        for (name, got) in [("polynomial", polynomial), ("start", start), ("xor_out", xor_out)] {
            if got > mask {
                return Err(ChecksumError::Parameter { name, got, width });
            }
        }
        let mut table = Box::new([0; 256]);
        // The register is right-aligned if reflected and left-aligned otherwise, so that one shift serves every
        // width.
        let generator = if reflect { mirrored(polynomial, width) } else { polynomial << (64 - u32::from(width)) };
        for (byte, entry) in (0_u64..).zip(table.iter_mut()) {
            *entry = (0..8).fold(if reflect { byte } else { byte << 56 }, |register, _| match reflect {
                true => register >> 1 ^ if register & 1 == 1 { generator } else { 0 },
                false => register << 1 ^ if register >> 63 == 1 { generator } else { 0 },
            });
        }
        Ok(Crc { width, polynomial, start, xor_out, reflect, table })
    }

    fn begin(&self) -> u64 {
        // The start value is stated most significant bit first, so a reflected register takes it mirrored, as the
        // polynomial.
        let start = self.start;
        if self.reflect { mirrored(start, self.width) } else { start << (64 - u32::from(self.width)) }
    }

    fn step(&self, register: u64, byte: u8) -> u64 {
        if self.reflect {
            register >> 8 ^ self.table[(register as u8 ^ byte) as usize]
        } else {
            register << 8 ^ self.table[((register >> 56) as u8 ^ byte) as usize]
        }
    }

    fn end(&self, register: u64) -> u64 {
        self.xor_out ^ if self.reflect { register } else { register >> (64 - u32::from(self.width)) }
    }
}

impl fmt::Debug for Crc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Crc { width, polynomial, start, xor_out, reflect, .. } = self;
        write!(f, "CRC-{width} {polynomial:#x} from {start:#x} xor {xor_out:#x}, reflect: {reflect}")
    }
}

/// A sum modulo 2ʷ: start ± Σ, then XORed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sum {
    width: u8,
    start: u64,
    xor_out: u64,
    subtract: bool,
}

impl Sum {
    /// Returns a sum of `width` bits, 1 to 64: `start` plus the sum, or minus it with `subtract`, modulo 2 to the
    /// width, then XORed with `xor_out`.
    ///
    /// # Errors
    /// [`ChecksumError::Width`], [`ChecksumError::Parameter`] if a value has more bits than the sum.
    pub const fn new(width: u8, start: u64, xor_out: u64, subtract: bool) -> Result<Sum, ChecksumError> {
        let mask = match mask(width) {
            Ok(mask) => mask,
            Err(error) => return Err(error),
        };
        if start > mask {
            return Err(ChecksumError::Parameter { name: "start", got: start, width });
        }
        if xor_out > mask {
            return Err(ChecksumError::Parameter { name: "xor_out", got: xor_out, width });
        }
        Ok(Sum { width, start, xor_out, subtract })
    }

    const fn step(&self, sum: u64, number: u64) -> u64 {
        if self.subtract { sum.wrapping_sub(number) } else { sum.wrapping_add(number) }
    }

    /// Masks the sum to its width. 2⁶⁴ is a multiple of 2ʷ, so the upper bits may be dropped at the end.
    const fn end(&self, sum: u64) -> u64 {
        (sum & (u64::MAX >> (64 - self.width as u32))) ^ self.xor_out
    }
}

/// Algorithm of a checksum.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Algorithm {
    /// A cyclic redundancy check.
    Crc(Crc),
    /// The sum of the bytes.
    Sum(Sum),
    /// The sum of the half bytes: of the high and the low four bits of each byte.
    NibbleSum(Sum),
    /// The exclusive or of the bytes, 8 bits.
    Xor {
        /// Initial value that the bytes are XORed into.
        start: u8,
    },
}

impl Algorithm {
    /// Returns the width of the result, bits.
    pub const fn width(&self) -> u8 {
        match self {
            Algorithm::Crc(crc) => crc.width,
            Algorithm::Sum(sum) | Algorithm::NibbleSum(sum) => sum.width,
            Algorithm::Xor { .. } => 8,
        }
    }

    /// Returns the checksum of `bytes`.
    pub fn of(&self, bytes: impl IntoIterator<Item = u8>) -> u64 {
        self.end(bytes.into_iter().fold(self.begin(), |state, byte| self.step(state, byte)))
    }

    pub(super) fn begin(&self) -> u64 {
        match self {
            Algorithm::Crc(crc) => crc.begin(),
            Algorithm::Sum(sum) | Algorithm::NibbleSum(sum) => sum.start,
            Algorithm::Xor { start } => u64::from(*start),
        }
    }

    pub(super) fn step(&self, state: u64, byte: u8) -> u64 {
        match self {
            Algorithm::Crc(crc) => crc.step(state, byte),
            Algorithm::Sum(sum) => sum.step(state, u64::from(byte)),
            Algorithm::NibbleSum(sum) => sum.step(state, u64::from(byte >> 4) + u64::from(byte & 0xF)),
            Algorithm::Xor { .. } => state ^ u64::from(byte),
        }
    }

    pub(super) fn end(&self, state: u64) -> u64 {
        match self {
            Algorithm::Crc(crc) => crc.end(state),
            Algorithm::Sum(sum) | Algorithm::NibbleSum(sum) => sum.end(state),
            Algorithm::Xor { .. } => state,
        }
    }
}

const fn mask(width: u8) -> Result<u64, ChecksumError> {
    match width {
        1..=64 => Ok(u64::MAX >> (64 - width as u32)),
        got => Err(ChecksumError::Width { got }),
    }
}

/// Returns the lowest `width` bits in reverse order.
const fn mirrored(bits: u64, width: u8) -> u64 {
    bits.reverse_bits() >> (64 - width as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHECKED: [u8; 9] = *b"123456789";

    /// Width, polynomial, start, xor_out, reflect, and the CRC of "123456789", from the catalogue of parametrised CRC
    /// algorithms of Greg Cook, with the names of AUTOSAR CRC Library where it has them.
    const CATALOGUE: [(u8, u64, u64, u64, bool, u64); 16] = [
        (3, 0x3, 0x0, 0x7, false, 0x4),                                               // CRC-3/GSM
        (4, 0x3, 0x0, 0x0, true, 0x7),                                                // CRC-4/G-704
        (5, 0x05, 0x1F, 0x1F, true, 0x19),                                            // CRC-5/USB
        (7, 0x09, 0x00, 0x00, false, 0x75),                                           // CRC-7/MMC
        (8, 0x1D, 0xFF, 0xFF, false, 0x4B),                                           // Crc_CalculateCRC8, SAE J1850
        (8, 0x2F, 0xFF, 0xFF, false, 0xDF),                                           // Crc_CalculateCRC8H2F
        (8, 0x31, 0x00, 0x00, true, 0xA1),                                            // CRC-8/MAXIM-DOW
        (15, 0x4599, 0x0000, 0x0000, false, 0x059E),                                  // CRC-15/CAN
        (16, 0x1021, 0xFFFF, 0x0000, false, 0x29B1),                                  // Crc_CalculateCRC16
        (16, 0x8005, 0x0000, 0x0000, true, 0xBB3D),                                   // Crc_CalculateCRC16ARC
        (17, 0x1685B, 0x00000, 0x00000, false, 0x04F03),                              // CRC-17/CAN-FD
        (21, 0x102899, 0x00000, 0x00000, false, 0x0ED841),                            // CRC-21/CAN-FD
        (32, 0x04C1_1DB7, 0xFFFF_FFFF, 0xFFFF_FFFF, true, 0xCBF4_3926),               // Crc_CalculateCRC32
        (32, 0xF4AC_FB13, 0xFFFF_FFFF, 0xFFFF_FFFF, true, 0x1697_D06A),               // Crc_CalculateCRC32P4
        (64, 0x42F0_E1EB_A9EA_3693, u64::MAX, u64::MAX, true, 0x995D_C9BB_DF19_39FA), // Crc_CalculateCRC64
        (64, 0x42F0_E1EB_A9EA_3693, 0, 0, false, 0x6C40_DF5F_0B49_7347),              // CRC-64/ECMA-182
    ];

    #[test]
    fn gives_the_check_values_of_the_catalogue() {
        for (width, polynomial, start, xor_out, reflect, expected) in CATALOGUE {
            let crc = Crc::new(width, polynomial, start, xor_out, reflect).unwrap();
            assert_eq!(Algorithm::Crc(crc.clone()).of(CHECKED), expected, "{crc:?}");
        }
    }

    #[test]
    fn sums() {
        let sum = |width, start, xor_out, subtract| Sum::new(width, start, xor_out, subtract).unwrap();
        assert_eq!(Algorithm::Sum(sum(8, 0, 0, false)).of(CHECKED), 0xDD);
        assert_eq!(Algorithm::Sum(sum(16, 0, 0, false)).of(CHECKED), 0x1DD);
        assert_eq!(Algorithm::Sum(sum(8, 0, 0xFF, false)).of(CHECKED), 0x22);
        assert_eq!(Algorithm::Sum(sum(8, 0, 0, true)).of(CHECKED), 0x23);
        assert_eq!(Algorithm::NibbleSum(sum(4, 8, 0, true)).of([0x12, 0xFF]), 8_u64.wrapping_sub(33) & 0xF);
        assert_eq!(Algorithm::Xor { start: 0 }.of(CHECKED), 0x31);
    }

    #[test]
    fn refuses_parameters_beyond_the_width() {
        assert_eq!(Crc::new(0, 0, 0, 0, false), Err(ChecksumError::Width { got: 0 }));
        assert_eq!(Sum::new(65, 0, 0, false), Err(ChecksumError::Width { got: 65 }));
        let polynomial = ChecksumError::Parameter { name: "polynomial", got: 0x11D, width: 8 };
        assert_eq!(Crc::new(8, 0x11D, 0, 0, false), Err(polynomial));
        assert!(Sum::new(4, 16, 0, false).is_err());
    }
}
