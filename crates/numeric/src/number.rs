//! Numbers in messages: exact in the fewest digits, or rounded, but never hundreds of digits long.

use alloc::format;
use core::fmt;

/// A number in the fewest digits that identify it, at most 17, plain or with a power of ten.
#[derive(Clone, Copy, Debug)]
pub struct Short(f64);

/// Formats a number for a message.
pub const fn short(value: &f64) -> Short {
    Short(*value)
}

/// A number with `places` digits after the decimal point, plain or, from 1e9 on, with a power of ten.
#[derive(Clone, Copy, Debug)]
pub struct Rounded {
    value: f64,
    places: usize,
}

/// Formats a number, rounded, for a message.
pub const fn rounded(value: &f64, places: usize) -> Rounded {
    Rounded { value: *value, places }
}

impl fmt::Display for Rounded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Rounded { value, places } = *self;
        if value.abs() < 1e9 { write!(f, "{value:.places$}") } else { write!(f, "{value:.places$e}") }
    }
}

/// A number with `digits` significant digits, plain from 1e-4 to 1e6, otherwise with a power of ten.
#[derive(Clone, Copy, Debug)]
pub struct Significant {
    value: f64,
    digits: usize,
}

/// Formats a number with as many significant digits, for values whose size is not known beforehand.
pub const fn significant(value: &f64, digits: usize) -> Significant {
    Significant { value: *value, digits }
}

impl fmt::Display for Significant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Significant { value, digits } = *self;
        let others = digits.saturating_sub(1);
        match value.abs() {
            size if size == 0.0 || !size.is_finite() => write!(f, "{value}"),
            size if !(1e-4..1e6).contains(&size) => write!(f, "{value:.others$e}"),
            size => {
                // 1 of a number from 10 to 99, −1 of one from 0.1 to 0.99; that of the rounded number, which may be the
                // next power of ten.
                let rounded = format!("{size:.others$e}");
                let exponent = rounded.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0);
                let places = usize::try_from(others as i32 - exponent).unwrap_or(0);
                write!(f, "{value:.places$}")
            }
        }
    }
}

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        // Beyond these, plain notation is mostly zeros: 301 digits for 1e300.
        if size == 0.0 || !size.is_finite() || (1e-5..1e15).contains(&size) {
            write!(f, "{}", self.0)
        } else {
            write!(f, "{:e}", self.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use proptest::prelude::*;

    #[test]
    fn large_and_small_numbers_have_a_power_of_ten() {
        let texts =
            [0.0, -1.0, 1.0 / 3.0, 65535.0, 1e300, -2.5e-300, f64::NAN, f64::INFINITY].map(|x| short(&x).to_string());
        assert_eq!(texts, ["0", "-1", "0.3333333333333333", "65535", "1e300", "-2.5e-300", "NaN", "inf"]);
    }

    #[test]
    fn rounded_numbers_are_bounded() {
        let texts = [0.0, -1.23456, 999_999_999.25, 1e9, -2.55e300, f64::NAN, f64::INFINITY];
        let texts = texts.map(|x| rounded(&x, 3).to_string());
        assert_eq!(texts, ["0.000", "-1.235", "999999999.250", "1.000e9", "-2.550e300", "NaN", "inf"]);
    }

    #[test]
    fn significant_digits_are_as_many_for_small_numbers() {
        let texts = [0.0, -1.23456, 0.0273, 12345.6, 2.5e6, 3.14159e-5, f64::NAN];
        let texts = texts.map(|x| significant(&x, 4).to_string());
        assert_eq!(texts, ["0", "-1.235", "0.02730", "12346", "2.500e6", "3.142e-5", "NaN"]);
    }

    /// A number that rounds up to a power of ten had a digit too many.
    #[test]
    fn significant_digits_are_as_many_where_rounding_carries() {
        let texts = [9.9994, 9.9996, 0.099_996, 999.96, 99_999.7].map(|x| significant(&x, 4).to_string());
        assert_eq!(texts, ["9.999", "10.00", "0.1000", "1000", "100000"]);
    }

    proptest! {
        #[test]
        fn they_are_bounded_and_exact(value in proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL) {
            let text = short(&value).to_string();
            prop_assert!(text.len() <= 24, "{}", text);
            prop_assert_eq!(text.parse::<f64>().unwrap(), value);
        }
    }
}
