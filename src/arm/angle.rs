//! Sine and cosine of β + α: the pose β is constant, the vibration α small.
//!
//! sin(β+α) = sin β cos α + cos β sin α, and likewise the cosine, with sin β and cos β computed once and sin α, cos α
//! by short polynomials, for |α| ≤ 0.4. With z = α² ≤ Z = 0.16,
//!
//! ```text
//! sin α = α + α z p(z)    cos α = 1 + z q(z)    p = −1/3! + z/5! − …    q = −1/2! + z/4! − …
//! ```
//!
//! Both series are cut after z⁵ and then economised (C. Lanczos 1938): z⁵ is replaced by the polynomial of degree 4
//! that equals it up to the Chebyshev polynomial, Z⁵ (y⁵ − T₅*(y)/512) with y = z/Z and T₅* = 512 y⁵ − 1280 y⁴ + 1120
//! y³ − 400 y² + 50 y − 1, which stays within ±1 on 0 ≤ y ≤ 1.
//!
//! Length included, with h = sin β and t = cos β times the length, the code sums
//!
//! ```text
//! S = α + (z α) p    C = 1 + z q    sin: h C + t S    cos: t C − h S
//! ```
//!
//! **Error bound**, as parts of the length, u = 2⁻⁵³ = 1.11e-16. Of the polynomials: the alternating series leaves out
//! less than its next term, |α|¹⁵/15! < 9e-19 and α¹⁴/14! < 3.1e-17; economising adds at most |α|³ Z⁵/(512 · 13!) <
//! 2.2e-18 and α² Z⁵/(512 · 12!) < 7e-17: together less than 0.03 u of sin α and 0.92 u of cos α. Of the constants:
//! `libm` gives sin β and cos β to 2 u relative, the length adds u, which is 3 u (|sin β cos α| + |cos β sin α|) ≤ 3 u.
//! Of rounding: p and q are sums whose first term dominates, exact to 6 u relative; so z q errs by 8 u α²/2 < 0.64 u
//! and C by 1.64 u, (z α) p by 9 u |α|³/6 < 0.1 u and S, at most 0.4, by 0.5 u; |h| 1.64 u + |t| 0.5 u ≤ 1.72 u. The
//! products err by u (|h C| + |t S|) ≤ u, and their sum, at most 1, by u. Together 0.95 u + 3 u + 3.72 u < 8 u =
//! 8.9e-16. Beyond 0.4
//! `libm` computes the sine of the rounded sum β + α, which is off by no more than u |β + α| and one unit in the last
//! place.

use super::real::Real;

/// Up to this |α| the polynomials hold, rad.
const LIMIT_RAD: f64 = 0.4;

/// p and q.
const SINE: [f64; 5] = economised([6.0, 120.0, 5_040.0, 362_880.0, 39_916_800.0, 6_227_020_800.0]);
const COSINE: [f64; 5] = economised([2.0, 24.0, 720.0, 40_320.0, 3_628_800.0, 479_001_600.0]);

/// −1/n₀ + z/n₁ − z²/n₂ + … + z⁵/n₅ with z⁵ economised.
const fn economised(n: [f64; 6]) -> [f64; 5] {
    let limit = LIMIT_RAD * LIMIT_RAD;
    let top = 1.0 / n[5] / 512.0;
    let limit2 = limit * limit;
    [
        -1.0 / n[0] + top * (limit2 * limit2 * limit),
        1.0 / n[1] - 50.0 * top * (limit2 * limit2),
        -1.0 / n[2] + 400.0 * top * (limit2 * limit),
        1.0 / n[3] - 1120.0 * top * limit2,
        -1.0 / n[4] + 1280.0 * top * limit,
    ]
}

/// A constant angle with its sine and cosine, to which a small one is added.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Angle<T> {
    pub base_rad: T,
    /// A factor of sine and cosine, which they hold already.
    pub length: T,
    pub sine: T,
    pub cosine: T,
}

impl Angle<f64> {
    pub fn new(base_rad: f64) -> Angle<f64> {
        let (sine, cosine) = libm::sincos(base_rad);
        Angle { base_rad, length: 1.0, sine, cosine }
    }

    /// The same angle with sine and cosine times `length`.
    pub fn times(self, length: f64) -> Angle<f64> {
        Angle { length: self.length * length, sine: self.sine * length, cosine: self.cosine * length, ..self }
    }
}

