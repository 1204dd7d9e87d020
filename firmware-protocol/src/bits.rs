//! The number of bits that a frame takes on a bus: exactly, with its own stuff bits, or at most.
//!
//! ISO 11898-1:2015. After five equal bits in a row a sender inserts one of the other level, which counts for the next
//! five.
//!
//! ```text
//! classical   SOF 1, identifier 11, RTR, IDE, r0, DLC 4, data 8n, CRC 15 | delimiter, ACK 2, EOF 7, intermission 3
//!             └───────────────────────── stuffed ──────────────────────┘
//! extended    the identifier is 11 bits, SRR, IDE and 18 bits; then RTR, r1, r0
//!
//! FD          SOF 1, identifier 11, RRS, IDE, FDF, res, BRS | ESI, DLC 4, data 8n | count 4, CRC, delimiter | ACK …
//!             └─────────────────────────── stuffed ────────────────────────────┘
//!                                                           └─── at the data bit rate, if BRS is set ─────┘
//! ```
//!
//! In an FD frame the count of the stuff bits and the CRC (17 bits for up to 16 bytes of data, else 21) have a fixed
//! stuff bit before their first bit and after every fourth, even if there was a stuff bit just before. So the length of
//! an FD frame does not depend on its CRC, which is not computed.
//!
//! The bit rate changes at the sample points of BRS and of the CRC delimiter. With sample points at the same fraction
//! of both bit times the frame takes exactly as long as if BRS had the nominal bit time and the delimiter the data bit
//! time, which is how they are counted.

use crate::frame::{Frame, FrameFormat, Id};

/// Bits by the rate at which they are sent: of a frame, or per second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bits {
    /// Bits at the nominal bit rate: the arbitration phases.
    pub nominal: u64,
    /// Bits at the data bit rate: the data phase of an FD frame with BRS.
    pub data: u64,
}

impl Bits {
    /// The bits at both rates.
    pub const fn total(self) -> u64 {
        self.nominal + self.data
    }

    /// Returns the sum, for each of the two rates.
    pub const fn plus(self, other: Bits) -> Bits {
        Bits { nominal: self.nominal + other.nominal, data: self.data + other.data }
    }

    /// Returns `factor` times the bits, for each of the two rates.
    pub const fn times(self, factor: u64) -> Bits {
        Bits { nominal: self.nominal * factor, data: self.data * factor }
    }

    /// Their duration, ns, the bits of each rate rounded up.
    pub const fn time_ns(self, rates: BitRates) -> u64 {
        const SECOND_NS: u64 = 1_000_000_000;
        // Each part is rounded up by itself: the sum is never below the exact duration, and above it by less than 2
        // ns.
        (self.nominal * SECOND_NS).div_ceil(rates.nominal_hz as u64)
            + (self.data * SECOND_NS).div_ceil(rates.data_hz as u64)
    }
}

/// The bit rates of a bus, both positive. A classical bus has one for both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRates {
    /// Bits a second of arbitration, and of all of a frame without BRS.
    pub nominal_hz: u32,
    /// Bits a second of the data phase of an FD frame with BRS.
    pub data_hz: u32,
}

impl BitRates {
    /// One rate for everything.
    pub const fn classical(bit_rate_hz: u32) -> BitRates {
        BitRates { nominal_hz: bit_rate_hz, data_hz: bit_rate_hz }
    }
}

/// The format of an identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IdFormat {
    /// Standard identifier of 11 bits.
    Standard,
    /// Extended identifier of 29 bits.
    Extended,
}

/// Number of stuff bits to count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stuffing {
    /// No stuff bits: the shortest time that a frame can take.
    None,
    /// The most that any frame of the format and length can have.
    Worst,
}

/// Delimiter of the CRC, ACK slot and delimiter, end of frame.
const CLASSICAL_TAIL: u64 = 3 + 7;
/// ACK slot and delimiter, end of frame.
const FD_TAIL: u64 = 2 + 7;
/// The bits between the end of a frame and the start of the next.
pub const INTERMISSION: u64 = 3;

/// Bits of the CRC of an FD frame.
const fn fd_crc(len: usize) -> u64 {
    if len <= 16 { 17 } else { 21 }
}

/// Stuff count, CRC, their fixed stuff bits, and the delimiter.
const fn fd_check(len: usize) -> u64 {
    // One fixed stuff bit before the first of n bits and one after every fourth are ⌈n/4⌉; the 1 is the delimiter.
    let checked = 4 + fd_crc(len);
    checked + checked.div_ceil(4) + 1
}

