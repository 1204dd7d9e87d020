//! Sampling by the instruments' converters: instant, gain, and leakage of the force's steps.
//!
//! A held command is a staircase, which has images of every frequency f beside all multiples of the sample rate. A
//! coil, a suspension and the arm change them, and an instantaneous reading adds them to f. A converter with a sinc
//! filter of order N reads at t_n = nT
//!
//! ```text
//! y_n = ∫₀ᴺ M_N(u) x(t_n − uT) du        M_N = M_1 * M_{N−1},   M_1 = 1 on [0, 1)
//! ```
//!
//! which is N moving means, each over one sample period T, one after the other (a filter of CIC type: E. B. Hogenauer,
//! "An Economical Class of Digital Filters for Decimation and Interpolation", 1981); M_N is the cardinal B-spline (I.
//! J. Schoenberg, "Contributions to the Problem of Approximation of Equidistant Data by Analytic Functions", 1946). Its
//! gain is (sin πfT/(πfT))ᴺ, with N-fold zeros at all multiples of the rate, and its delay is NT/2 at every frequency.
//! They are the same for all channels, so that ratios are exact. N is odd, so that a reading belongs to the middle of a
//! hold.

use core::f64::consts::PI;

use serde::{Deserialize, Serialize};

/// Largest order N of a converter.
pub const MOST_ORDER: usize = 5;

/// Sampling of the converters of all instruments.
///
/// | | delay, samples | gain at 0.05, 0.1 of the rate | attenuation at 0.5, 0.6, 0.8, 0.95 of the rate |
/// | --- | ---: | ---: | ---: |
/// | `instant` | 0.5 | 1, 1 | none |
/// | `sinc1` | 0.5 | 0.996, 0.984 | 3.9, 5.9, 12.6, 25.6 dB |
/// | `sinc3` | 1.5 | 0.988, 0.952 | 11.8, 17.8, 37.9, 76.8 dB |
/// | `sinc5` | 2.5 | 0.980, 0.921 | 19.6, 29.7, 63.1, 128.1 dB |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Converter {
    /// Reads the instant in the middle of the hold, without a filter: components above half the sample rate are
    /// aliased.
    Instant,
    /// Sinc filter of order 1: the mean over the hold.
    Sinc1,
    /// Sinc filter of order 3.
    Sinc3,
    /// Sinc filter of order 5, as in the fast path of sigma-delta converters.
    #[default]
    Sinc5,
    /// Unknown, as that of a plant that is not simulated here: readings are taken as they are, and nothing in
    /// them is corrected. No scenario and no recording states it.
    #[serde(skip)]
    Unknown,
}

impl Converter {
    /// All converters that a scenario can state.
    pub const ALL: [Converter; 4] = [Converter::Instant, Converter::Sinc1, Converter::Sinc3, Converter::Sinc5];

