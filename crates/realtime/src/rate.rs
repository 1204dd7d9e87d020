//! The sample rate, and the instants it gives: exact, without drift.

use resonarm_numeric::number::short;
use thiserror::Error;

/// The lowest rate of a periodic loop, Hz.
pub const MIN_RATE_HZ: f64 = 1.0;
/// The highest rate of a periodic loop, Hz.
pub const MAX_RATE_HZ: f64 = 100_000.0;

/// A rate in [[`MIN_RATE_HZ`], [`MAX_RATE_HZ`]], held as the exact binary fraction that the `f64` is.
///
/// A finite `f64` is `m / 2^s` with an odd whole m below 2^53, or a whole number. So the instant of tick k, in
/// nanoseconds after the start,
///
/// ```text
///     t_k = round(k · 10⁹ · 2^s / m)      halves up
/// ```
///
/// needs only whole numbers: no tick is more than half a nanosecond from its true instant, however long the loop runs.
/// In 128 bits k · 10⁹ · 2^s has room for 2^44 s of loop, as s ≤ 52 and k ≤ rate · time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleRate {
    rate_hz: f64,
    /// Numerator m of the rate's binary fraction.
    numerator: u128,
    /// Exponent s of its denominator 2^s.
    shift: u32,
}

impl SampleRate {
    /// A rate of `rate_hz`.
    ///
    /// # Errors
    /// [`RateError`] if it is not a number, or out of [[`MIN_RATE_HZ`], [`MAX_RATE_HZ`]].
    pub fn new(rate_hz: f64) -> Result<Self, RateError> {
        // No range contains a NaN, so this refuses it as well.
        if !(MIN_RATE_HZ..=MAX_RATE_HZ).contains(&rate_hz) {
            return Err(RateError { rate_hz });
        }
        // rate_hz = mantissa · 2^(exponent − 1075), normal because it is at least 1.
        let bits = rate_hz.to_bits();
        let exponent = (bits >> 52) as i32 - 1075;
        let mantissa = u128::from(bits & ((1 << 52) - 1) | 1 << 52);
        // Common factors of two are cancelled, which makes m odd or s zero: the products of `offset_ns` stay small.
        let spare = mantissa.trailing_zeros().min(exponent.unsigned_abs());
        Ok(Self { rate_hz, numerator: mantissa >> spare, shift: exponent.unsigned_abs() - spare })
    }

    /// Returns the rate in Hz, as it was given.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Returns the time at which tick `index` is due, ns after tick 0.
    pub fn offset_ns(&self, index: u64) -> u64 {
        let scaled = (u128::from(index) * 1_000_000_000) << self.shift;
        // ⌊x/m + 1/2⌋ as ⌊(2x + m)/(2m)⌋, in whole numbers.
        ((2 * scaled + self.numerator) / (2 * self.numerator)) as u64
    }

    /// The last tick due at `offset_ns` after tick 0 or before.
    ///
    /// With x = offset · m / (10⁹ · 2^s) the answer is ⌊x⌋ or, as instants are rounded down too, one more.
    pub fn last_due(&self, offset_ns: u64) -> u64 {
        let floor = (u128::from(offset_ns) * self.numerator / (1_000_000_000_u128 << self.shift)) as u64;
        if self.offset_ns(floor + 1) <= offset_ns { floor + 1 } else { floor }
    }
}

/// A rate that no periodic loop has.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("the sample rate is {rate_hz} Hz; it must be from {MIN_RATE_HZ} to {MAX_RATE_HZ} Hz", rate_hz = short(.rate_hz))]
pub struct RateError {
    /// The rate asked for, Hz.
    pub rate_hz: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn refused_rates_are_named() {
        for rate_hz in [0.0, -1.0, f64::NAN, f64::INFINITY, 0.999_999, 100_000.1] {
            assert!(SampleRate::new(rate_hz).is_err(), "{rate_hz}");
        }
        let error = SampleRate::new(0.0).unwrap_err();
        insta::assert_snapshot!(error, @"the sample rate is 0 Hz; it must be from 1 to 100000 Hz");
    }

    #[test]
    fn whole_rates_give_textbook_instants() {
        let rate = SampleRate::new(1000.0).unwrap();
        assert_eq!([0, 1, 2, 3_600_000].map(|k| rate.offset_ns(k)), [0, 1_000_000, 2_000_000, 3_600_000_000_000]);
        // A third of a nanosecond a tick would be lost or won by a period held in whole nanoseconds.
        let rate = SampleRate::new(3000.0).unwrap();
        assert_eq!([1, 2, 3, 3_000_000_000].map(|k| rate.offset_ns(k)), [333_333, 666_667, 1_000_000, 10_u64.pow(15)]);
        // The ends of the range.
        assert_eq!(SampleRate::new(1.0).unwrap().offset_ns(7), 7_000_000_000);
        assert_eq!(SampleRate::new(100_000.0).unwrap().offset_ns(7), 70_000);
    }

    #[test]
    fn fractions_are_exact() {
        // 1000.5 Hz: 2001 ticks in two seconds, for a year.
        let rate = SampleRate::new(1000.5).unwrap();
        let year_s = 31_557_600;
        assert_eq!(rate.offset_ns(2001 * year_s / 2), year_s * 1_000_000_000);
        // The widest fraction: the f64 next above 1, whose period is 2^52 / (2^52 + 1) s.
        let rate = SampleRate::new(1.0_f64.next_up()).unwrap();
        // Each period lacks 10⁹/2⁵² ns to a second, near enough, so that 2³³ of them lack 10⁹/2¹⁹ = 1907.3 ns.
        assert_eq!(rate.offset_ns(1 << 33), (1 << 33) * 1_000_000_000 - 1907);
    }

    proptest! {
        #[test]
        fn last_due_inverts_the_instants(rate_hz in MIN_RATE_HZ..=MAX_RATE_HZ, index in 0_u64..100_000_000_000) {
            let rate = SampleRate::new(rate_hz).unwrap();
            // At most 3000 years of ticks, so that the instants fit in 64 bits.
            let index = index.min((rate_hz * 1e10) as u64);
            let due = rate.offset_ns(index);
            prop_assert_eq!(rate.last_due(due), index);
            prop_assert!(rate.last_due(due.saturating_sub(1)) == index.saturating_sub(1));
            let next = rate.offset_ns(index + 1);
            prop_assert!(next > due);
            prop_assert_eq!(rate.last_due(next - 1), index);
        }

        #[test]
        fn instants_are_within_half_a_nanosecond(rate_hz in MIN_RATE_HZ..=MAX_RATE_HZ, index in 0_u64..4_000_000) {
            let rate = SampleRate::new(rate_hz).unwrap();
            // k · 10⁹ is below 2^53, so the quotient in f64 is within a unit in its last place, at most 0.5 ns here.
            let near = index as f64 * 1e9 / rate_hz;
            prop_assert!((rate.offset_ns(index) as f64 - near).abs() <= 1.0);
        }
    }
}
