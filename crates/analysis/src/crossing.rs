//! Branch points, where two branches of a structure's periodic responses cross, by an extended system (Govaerts,
//! "Numerical Methods for Bifurcations of Dynamical Equilibria", SIAM 2000, Ch. 8).
//!
//! Let z = (λ, X) and A = [R_λ R_X], n rows and n + 1 columns. On a branch A has the rank n and its null vector is the
//! tangent; at a simple branch point the rank is n − 1. With b near the null vector of Aᵀ and the rows c₁, c₂ near those
//! of A, the matrix of
//! ```text
//! ⎡ A   b ⎤ ⎡φⱼ⎤   ⎡ 0  ⎤        ⎡ Aᵀ  c₁ c₂ ⎤ ⎡ψ⎤   ⎡0⎤
//! ⎢ c₁ᵀ 0 ⎥ ⎢  ⎥ = ⎢    ⎥        ⎢           ⎥ ⎢g₁⎥ = ⎢ ⎥
//! ⎣ c₂ᵀ 0 ⎦ ⎣gⱼ⎦   ⎣ eⱼ ⎦        ⎣ bᵀ  0  0  ⎦ ⎣g₂⎦   ⎣1⎦
//! ```
//!
//! has an inverse, g₁ and g₂ are zero if and only if A lacks a rank, and dgⱼ = −ψᵀ dA φⱼ. The n + 2 unknowns are λ, β and
//! X, the equations R + β b = 0 and g₁ = g₂ = 0. They are regular at a simple branch point, where Newton's method on R
//! alone fails: it then converges quadratically. β is zero at the solution if the branches cross; where they only pass
//! close by it is not.
//!
//! The derivatives are differences of A along φⱼ, as for [`super::singular`]. They also give the quadratic form of the
//! branches: along φ = α φ₁ + γ φ₂ the equations are solved to second order if
//!
//! ```text
//! c₁₁ α² + 2 c₁₂ αγ + c₂₂ γ² = 0,     cⱼₖ = ψᵀ (dA φⱼ) φₖ,
//! ```
//!
//! whose two solutions are the tangents of the two branches.

use alloc::vec;
use alloc::vec::Vec;

use super::balance::Balance;
use super::singular::{DIFFERENCE, MORE_HARMONICS, NULL_VECTOR_ERROR};
use crate::continuation::{Continuation, ContinuationSettings, System};
use crate::dense::{Lu, dot, norm, normalise};
use crate::error::AnalysisError;
use crate::forced::Coordinate;

/// Branches that pass each other within this, β relative to the size of the response, count as crossing: it is rounding
/// where a symmetry makes them cross, and leaves branches apart by its square root.
const IMPERFECTION: f64 = 1e-9;
/// A branch whose tangent has a smaller component by λ, of unit length, turns back there.
const TURNS_BACK: f64 = 1e-4;

/// The equations of a branch point: unknowns (λ, β, X), with λ shifted and scaled.
#[derive(Clone, Debug)]
pub(super) struct CrossingEquations {
    balance: Balance,
    lambda: Coordinate,
    /// λ = origin + scale · z₀.
    lambda_origin: f64,
    lambda_scale: f64,
    settings: ContinuationSettings,
    /// b, and c₁ and c₂ over (λ, X).
    column: Vec<f64>,
    rows: [Vec<f64>; 2],
    /// φ₁ and φ₂ over (λ, X), and ψ.
    kernel: [Vec<f64>; 2],
    psi: Vec<f64>,
    /// The coefficients cⱼₖ of the quadratic form.
    form: [[f64; 2]; 2],
    bordered: Lu,
    residual: Vec<f64>,
    /// [R_X R_λ]: at z, and at z + h φ and z − h φ.
    matrices: [Vec<f64>; 3],
}

/// A branch point, with the directions in which branches leave it.
#[derive(Clone, Debug)]
pub(super) struct Crossing {
    /// The value of the coordinate at the branch point.
    pub lambda: f64,
    /// The unknowns of the response at the branch point.
    pub x: Vec<f64>,
    /// The tangents of the two branches: dX, and last dλ.
    pub tangents: [Vec<f64>; 2],
    /// The scale of dλ: X/Λ.
    sigma: f64,
}