    /// Returns the name in a scenario.
    pub const fn name(self) -> &'static str {
        match self {
            Converter::Instant => "instant",
            Converter::Sinc1 => "sinc1",
            Converter::Sinc3 => "sinc3",
            Converter::Sinc5 => "sinc5",
            Converter::Unknown => "unknown",
        }
    }

    /// Returns the order N of the filter; 0 without one.
    pub const fn order(self) -> usize {
        match self {
            Converter::Instant | Converter::Unknown => 0,
            Converter::Sinc1 => 1,
            Converter::Sinc3 => 3,
            Converter::Sinc5 => MOST_ORDER,
        }
    }

    /// Returns the delay of the filter, sample periods from the moment that a reading belongs to, to its
    /// sample.
    pub const fn delay_samples(self) -> f64 {
        0.5 + self.holds_late() as f64
    }

    /// Returns the number of holds by which a reading lags the middle of the hold that ends with its sample:
    /// the reading of sample n belongs to the middle of the hold that began with sample n − 1 − this.
    pub const fn holds_late(self) -> usize {
        self.order().saturating_sub(1) / 2
    }

    /// Returns the gain at a frequency in cycles per sample: the amplitude of a reading over that of a
    /// continuous sine.
    pub fn gain(self, cycles: f64) -> f64 {
        (0..self.order()).fold(1.0, |gain, _| gain * sinc(cycles))
    }

    /// Returns the part of the readings of a staircase of held values beyond its fundamental, over the
    /// amplitude of the held values, after readings are divided by [`Converter::gain`]: the images aliased onto
    /// a frequency of `cycles` cycles per sample. It is in phase with the fundamental.
    ///
    /// The readings of a staircase are Σ_j w_j c_{n−1−j} with w_j the integral of the spline's piece j: of c e^{iωTn}
    /// they are W = Σ_j w_j cos 2πf(j − (N−1)/2)T times the value held in the middle. The fundamental is sin πfT/(πfT)
    /// of it. Instants read the held value: W = 1. Of an unknown converter no images are assumed.
    pub fn images(self, cycles: f64) -> f64 {
        let middle = self.holds_late() as f64;
        let turn = |piece: usize| libm::cos(2.0 * PI * cycles * (piece as f64 - middle));
        let read = match self {
            // Correcting for images that may not be there would falsify readings of a third-party plant.
            Converter::Unknown => return 0.0,
            Converter::Instant => 1.0,
            _ => (0..self.order()).map(|piece| self.piece_integral(piece) * turn(piece)).sum(),
        };
        read / self.gain(cycles) - sinc(cycles)
    }

    /// Returns M_N in the hold that ended `piece` holds before the last one, as a Taylor polynomial in y = x −
    /// `at`, with x from 0 at its start to 1 at its end:
    ///
    /// M_N(p + x) = 1/(N−1)! Σ_{k ≤ p} (−1)ᵏ C(N, k) (p − k + x)^{N−1},   p = N − 1 − `piece`.
    pub fn piece(self, piece: usize, at: f64) -> [f64; MOST_ORDER] {
        let order = self.order();
        let degree = order.saturating_sub(1);
        let mut taylor = [0.0; MOST_ORDER];
        let Some(p) = degree.checked_sub(piece).filter(|_| order > 0) else { return taylor };
        // Orders up to 5 only, so plain products are exact in f64.
        let factorial = (1..=degree).map(|k| k as f64).product::<f64>();
        for (power, coefficient) in taylor.iter_mut().enumerate().take(order) {
            let term = |k: usize| {
                let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
                sign * binomial(order, k) * whole_power((p - k) as f64 + at, degree - power)
            };
            *coefficient = binomial(degree, power) * (0..=p).map(term).sum::<f64>() / factorial;
        }
        taylor
    }

    /// Returns the integral of a piece over its hold.
    pub fn piece_integral(self, piece: usize) -> f64 {
        self.piece(piece, 0.0).iter().enumerate().map(|(power, c)| c / (power + 1) as f64).sum()
    }
}

/// Sample rate and converters, which is all that a controller knows of its readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Sample rate of the instruments, Hz.
    pub rate_hz: f64,
    /// Converters of the instruments.
    pub converter: Converter,
}

impl Sampling {
    /// Returns [`Converter::gain`] at a frequency, Hz.
    pub fn gain(&self, frequency_hz: f64) -> f64 {
        self.converter.gain(frequency_hz / self.rate_hz)
    }

    /// Returns [`Converter::images`] at a frequency, Hz.
    pub fn images(&self, frequency_hz: f64) -> f64 {
        self.converter.images(frequency_hz / self.rate_hz)
    }

    /// Returns the fundamental of a sine that is held from sample to sample, over the amplitude of its samples:
    /// sin y/y with y = πfT.
    pub fn hold(&self, frequency_hz: f64) -> f64 {
        sinc(frequency_hz / self.rate_hz)
    }
}

/// Returns sin πx/(πx), and 1 at x = 0.
fn sinc(cycles: f64) -> f64 {
    let x = PI * cycles;
    if x == 0.0 { 1.0 } else { libm::sin(x) / x }
}

fn binomial(n: usize, k: usize) -> f64 {
    (0..k).fold(1.0, |product, i| product * (n - i) as f64 / (i + 1) as f64)
}

