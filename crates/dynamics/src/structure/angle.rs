//! Sine and cosine of β + α: the pose β is constant, the vibration α small.
//!
//! sin(β+α) = sin β cos α + cos β sin α, and likewise the cosine, with sin β and cos β computed once. A vibration then
//! enters by its [`Turn`], S = sin α and V = cos α − 1, from short polynomials for |α| ≤ 0.4. With z = α² ≤ Z = 0.16,
//!
//! ```text
//! S = α + (z α) p(z)    V = z q(z)    p = −1/3! + z/5! − …    q = −1/2! + z/4! − …
//! ```
//!
//! Both series are cut after z⁵ and then economised (C. Lanczos, "Trigonometric Interpolation of Empirical and
//! Analytical Functions", J. Math. Phys. 17 (1938)): z⁵ is replaced by the polynomial of degree 4 that equals it up to
//! the Chebyshev polynomial, Z⁵ (y⁵ − T₅*(y)/512) with y = z/Z and T₅* = 512 y⁵ − 1280 y⁴ + 1120 y³ − 400 y² + 50 y −
//! 1, which stays within ±1 on 0 ≤ y ≤ 1.
//!
//! With h = sin β and t = cos β, the code sums
//!
//! ```text
//! C = 1 + V    sin: h C + t S    cos: t C − h S
//! ```
//!
//! **Error bound**, in u = 2⁻⁵³ = 1.11e-16. Of the polynomials: the alternating series leaves out
//! less than its next term, |α|¹⁵/15! < 9e-19 and α¹⁴/14! < 3.1e-17; economising adds at most |α|³ Z⁵/(512 · 13!) <
//! 2.2e-18 and α² Z⁵/(512 · 12!) < 7e-17: together less than 0.03 u of S and 0.92 u of V. Of the constants: `libm`
//! gives sin β and cos β to 2 u relative, which is 2 u (|sin β cos α| + |cos β sin α|) ≤ 2 u. Of
//! rounding: p and q are sums whose first term dominates, exact to 6 u relative; so V = z q errs by 8 u α²/2 < 0.64 u
//! and C by 1.64 u, (z α) p by 9 u |α|³/6 < 0.1 u and S, at most 0.4, by 0.5 u; |h| 1.64 u + |t| 0.5 u ≤ 1.72 u. The
//! products err by u (|h C| + |t S|) ≤ u, and their sum, at most 1, by u. Together 0.95 u + 2 u + 3.72 u < 7 u,
//! and the tests allow 8 u = 8.9e-16.
//!
//! Beyond 0.4 `libm` computes S and V.

use crate::real::Real;

/// Up to this |α| the polynomials hold, rad.
const LIMIT_RAD: f64 = 0.4;

/// Coefficients of the polynomials p and q.
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

/// A turn by an angle α: S = sin α and V = cos α − 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn<T> {
    sine: T,
    versed: T,
}

/// Sine and cosine of a constant angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Angle<T> {
    pub sine: T,
    pub cosine: T,
}

impl<T: Real> Turn<T> {
    /// The turn by no angle.
    pub fn none() -> Turn<T> {
        Turn { sine: T::splat(0.0), versed: T::splat(0.0) }
    }

    /// The turn by an angle. With `FAR` it holds for every angle. Without it, it holds only where [`within_reach`] is
    /// true, with the same bits, and takes no branch or call; elsewhere it is meaningless.
    #[inline(always)]
    pub fn new<const FAR: bool>(alpha_rad: T) -> Turn<T> {
        let z = alpha_rad * alpha_rad;
        let z2 = z * z;
        let p = polynomial(&SINE, z, z2);
        let q = polynomial(&COSINE, z, z2);
        // The leading terms stand outside of the polynomials, so that their rounding errors are those of a small
        // correction.
        let near = (alpha_rad + (z * alpha_rad) * p, z * q);
        let (sine, versed) = if FAR { T::where_within(alpha_rad, LIMIT_RAD, near, far) } else { near };
        Turn { sine, versed }
    }

    /// p S + q V.
    #[inline(always)]
    pub fn weighed(self, p: T, q: T) -> T {
        p * self.sine + q * self.versed
    }
}

impl Angle<f64> {
    pub fn new(base_rad: f64) -> Angle<f64> {
        let (sine, cosine) = libm::sincos(base_rad);
        Angle { sine, cosine }
    }
}

impl<T: Real> Angle<T> {
    /// The same for `T::WIDTH` chains side by side.
    #[inline(always)]
    pub fn gather<'a>(of: impl Fn(usize) -> &'a Angle<f64>) -> Angle<T> {
        Angle { sine: T::gather(|i| of(i).sine), cosine: T::gather(|i| of(i).cosine) }
    }

    /// Sine and cosine of the angle after a turn.
    #[inline(always)]
    pub fn turned(&self, turn: Turn<T>) -> (T, T) {
        let h = self.sine;
        let t = self.cosine;
        let cosine = T::splat(1.0) + turn.versed;
        (h * cosine + t * turn.sine, t * cosine - h * turn.sine)
    }

    /// The change of the cosine by a turn, exact at small turns too: t V − h S.
    #[inline(always)]
    pub fn cosine_change(&self, turn: Turn<T>) -> T {
        self.cosine * turn.versed - self.sine * turn.sine
    }
}

