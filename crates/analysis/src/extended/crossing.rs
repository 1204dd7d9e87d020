//! Neimark–Sacker and branch points by extended systems, for Newton's method. With z = (λ, X) and R_z = (R_λ, R_x):
//!
//! - Neimark–Sacker point (Yu. A. Kuznetsov, "Elements of Applied Bifurcation Theory", 2004, Sec. 10.2): R(z) = 0 and
//!   ψ(z) = 0, where ψ = det(Φ ⊙ Φ − I) = Π (μᵢμⱼ − 1), i < j, is that of the bialternate product of the monodromy
//!   matrix Φ.
//! - Branch point (A. Griewank, G. W. Reddien, "Characterization and Computation of Generalized Turning Points", SIAM
//!   J. Numer. Anal. 21 (1984)): R_z has lost a rank. With one more unknown β, which is zero at the solution, R(z) + β
//!   b = 0 and g₁(z) = g₂(z) = 0 of the bordered system
//!
//! ```text
//! ⎡ R_z  b ⎤ ⎡V ⎤   ⎡0⎤
//! ⎢        ⎥ ⎢  ⎥ = ⎢ ⎥        V of two columns, g of two elements, I the identity of order 2
//! ⎣ Cᵀ   0 ⎦ ⎣gᵀ⎦   ⎣I⎦
//! ```
//!
//! b is near the left null vector of R_z and C near its right null vectors, which keeps the bordered matrix well
//! conditioned; the zeros of g don't depend on them. Both systems are regular at the point.
//!
//! The derivatives of ψ and g are central differences along the null vectors of R_z alone, and taken to be zero across:
//! after an iteration R is of the order of its square, so is what the next one moves across, and convergence is
//! quadratic all the same.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use crate::continuation::{Continuation, ContinuationSettings, Point, System, Work, not_located};
use crate::dense::{Lu, dot, normalise};
use crate::{AnalysisError, Floquet, ForcedResponse, Oscillator};

/// Steps of differences, relative to X: small against the width of a resonance, large against the rounding of
/// multipliers.
const DIFFERENCE: f64 = 1e-6;

/// The condition at the point besides R = 0.
enum Condition {
    /// ψ = 0.
    NeimarkSacker(Box<Floquet>),
    /// g = 0.
    BranchPoint,
}

/// The bordered matrix: rows C, one for each null vector of R_z, and the columns b that make it square, one or none.
struct Border {
    b: Vec<Vec<f64>>,
    c: Vec<Vec<f64>>,
    lu: Lu,
}

/// The equations; unknowns are ζ, X and, for a branch point, β, with λ = origin + scale · ζ.
struct Crossing<O: Oscillator> {
    response: ForcedResponse<O>,
    condition: Condition,
    border: Border,
    lambda_origin: f64,
    lambda_scale: f64,
    /// The step of differences.
    step: f64,
    /// R, and R_x and R_λ in the layout of [`System::evaluate`].
    residual: Vec<f64>,
    matrix: Vec<f64>,
}

/// The Neimark–Sacker point near `guess`.
pub(crate) fn neimark_sacker<O: Oscillator + Clone>(
    response: &ForcedResponse<O>,
    settings: &ContinuationSettings,
    guess: &Point,
) -> Result<(Point, Work), AnalysisError> {
    let border = Border { b: vec![], c: vec![tangent(guess)], lu: Lu::default() };
    let condition = Condition::NeimarkSacker(Box::default());
    Crossing::near(response, settings, guess, condition, border).solve(settings, guess)
}

/// The branch point near `guess`.
pub(crate) fn branch_point<O: Oscillator + Clone>(
    response: &ForcedResponse<O>,
    settings: &ContinuationSettings,
    guess: &Point,
) -> Result<(Point, Work), AnalysisError> {
    let mut response = response.clone();
    let border = Border::near(&mut response, settings, guess)?;
    Crossing::near(&response, settings, guess, Condition::BranchPoint, border).solve(settings, guess)
}

/// The direction of the branch by (ζ, X).
fn tangent(point: &Point) -> Vec<f64> {
    let n = point.tangent.len() - 1;
    core::iter::once(point.tangent[n]).chain(point.tangent[..n].iter().copied()).collect()
}

