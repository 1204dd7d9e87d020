//! Samples thinned out for the screen: the least and the largest of each number over a stretch of samples, so that no
//! peak is lost at any width of the screen.

use super::rows::{Numbers, Row};

/// A stretch of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// Index of its first sample.
    pub first: u64,
    /// The least of each number; NaN if none is known.
    pub least: Numbers,
    /// The largest of each number; NaN if none is known.
    pub largest: Numbers,
    /// Readings clipped in any of its samples.
    pub clipped: u32,
}

/// Collects samples into stretches.
#[derive(Debug)]
pub struct Extremes {
    /// Samples in a stretch.
    pub width: u64,
    stretch: Option<Stretch>,
}

impl Extremes {
    /// Stretches of `width` samples, at least 1, that begin at multiples of it.
    pub fn new(width: u64) -> Extremes {
        Extremes { width: width.max(1), stretch: None }
    }

    /// Takes a sample; returns the previous stretch if it begins a new one.
    pub fn push(&mut self, sample: u64, row: &Row) -> Option<Stretch> {
        // Multiples of the width, so that stretches have the same places after a gap.
        let first = sample - sample % self.width;
        match &mut self.stretch {
            Some(stretch) if stretch.first == first => {
                // `f32::min` and `max` ignore NaN.
                for (place, value) in row.numbers.iter().enumerate() {
                    stretch.least[place] = stretch.least[place].min(*value);
                    stretch.largest[place] = stretch.largest[place].max(*value);
                }
                // A stretch is marked if any of its samples is clipped, as its extremes are then not those of the
                // motion.
                stretch.clipped |= row.clipped;
                None
            }
            stretch => {
                let Row { numbers, clipped } = row.clone();
                stretch.replace(Stretch { first, least: numbers.clone(), largest: numbers, clipped })
            }
        }
    }

    /// Drops the samples collected so far.
    pub fn restart(&mut self) {
        self.stretch = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_peak_is_lost() {
        let mut extremes = Extremes::new(10);
        let row = |value: f32| Row { numbers: [value; 12].into(), clipped: 0 };
        let mut stretches = Vec::new();
        for sample in 3..45_u64 {
            // One sample of 42 is a peak, and the stretch around it must have it.
            let value = if sample == 27 { 9.0 } else { -(sample as f32) };
            stretches.extend(extremes.push(sample, &row(value)));
        }
        let found: Vec<_> = stretches.iter().map(|it| (it.first, it.least[0], it.largest[11])).collect();
        assert_eq!(found, [(0, -9.0, -3.0), (10, -19.0, -10.0), (20, -29.0, 9.0), (30, -39.0, -30.0)]);
        extremes.restart();
        assert_eq!(extremes.push(40, &row(f32::NAN)), None);
        assert_eq!(extremes.push(41, &row(1.0)), None);
        let stretch = extremes.push(50, &row(0.0)).unwrap();
        assert_eq!((stretch.least[3], stretch.largest[3]), (1.0, 1.0), "unknown numbers are left out");
    }

    #[test]
    fn a_stretch_names_the_readings_clipped_in_any_of_its_samples() {
        let mut extremes = Extremes::new(3);
        let clipped = [0, 0b1000, 0b1, 0, 0, 0, 0];
        let rows = clipped.map(|clipped| Row { clipped, ..Row::unknown(12) });
        let stretches = rows.iter().zip(0..).filter_map(|(row, sample)| extremes.push(sample, row));
        let marked: Vec<u32> = stretches.map(|stretch| stretch.clipped).collect();
        assert_eq!(marked, [0b1001, 0]);
    }
}