/// Whether the polynomials hold for this angle.
#[inline(always)]
pub(super) fn within_reach<T: Real>(alpha_rad: T) -> bool {
    alpha_rad.all_within(LIMIT_RAD)
}

/// S and V by `libm`; V = −2 sin²(α/2) loses no digits at any angle.
#[cold]
fn far(alpha_rad: f64) -> (f64, f64) {
    let half = libm::sin(0.5 * alpha_rad);
    (libm::sin(alpha_rad), -2.0 * half * half)
}

/// Σ cₖ zᵏ, in pairs (G. Estrin, "Organization of Computer Systems: The Fixed Plus Variable Structure Computer", 1960):
/// the processor works on the pairs at the same time.
#[inline(always)]
fn polynomial<T: Real>(c: &[f64; 5], z: T, z2: T) -> T {
    let pair = |k: usize| T::splat(c[k]) + T::splat(c[k + 1]) * z;
    pair(0) + z2 * (pair(2) + z2 * T::splat(c[4]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::Lanes;

    const U: f64 = f64::EPSILON / 2.0;

    /// sin and cos of β + α to better than 1 u: `libm` at the rounded sum, turned on by what the rounding lost.
    fn reference(beta: f64, alpha: f64) -> (f64, f64) {
        let sum = beta + alpha;
        let part = sum - beta;
        let lost = (beta - (sum - part)) + (alpha - part);
        let (s, c) = libm::sincos(sum);
        (s + c * lost, c - s * lost)
    }

    fn error((s, c): (f64, f64), (s_true, c_true): (f64, f64)) -> f64 {
        (s - s_true).abs().max((c - c_true).abs())
    }

    /// Sine and cosine after a turn by any angle.
    fn sincos_plus(angle: &Angle<f64>, alpha_rad: f64) -> (f64, f64) {
        angle.turned(Turn::new::<true>(alpha_rad))
    }

    /// Angles up to the limit, evenly spaced and on every scale, of both signs.
    fn angles(count: i32) -> impl Iterator<Item = f64> {
        (0..=count).flat_map(move |k| {
            let part = f64::from(k) / f64::from(count);
            let magnitude = if k % 2 == 0 { 0.4 * part } else { 0.4 * libm::exp2(-50.0 * part) };
            [magnitude, -magnitude]
        })
    }

    /// The bound of 8 u, with 1 u for the reference, over a grid of poses.
    #[test]
    fn polynomials_keep_their_bound() {
        let mut worst = 0.0_f64;
        let mut count = 0;
        for pose in -360..=360 {
            let beta = f64::from(pose).to_radians();
            let angle = Angle::new(beta);
            for alpha in angles(2000) {
                worst = worst.max(error(sincos_plus(&angle, alpha), reference(beta, alpha)));
                count += 1;
            }
        }
        assert_eq!(count, 721 * 2001 * 2);
        assert!(worst <= 9.0 * U && worst > 0.0, "{} u", worst / U);
    }

    /// The bound is that of small angles; the difference of two cosines adds 3 u.
    #[test]
    fn far_angles_are_libms() {
        let angle = Angle::new(1.0);
        for alpha in [0.400_000_1, -3.0, 70.0] {
            let truth = reference(1.0, alpha);
            assert!(error(sincos_plus(&angle, alpha), truth) <= 9.0 * U, "{alpha}");
            let seen = angle.cosine_change(Turn::new::<true>(alpha));
            assert!((seen - (truth.1 - libm::cos(1.0))).abs() <= 12.0 * U, "{alpha}");
        }
        assert!(sincos_plus(&angle, f64::NAN).0.is_nan() && sincos_plus(&angle, f64::INFINITY).1.is_nan());
    }

    /// Near and far, each lane has the bits of the single number.
    #[test]
    fn lanes_are_the_single_number_bit_for_bit() {
        let some = [0.1, -0.2, 0.4, 0.400_001, f64::NAN, 12.0, -0.0, 1e-300];
        let alone = |i: usize| {
            let turn = Turn::new::<true>(some[i]);
            let (s, c) = Angle::new(i as f64 - 3.5).turned(turn);
            (s.to_bits(), c.to_bits())
        };
        let angles: [Angle<f64>; 8] = core::array::from_fn(|i| Angle::new(i as f64 - 3.5));
        let turn = Turn::new::<true>(Lanes(some));
        let (s, c) = Angle::<Lanes<8>>::gather(|i| &angles[i]).turned(turn);
        for i in 0..8 {
            assert_eq!((s.lane(i).to_bits(), c.lane(i).to_bits()), alone(i), "lane {i}");
        }
    }
}