/// Λ/X: the unit of λ, so that λ has the same scale as along a continuation.
fn lambda_scale(settings: &ContinuationSettings, guess: &Point) -> f64 {
    settings.lambda_scale(guess.lambda) / settings.size(&guess.x)
}

/// Computes R and its derivatives at a point; returns whether the system exists there.
fn evaluate<O: Oscillator>(
    response: &mut ForcedResponse<O>,
    lambda: f64,
    x: &[f64],
    residual: &mut Vec<f64>,
    matrix: &mut Vec<f64>,
) -> bool {
    residual.clear();
    residual.resize(x.len(), 0.0);
    matrix.clear();
    matrix.resize((x.len() + 1) * (x.len() + 1), 0.0);
    response.evaluate(x, lambda, residual, matrix)
}

impl Border {
    /// From the tangent t at `guess` and the null vectors of R_z bordered by t.
    fn near<O: Oscillator>(
        response: &mut ForcedResponse<O>,
        settings: &ContinuationSettings,
        guess: &Point,
    ) -> Result<Border, AnalysisError> {
        let n = response.dimension();
        let (mut residual, mut matrix) = (Vec::new(), Vec::new());
        if !evaluate(response, guess.lambda, &guess.x, &mut residual, &mut matrix) {
            return Err(not_located(response, [guess, guess]));
        }
        let tangent = tangent(guess);
        let mut lu = Lu::default();
        let square = lu.zeroed(n + 1);
        by_z(&matrix, n, lambda_scale(settings, guess), square, n + 1);
        for (column, t) in square.chunks_exact_mut(n + 1).zip(&tangent) {
            column[n] = *t;
        }
        lu.factor()?;
        let [other, mut b] = lu.null_vectors();
        b.truncate(n);
        Ok(Border { b: vec![b], c: vec![tangent, other], lu })
    }

    /// The columns of V, and under them, where there is b, the elements of g; from R_x and R_λ.
    fn solve(&mut self, matrix: &[f64], n: usize, scale: f64) -> Option<Vec<Vec<f64>>> {
        let size = n + self.c.len();
        let square = self.lu.zeroed(size);
        by_z(matrix, n, scale, square, size);
        for (column, b) in square.chunks_exact_mut(size).skip(n + 1).zip(&self.b) {
            column[..n].copy_from_slice(b);
        }
        for (i, c) in self.c.iter().enumerate() {
            for (column, value) in square.chunks_exact_mut(size).zip(c) {
                column[n + i] = *value;
            }
        }
        self.lu.factor().ok()?;
        let solve = |i: usize| {
            let mut solution = vec![0.0; size];
            solution[n + i] = 1.0;
            self.lu.solve(&mut solution);
            solution
        };
        Some((0..self.c.len()).map(solve).collect())
    }
}

/// R_z by columns `stride` apart, that of ζ first, from R_x and R_λ.
fn by_z(matrix: &[f64], n: usize, scale: f64, out: &mut [f64], stride: usize) {
    let columns = matrix.chunks_exact(n + 1);
    for (to, from) in out.chunks_mut(stride).zip(columns.clone().skip(n).chain(columns)).take(n + 1) {
        to[..n].copy_from_slice(&from[..n]);
    }
    out[..n].iter_mut().for_each(|value| *value *= scale);
}

/// Makes the vectors orthonormal (Gram and Schmidt).
fn orthonormalise(vectors: &mut [Vec<f64>]) {
    for i in 0..vectors.len() {
        let (done, rest) = vectors.split_at_mut(i);
        for other in done {
            let along = dot(other, &rest[0]);
            rest[0].iter_mut().zip(other.iter()).for_each(|(value, other)| *value -= along * other);
        }
        normalise(&mut rest[0]);
    }
}

