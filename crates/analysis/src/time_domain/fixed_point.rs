//! Fixed points of the stroboscopic map's powers, and the decay of trajectories near them.

use nalgebra::{DMatrix, DVector};

use super::map::{StroboscopicMap, size};
use resonarm_numeric::linear_solve::solve;

/// Newton's limit: where it converges it needs three to six iterations.
const MAX_ITERATIONS: usize = 8;
/// A correction below this fraction of the response is the last one: the remaining error is its square times at most
/// 1/(1 − μ), below 1e-12.
const CORRECTION_LIMIT: f64 = 1e-8;
/// Newton's method is given up at a correction of more than this many times the response.
const CORRECTION_BOUND: f64 = 10.0;
/// Two points this near each other, relative to the response, are one.
pub(crate) const SAME_POINT: f64 = 1e-7;
/// A multiplier nearer to 1 is indistinguishable from 1: the derivative's own error is near 1e-10.
const SMALLEST_DECAY: f64 = 1e-9;
/// A stretch is as the linearisation predicts if the remainder is at most this part of the decay.
const PREDICTED: f64 = 0.25;
/// The remainder is negligible if it is at most this part of the decay, near the fixed point.
const LINEAR: f64 = 0.01;
/// A deviation of at most this part of the response is near the fixed point.
const NEAR: f64 = 0.1;
/// Squarings of the derivative: they reach 2⁴⁰ periods.
const SQUARINGS: i32 = 40;

/// A stable fixed point of the map's power: a periodic response to which its neighbours converge.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FixedPoint {
    /// n: periods after which the response repeats, the fewest.
    pub period: u32,
    pub point: DVector<f64>,
    /// Derivative of n periods at the point: the monodromy matrix M.
    derivative: DMatrix<f64>,
    /// max |μ| of M's eigenvalues: the slowest transient falls by this factor in n periods.
    pub largest_multiplier: f64,
    /// Q = Σ (Mᵀ)ʲ Mʲ over j ≥ 0.
    norm: DMatrix<f64>,
}

impl FixedPoint {
    /// Returns the fixed point that Newton's method reaches from `start`, x⁺ = x + (I − M)⁻¹ (Pⁿ(x) − x); `None` if it
    /// reaches none, or one that isn't stable.
    pub fn shoot(map: &StroboscopicMap, start: &DVector<f64>, period: u32) -> Option<FixedPoint> {
        let mut point = start.clone();
        let n = start.len();
        for _ in 0..MAX_ITERATIONS {
            let derivative = map.derivative(&point, period)?;
            let defect = map.image(&point, period).ok()? - &point;
            // Columns of the transpose are rows.
            let mut rows = (DMatrix::identity(n, n) - &derivative).transpose();
            let mut correction = defect;
            solve(rows.as_mut_slice(), correction.as_mut_slice().as_chunks_mut::<1>().0)?;
            point += &correction;
            let change = correction.norm();
            if change <= CORRECTION_LIMIT * size(&point) {
                return match shorter_period(map, &point, period) {
                    Some(fewer) => FixedPoint::shoot(map, &point, fewer),
                    None => FixedPoint::stable(point, period, derivative),
                };
            }
            if change.is_nan() || change > CORRECTION_BOUND * size(start) {
                return None;
            }
        }
        None
    }

    /// Returns the fixed point if it is stable.
    ///
    /// Squaring M k times and scaling each time gives ‖M^(2ᵏ)‖, and its 2ᵏth root tends to max |μ| (I. Gelfand,
    /// "Normierte Ringe", 1941). Q solves MᵀQM − Q + I = 0 (A. M. Lyapunov, "The General Problem of the Stability of
    /// Motion", 1892); with A = M^(2ᵏ) the sum of 2ᵏ terms doubles by Q + AᵀQA (R. A. Smith, "Matrix Equation XA + BX
    /// = C", SIAM J. Appl. Math. 16 (1968)).
    fn stable(point: DVector<f64>, period: u32, derivative: DMatrix<f64>) -> Option<FixedPoint> {
        let mut power = derivative.clone();
        let n = derivative.nrows();
        let mut log_norm = 0.0;
        for k in 0..SQUARINGS {
            let norm = power.norm();
            if !norm.is_finite() {
                return None;
            }
            if norm == 0.0 {
                log_norm = f64::NEG_INFINITY;
                break;
            }
            // With nⱼ the norm taken off before the square j, ln ‖M^(2ᵏ)‖/2ᵏ is Σ ln nⱼ/2ʲ: nothing overflows.
            log_norm += libm::log(norm) * libm::exp2(-f64::from(k));
            power /= norm;
            power = &power * &power;
        }
        let largest_multiplier = libm::exp(log_norm);
        if largest_multiplier.is_nan() || largest_multiplier >= 1.0 - SMALLEST_DECAY {
            return None;
        }
        let mut norm = DMatrix::identity(n, n);
        let mut power = derivative.clone();
        for _ in 0..SQUARINGS {
            norm += power.tr_mul(&(&norm * &power));
            power = &power * &power;
        }
        Some(FixedPoint { period, point, derivative, largest_multiplier, norm })
    }

