//! Neimark–Sacker and branch points by their own extended systems, for Newton's method. With z = (λ, X) and R_z = (R_λ, R_x):
//!
//! - Neimark–Sacker point (Kuznetsov, "Elements of Applied Bifurcation Theory", Sec. 10.2): R(z) = 0 and ψ(z) = 0, where
//!   ψ = det(Φ ⊙ Φ − I) = Π (μᵢμⱼ − 1), i < j, is that of the bialternate product of the monodromy matrix Φ.
//! - Branch point (Griewank & Reddien, "Characterization and Computation of Generalized Turning Points", SIAM J. Numer. Anal. 21
//!   (1984)): R_z has lost a rank. With one more unknown β, which is zero at the solution, R(z) + β b = 0 and g₁(z) = g₂(z) = 0
//!   of the bordered system
//!
//! ```text
//! ⎡ R_z  b ⎤ ⎡V ⎤   ⎡0⎤
//! ⎢        ⎥ ⎢  ⎥ = ⎢ ⎥        V of two columns, g of two elements, I the identity of order 2
//! ⎣ Cᵀ   0 ⎦ ⎣gᵀ⎦   ⎣I⎦
//! ```
//!
//! b is near the left null vector of R_z and C near its right null vectors, which keeps the bordered matrix well conditioned; the
//! zeros of g don't depend on them. Both systems are regular at the point, where continuation is not. The derivatives of ψ and g
//! are central differences: such points are few.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::continuation::{Point, Settings, System, Walk, Work};
use super::dense::{Lu, norm};
use super::locate::not_located;
use super::{AnalysisError, Floquet, ForcedResponse, Oscillator};

/// Steps of differences, relative to X: small against the width of a resonance, large against the rounding of multipliers.
const DIFFERENCE: f64 = 1e-6;
/// Inverse iterations for the null vectors.
const INVERSE_ITERATIONS: usize = 3;

/// What holds at the point besides R = 0.
enum Condition {
    /// ψ = 0.
    NeimarkSacker(Box<Floquet>),
    /// g = 0.
    BranchPoint(Border),
}

/// b, C and the bordered matrix.
struct Border {
    b: Vec<f64>,
    c: [Vec<f64>; 2],
    lu: Lu,
}

/// The equations; unknowns are ζ, then β for a branch point, then X, with λ = origin + scale · ζ.
struct Augmented<O: Oscillator> {
    response: ForcedResponse<O>,
    condition: Condition,
    lambda_origin: f64,
    lambda_scale: f64,
    /// The step of differences.
    step: f64,
    /// R, and R_x and R_λ as [`System::evaluate`] has them.
    residual: Vec<f64>,
    matrix: Vec<f64>,
}

/// The Neimark–Sacker point near `guess`.
pub(super) fn neimark_sacker<O: Oscillator + Clone>(
    response: &ForcedResponse<O>,
    settings: &Settings,
    guess: &Point,
) -> Result<(Point, Work), AnalysisError> {
    let condition = Condition::NeimarkSacker(Box::default());
    Augmented::near(response, settings, guess, condition).solve(settings, guess)
}

/// The branch point near `guess`.
pub(super) fn branch_point<O: Oscillator + Clone>(
    response: &ForcedResponse<O>,
    settings: &Settings,
    guess: &Point,
) -> Result<(Point, Work), AnalysisError> {
    let mut response = response.clone();
    let border = Border::near(&mut response, settings, guess)?;
    Augmented::near(&response, settings, guess, Condition::BranchPoint(border)).solve(settings, guess)
}

/// Λ/X: λ is measured in it, so that it counts as it does along a walk.
fn lambda_scale(settings: &Settings, guess: &Point) -> f64 {
    settings.lambda_scale(guess.lambda) / settings.size(&guess.x)
}

