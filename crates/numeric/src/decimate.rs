//! Keeps every n-th row of a series, filtered against aliases.
//!
//! A linear-phase FIR filter: the ideal low-pass under a Kaiser window (J. F. Kaiser, "Nonrecursive digital filter
//! design using the I0-sinh window function", Proc. IEEE Int. Symp. Circuits Syst. 1974). With n the decimation, f_s
//! the rate of the series and f_N = f_s/(2n) half the lower rate, it passes up to 0.8 f_N and stops from f_N on. For an
//! attenuation of A = 80 dB and a transition Δω = 2π·0.2 f_N/f_s = 0.2π/n,
//!
//! ```text
//! β = 0.1102 (A − 8.7) = 7.857,   taps − 1 ≥ (A − 7.95)/(2.285 Δω) = 50.2 n,   so 2h + 1 taps with h = 26 n
//! w_i = I0(β √(1 − (i/h)²)) · sinc(0.9 i/n),   i = −h … h,   divided by Σ w_i
//! ```
//!
//! Both bands ripple by 10^(−A/20) = 1e-4 of the amplitude at most. The taps are symmetric about the output row, so
//! nothing is delayed. The series is extended beyond its ends by its first and last row.

use alloc::collections::VecDeque;
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;
use core::f64::consts::PI;

use crate::registers::{Task, widest};

/// β of the Kaiser window for 80 dB.
const BETA: f64 = 0.1102 * (80.0 - 8.7);
/// Half the length of the filter, rows for each of the decimation.
const HALF_LENGTH: usize = 26;
/// The cut-off of the ideal low-pass, in f_N: in the middle of the transition.
const CUT_OFF: f64 = 0.9;

/// Describes the filter of a decimation in words.
pub fn describe(every: u64) -> String {
    match every {
        0 => String::from("none: nothing is repeated"),
        1 => String::from("none: every sample is repeated as it is"),
        every => format!(
            "linear-phase FIR, {} taps, Kaiser window: pass band to {:?} of the sample rate, stop band from {:?}, ripple 1e-4 \
             in both",
            2 * HALF_LENGTH * every as usize + 1,
            0.4 / every as f64,
            0.5 / every as f64
        ),
    }
}

/// Numbers of a row that are filtered at once: as many sums as hide the latency of an addition.
const LANES: usize = 8;

/// Takes rows of numbers, and returns every n-th row filtered.
#[derive(Clone, Debug)]
pub struct Decimator {
    every: u64,
    taps: Vec<f64>,
    /// The numbers of a row.
    width: usize,
    /// The rows under the filter, oldest first, in blocks of [`LANES`] numbers.
    windows: Vec<VecDeque<[f64; LANES]>>,
    /// The flags of each row.
    flags: VecDeque<u32>,
    /// The first row of the series and the one after its last.
    series: Option<(u64, u64)>,
}

/// A row that has passed the low-pass filter.
#[derive(Clone, Debug, PartialEq)]
pub struct Decimated {
    /// The index of the row that it replaces.
    pub index: u64,
    /// Its numbers, in the units of the series.
    pub values: Vec<f64>,
    /// The flags of all rows that contributed to it.
    pub flags: u32,
}

impl Decimator {
    /// Makes a decimator that returns the rows, of `width` numbers each, whose index is a multiple of `every`; none for
    /// 0, and for 1 all unchanged.
    pub fn new(every: u64, width: usize) -> Decimator {
        // A single tap of 1 for the two decimations without a filter, so that the windows need no special case.
        let taps = if every < 2 { vec![1.0] } else { taps(every) };
        let windows = vec![VecDeque::with_capacity(taps.len() + 1); width.div_ceil(LANES)];
        let flags = VecDeque::with_capacity(taps.len() + 1);
        Decimator { every, taps, width, windows, flags, series: None }
    }

    /// Takes the next row; a row that doesn't follow the last begins another series. Appends finished rows to `ready`.
    pub fn push(&mut self, index: u64, values: &[f64], flags: u32, ready: &mut Vec<Decimated>) {
        if self.every == 0 {
            return;
        }
        // A filter over a gap would mix rows from before and after it, so each side is a series of its own.
        if self.series.is_some_and(|(_, next)| next != index) {
            self.end(ready);
        }
        let first = match self.series {
            Some((first, _)) => first,
            None => {
                // The first row is taken to go on before the series, so the windows start full of it.
                (0..self.taps.len()).for_each(|_| self.take(values, flags));
                index
            }
        };
        self.series = Some((first, index.wrapping_add(1)));
        self.take(values, flags);
        self.give(index, ready);
    }

