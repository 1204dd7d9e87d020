//! The order of sample indices: the window of the specification.

use crate::timing;

/// The place of a sample's index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// The first since arming.
    First,
    /// A new one, this many after the last.
    Ahead(u16),
    /// Repeated or older: to be ignored.
    Stale,
    /// Outside the window, or one stale sample too many: another plant, or the plant has restarted.
    Broken,
}

/// Tracks the indices of samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sequence {
    window: u16,
    last: Option<u16>,
    stale: u64,
}

impl Sequence {
    /// No index yet, at `rate_hz` samples a second.
    pub fn new(rate_hz: u16) -> Sequence {
        Sequence { window: timing::sample_window(rate_hz), last: None, stale: 0 }
    }

    /// Judges an index; a new one becomes the last one.
    ///
    /// With d = (index − last) mod 2¹⁶ and the window w < 2¹⁵: ahead for 1 ≤ d ≤ w, stale for d = 0 or d ≥ 2¹⁶ − w.
    pub fn judge(&mut self, index: u16) -> Place {
        let Some(last) = self.last else {
            self.last = Some(index);
            return Place::First;
        };
        // Indices are compared by their difference modulo 2¹⁶. The window is below 2¹⁵, so an index can't be
        // both ahead and stale.
        let ahead = index.wrapping_sub(last);
        if (1..=self.window).contains(&ahead) {
            self.last = Some(index);
            Place::Ahead(ahead)
        } else if last.wrapping_sub(index) <= self.window {
            // An older index does not become the last one, so a delayed frame can't move the window back.
            self.stale += 1;
            if self.stale < timing::STALE_SAMPLES_LIMIT { Place::Stale } else { Place::Broken }
        } else {
            Place::Broken
        }
    }

    /// Indices that were repeated or older.
    pub fn stale(&self) -> u64 {
        self.stale
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_window_has_both_ends() {
        let place = |index: u16| {
            let mut sequence = Sequence::new(1000);
            assert_eq!(sequence.judge(100), Place::First);
            sequence.judge(index)
        };
        // At 1 kHz the window is 350 samples: 350 ms, the timeout of the partner.
        assert_eq!((place(101), place(450)), (Place::Ahead(1), Place::Ahead(350)));
        assert_eq!((place(451), place(40_000)), (Place::Broken, Place::Broken));
        assert_eq!((place(100), place(99), place(65_286)), (Place::Stale, Place::Stale, Place::Stale));
        assert_eq!(place(65_285), Place::Broken);
    }

    #[test]
    fn the_tenth_stale_sample_is_one_too_many() {
        let mut sequence = Sequence::new(1000);
        sequence.judge(7);
        let places: std::vec::Vec<_> = (0..10).map(|_| sequence.judge(7)).collect();
        assert!(places[..9].iter().all(|place| *place == Place::Stale));
        assert_eq!((places[9], sequence.stale(), sequence.last), (Place::Broken, 10, Some(7)));
    }

    proptest! {
        /// At every rate and from every index, new indices are never far, and a gapless plant is never out of sequence.
        #[test]
        fn every_index_has_one_place(rate_hz in 1_u16.., last: u16, index: u16) {
            let mut sequence = Sequence::new(rate_hz);
            sequence.judge(last);
            match sequence.judge(index) {
                Place::First => prop_assert!(false, "the second is not the first"),
                Place::Ahead(n) => prop_assert_eq!((last.wrapping_add(n), n > 0), (index, true)),
                Place::Stale | Place::Broken => prop_assert_ne!(index, last.wrapping_add(1)),
            }
        }
    }
}