/// R and its derivatives at a point; whether there is such a system.
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
        settings: &Settings,
        guess: &Point,
    ) -> Result<Border, AnalysisError> {
        let n = response.dimension();
        let (mut residual, mut matrix) = (Vec::new(), Vec::new());
        if !evaluate(response, guess.lambda, &guess.x, &mut residual, &mut matrix) {
            return Err(not_located(response, [guess, guess]));
        }
        let tangent: Vec<f64> = core::iter::once(guess.tangent[n]).chain(guess.tangent[..n].iter().copied()).collect();
        let mut lu = Lu::default();
        let square = lu.zeroed(n + 1);
        by_z(&matrix, n, lambda_scale(settings, guess), square, n + 1);
        for (column, t) in square.chunks_exact_mut(n + 1).zip(&tangent) {
            column[n] = *t;
        }
        lu.factor()?;
        let iterate = |solve: &dyn Fn(&mut [f64])| {
            let mut vector: Vec<f64> = (0..=n).map(|i| 1.0 / (1 + i) as f64).collect();
            for _ in 0..INVERSE_ITERATIONS {
                solve(&mut vector);
                normalise(&mut vector);
            }
            vector
        };
        let other = iterate(&|v| lu.solve(v));
        let mut b = iterate(&|v| lu.solve_transposed(v));
        b.truncate(n);
        Ok(Border { b, c: [tangent, other], lu })
    }

    /// g, from R_x and R_λ.
    fn g(&mut self, matrix: &[f64], scale: f64) -> Option<[f64; 2]> {
        let n = self.b.len();
        let square = self.lu.zeroed(n + 2);
        by_z(matrix, n, scale, square, n + 2);
        square[(n + 1) * (n + 2)..(n + 1) * (n + 2) + n].copy_from_slice(&self.b);
        for (i, c) in self.c.iter().enumerate() {
            for (column, value) in square.chunks_exact_mut(n + 2).zip(c) {
                column[n + i] = *value;
            }
        }
        self.lu.factor().ok()?;
        let mut solution = vec![0.0; n + 2];
        Some([0, 1].map(|i| {
            solution.fill(0.0);
            solution[n + i] = 1.0;
            self.lu.solve(&mut solution);
            solution[n + 1]
        }))
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

fn normalise(vector: &mut [f64]) {
    let length = norm(vector);
    vector.iter_mut().for_each(|value| *value /= length);
}

impl<O: Oscillator + Clone> Augmented<O> {
    fn near(response: &ForcedResponse<O>, settings: &Settings, guess: &Point, condition: Condition) -> Augmented<O> {
        Augmented {
            response: response.clone(),
            condition,
            lambda_origin: guess.lambda,
            lambda_scale: lambda_scale(settings, guess),
            step: DIFFERENCE * settings.size(&guess.x),
            residual: Vec::new(),
            matrix: Vec::new(),
        }
    }

    /// Newton's method from `guess`.
    fn solve(mut self, settings: &Settings, guess: &Point) -> Result<(Point, Work), AnalysisError> {
        let mut start = vec![0.0; self.conditions()];
        start.extend_from_slice(&guess.x);
        let walk = Walk::start(&mut self, *settings, &start, 0.0, 1.0)
            .map_err(|_| not_located(&self.response, [guess, guess]))?;
        let z = &walk.point().x;
        let x = z[self.conditions()..].to_vec();
        Ok((Point { x, lambda: self.lambda(z[0]), ..guess.clone() }, walk.work()))
    }
}

impl<O: Oscillator> Augmented<O> {
    /// The number of conditions, and of unknowns before X.
    fn conditions(&self) -> usize {
        match self.condition {
            Condition::NeimarkSacker(_) => 1,
            Condition::BranchPoint(_) => 2,
        }
    }

    fn lambda(&self, zeta: f64) -> f64 {
        self.lambda_origin + self.lambda_scale * zeta
    }

    /// ψ, or g; R and its derivatives are left in `self`. None where there is no such system, or a matrix has no inverse.
    fn condition(&mut self, zeta: f64, x: &[f64]) -> Option<[f64; 2]> {
        let lambda = self.lambda(zeta);
        if !evaluate(&mut self.response, lambda, x, &mut self.residual, &mut self.matrix) {
            return None;
        }
        match &mut self.condition {
            Condition::NeimarkSacker(floquet) => {
                Some([floquet.stability(self.response.balance(), x).neimark_sacker_test(), 0.0])
            }
            Condition::BranchPoint(border) => border.g(&self.matrix, self.lambda_scale),
        }
    }

    /// The derivatives of the conditions by ζ (`index` 0) or an element of X.
    fn slope(&mut self, zeta: f64, x: &mut [f64], index: usize) -> Option<[f64; 2]> {
        let step = self.step;
        let mut at = |shift: f64| {
            if index == 0 {
                return self.condition(zeta + shift, x);
            }
            let before = x[index - 1];
            x[index - 1] += shift;
            let value = self.condition(zeta, x);
            x[index - 1] = before;
            value
        };
        let (above, below) = (at(step)?, at(-step)?);
        Some([0, 1].map(|i| (above[i] - below[i]) / (2.0 * step)))
    }
}

impl<O: Oscillator> System for Augmented<O> {
    fn dimension(&self) -> usize {
        self.response.dimension() + self.conditions()
    }

    fn evaluate(&mut self, z: &[f64], _mu: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
        let (n, count) = (self.response.dimension(), self.conditions());
        let stride = n + count + 1;
        let mut x = z[count..].to_vec();
        for column in 0..=n {
            let Some(slope) = self.slope(z[0], &mut x, column) else { return false };
            let place = if column == 0 { 0 } else { count - 1 + column };
            matrix[place * stride + n..][..count].copy_from_slice(&slope[..count]);
        }
        let Some(value) = self.condition(z[0], &x) else { return false };
        residual[..n].copy_from_slice(&self.residual);
        residual[n..].copy_from_slice(&value[..count]);
        let columns = self.matrix.chunks_exact(n + 1);
        for (place, from) in core::iter::once(0).chain(count..).zip(columns.clone().skip(n).chain(columns)).take(n + 1)
        {
            matrix[place * stride..][..n].copy_from_slice(&from[..n]);
        }
        matrix[..n].iter_mut().for_each(|value| *value *= self.lambda_scale);
        if let Condition::BranchPoint(border) = &self.condition {
            for (i, b) in border.b.iter().enumerate() {
                residual[i] += z[1] * b;
                matrix[stride + i] = *b;
            }
        }
        matrix[(n + count) * stride..].fill(0.0);
        residual.iter().all(|value| value.is_finite())
    }
}