    /// Ends the series, and appends its remaining rows to `ready`.
    pub fn end(&mut self, ready: &mut Vec<Decimated>) {
        let (Some((_, next)), Some(last)) = (self.series, self.last()) else { return };
        // The last row is taken to go on behind the series, until the middle of the windows has passed over all of it.
        for index in 0..self.half_length() {
            self.take(&last.values, last.flags);
            self.give(next.wrapping_add(index), ready);
        }
        self.series = None;
    }

    /// Returns the newest row unchanged.
    fn last(&self) -> Option<Decimated> {
        let blocks = self.windows.iter().filter_map(VecDeque::back).flatten();
        let values = blocks.take(self.width).copied().collect();
        let flags = *self.flags.back()?;
        Some(Decimated { index: self.series?.1.wrapping_sub(1), values, flags })
    }

    /// Replaces the oldest row in the windows by a new one.
    fn take(&mut self, values: &[f64], flags: u32) {
        let is_full = self.flags.len() == self.taps.len();
        for (window, values) in self.windows.iter_mut().zip(values.chunks(LANES)) {
            // The last block of a row is filled up with zeros, so that the inner loop has a constant length and is
            // vectorised.
            let mut block = [0.0; LANES];
            block[..values.len()].copy_from_slice(values);
            window.push_back(block);
            is_full.then(|| window.pop_front());
        }
        self.flags.push_back(flags);
        is_full.then(|| self.flags.pop_front());
    }

    fn half_length(&self) -> u64 {
        (self.taps.len() / 2) as u64
    }

    /// Appends the row in the middle of the windows up to `newest`, if it is wanted.
    fn give(&self, newest: u64, ready: &mut Vec<Decimated>) {
        let middle = newest.wrapping_sub(self.half_length());
        // The differences wrap, since at first the middle lies before the series.
        let within = self.series.is_some_and(|(first, next)| middle.wrapping_sub(first) < next.wrapping_sub(first));
        if within && middle.is_multiple_of(self.every) {
            match self.taps.as_slice() {
                [_] => ready.extend(self.last()),
                taps => ready.push(self.filtered(taps, middle)),
            }
        }
    }

    fn filtered(&self, taps: &[f64], index: u64) -> Decimated {
        let mut values = Vec::with_capacity(self.windows.len() * LANES);
        for window in &self.windows {
            values.extend(widest(Weighted { taps, window }));
        }
        values.truncate(self.width);
        Decimated { index, values, flags: self.flags.iter().fold(0, |all, flags| all | flags) }
    }
}

/// The weighted sums of the rows of a window.
struct Weighted<'a> {
    taps: &'a [f64],
    window: &'a VecDeque<[f64; LANES]>,
}

impl Task for Weighted<'_> {
    type Output = [f64; LANES];

    #[inline(always)]
    fn run(self) -> [f64; LANES] {
        let mut sums = [0.0; LANES];
        let mut taps = self.taps.iter();
        // One iterator of taps runs over both halves of the ring: the second continues where the first ends.
        let (older, newer) = self.window.as_slices();
        for rows in [older, newer] {
            for (row, tap) in rows.iter().zip(&mut taps) {
                sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += tap * value);
            }
        }
        sums
    }
}

/// Returns the weights of the filter, oldest first; their sum is 1.
fn taps(every: u64) -> Vec<f64> {
    let half = HALF_LENGTH * every as usize;
    let weight = |place: usize| {
        let i = place.abs_diff(half) as f64;
        // Exactly 0 at both ends, since i is then `half` itself, so that the root below never sees a negative number.
        let inside = 1.0 - (i / half as f64) * (i / half as f64);
        bessel_i0(BETA * libm::sqrt(inside)) * sinc(CUT_OFF * i / every as f64)
    };
    let weights: Vec<f64> = (0..=2 * half).map(weight).collect();
    // Divided by their sum, so that the gain at 0 Hz is 1: the sum of a windowed sinc is only near to that of the ideal
    // filter.
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

/// Returns the normalised sinc function, sin(πx)/(πx).
fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { libm::sin(PI * x) / (PI * x) }
}

