//! The states of a structure at a sample, as one value of fixed size.

use core::ops::Deref;

/// The most coordinates of a structure: modes, or joints.
pub const MOST_COORDINATES: usize = 32;
/// The most elements, each with at most one state and a branch.
pub const MOST_ELEMENTS: usize = 16;
/// The most states of a structure: coordinates, their rates, the current of a coil, states and branches of elements.
pub const MOST_STATES: usize = 2 * MOST_COORDINATES + 1 + 2 * MOST_ELEMENTS;

/// The states of a structure at a sample, in the order of its channels: coordinates, their rates, and what belongs to
/// devices and elements. A value without allocation, which passes through rings.
#[derive(Clone, Copy)]
pub struct States {
    numbers: [f64; MOST_STATES],
    /// How many are coordinates and rates.
    moving: usize,
    count: usize,
}

impl States {
    /// No states, of a plant that only reads.
    pub const NONE: States = States { numbers: [0.0; MOST_STATES], moving: 0, count: 0 };

    /// The states of which the first `moving` of `count` are coordinates and rates, as `write` writes them; at most
    /// [`MOST_STATES`].
    #[inline]
    pub fn written(moving: usize, count: usize, write: impl FnOnce(&mut [f64])) -> States {
        let count = count.min(MOST_STATES);
        let mut states = States { numbers: [0.0; MOST_STATES], moving: moving.min(count), count };
        write(&mut states.numbers[..count]);
        states
    }

    /// The numbers, to be overwritten.
    pub(crate) fn numbers_mut(&mut self) -> &mut [f64] {
        &mut self.numbers[..self.count]
    }

    /// Coordinates and rates, and states of devices and elements; `None` if there are more than [`MOST_STATES`].
    pub fn new(moving: &[f64], internal: &[f64]) -> Option<States> {
        let count = moving.len() + internal.len();
        (count <= MOST_STATES).then(|| {
            States::written(moving.len(), count, |numbers| {
                numbers.iter_mut().zip(moving.iter().chain(internal)).for_each(|(to, number)| *to = *number);
            })
        })
    }

    /// The coordinates, and behind them their rates.
    #[inline]
    pub fn moving(&self) -> &[f64] {
        &self.numbers[..self.moving]
    }

    /// The coordinates: angles, rad, or modal coordinates, m·√kg.
    #[inline]
    pub fn coordinates(&self) -> &[f64] {
        &self.numbers[..self.moving / 2]
    }

    /// The rates of the coordinates, in their units a second.
    #[inline]
    pub fn rates(&self) -> &[f64] {
        &self.numbers[self.moving / 2..self.moving]
    }

    /// What belongs to devices and elements.
    #[inline]
    pub fn internal(&self) -> &[f64] {
        &self.numbers[self.moving..self.count]
    }
}

impl Default for States {
    fn default() -> States {
        States::NONE
    }
}

impl Deref for States {
    type Target = [f64];

    #[inline]
    fn deref(&self) -> &[f64] {
        &self.numbers[..self.count]
    }
}

impl PartialEq for States {
    fn eq(&self, other: &States) -> bool {
        self.moving == other.moving && **self == **other
    }
}

impl core::fmt::Debug for States {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_rates_and_internal_states_are_apart() {
        let states = States::new(&[1.0, 2.0, 3.0, 4.0], &[5.0]).unwrap();
        assert_eq!(
            (states.coordinates(), states.rates(), states.internal()),
            (&[1.0, 2.0][..], &[3.0, 4.0][..], &[5.0][..])
        );
        assert_ne!(Some(states), States::new(&[1.0, 2.0, 3.0, 4.0], &[]));
        assert_eq!(States::new(&[0.0; MOST_STATES], &[1.0]), None);
    }
}
