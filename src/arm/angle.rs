//! Sine and cosine of β + α: the pose β is constant, the vibration α small.
//!
//! sin(β+α) = sin β cos α + cos β sin α, and likewise the cosine, with sin β and cos β computed once and sin α, cos α from
//! the first terms of their Taylor series.
//!
//! **Error bound.** Let u = 2⁻⁵³ and |α| ≤ ½. The series alternate with falling terms, so what is left out is less than the
//! first term left out: |α|¹⁷/17! < 2.2e-20 of the sine, |α|¹⁶/16! < 7.3e-19 of the cosine, both below 0.01 u. Write the
//! sine as α + α³ p and the cosine as 1 + α² q with |p| ≤ 1/6, |q| ≤ ½. Each of p and q is a sum whose first term dominates:
//! evaluated in pairs it is exact to 5 u relative, its factor α³ or α² to 3 u. So |sin α| errs by at most
//! 8 u · 2.1e-2 + u/4 < 0.5 u (the second part is the last rounding, of a number below ½) and cos α by
//! 8 u · 0.125 + u/2 < 1.6 u. `libm` gives sin β and cos β within one unit in the last place, 2 u relative. Two products and a sum add
//! 2 u: in all at most (2 + 1 + 1) u + 0.5 u + 1.6 u < 7 u = 7.8e-16 absolute, for |sin β cos α| + |cos β sin α| ≤ 1. Beyond ½ `libm`
//! computes the sine of the rounded sum β + α, which is off by no more than u |β + α| and one unit in the last place.

use super::real::Real;

/// Up to this |α| the series hold, rad.
const SERIES_LIMIT_RAD: f64 = 0.5;

/// 1/3!, 1/5!, … 1/15!, with the signs of the sine's series.
const SINE: [f64; 7] = [
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5_040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 1_307_674_368_000.0,
];
/// 1/2!, 1/4!, … 1/14!, with the signs of the cosine's series.
const COSINE: [f64; 7] = [
    -1.0 / 2.0,
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
    -1.0 / 87_178_291_200.0,
];

/// A constant angle with its sine and cosine, to which a small one is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Angle<T> {
    pub base_rad: T,
    pub sine: T,
    pub cosine: T,
}

impl Angle<f64> {
    pub fn new(base_rad: f64) -> Angle<f64> {
        let (sine, cosine) = libm::sincos(base_rad);
        Angle { base_rad, sine, cosine }
    }
}

impl<T: Real> Angle<T> {
    /// Sine and cosine of the angle plus `small_rad`.
    #[inline(always)]
    pub fn sincos_plus(&self, small_rad: T) -> (T, T) {
        let (s, c) = series(small_rad);
        let near = (self.sine * c + self.cosine * s, self.cosine * c - self.sine * s);
        T::where_within(small_rad, SERIES_LIMIT_RAD, self.base_rad, near, |base, small| libm::sincos(base + small))
    }
}

/// (sin α, cos α) by the series.
#[inline(always)]
fn series<T: Real>(alpha: T) -> (T, T) {
    let x2 = alpha * alpha;
    let x4 = x2 * x2;
    (alpha + (alpha * x2) * polynomial(&SINE, x2, x4), T::splat(1.0) + x2 * polynomial(&COSINE, x2, x4))
}

/// Σ cₖ x2ᵏ, in pairs (G. Estrin 1960): the processor works on the pairs at the same time, x4 = x2².
#[inline(always)]
fn polynomial<T: Real>(c: &[f64; 7], x2: T, x4: T) -> T {
    let pair = |k: usize| T::splat(c[k]) + T::splat(c[k + 1]) * x2;
    (pair(0) + x4 * pair(2)) + (x4 * x4) * (pair(4) + x4 * T::splat(c[6]))
}

#[cfg(test)]
mod tests {
    use super::super::real::{LANES, Lanes};
    use super::*;

    /// sin and cos of β + α to better than 0.6 u: `libm` at the rounded sum, turned on by what the rounding lost.
    fn reference(beta: f64, alpha: f64) -> (f64, f64) {
        let sum = beta + alpha;
        let part = sum - beta;
        let lost = (beta - (sum - part)) + (alpha - part);
        let (s, c) = libm::sincos(sum);
        (s + c * lost, c - s * lost)
    }

    /// The bound of 7 u, with 2 u for the reference: over a grid of poses, and of α up to the limit on every scale.
    #[test]
    fn series_keep_their_bound() {
        let u = f64::EPSILON / 2.0;
        let (mut worst, mut count) = (0.0_f64, 0);
        for pose in -360..=360 {
            let angle = Angle::new(f64::from(pose).to_radians());
            for k in 0..=2000 {
                let magnitude = if k % 2 == 0 { f64::from(k) / 4000.0 } else { 0.5 * libm::exp2(-f64::from(k) / 40.0) };
                for alpha in [magnitude, -magnitude] {
                    let (s, c) = angle.sincos_plus(alpha);
                    let (s_true, c_true) = reference(angle.base_rad, alpha);
                    worst = worst.max((s - s_true).abs()).max((c - c_true).abs());
                    count += 1;
                }
            }
        }
        assert_eq!(count, 721 * 2001 * 2);
        assert!(worst <= 9.0 * u && worst > 0.0, "{} u", worst / u);
    }

    #[test]
    fn far_angles_are_libms() {
        let angle = Angle::new(1.0);
        for alpha in [0.500_000_1, -3.0, 70.0] {
            assert_eq!(angle.sincos_plus(alpha), libm::sincos(1.0 + alpha));
        }
        assert!(angle.sincos_plus(f64::NAN).0.is_nan() && angle.sincos_plus(f64::INFINITY).1.is_nan());
    }

    #[test]
    fn lanes_are_the_single_number_bit_for_bit() {
        let bases: [f64; LANES] = core::array::from_fn(|i| i as f64 - 3.5);
        let alphas = [0.1, -0.2, 0.5, 0.500_001, f64::NAN, 12.0, -0.0, 1e-300];
        let angles = bases.map(Angle::new);
        let together = Angle {
            base_rad: Lanes(bases),
            sine: Lanes(angles.map(|a| a.sine)),
            cosine: Lanes(angles.map(|a| a.cosine)),
        };
        let (s, c) = together.sincos_plus(Lanes(alphas));
        for i in 0..LANES {
            let (s_one, c_one) = angles[i].sincos_plus(alphas[i]);
            assert_eq!((s.0[i].to_bits(), c.0[i].to_bits()), (s_one.to_bits(), c_one.to_bits()), "lane {i}");
        }
    }
}