/// Returns the modified Bessel function of the first kind and order 0: Σ ((x/2)^k / k!)², to the last digit for the x
/// in use, below 8.
fn bessel_i0(x: f64) -> f64 {
    let mut sum = 1.0;
    let mut term = 1.0;
    // For x = 8 the last term is (4⁴⁰/40!)² = 2e-48, far below the last digit of the sum.
    for k in 1..=40 {
        term *= x / (2.0 * f64::from(k));
        sum += term * term;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns every 10th row of a sine of 1 at `frequency`, in parts of the rate.
    fn decimated(frequency: f64) -> Vec<f64> {
        let mut decimator = Decimator::new(10, 1);
        let mut ready = Vec::new();
        for index in 0..5000_u64 {
            decimator.push(index, &[libm::sin(2.0 * PI * frequency * index as f64)], 0, &mut ready);
        }
        decimator.end(&mut ready);
        assert!(ready.iter().map(|row| row.index).eq((0..5000).step_by(10)));
        ready.iter().map(|row| row.values[0]).collect()
    }

    #[test]
    fn passes_what_the_lower_rate_can_tell_and_stops_the_rest() {
        // Away from the ends, where the sine is taken to stand still.
        let inner = 26..500 - 26;
        // Steps of 1e-4 of the rate find the peaks of the ripple, which are some 1/521 apart with as many taps.
        for hundredth in 0..=400 {
            let frequency = f64::from(hundredth) * 1e-4; // to 0.04 = 0.8 · 0.5/10
            let values = decimated(frequency);
            for place in inner.clone() {
                let expected = libm::sin(2.0 * PI * frequency * (10 * place) as f64);
                assert!((values[place] - expected).abs() < 1.1e-4, "{frequency}: {} for {expected}", values[place]);
            }
        }
        for thousandth in 50..=500 {
            let frequency = f64::from(thousandth) * 1e-3; // from 0.5/10 to half the rate; 0.1015 would show as 0.0015
            let peak = decimated(frequency)[inner.clone()].iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
            assert!(peak < 1.1e-4, "{frequency}: {peak}");
        }
        let alias = decimated(0.1015)[inner].iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
        assert!(alias < 1.1e-4, "{alias}");
    }

    #[test]
    fn a_constant_stays_and_flags_reach_every_value_that_rests_on_them() {
        let mut decimator = Decimator::new(4, 2);
        let mut ready = Vec::new();
        for index in 1000..2000_u64 {
            decimator.push(index, &[3.0, -2.0], u32::from(index == 1500), &mut ready);
        }
        decimator.end(&mut ready);
        assert!(ready.iter().map(|row| row.index).eq((1000..2000).step_by(4)));
        for row in &ready {
            assert!((row.values[0] - 3.0).abs() < 1e-14 && (row.values[1] + 2.0).abs() < 1e-14);
            assert_eq!(row.flags == 1, row.index.abs_diff(1500) <= 26 * 4, "{row:?}");
        }
    }

    #[test]
    fn all_or_nothing_is_given_as_it_is() {
        for (every, count) in [(0, 0), (1, 100)] {
            let mut decimator = Decimator::new(every, 1);
            let mut ready = Vec::new();
            for index in (0..60_u64).chain(100..140) {
                decimator.push(index, &[if index == 3 { -0.0 } else { index as f64 }], 0, &mut ready);
            }
            decimator.end(&mut ready);
            assert_eq!(ready.len(), count);
            assert!(ready.iter().all(|row| row.values[0] == row.index as f64 || row.index == 3));
            assert!(ready.get(3).is_none_or(|row| row.values[0].to_bits() == (-0.0_f64).to_bits()));
        }
    }

    #[test]
    fn a_gap_ends_a_series() {
        let mut decimator = Decimator::new(10, 1);
        let mut ready = Vec::new();
        for index in (0..400_u64).chain(1_000..1_400) {
            decimator.push(index, &[if index < 400 { 1.0 } else { 5.0 }], 0, &mut ready);
        }
        decimator.end(&mut ready);
        assert!(ready.iter().map(|row| row.index).eq((0..400).step_by(10).chain((1_000..1_400).step_by(10))));
        assert!(ready.iter().all(|row| (row.values[0] - if row.index < 400 { 1.0 } else { 5.0 }).abs() < 1e-14));
    }
}