impl<O: Oscillator + Clone> Crossing<O> {
    fn near(
        response: &ForcedResponse<O>,
        settings: &ContinuationSettings,
        guess: &Point,
        condition: Condition,
        border: Border,
    ) -> Crossing<O> {
        Crossing {
            response: response.clone(),
            condition,
            border,
            lambda_origin: guess.lambda,
            lambda_scale: lambda_scale(settings, guess),
            step: DIFFERENCE * settings.size(&guess.x),
            residual: Vec::new(),
            matrix: Vec::new(),
        }
    }

    /// Newton's method from `guess`.
    fn solve(mut self, settings: &ContinuationSettings, guess: &Point) -> Result<(Point, Work), AnalysisError> {
        let mut start = vec![0.0; self.dimension()];
        let x = 1..=guess.x.len();
        start[x.clone()].copy_from_slice(&guess.x);
        let continuation = Continuation::start(&mut self, *settings, &start, 0.0, 1.0)
            .map_err(|_| not_located(&self.response, [guess, guess]))?;
        let found = &continuation.point().x;
        Ok((Point { x: found[x].to_vec(), lambda: self.lambda(found[0]), ..guess.clone() }, continuation.work()))
    }
}

impl<O: Oscillator> Crossing<O> {
    /// The number of conditions, which is that of the null vectors of R_z.
    fn conditions(&self) -> usize {
        self.border.c.len()
    }

    fn lambda(&self, zeta: f64) -> f64 {
        self.lambda_origin + self.lambda_scale * zeta
    }

    /// ψ, or g, at (ζ, X), and the result of [`Border::solve`]; R and its derivatives are stored in `self`. None if the
    /// system does not exist there, or a matrix has no inverse.
    fn condition(&mut self, z: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let (lambda, x) = (self.lambda(z[0]), &z[1..]);
        if !evaluate(&mut self.response, lambda, x, &mut self.residual, &mut self.matrix) {
            return None;
        }
        let solutions = self.border.solve(&self.matrix, x.len(), self.lambda_scale)?;
        let values = match &mut self.condition {
            Condition::NeimarkSacker(floquet) => {
                vec![floquet.stability(self.response.balance(), x).neimark_sacker_test()]
            }
            Condition::BranchPoint => solutions.iter().map(|solution| solution[z.len()]).collect(),
        };
        Some((values, solutions))
    }

    /// The derivative of ψ, or g, along a direction of (ζ, X).
    fn slope(&mut self, z: &[f64], direction: &[f64]) -> Option<Vec<f64>> {
        let step = self.step;
        let mut at = |step: f64| {
            let shifted: Vec<f64> = z.iter().zip(direction).map(|(z, d)| z + step * d).collect();
            self.condition(&shifted)
        };
        let ((above, _), (below, _)) = (at(step)?, at(-step)?);
        Some(above.iter().zip(below).map(|(above, below)| (above - below) / (2.0 * step)).collect())
    }
}

impl<O: Oscillator> System for Crossing<O> {
    fn dimension(&self) -> usize {
        self.response.dimension() + self.conditions()
    }

    fn evaluate(&mut self, unknowns: &[f64], _mu: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
        let (n, count) = (self.response.dimension(), self.conditions());
        let stride = n + count + 1;
        let (z, betas) = unknowns.split_at(n + 1);
        let Some((values, mut directions)) = self.condition(z) else { return false };
        residual[..n].copy_from_slice(&self.residual);
        residual[n..].copy_from_slice(&values);
        matrix.fill(0.0);
        by_z(&self.matrix, n, self.lambda_scale, matrix, stride);
        let columns = matrix.chunks_exact_mut(stride).skip(n + 1);
        for ((column, b), beta) in columns.zip(&self.border.b).zip(betas) {
            column[..n].copy_from_slice(b);
            residual.iter_mut().zip(b).for_each(|(residual, b)| *residual += beta * b);
        }
        directions.iter_mut().for_each(|direction| direction.truncate(n + 1));
        orthonormalise(&mut directions);
        for direction in &directions {
            let Some(slopes) = self.slope(z, direction) else { return false };
            for (column, along) in matrix.chunks_exact_mut(stride).zip(direction) {
                column[n..].iter_mut().zip(&slopes).for_each(|(entry, slope)| *entry += slope * along);
            }
        }
        residual.iter().all(|value| value.is_finite())
    }
}