/// The bits of a frame of `len` bytes, intermission included, without stuff bits or with the most.
///
/// Among s stuffed bits at most one is inserted after the first five, and then one after every four: ⌊(s − 1)/4⌋. In an
/// FD frame FDF, res and BRS differ, so that no five equal bits end among them, and none is inserted after the last
/// bit. For frames of 8 bytes this gives the 135 and 160 bits of R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien,
/// "Controller Area Network (CAN) schedulability analysis: Refuted, revisited and revised", Real-Time Systems 35
/// (2007), doi:10.1007/s11241-007-9012-7.
pub const fn bounds(id: IdFormat, format: FrameFormat, len: usize, stuffing: Stuffing) -> Bits {
    let bits = 8 * len as u64;
    let most = match stuffing {
        Stuffing::None => 0,
        Stuffing::Worst => 1,
    };
    match format {
        FrameFormat::Classic | FrameFormat::Remote => {
            let data = if matches!(format, FrameFormat::Remote) { 0 } else { bits };
            let stuffed = data
                + match id {
                    // SOF 1, identifier 11, RTR, IDE, r0, DLC 4, CRC 15. The extended format has SRR, 18 bits of
                    // identifier and r1 more.
                    IdFormat::Standard => 34,
                    IdFormat::Extended => 54,
                };
            Bits { nominal: stuffed + most * ((stuffed - 1) / 4) + CLASSICAL_TAIL + INTERMISSION, data: 0 }
        }
        FrameFormat::Fd { bit_rate_switch, .. } => {
            // Bits up to BRS, and those of them before FDF.
            let (head, before) = match id {
                IdFormat::Standard => (17, 14),
                IdFormat::Extended => (36, 33),
            };
            // Res or BRS, ESI, DLC and data, less the last bit: the first is the one that a run can begin with.
            let stuff = (5 + bits) / 4;
            let nominal = head + most * ((before - 1) / 4) + FD_TAIL + INTERMISSION;
            split(bit_rate_switch, nominal, 5 + bits + most * stuff + fd_check(len))
        }
    }
}

/// The bits that `frame` takes, with its own stuff bits and the intermission.
pub fn of(frame: &Frame) -> Bits {
    let Line { bits, head, .. } = Line::of(frame, None);
    match frame.format() {
        FrameFormat::Classic | FrameFormat::Remote => Bits { nominal: bits + CLASSICAL_TAIL + INTERMISSION, data: 0 },
        FrameFormat::Fd { bit_rate_switch, .. } => {
            split(bit_rate_switch, head + FD_TAIL + INTERMISSION, bits - head + fd_check(frame.len()))
        }
    }
}

/// The level of a bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// 0: the level of the bus if any node sends it.
    Dominant,
    /// 1: the level of the idle bus.
    Recessive,
}

/// Returns after how many bits a receiver detects an error if bit `k` of `frame`, counted from SOF as 0, is not as sent
/// and all later bits have the level `behind`, as those of an error flag; 0 means at bit `k`. `None` if it detects
/// none: only for SOF followed by an idle bus.
///
/// ```text
/// among stuffed bits    at the sixth equal bit in a row
/// stuff count and CRC   of FD: at a fixed stuff bit like the bit before it
/// CRC delimiter         if it is dominant; else after the ACK delimiter, since the CRC is wrong
/// from there on         at bit k: these bits have one level
/// ```
///
/// The bits of an FD frame's CRC are not computed: there, the bit before bit `k` is taken to differ from it.
pub fn noticed_after(frame: &Frame, k: u64, behind: Level) -> Option<u64> {
    let line = Line::of(frame, Some(k));
    let (stuffed, checked) = match frame.format() {
        FrameFormat::Classic | FrameFormat::Remote => (line.bits, line.bits),
        FrameFormat::Fd { .. } => (line.bits, line.bits + fd_check(frame.len()) - 1),
    };
    let is_fixed = |bit: u64| (stuffed..checked).contains(&bit) && (bit - stuffed).is_multiple_of(5);
    // A receiver sees the disturbed bit and the run of equal bits that ends there. All later bits have the
    // level `behind`, so level and length of the run are enough to find the first violation.
    let (mut level, mut run) = match line.disturbed {
        _ if k >= checked || is_fixed(k) => return Some(0),
        // A stuff bit that is not as sent makes six equal bits by itself.
        Some((_, 6)) => return Some(0),
        Some((level, run)) if k > 0 => (Some(level), run),
        // SOF was not seen and the bus is idle: to the receiver there was no frame.
        _ if k == 0 && behind == Level::Recessive => return None,
        _ => (None, 0),
    };
    for bit in k + 1..checked {
        run = if level == Some(behind) { run + 1 } else { 1 };
        if bit < stuffed && run == 6 || is_fixed(bit) && level == Some(behind) {
            return Some(bit - k);
        }
        level = Some(behind);
    }
    // Bit `checked` is the CRC delimiter. If it is recessive, the wrong CRC is reported after the ACK slot and the
    // ACK delimiter, two bits later.
    Some(checked - k + if behind == Level::Dominant { 0 } else { 2 })
}

