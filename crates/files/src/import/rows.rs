//! Gathers the numbers of samples from several messages.

use std::collections::BTreeMap;

/// The numbers of a sample, as far as they have arrived.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Row {
    /// The numbers; those that did not arrive are not used.
    pub values: Vec<f64>,
    /// One bit for each number: whether it is beyond the range of its sensor.
    pub clipped: u32,
    came: u64,
}

/// Gathers the numbers of samples, and returns the complete ones, in order.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    /// Number of values in a sample.
    width: usize,
    /// One bit for each message.
    needed: u64,
    hold: u64,
    waiting: BTreeMap<u64, Row>,
    newest: u64,
    next: Option<u64>,
    /// Samples of which only a part arrived.
    pub incomplete: u64,
    /// Frames of samples that were given up before, or of a message that had already arrived for the sample.
    pub too_late: u64,
}

impl Rows {
    /// Makes rows of `width` numbers. `needed` has one bit for each message; a sample waits for missing messages until
    /// one is `hold` samples newer.
    pub fn new(width: usize, needed: u64, hold: u64) -> Rows {
        Rows { width, needed, hold, waiting: BTreeMap::new(), newest: 0, next: None, incomplete: 0, too_late: 0 }
    }

    /// Says whether the message of this number is needed.
    pub const fn needs(&self, message: u32) -> bool {
        self.needed >> message & 1 == 1
    }

    /// Processes the data of a message for a sample.
    pub fn add(&mut self, sample: u64, message: u32, write: impl FnOnce(&mut Row)) {
        let is_past = self.next.is_some_and(|next| sample < next);
        let empty = || Row { values: vec![0.0; self.width], clipped: 0, came: 0 };
        let row = (!is_past).then(|| self.waiting.entry(sample).or_insert_with(empty));
        // Of two frames of one message for the same sample the first counts.
        match row.filter(|row| row.came >> message & 1 == 0) {
            Some(row) => {
                row.came |= 1 << message;
                write(row);
            }
            None => self.too_late += 1,
        }
        self.newest = self.newest.max(sample);
    }

    /// Returns the next complete sample, if there is one and no older one can become complete; `is_end` after the last
    /// frame.
    pub fn next(&mut self, is_end: bool) -> Option<(u64, Row)> {
        // At the end nothing more can arrive, so that incomplete samples need not be waited for.
        let hold = if is_end { 0 } else { self.hold };
        loop {
            let (&sample, row) = self.waiting.first_key_value()?;
            let is_whole = row.came == self.needed;
            // What is held from a sample on is known when the next begins.
            let is_due = self.next == Some(sample) && is_whole && sample < self.newest;
            if !is_due && hold > 0 && self.newest - sample <= hold {
                return None;
            }
            let (_, row) = self.waiting.pop_first()?;
            self.next = Some(sample + 1);
            if is_whole {
                return Some((sample, row));
            }
            self.incomplete += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_samples_come_in_order_and_others_are_counted() {
        let mut rows = Rows::new(2, 0b11, 2);
        let add = |rows: &mut Rows, sample, message: u32| {
            rows.add(sample, message, |row| row.values[message as usize] = sample as f64);
        };
        for (sample, message) in [(1, 0), (1, 1), (0, 1), (0, 0), (2, 0), (3, 0), (3, 1)] {
            add(&mut rows, sample, message);
        }
        // Older ones may still come.
        assert_eq!(rows.next(false).map(|(sample, _)| sample), Some(0));
        assert_eq!(rows.next(false).map(|(sample, row)| (sample, row.values)), Some((1, vec![1.0, 1.0])));
        assert_eq!(rows.next(false), None);
        add(&mut rows, 5, 1);
        assert_eq!(rows.next(false).map(|(sample, _)| sample), Some(3));
        add(&mut rows, 2, 1);
        add(&mut rows, 5, 1);
        assert_eq!((rows.next(false), rows.next(true)), (None, None));
        assert_eq!((rows.incomplete, rows.too_late), (2, 2));
    }
}
