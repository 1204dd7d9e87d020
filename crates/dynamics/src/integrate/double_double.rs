//! Numbers of twice the precision, as the unevaluated sum of two `f64` (T. J. Dekker, "A Floating-Point Technique for
//! Extending the Available Precision", Numer. Math. 18 (1971)): relative error about 2⁻¹⁰⁰. For constants, not for the
//! step.

use core::ops::{Add, Div, Mul, Sub};

/// high + low, where |low| is at most half a unit in the last place of high.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DoubleDouble {
    pub high: f64,
    pub low: f64,
}

impl DoubleDouble {
    pub const fn new(high: f64) -> DoubleDouble {
        DoubleDouble { high, low: 0.0 }
    }

    /// The number as its first 26 bits and the next 53.
    pub fn head_and_tail(self) -> [f64; 2] {
        let (head, rest) = halves(self.high);
        [head, rest + self.low]
    }

    /// √x: the rounded root s, and (x − s²)/(2s).
    pub fn sqrt(self) -> DoubleDouble {
        let high = libm::sqrt(self.high);
        let square = two_product(high, high);
        DoubleDouble { high, low: (((self.high - square.high) - square.low) + self.low) / (2.0 * high) }
    }
}

/// a + b as its rounded value and the rounding error (D. E. Knuth, "The Art of Computer Programming", volume 2, 1969,
/// section 4.2.2).
fn two_sum(a: f64, b: f64) -> DoubleDouble {
    let high = a + b;
    let part = high - a;
    DoubleDouble { high, low: (a - (high - part)) + (b - part) }
}

/// A number as its first 26 bits and the rest (Veltkamp, in the paper above).
fn halves(x: f64) -> (f64, f64) {
    // 2²⁷ + 1: the product pushes the lower bits out, and the difference brings the upper 26 back.
    let scaled = x * 134_217_729.0;
    let high = scaled - (scaled - x);
    (high, x - high)
}

/// a b as its rounded value and the rounding error (Dekker, with Veltkamp's halves).
fn two_product(a: f64, b: f64) -> DoubleDouble {
    let high = a * b;
    let (a_high, a_low) = halves(a);
    let (b_high, b_low) = halves(b);
    DoubleDouble { high, low: a_low * b_low - (((high - a_high * b_high) - a_low * b_high) - a_high * b_low) }
}

impl Add for DoubleDouble {
    type Output = DoubleDouble;
    fn add(self, other: DoubleDouble) -> DoubleDouble {
        // The errors of both sums are kept: if only the low parts were added, digits would be lost where the high
        // parts cancel.
        let highs = two_sum(self.high, other.high);
        let lows = two_sum(self.low, other.low);
        let first = two_sum(highs.high, highs.low + lows.high);
        two_sum(first.high, first.low + lows.low)
    }
}

impl Mul for DoubleDouble {
    type Output = DoubleDouble;
    fn mul(self, other: DoubleDouble) -> DoubleDouble {
        let highs = two_product(self.high, other.high);
        two_sum(highs.high, highs.low + (self.high * other.low + self.low * other.high))
    }
}

impl Sub for DoubleDouble {
    type Output = DoubleDouble;
    fn sub(self, other: DoubleDouble) -> DoubleDouble {
        self + DoubleDouble { high: -other.high, low: -other.low }
    }
}

/// The rounded quotient, then its remainder over the divisor.
impl Div for DoubleDouble {
    type Output = DoubleDouble;
    fn div(self, other: DoubleDouble) -> DoubleDouble {
        let quotient = DoubleDouble::new(self.high / other.high);
        let left = self - quotient * other;
        quotient + DoubleDouble::new(left.high / other.high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_third_three_times_is_one_to_31_digits() {
        let [one, three] = [1.0, 3.0].map(DoubleDouble::new);
        let third = one / three;
        let sum = third + third + third;
        assert!(sum.high == 1.0 && sum.low.abs() < 1e-31, "{sum:?}");
        let ninth = third * third;
        let left = ninth * DoubleDouble::new(9.0) - one;
        assert!(left.high.abs() < 1e-31, "{left:?}");
        let back = ninth / third - third;
        assert!(back.high.abs() < 1e-31, "{back:?}");
    }

    #[test]
    fn root_squared_is_the_number_to_31_digits() {
        for square in [DoubleDouble::new(15.0), DoubleDouble::new(6.0) / DoubleDouble::new(5.0)] {
            let root = square.sqrt();
            let left = root * root - square;
            assert!(root.low != 0.0 && left.high.abs() < 1e-30, "{root:?} {left:?}");
        }
    }
}
