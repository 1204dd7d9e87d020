//! Physical values of the classic profile as signed 16-bit counts: raw = round(value · counts per unit),
//! value = raw / counts per unit.
//!
//! Rounding is to nearest, ties to even. Counts go from −32767 to 32767; −32768 is reserved for "not available".

use crate::network::Profile;

/// The largest count; the smallest is its negative.
pub const RAW_MAX: i16 = i16::MAX;

/// The reserved count for "not available".
pub const RAW_NOT_AVAILABLE: i16 = i16::MIN;

/// The counts of a physical quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    counts_per_unit: u16,
}

/// Newtons: 50 counts per newton, ±655.34 N, resolution 0.02 N.
pub const FORCE: Scale = Scale { counts_per_unit: 50 };

/// Newton metres: 20 counts per newton metre, ±1638.35 N·m, resolution 0.05 N·m.
pub const TORQUE: Scale = Scale { counts_per_unit: 20 };

/// Metres per second squared: 20 counts per m/s², ±1638.35 m/s², resolution 0.05 m/s².
pub const ACCELERATION: Scale = Scale { counts_per_unit: 20 };

/// The count nearest to a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Count {
    /// The value is in range.
    InRange(i16),
    /// The value rounds to a count beyond the range; this is the nearer end of the range.
    Beyond(i16),
    /// The value is not a number or infinite.
    NotFinite,
}

impl Scale {
    /// Counts per unit of the quantity.
    pub const fn counts_per_unit(self) -> u16 {
        self.counts_per_unit
    }

    /// The value of the largest count, in units of the quantity; the smallest is its negative.
    pub const fn max(self) -> f64 {
        self.value(RAW_MAX)
    }

    /// The largest value of a profile's signals, in units of the quantity; the smallest is its negative.
    pub const fn limit(self, profile: Profile) -> f64 {
        match profile {
            Profile::Classic => self.max(),
            Profile::Fd => f32::MAX as f64,
        }
    }

    /// The count for `value`.
    ///
    /// A count c represents every value whose product with the counts per unit rounds to c, so the range reaches half
    /// a count beyond [`Scale::max`].
    pub const fn count(self, value: f64) -> Count {
        let scaled = value * self.counts_per_unit as f64;
        if !value.is_finite() {
            Count::NotFinite
        // 32767.5 is beyond: it would go to the even neighbour, 32768. A product that overflows is infinite, and
        // beyond as well.
        } else if scaled >= RAW_MAX as f64 + 0.5 {
            Count::Beyond(RAW_MAX)
        } else if scaled <= -(RAW_MAX as f64) - 0.5 {
            Count::Beyond(-RAW_MAX)
        } else {
            Count::InRange(round_ties_even(scaled) as i16)
        }
    }

    /// The value of a count, in units of the quantity.
    pub const fn value(self, raw: i16) -> f64 {
        raw as f64 / self.counts_per_unit as f64
    }
}

/// The integer nearest to `x`, ties to even, for |x| ≤ 2⁵¹.
///
/// With c = 2⁵² + 2⁵¹ the sum x + c is in [2⁵², 2⁵³], where a double has a unit of exactly 1: the addition rounds x
/// to an integer, nearest and ties to even (c is even), and subtracting c again is exact.
const fn round_ties_even(x: f64) -> f64 {
    const C: f64 = 6_755_399_441_055_744.0;
    (x + C) - C
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_to_nearest_and_ties_to_even() {
        let cases = [(0.5, 0.0), (1.5, 2.0), (2.5, 2.0), (-0.5, 0.0), (-1.5, -2.0), (-2.5, -2.0), (0.499_999, 0.0)];
        for (x, expected) in cases {
            assert_eq!(round_ties_even(x), expected, "{x}");
        }
        for halves in -70_000..70_000 {
            let x = f64::from(halves) / 2.0;
            for x in [x, x.next_up(), x.next_down()] {
                assert_eq!(round_ties_even(x), x.round_ties_even(), "{x}");
            }
        }
    }

    #[test]
    fn every_count_converts_in_both_directions() {
        for scale in [FORCE, TORQUE, ACCELERATION] {
            for raw in -RAW_MAX..=RAW_MAX {
                assert_eq!(scale.count(scale.value(raw)), Count::InRange(raw));
            }
        }
    }

    #[test]
    fn the_range_ends_half_a_count_beyond_the_largest_value() {
        // In counts of 1/50 N the end, 32767.5, is exactly 655.35 N as a product.
        assert_eq!(655.35 * 50.0, 32_767.5);
        let cases = [
            (655.34, Count::InRange(32_767)),
            (655.349_999, Count::InRange(32_767)),
            (655.35, Count::Beyond(32_767)),
            (-655.349_999, Count::InRange(-32_767)),
            (-655.35, Count::Beyond(-32_767)),
            (f64::MAX, Count::Beyond(32_767)),
            (f64::MIN, Count::Beyond(-32_767)),
            (f64::NAN, Count::NotFinite),
            (f64::INFINITY, Count::NotFinite),
            (f64::NEG_INFINITY, Count::NotFinite),
        ];
        for (value, count) in cases {
            assert_eq!(FORCE.count(value), count, "{value}");
        }
    }

    #[test]
    fn the_ranges_are_those_of_the_specification() {
        assert_eq!((FORCE.max(), TORQUE.max(), ACCELERATION.max()), (655.34, 1638.35, 1638.35));
    }
}
