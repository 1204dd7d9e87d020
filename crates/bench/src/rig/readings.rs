//! Readings of the sensors that the protocol does not carry.

use super::reading::{NATIVE_CHANNELS, Reading};

/// Largest number of channels of head and sensors together.
pub const MOST_CHANNELS: usize = 32;

/// Largest number of channels of the sensors other than head, B and C.
pub const MOST_MORE: usize = MOST_CHANNELS - NATIVE_CHANNELS;

/// Readings of sensors at a sample, in the order of their channels. The value has a fixed size, so that it
/// passes through ring buffers without an allocation. The names are in the plant's table
/// ([`Structure::outputs`](crate::structure::Structure::outputs)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings {
    values: [f64; MOST_MORE],
    /// Marks of clipped values: bit n belongs to value n.
    clipped: u32,
    count: u8,
}

impl Readings {
    /// No readings, for a rig with head, B and C only.
    pub const NONE: Readings = Readings { values: [0.0; MOST_MORE], clipped: 0, count: 0 };

    /// Returns readings with these values, clipped where their bit is set; `None` if there are more than
    /// [`MOST_MORE`], or a bit belongs to no value.
    pub fn new(values: &[f64], clipped: u32) -> Option<Readings> {
        let mut readings = Readings { clipped, count: values.len() as u8, ..Readings::NONE };
        readings.values.get_mut(..values.len())?.copy_from_slice(values);
        // A mark must belong to a value that is there.
        (u64::from(clipped) < 1 << values.len()).then_some(readings)
    }

    /// Appends a reading, if there is room.
    pub(super) fn push(&mut self, reading: Reading) {
        if let Some(value) = self.values.get_mut(usize::from(self.count)) {
            *value = reading.value;
            self.clipped |= u32::from(reading.clipped) << self.count;
            self.count += 1;
        }
    }

    /// Returns the values, in the unit of each channel.
    pub fn values(&self) -> &[f64] {
        &self.values[..usize::from(self.count)]
    }

    /// Returns which values were clipped: bit n belongs to value n.
    pub fn clipped(&self) -> u32 {
        self.clipped
    }

    /// Returns the reading at an index; `None` beyond the last one.
    pub fn get(&self, index: usize) -> Option<Reading> {
        let value = *self.values().get(index)?;
        Some(Reading { value, clipped: self.clipped >> index & 1 == 1 })
    }

    /// Returns all readings in order.
    pub fn iter(&self) -> impl Iterator<Item = Reading> + '_ {
        (0..self.values().len()).filter_map(|index| self.get(index))
    }
}

impl Default for Readings {
    fn default() -> Readings {
        Readings::NONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_at_most_what_a_rig_has() {
        let readings = Readings::new(&[1.0, 2.0], 0b10).unwrap();
        assert_eq!(readings.get(1), Some(Reading { value: 2.0, clipped: true }));
        assert_eq!((readings.get(0).map(|reading| reading.clipped), readings.get(2)), (Some(false), None));
        assert_eq!([Readings::new(&[1.0], 0b10), Readings::new(&[0.0; MOST_MORE + 1], 0)], [None; 2]);
        let mut all = Readings::NONE;
        (0..40).for_each(|_| all.push(Reading { value: 1.0, clipped: true }));
        assert_eq!((all.values().len(), all.clipped().count_ones() as usize), (MOST_MORE, MOST_MORE));
        assert_eq!(Readings::new(all.values(), all.clipped()), Some(all));
    }
}
