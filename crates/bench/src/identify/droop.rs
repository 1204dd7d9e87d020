//! Correction of readings for the droop of their converters.
//!
//! With y = ωT/2 and s = sin² y a converter of order N has the gain (sin y/y)ᴺ ([`Converter::gain`]). Its inverse is a
//! power series in s,
//!
//! ```text
//! y/sin y = arcsin √s/√s = Σ cₖ sᵏ     cₖ = (2k)!/(4ᵏ k!² (2k + 1))     1/gain = (Σ cₖ sᵏ)ᴺ = Σ aₖ sᵏ
//! ```
//!
//! and −4s is the factor 2 cos ωT − 2 of the second difference δ²x = x(n+1) − 2 x(n) + x(n−1). So Σ aₖ (−δ²/4)ᵏ, summed
//! by Horner's rule, undoes the gain without a delay. At order 5 the omitted terms are 2·10⁻⁷ at a tenth of the sample
//! rate, and 10⁻⁴ at a fifth.

use alloc::vec::Vec;

use super::double_integration::Pair;
use crate::rig::Converter;

/// Number of terms of the series.
const TERMS: usize = 9;

/// Divides the readings by the converter's gain; silence is assumed before and after them.
pub(super) fn without_droop(values: &[Pair], converter: Converter) -> Vec<Pair> {
    let [lower @ .., last] = inverse_gain(converter);
    let mut sum: Vec<Pair> = values.iter().map(|value| value * last).collect();
    for factor in lower.into_iter().rev() {
        let at = |n: usize| sum.get(n).copied().unwrap_or_default();
        let differences = |n: usize| at(n + 1) - at(n) * 2.0 + n.checked_sub(1).map_or(Pair::default(), at);
        sum = values.iter().enumerate().map(|(n, value)| value * factor - differences(n) * 0.25).collect();
    }
    sum
}

/// Returns the coefficients a₀ … of the series for 1/gain.
fn inverse_gain(converter: Converter) -> [f64; TERMS] {
    let mut arcsine = [1.0; TERMS];
    let mut central = 1.0;
    for (k, coefficient) in arcsine.iter_mut().enumerate().skip(1) {
        // (2k)!/(4ᵏ k!²) = Π (2j − 1)/(2j).
        central *= (2 * k - 1) as f64 / (2 * k) as f64;
        *coefficient = central / (2 * k + 1) as f64;
    }
    let mut power = [0.0; TERMS];
    power[0] = 1.0;
    // The N-th power of the series, by repeated multiplication of truncated series.
    for _ in 0..converter.order() {
        power = core::array::from_fn(|k| (0..=k).map(|j| power[j] * arcsine[k - j]).sum());
    }
    power
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The series as a polynomial of sin², against the gain itself.
    #[test]
    fn the_inverse_gain_is_one_over_the_gain() {
        for converter in Converter::ALL {
            for (cycles, bound) in [(0.01, 1e-14), (0.06, 1e-10), (0.1, 2e-7), (0.2, 1e-4)] {
                let sine = libm::sin(core::f64::consts::PI * cycles);
                let inverse = inverse_gain(converter).iter().rev().fold(0.0, |sum, a| sum * sine * sine + a);
                let expected = if converter.order() == 0 { 1.0 } else { 1.0 / converter.gain(cycles) };
                assert!((inverse / expected - 1.0).abs() < bound, "{converter:?} {cycles}: {inverse} {expected}");
            }
        }
    }

    #[test]
    fn a_sine_is_restored() {
        let converter = Converter::Sinc5;
        let sine = |n: usize| libm::sin(core::f64::consts::TAU * 0.06 * n as f64);
        let read: Vec<Pair> = (0..200).map(|n| Pair::new(converter.gain(0.06) * sine(n), 0.0)).collect();
        let found = without_droop(&read, converter);
        assert!((20..180).all(|n| (found[n].re - sine(n)).abs() < 1e-10));
    }
}