impl<T: Real> Angle<T> {
    /// The angles of `T::WIDTH` arms side by side.
    pub fn gather<'a>(of: impl Fn(usize) -> &'a Angle<f64>) -> Angle<T> {
        let number = |pick: fn(&Angle<f64>) -> f64| T::gather(|i| pick(of(i)));
        Angle {
            base_rad: number(|a| a.base_rad),
            length: number(|a| a.length),
            sine: number(|a| a.sine),
            cosine: number(|a| a.cosine),
        }
    }

    /// Sine and cosine of the angle plus `small_rad`, times the length.
    #[inline(always)]
    pub fn sincos_plus(&self, small_rad: T) -> (T, T) {
        T::where_within(small_rad, LIMIT_RAD, self.near(small_rad), [self.base_rad, self.length], far)
    }

    /// The same. With `FAR` at every angle; without it only where [`within_reach`] says so, to the same bits, and
    /// without a branch or a call.
    #[inline(always)]
    pub fn sincos<const FAR: bool>(&self, small_rad: T) -> (T, T) {
        if FAR { self.sincos_plus(small_rad) } else { self.near(small_rad) }
    }

    /// Length times (cos(base + small) − cos(base)), with all its digits at small angles: t z q − h S, and beyond their
    /// limit −2 sin(α/2) sin(β + α/2). `FAR` as [`Angle::sincos`] has it.
    #[inline(always)]
    pub fn cosine_change<const FAR: bool>(&self, small_rad: T) -> T {
        let (sine, versed) = small(small_rad);
        let near = self.cosine * versed - self.sine * sine;
        if FAR {
            T::where_within(small_rad, LIMIT_RAD, (near, near), [self.base_rad, self.length], far_change).0
        } else {
            near
        }
    }

    /// Sine and cosine where [`within_reach`] says so, and meaningless elsewhere; without a branch or a call.
    #[inline(always)]
    fn near(&self, small_rad: T) -> (T, T) {
        let (h, t) = (self.sine, self.cosine);
        let (sine, versed) = small(small_rad);
        let cosine = T::splat(1.0) + versed;
        (h * cosine + t * sine, t * cosine - h * sine)
    }
}

/// S and z q: sin α and cos α − 1 where the polynomials hold.
#[inline(always)]
fn small<T: Real>(alpha_rad: T) -> (T, T) {
    let z = alpha_rad * alpha_rad;
    let z2 = z * z;
    let (p, q) = (polynomial(&SINE, z, z2), polynomial(&COSINE, z, z2));
    (alpha_rad + (z * alpha_rad) * p, z * q)
}

/// Whether the polynomials hold for this angle.
#[inline(always)]
pub(crate) fn within_reach<T: Real>(small_rad: T) -> bool {
    small_rad.all_within(LIMIT_RAD)
}

/// Length times sine and cosine of base + small.
#[cold]
fn far([base_rad, length]: [f64; 2], small_rad: f64) -> (f64, f64) {
    let (sine, cosine) = libm::sincos(base_rad + small_rad);
    (length * sine, length * cosine)
}

/// Length times the change of the cosine from base to base + small, twice.
#[cold]
fn far_change([base_rad, length]: [f64; 2], small_rad: f64) -> (f64, f64) {
    let change = -2.0 * length * libm::sin(0.5 * small_rad) * libm::sin(base_rad + 0.5 * small_rad);
    (change, change)
}

/// Σ cₖ zᵏ, in pairs (G. Estrin 1960): the processor works on the pairs at the same time.
#[inline(always)]
fn polynomial<T: Real>(c: &[f64; 5], z: T, z2: T) -> T {
    let pair = |k: usize| T::splat(c[k]) + T::splat(c[k + 1]) * z;
    pair(0) + z2 * (pair(2) + z2 * T::splat(c[4]))
}

#[cfg(test)]
mod tests {
    use super::super::real::{LANES, Lanes};
    use super::*;

    /// sin and cos of β + α to better than 1 u: `libm` at the rounded sum, turned on by what the rounding lost.
    fn reference(beta: f64, alpha: f64) -> (f64, f64) {
        let sum = beta + alpha;
        let part = sum - beta;
        let lost = (beta - (sum - part)) + (alpha - part);
        let (s, c) = libm::sincos(sum);
        (s + c * lost, c - s * lost)
    }

    /// The bound of 8 u, with 1 u for the reference: over a grid of poses, and of α up to the limit on every scale.
    #[test]
    fn polynomials_keep_their_bound() {
        let u = f64::EPSILON / 2.0;
        let (mut worst, mut count) = (0.0_f64, 0);
        for pose in -360..=360 {
            let angle = Angle::new(f64::from(pose).to_radians());
            for k in 0..=2000 {
                let magnitude = if k % 2 == 0 { f64::from(k) / 5000.0 } else { 0.4 * libm::exp2(-f64::from(k) / 40.0) };
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
        for alpha in [0.400_000_1, -3.0, 70.0] {
            assert_eq!(angle.sincos_plus(alpha), libm::sincos(1.0 + alpha));
        }
        assert!(angle.sincos_plus(f64::NAN).0.is_nan() && angle.sincos_plus(f64::INFINITY).1.is_nan());
    }

    #[test]
    fn lanes_are_the_single_number_bit_for_bit() {
        let bases: [f64; LANES] = core::array::from_fn(|i| i as f64 - 3.5);
        let some = [0.1, -0.2, 0.4, 0.400_001, f64::NAN, 12.0, -0.0, 1e-300];
        let alphas: [f64; LANES] = core::array::from_fn(|i| some[i % some.len()]);
        let angles = bases.map(Angle::new);
        let together = Angle {
            length: Lanes([1.0; LANES]),
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