    /// Returns ‖e‖ = √(eᵀQe): in this norm every small deviation falls from one return to the next, ‖Me‖² = ‖e‖² −
    /// |e|².
    fn deviation(&self, e: &DVector<f64>) -> f64 {
        libm::sqrt(e.dot(&(&self.norm * e)))
    }

    /// Returns the linearisation at the point over so many returns.
    pub fn linearised(&self, returns: u64) -> Linearised<'_> {
        Linearised {
            fixed_point: self,
            power: power(&self.derivative, returns),
            decay: 1.0 - libm::pow(self.largest_multiplier, returns as f64),
        }
    }

    /// Returns the distance to the point over the response's size.
    pub fn distance(&self, point: &DVector<f64>) -> f64 {
        (point - &self.point).norm() / size(&self.point)
    }
}

/// The linearisation at a fixed point over a stretch of several returns.
pub(crate) struct Linearised<'a> {
    fixed_point: &'a FixedPoint,
    /// Power Mᵏ of the map's derivative.
    power: DMatrix<f64>,
    /// 1 − ρᵏ, ρ = max |μ|: at least this part of a small deviation is gone after the stretch.
    decay: f64,
}

impl Linearised<'_> {
    /// Returns the approach of a trajectory that went from `before` to `after` in this stretch and had approached the
    /// point `so_far`; `None` if the stretch is not what the linearisation predicts.
    ///
    /// The deviation e follows e⁺ = Mᵏe + r(e), with a remainder r that falls as the square of e or faster. The linear
    /// part takes at least (1 − ρᵏ)‖e‖ off the deviation: the decay. The stretch is as predicted if the remainder is at
    /// most a quarter of that: then the deviation falls.
    pub fn approach(&self, so_far: Option<Approach>, before: &DVector<f64>, after: &DVector<f64>) -> Option<Approach> {
        let fixed_point = self.fixed_point;
        let e = before - &fixed_point.point;
        let e_after = after - &fixed_point.point;
        let remainder = fixed_point.deviation(&(&e_after - &self.power * &e));
        let expected = self.decay * fixed_point.deviation(&e);
        (remainder <= PREDICTED * expected).then(|| {
            let deviation = fixed_point.deviation(&e_after);
            Approach {
                is_linear: remainder <= LINEAR * expected
                    && deviation <= NEAR * fixed_point.deviation(&fixed_point.point),
                first: so_far.map_or(deviation, |approach| approach.first),
                deviation,
            }
        })
    }
}

/// The approach of a trajectory to a fixed point over successive stretches, each as the linearisation predicts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Approach {
    /// Whether the last stretch ended near the fixed point and its remainder is negligible.
    is_linear: bool,
    /// The deviation after the first of these stretches.
    first: f64,
    /// The deviation after the last one.
    deviation: f64,
}

impl Approach {
    /// Says whether the trajectory can only end at the fixed point.
    ///
    /// One stretch as predicted does not show that. Far from the fixed point a trajectory that goes elsewhere can meet
    /// the prediction by chance: near the boundary between two basins it is slow, and turns about both stable
    /// responses. From where the remainder is of second order it falls faster than the deviation. Near the fixed point
    /// a negligible remainder shows this; farther away, stretches that remain as predicted until the deviation has
    /// halved.
    pub fn is_certain(self) -> bool {
        self.is_linear || self.deviation <= 0.5 * self.first
    }
}

/// Returns a divisor of `period` after which the response already repeats.
fn shorter_period(map: &StroboscopicMap, point: &DVector<f64>, period: u32) -> Option<u32> {
    (1..period)
        .filter(|fewer| period.is_multiple_of(*fewer))
        .find(|fewer| map.image(point, *fewer).is_ok_and(|image| (image - point).norm() <= SAME_POINT * size(point)))
}

/// Returns the power Mᵏ of a matrix, by squaring.
fn power(matrix: &DMatrix<f64>, exponent: u64) -> DMatrix<f64> {
    let n = matrix.nrows();
    let mut result = DMatrix::identity(n, n);
    let mut square = matrix.clone();
    let mut left = exponent;
    while left > 0 {
        if left & 1 == 1 {
            result = &result * &square;
        }
        square = &square * &square;
        left >>= 1;
    }
    result
}