impl Crossing {
    /// Returns the number of the branch whose tangent is nearer to a direction: dX, and last dλ.
    pub fn along(&self, direction: &[f64]) -> usize {
        let scaled = |of: &[f64]| {
            let mut of = of.to_vec();
            if let Some(lambda) = of.last_mut() {
                *lambda *= self.sigma;
            }
            of
        };
        let direction = scaled(direction);
        let [first, second] = self.tangents.each_ref().map(|tangent| {
            let tangent = scaled(tangent);
            dot(&tangent, &direction).abs() / norm(&tangent)
        });
        usize::from(second > first)
    }

    /// Says whether a branch turns back in λ here, as the arm of a pitchfork does: a symmetry of the other branch then
    /// maps its two sides to each other.
    pub fn turns_back(&self, branch: usize) -> bool {
        let Some((lambda, x)) = self.tangents[branch].split_last() else { return false };
        let lambda = lambda * self.sigma;
        lambda.abs() < TURNS_BACK * libm::sqrt(dot(x, x) + lambda * lambda)
    }
}

/// Solves for the branch point near the response `x` of a balance whose coordinates are set, on a branch in the
/// direction dX and, last, dλ: for a smooth structure with as many harmonics as the null vectors need. `None` if
/// branches pass close by without equations.
///
/// # Errors
/// [`AnalysisError::Singular`], [`AnalysisError::NoSolution`] if Newton's method finds no solution near, or if the null
/// vectors need too many harmonics [`AnalysisError::TooManyHarmonics`].
pub(super) fn crossing(
    balance: &Balance,
    settings: &ContinuationSettings,
    x: &[f64],
    direction: &[f64],
) -> Result<Option<Crossing>, AnalysisError> {
    let mut equations = CrossingEquations::near(balance, settings, x, direction)?;
    let mut start = vec![0.0; 2];
    start.extend_from_slice(x);
    let mut continuation = Continuation::start(&mut equations, *settings, &start, 0.0, 1.0)?;
    for _ in 0..MORE_HARMONICS.1 {
        let z = continuation.point().x.clone();
        equations.linearise(&z);
        let smooth = equations.balance.forced.assembly().is_smooth();
        if !smooth || equations.null_vector_error() < NULL_VECTOR_ERROR {
            return Ok(equations.branch_point(&z));
        }
        let harmonics = equations.balance.harmonics() + MORE_HARMONICS.0;
        equations.set_harmonics(harmonics);
        continuation.resize(&mut equations)?;
    }
    let harmonics = equations.balance.harmonics();
    Err(AnalysisError::TooManyHarmonics { at: balance.place(equations.lambda_origin), harmonics })
}

impl CrossingEquations {
    /// The equations near a response.
    fn near(
        balance: &Balance,
        settings: &ContinuationSettings,
        x: &[f64],
        direction: &[f64],
    ) -> Result<CrossingEquations, AnalysisError> {
        let lambda_origin = balance.value(balance.coordinate);
        // A change of λ by Λ is one of z₀ by X, the size of the response.
        let lambda_scale = settings.lambda_scale(lambda_origin) / settings.size(x);
        let mut crossing = CrossingEquations {
            balance: balance.clone(),
            lambda: balance.coordinate,
            lambda_origin,
            lambda_scale,
            settings: *settings,
            column: vec![],
            rows: Default::default(),
            kernel: Default::default(),
            psi: vec![],
            form: Default::default(),
            bordered: Lu::default(),
            residual: vec![],
            matrices: Default::default(),
        };
        crossing.differentiate(x, 0);
        // The tangent is one null vector of A nearly, and the rows of A and the tangent together have another.
        let n = x.len();
        let mut tangent = vec![direction[n] / lambda_scale];
        tangent.extend_from_slice(&direction[..n]);
        normalise(&mut tangent);
        let matrix = crossing.bordered.zeroed(n + 1);
        crossing.matrices[0].chunks_exact(n).zip(1..).for_each(|(from, to)| {
            // The balance has λ as the last column, the equations here as the first.
            let to = if to > n { 0 } else { to };
            matrix[to * (n + 1)..][..n].copy_from_slice(from);
        });
        for (column, t) in matrix.chunks_exact_mut(n + 1).zip(&tangent) {
            column[n] = *t;
        }
        crossing.bordered.factor()?;
        let [right, mut left] = crossing.bordered.null_vectors();
        left.truncate(n);
        crossing.column = left;
        crossing.rows = [tangent, right];
        Ok(crossing)
    }

