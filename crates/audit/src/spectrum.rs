//! Statistics of segments of a random record: whether its lines scatter as they must, and whether a drive repeats itself.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;
use resonarm_numeric::dft::Lines;

/// Segments of `length` samples under Hann's window, transformed at every second line of a band: adjacent lines are
/// correlated.
#[derive(Clone, Debug)]
pub(crate) struct Segments {
    lines: Vec<Vec<Complex<f64>>>,
}

impl Segments {
    /// Transforms the segments of `length` samples, each `hop` behind the one before, at the lines from `first` to `last`.
    pub fn new(samples: &[f64], length: usize, hop: usize, [first, last]: [usize; 2]) -> Segments {
        let transform = Lines::new(length, length, first, (last + 1).saturating_sub(first));
        let window: Vec<f64> = (0..length).map(|k| 0.5 - 0.5 * libm::cos(TAU * k as f64 / length as f64)).collect();
        let segment = |start: usize| {
            let windowed = samples[start..start + length].iter().zip(&window);
            let lines = transform.transform(windowed.map(|(sample, window)| Complex::new(sample * window, 0.0)));
            lines.into_iter().step_by(2).collect()
        };
        let count = if samples.len() < length { 0 } else { (samples.len() - length) / hop.max(1) + 1 };
        Segments { lines: (0..count).map(|index| segment(index * hop)).collect() }
    }

    pub fn count(&self) -> usize {
        self.lines.len()
    }

    /// Returns the mean squares of the lines over all segments.
    pub fn powers(&self) -> Vec<f64> {
        let lines = self.lines.first().map_or(0, Vec::len);
        let mean = |line: usize| self.lines.iter().map(|segment| segment[line].norm_sqr()).sum::<f64>();
        (0..lines).map(|line| mean(line) / self.count() as f64).collect()
    }

    /// Returns the variance of the densities of all segments and lines, each over the mean of its line, over that of χ² with
    /// 2 degrees of freedom.
    ///
    /// The ratios of K exponential values to their mean have the variance (K − 1)/(K + 1).
    pub fn variance(&self) -> f64 {
        let count = self.count() as f64;
        let lines = self.lines.first().map_or(0, Vec::len);
        let mut squares = 0.0;
        let mut values = 0.0;
        for line in 0..lines {
            let powers = || self.lines.iter().map(|segment| segment[line].norm_sqr());
            let mean = powers().sum::<f64>() / count;
            for power in powers() {
                let deviation = power / mean - 1.0;
                squares += deviation * deviation;
                values += 1.0;
            }
        }
        // The mean of the ratios is 1 at every line.
        squares / (values - 1.0) * (count + 1.0) / (count - 1.0)
    }

    /// Returns how well the drive matches an earlier one, over all distances of segments up to `most`.
    ///
    /// Of phases that are drawn anew, the mean of e^(i(φ(t + s) − φ(t))) over m pairs of segments has the mean size
    /// 0.886/√m (Rayleigh); the match is the mean size over the lines in that measure, about 1 for new phases, and √m/0.886 for
    /// repeated ones.
    pub fn largest_match(&self, most: usize) -> f64 {
        const RAYLEIGH: f64 = 0.886_226_925_452_758;
        let lines = self.lines.first().map_or(0, Vec::len);
        let turn = |value: Complex<f64>| value / libm::hypot(value.re, value.im).max(f64::MIN_POSITIVE);
        let turns: Vec<Vec<Complex<f64>>> =
            self.lines.iter().map(|segment| segment.iter().map(|value| turn(*value)).collect()).collect();
        let of_distance = |distance: usize| {
            let pairs = (turns.len() - distance) as f64;
            let size = |line: usize| {
                let products =
                    turns.iter().zip(&turns[distance..]).map(|(early, late)| late[line] * early[line].conj());
                let sum: Complex<f64> = products.sum();
                libm::hypot(sum.re, sum.im) / pairs
            };
            (0..lines).map(size).sum::<f64>() / lines as f64 * libm::sqrt(pairs) / RAYLEIGH
        };
        // Up to half of the segments, so that the mean at a distance d is over at least d pairs.
        (1..most.min(turns.len() / 2)).map(of_distance).fold(0.0, f64::max)
    }
}