/// Without BRS the whole frame has the nominal bit rate.
const fn split(bit_rate_switch: bool, nominal: u64, data: u64) -> Bits {
    if bit_rate_switch { Bits { nominal, data } } else { Bits { nominal: nominal + data, data: 0 } }
}

/// The DLC of an FD frame of `len` bytes.
const fn fd_length_code(len: usize) -> u32 {
    match len {
        0..=8 => len as u32,
        // 12, 16, 20 and 24 bytes have the codes 9 to 12; 32, 48 and 64 bytes the codes 13 to 15.
        9..=24 => 9 + (len as u32 - 12) / 4,
        _ => 12 + len as u32 / 16 - 1,
    }
}

/// The bits sent so far.
struct Line {
    /// Bits, stuff bits included.
    bits: u64,
    /// Bits of an FD frame up to BRS.
    head: u64,
    level: bool,
    /// The number of successive bits of this level, 0 before the first.
    run: u8,
    /// CRC-15 of the bits without stuff bits: x¹⁵ + x¹⁴ + x¹⁰ + x⁸ + x⁷ + x⁴ + x³ + 1, start 0.
    crc: u16,
    /// The bit that is not as sent.
    watched: Option<u64>,
    /// Level of the disturbed bit, and how many successive bits have this level.
    disturbed: Option<(Level, u8)>,
}

impl Line {
    /// The frame up to the end of its stuff bits: the CRC of a classical frame, the data of an FD frame.
    fn of(frame: &Frame, watched: Option<u64>) -> Line {
        // Before SOF the bus is idle, so recessive. The idle level counts in no run: stuffing begins with SOF.
        let mut line = Line { bits: 0, head: 0, level: true, run: 0, crc: 0, watched, disturbed: None };
        // SOF, a single dominant bit.
        line.put(0, 1);
        match frame.format() {
            FrameFormat::Classic => line.classical(frame, 0),
            FrameFormat::Remote => line.classical(frame, 1),
            FrameFormat::Fd { bit_rate_switch, error_state_indicator } => {
                line.identifier(frame.id(), 0);
                // IDE of an 11-bit identifier, FDF, res, BRS; a 29-bit identifier already has its IDE.
                match frame.id() {
                    Id::Standard(_) => line.put(0b0100 | u32::from(bit_rate_switch), 4),
                    Id::Extended(_) => line.put(0b100 | u32::from(bit_rate_switch), 3),
                }
                line.head = line.bits;
                line.put(u32::from(error_state_indicator), 1);
                line.put(fd_length_code(frame.len()), 4);
                frame.data().iter().for_each(|byte| line.put(u32::from(*byte), 8));
            }
        }
        // After the last data bit of an FD frame there is a fixed stuff bit, and no other.
        if line.run == 5 && !matches!(frame.format(), FrameFormat::Fd { .. }) {
            line.push(!line.level);
        }
        line
    }

    /// Appends the lowest `count` bits of `value`, the most significant first.
    fn put(&mut self, value: u32, count: u32) {
        for k in (0..count).rev() {
            let level = value >> k & 1 == 1;
            // The CRC covers the bits without stuff bits, so it takes each bit before stuffing.
            // The register has 15 bits; the one that leaves it decides, together with the new bit, whether the
            // polynomial is added.
            let feedback = level != (self.crc & 0x4000 != 0);
            self.crc = (self.crc << 1 & 0x7FFF) ^ if feedback { 0x4599 } else { 0 };
            if self.run == 5 {
                self.push(!self.level);
            }
            self.push(level);
        }
    }

    fn push(&mut self, level: bool) {
        let run = |level| if level == self.level { self.run + 1 } else { 1 };
        if self.watched == Some(self.bits) {
            // The disturbed bit has the other level: level and run are those of `!level`.
            self.disturbed = Some((if level { Level::Dominant } else { Level::Recessive }, run(!level)));
        }
        (self.level, self.run) = (level, run(level));
        self.bits += 1;
    }

    /// The identifier, and RTR or RRS.
    fn identifier(&mut self, id: Id, request: u32) {
        match id {
            Id::Standard(id) => self.put(u32::from(id), 11),
            Id::Extended(id) => {
                self.put(id >> 18, 11);
                // SRR and IDE are recessive, so a standard frame with the same first 11 bits wins the arbitration.
                self.put(0b11, 2);
                self.put(id, 18);
            }
        }
        self.put(request, 1);
    }

    fn classical(&mut self, frame: &Frame, request: u32) {
        self.identifier(frame.id(), request);
        // IDE and r0, or r1 and r0.
        self.put(0, 2);
        self.put(frame.len() as u32, 4);
        frame.data().iter().for_each(|byte| self.put(u32::from(*byte), 8));
        // The argument is taken before `put` changes the CRC. The CRC of a classical frame is stuffed like its data.
        self.put(u32::from(self.crc), 15);
    }
}

#[cfg(test)]
mod tests;