    /// Computes [R_X R_λ], with λ scaled, and R; λ is that of the balance.
    fn differentiate(&mut self, x: &[f64], which: usize) {
        let n = x.len();
        self.residual.resize(n, 0.0);
        self.matrices[which].resize(n * (n + 1), 0.0);
        let matrix = &mut self.matrices[which];
        self.balance.derivatives(x, &[self.lambda], &mut self.residual, matrix, n);
        matrix[n * n..].iter_mut().for_each(|by_lambda| *by_lambda *= self.lambda_scale);
    }

    /// Sets λ and returns whether such a structure exists.
    #[must_use]
    fn set(&mut self, z: f64) -> bool {
        self.balance.set(self.lambda, self.lambda_origin + z * self.lambda_scale)
    }

    /// Computes g₁ and g₂ with φ and ψ; not numbers if the bordered matrix has no inverse.
    fn border(&mut self) -> [f64; 2] {
        let n = self.column.len();
        let stride = n + 2;
        let matrix = self.bordered.zeroed(stride);
        let (by_x, by_lambda) = self.matrices[0].split_at(n * n);
        let columns = [by_lambda].into_iter().chain(by_x.chunks_exact(n)).chain([&self.column[..]]);
        for (to, from) in matrix.chunks_exact_mut(stride).zip(columns) {
            to[..n].copy_from_slice(from);
        }
        for ((to, first), second) in matrix.chunks_exact_mut(stride).zip(&self.rows[0]).zip(&self.rows[1]) {
            to[n] = *first;
            to[n + 1] = *second;
        }
        if self.bordered.factor().is_err() {
            return [f64::NAN; 2];
        }
        let bordered = &self.bordered;
        let g = [0, 1].map(|j| {
            let kernel = &mut self.kernel[j];
            kernel.clear();
            kernel.resize(stride, 0.0);
            kernel[n + j] = 1.0;
            bordered.solve(kernel);
            kernel.pop().unwrap_or(f64::NAN)
        });
        self.psi.clear();
        self.psi.resize(stride, 0.0);
        self.psi[n + 1] = 1.0;
        bordered.solve_transposed(&mut self.psi);
        self.psi.truncate(n);
        g
    }

    /// Returns −∂gⱼ over (λ, X), which is ψᵀ dA φⱼ, at the response last differentiated; `None` if a structure beside it
    /// does not exist.
    fn along(&mut self, z: &[f64], j: usize) -> Option<Vec<f64>> {
        let lambda = z[0];
        let x = &z[2..];
        let n = x.len();
        let phi = self.kernel[j].clone();
        let step = DIFFERENCE * self.settings.size(x) / norm(&phi);
        let residual = self.residual.clone();
        let mut exists = true;
        for (which, h) in [(1, step), (2, -step)] {
            exists &= self.set(lambda + h * phi[0]);
            let moved: Vec<f64> = x.iter().zip(&phi[1..]).map(|(x, v)| x + h * v).collect();
            self.differentiate(&moved, which);
        }
        // The differences have overwritten R of the response itself.
        self.residual = residual;
        exists &= self.set(lambda);
        let [_, above, below] = &self.matrices;
        let along = |(above, below): (&[f64], &[f64])| -> f64 {
            let rows = above.iter().zip(below).zip(&self.psi);
            rows.map(|((above, below), psi)| psi * (above - below)).sum::<f64>() / (2.0 * step)
        };
        let mut by: Vec<f64> = above.chunks_exact(n).zip(below.chunks_exact(n)).map(along).collect();
        // λ is the first of the unknowns, and the last column of the matrix.
        by.rotate_right(1);
        exists.then_some(by)
    }

