//! What the instruments read at a sample.

use super::reading::{NATIVE_CHANNELS, Reading};
use super::readings::Readings;

/// Readings of one sample, along x and y of the base frame. They belong to the motion in the middle of an
/// earlier hold ([`Converter::delay_samples`](super::converter::Converter::delay_samples)).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measurement {
    /// Index of the sample.
    pub sample: u64,
    /// Force in the impedance head, N.
    pub head_force_n: [Reading; 2],
    /// Acceleration of B, m/s².
    pub acceleration_b_m_s2: [Reading; 2],
    /// Acceleration of C, m/s².
    pub acceleration_c_m_s2: [Reading; 2],
    /// Readings of the other sensors, which the protocol does not carry.
    pub more: Readings,
}

impl Measurement {
    /// Number of readings of head, B and C.
    pub const CHANNELS: usize = NATIVE_CHANNELS;

    /// Returns the readings of head, B and C: head x, y; B x, y; C x, y.
    pub fn readings(&self) -> [Reading; Measurement::CHANNELS] {
        let [hx, hy] = self.head_force_n;
        let [bx, by] = self.acceleration_b_m_s2;
        let [cx, cy] = self.acceleration_c_m_s2;
        [hx, hy, bx, by, cx, cy]
    }

    /// Returns the reading at this index among the outputs of the plant's structure; those of head, B and C
    /// come first.
    pub fn reading(&self, place: usize) -> Option<Reading> {
        match place.checked_sub(Measurement::CHANNELS) {
            Some(more) => self.more.get(more),
            None => self.readings().get(place).copied(),
        }
    }
}