fn whole_power(x: f64, power: usize) -> f64 {
    (0..power).fold(1.0, |product, _| product * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// M_N at the age u by N-fold moving means on a fine grid, independent of the formula.
    fn spline_by_means(order: usize, age: f64) -> f64 {
        const FINE: usize = 2000;
        let mut values = vec![1.0; FINE];
        for _ in 1..order {
            let padded: Vec<f64> = core::iter::repeat_n(0.0, FINE).chain(values.iter().copied()).collect();
            let length = values.len() + FINE;
            values = (0..length).map(|i| padded.iter().skip(i).take(FINE).sum::<f64>() / FINE as f64).collect();
        }
        values[(age * FINE as f64) as usize]
    }

    #[test]
    fn pieces_are_those_of_repeated_means() {
        for converter in [Converter::Sinc1, Converter::Sinc3] {
            for piece in 0..converter.order() {
                for at in [0.1, 0.5, 0.9] {
                    let age = piece as f64 + 1.0 - at;
                    let expected = spline_by_means(converter.order(), age);
                    assert!((converter.piece(piece, at)[0] - expected).abs() < 2e-3, "{converter:?} {piece} {at}");
                }
            }
        }
        // Quartic, by its known values at the knots, 1/24, 11/24, 11/24, 1/24, and its integrals, n/120.
        let knots = [1.0, 11.0, 11.0, 1.0, 0.0].map(|n| n / 24.0);
        for (piece, knot) in knots.into_iter().enumerate() {
            assert!((Converter::Sinc5.piece(piece, 0.0)[0] - knot).abs() < 1e-14);
            let integral = [1.0, 26.0, 66.0, 26.0, 1.0][piece] / 120.0;
            assert!((Converter::Sinc5.piece_integral(piece) - integral).abs() < 1e-14);
        }
    }

    /// Gain and delay of the weights, by quadrature over a sine.
    #[test]
    fn gain_and_delay_are_those_of_the_weights() {
        for converter in [Converter::Sinc1, Converter::Sinc3, Converter::Sinc5] {
            for cycles in [0.022, 0.1, 0.37, 0.6, 1.45] {
                let mut re = 0.0;
                let mut im = 0.0;
                let n = 4000;
                for piece in 0..converter.order() {
                    for i in 0..n {
                        let x = (f64::from(i) + 0.5) / f64::from(n);
                        let age = piece as f64 + 1.0 - x;
                        let weight = converter.piece(piece, x)[0] / f64::from(n);
                        let phase = 2.0 * PI * cycles * (converter.delay_samples() - age);
                        re += weight * libm::cos(phase);
                        im += weight * libm::sin(phase);
                    }
                }
                let gain = converter.gain(cycles);
                assert!((re - gain).abs() < 1e-6 && im.abs() < 1e-12, "{converter:?} {cycles}: {re} {im} {gain}");
            }
        }
    }

    /// The image of f at f + m has sin π(f+m)/(π(f+m)) of the held amplitude, with the same sign in the middle of every
    /// hold, and goes through the filter's gain there.
    #[test]
    fn images_are_the_sum_of_those_that_are_folded() {
        for converter in [Converter::Sinc1, Converter::Sinc3, Converter::Sinc5] {
            for cycles in [0.022, 0.059, 0.2] {
                let image = |m: i32| sinc(cycles + f64::from(m)) * converter.gain(cycles + f64::from(m));
                let folded: f64 = (1..4000).map(|m| image(m) + image(-m)).sum();
                let expected = folded / converter.gain(cycles);
                let seen = converter.images(cycles);
                // At order 1 the images beyond the 4000th add up to 2/4000 of the first.
                assert!((seen - expected).abs() < 3e-4 * expected + 1e-15, "{converter:?} {cycles}: {seen} {expected}");
            }
        }
        assert_eq!(Converter::Instant.images(0.0), 0.0);
        assert_eq!([Converter::Unknown.images(0.3), Converter::Unknown.gain(0.3) - 1.0], [0.0; 2]);
        assert!((Converter::Instant.images(0.022) - (1.0 - sinc(0.022))).abs() < 1e-15);
    }

    #[test]
    fn the_stated_figures_are_those_of_the_filters() {
        let db = |converter: Converter, cycles| -20.0 * libm::log10(converter.gain(cycles).abs());
        let stated: [(Converter, [f64; 2], [f64; 4]); 3] = [
            (Converter::Sinc1, [0.996, 0.984], [3.9, 5.9, 12.6, 25.6]),
            (Converter::Sinc3, [0.988, 0.952], [11.8, 17.8, 37.9, 76.8]),
            (Converter::Sinc5, [0.980, 0.921], [19.6, 29.7, 63.1, 128.1]),
        ];
        for (converter, gains, attenuations) in stated {
            for (cycles, gain) in [0.05, 0.1].into_iter().zip(gains) {
                assert!((converter.gain(cycles) - gain).abs() < 6e-4, "{converter:?} {cycles}");
            }
            for (cycles, attenuation) in [0.5, 0.6, 0.8, 0.95].into_iter().zip(attenuations) {
                let seen = db(converter, cycles);
                assert!((seen - attenuation).abs() < 0.051, "{converter:?} {cycles}: {seen}");
            }
        }
        for converter in Converter::ALL {
            let delay = 0.5_f64.max(0.5 * converter.order() as f64);
            assert_eq!(converter.delay_samples(), delay);
        }
    }
}