    /// Computes g₁, g₂, their derivatives and the quadratic form at the unknowns; `None` if there is no such structure.
    fn linearise(&mut self, z: &[f64]) -> Option<([f64; 2], [Vec<f64>; 2])> {
        if !self.set(z[0]) {
            return None;
        }
        self.differentiate(&z[2..], 0);
        let g = self.border();
        let by = [self.along(z, 0)?, self.along(z, 1)?];
        self.form = by.each_ref().map(|by| self.kernel.each_ref().map(|phi| dot(by, phi)));
        Some((g, by))
    }

    /// Changes the number of harmonics.
    fn set_harmonics(&mut self, harmonics: usize) {
        self.balance.set_harmonics(harmonics);
        let n = self.balance.dimension();
        self.column.resize(n, 0.0);
        self.rows.iter_mut().for_each(|row| row.resize(n + 1, 0.0));
    }

    /// Returns the larger distance of a null vector from one that includes the harmonics left out, relative to its size.
    fn null_vector_error(&mut self) -> f64 {
        let errors = self.kernel.each_ref().map(|phi| self.balance.variation_error(&phi[1..]) / norm(phi));
        errors[0].max(errors[1])
    }

    /// Returns the branch point at the solution last linearised, if branches cross there.
    fn branch_point(&self, z: &[f64]) -> Option<Crossing> {
        let [[a, b], [_, c]] = self.form;
        let discriminant = b * b - a * c;
        // Without two real tangents the point is one by itself, on no branch.
        if !(z[1].abs() <= IMPERFECTION * self.settings.size(&z[2..]) && discriminant > 0.0) {
            return None;
        }
        // The larger root is free of cancellation: α/γ = q/a, and with the product c/a the other is c/q.
        let q = -(b + libm::copysign(libm::sqrt(discriminant), b));
        let tangents = [[q, a], [c, q]].map(|[alpha, gamma]| {
            let mut along: Vec<f64> = self.kernel[0]
                .iter()
                .zip(&self.kernel[1])
                .map(|(first, second)| alpha * first + gamma * second)
                .collect();
            normalise(&mut along);
            along[0] *= self.lambda_scale;
            along.rotate_left(1);
            along
        });
        let lambda = self.lambda_origin + z[0] * self.lambda_scale;
        Some(Crossing { lambda, x: z[2..].to_vec(), tangents, sigma: 1.0 / self.lambda_scale })
    }
}

impl System for CrossingEquations {
    fn dimension(&self) -> usize {
        self.balance.dimension() + 2
    }

    fn evaluate(&mut self, z: &[f64], _parameter: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
        let n = z.len() - 2;
        let stride = z.len() + 1;
        let Some((g, by)) = self.linearise(z) else { return false };
        let here = &self.matrices[0];
        matrix[..n].copy_from_slice(&here[n * n..]);
        matrix[stride..][..n].copy_from_slice(&self.column);
        for (to, from) in matrix[2 * stride..].chunks_mut(stride).zip(here[..n * n].chunks_exact(n)) {
            to[..n].copy_from_slice(from);
        }
        // No parameter: its column is zero.
        matrix[(n + 2) * stride..][..n + 2].fill(0.0);
        let beta = z[1];
        for (out, (row, b)) in residual.iter_mut().zip(self.residual.iter().zip(&self.column)) {
            *out = row + beta * b;
        }
        for (j, by) in by.iter().enumerate() {
            residual[n + j] = g[j];
            matrix[n + j] = -by[0];
            matrix[stride + n + j] = 0.0;
            by[1..].iter().zip(2..).for_each(|(by, column)| matrix[column * stride + n + j] = -by);
        }
        g.iter().all(|g| g.is_finite())
    }
}
