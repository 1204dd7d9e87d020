//! How much of a bus the protocol takes.
//!
//! A classical data frame with an 11-bit identifier and n bytes has 44 + 8n bits and is followed by 3 bits of interframe
//! space (ISO 11898-1). The first 34 + 8n bits are stuffed: at most one bit is put in after the first five, and then one
//! after every four, ⌊(34 + 8n − 1)/4⌋ in all.

use crate::message::{Cycle, MessageKind};
use crate::network::Profile;

/// How many stuff bits to count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stuffing {
    /// None: the least that a frame can take.
    None,
    /// As many as a frame can have.
    Worst,
}

/// The bit times that a classical data frame with an 11-bit identifier and `len` bytes (0 to 8) takes.
pub const fn frame_bits(len: usize, stuffing: Stuffing) -> u64 {
    let data = 8 * len as u64;
    match stuffing {
        Stuffing::None => 47 + data,
        Stuffing::Worst => 47 + data + (33 + data) / 4,
    }
}

/// The bit times per second that a running network of the classic profile takes: at each sample a command of one kind and the three sensor
/// messages, and the heartbeats and hellos of both nodes.
///
/// Divided by the bit rate of the bus this is its load; above 0.7 single frames wait noticeably.
pub const fn bits_per_second(rate_hz: u16, stuffing: Stuffing) -> u64 {
    const SECOND_NS: u64 = 1_000_000_000;
    let mut bits = 0;
    let mut i = 0;
    while i < MessageKind::COUNT {
        let kind = MessageKind::ALL[i];
        let per_second = match (kind, kind.cycle()) {
            (MessageKind::Torque, _) | (_, Cycle::Event) => 0,
            (_, Cycle::Sample) => rate_hz as u64,
            (_, Cycle::Period { period_ns }) => SECOND_NS / period_ns,
        };
        if let Some(form) = kind.form(Profile::Classic) {
            bits += per_second * frame_bits(form.length, stuffing);
        }
        i += 1;
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_of_8_bytes_takes_111_to_135_bits_and_a_heartbeat_55_to_65() {
        let bits = |len| (frame_bits(len, Stuffing::None), frame_bits(len, Stuffing::Worst));
        assert_eq!((bits(8), bits(1), bits(0)), ((111, 135), (55, 65), (47, 55)));
    }

    #[test]
    fn a_sample_takes_four_frames() {
        let bits = |rate_hz| bits_per_second(rate_hz, Stuffing::None);
        assert_eq!(bits(2000) - bits(1000), 1000 * 4 * 111);
        assert_eq!(bits(1000), 1000 * 4 * 111 + 2 * 111 + 20 * 55);
    }
}
