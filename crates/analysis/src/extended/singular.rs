//! Folds and period doublings by an extended system (Govaerts, "Numerical Methods for Bifurcations of Dynamical
//! Equilibria", SIAM 2000, Ch. 3: minimally augmented systems).
//!
//! With the matrix A(X, λ), which is R_x for a fold and Hill's matrix of half-odd frequencies for a period doubling,
//! the scalar g of the bordered systems
//!
//! ```text
//! ⎡ A   b ⎤ ⎡v⎤   ⎡0⎤        ⎡ Aᵀ  c ⎤ ⎡w⎤   ⎡0⎤
//! ⎢       ⎥ ⎢ ⎥ = ⎢ ⎥        ⎢       ⎥ ⎢ ⎥ = ⎢ ⎥
//! ⎣ cᵀ  0 ⎦ ⎣g⎦   ⎣1⎦        ⎣ bᵀ  0 ⎦ ⎣g⎦   ⎣1⎦
//! ```
//!
//! is zero if and only if A is singular, and dg = −wᵀ dA v. The unknowns are X and λ, the equations R = 0 and g = 0:
//! the point is regular in them, so Newton's method converges quadratically, and a second coordinate μ makes a curve of
//! them. b and c are the latest w and v, which keeps the bordered matrix well conditioned; the zeros of g don't depend
//! on them.

use alloc::vec;
use alloc::vec::Vec;

use crate::adapt::Spectral;
use crate::continuation::System;
use crate::dense::{Lu, normalise};
use crate::fourier::Harmonics;
use crate::harmonic_balance::{FormGradient, Forms};
use crate::{AnalysisError, Coordinate, HarmonicBalance, Oscillator};

/// The matrix that is singular.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Singularity {
    /// R_x: a multiplier 1, where the branch turns back in λ.
    Fold,
    /// Hill's matrix of half-odd frequencies: a multiplier −1.
    PeriodDoubling,
}

impl Singularity {
    /// The frequencies of the null vector where the motion has H harmonics.
    fn harmonics(self, harmonics: usize) -> Harmonics {
        match self {
            Singularity::Fold => Harmonics::Integer(harmonics),
            Singularity::PeriodDoubling => Harmonics::HalfOdd(harmonics + 1),
        }
    }
}

/// The equations of a singular motion: unknowns z = (λ, X), with λ shifted and scaled, and a second coordinate μ to
/// continue in.
#[derive(Clone, Debug)]
pub struct SingularResponse<O: Oscillator> {
    balance: HarmonicBalance<O>,
    kind: Singularity,
    lambda: Coordinate<O::Parameter>,
    /// λ = origin + scale · z₀.
    lambda_origin: f64,
    lambda_scale: f64,
    mu: Option<Coordinate<O::Parameter>>,
    forms: Forms,
    gradient: FormGradient,
    bordered: Lu,
}

impl<O: Oscillator> SingularResponse<O> {
    /// The equations near the motion `x` of the balance, whose matrix is nearly singular. λ is measured in
    /// `lambda_scale`. Without a coordinate μ they have one solution, at any value of μ.
    ///
    /// # Errors
    /// [`AnalysisError::Singular`] if the matrix has no inverse at all there: start slightly beside the point.
    pub fn near(
        mut balance: HarmonicBalance<O>,
        kind: Singularity,
        lambda: Coordinate<O::Parameter>,
        mu: Option<Coordinate<O::Parameter>>,
        lambda_scale: f64,
        x: &[f64],
    ) -> Result<SingularResponse<O>, AnalysisError> {
        let harmonics = kind.harmonics(balance.harmonics());
        let size = 2 * harmonics.rows();
        balance.linearise(x);
        let mut lu = Lu::default();
        balance.jacobian(harmonics, lu.zeroed(size), size);
        lu.factor()?;
        let [v, w] = lu.null_vectors();
        let forms = Forms { harmonics, v, w };
        let lambda_origin = balance.coordinate(lambda);
        let gradient = FormGradient::default();
        Ok(SingularResponse { balance, kind, lambda, lambda_origin, lambda_scale, mu, forms, gradient, bordered: lu })
    }

    /// The matrix that is singular.
    pub fn kind(&self) -> Singularity {
        self.kind
    }

    /// The balance.
    pub fn balance(&self) -> &HarmonicBalance<O> {
        &self.balance
    }

    /// λ in its unit, and X, of a solution z.
    pub fn split<'a>(&self, z: &'a [f64]) -> (f64, &'a [f64]) {
        (self.lambda_origin + z[0] * self.lambda_scale, &z[1..])
    }

    /// The z of λ and X.
    pub fn join(&self, lambda: f64, x: &[f64]) -> Vec<f64> {
        let mut z = vec![(lambda - self.lambda_origin) / self.lambda_scale];
        z.extend_from_slice(x);
        z
    }

    /// How far the null vector is from one that includes the frequencies left out, relative to its size. The error of λ
    /// is of the order of its square.
    pub fn null_vector_error(&self) -> f64 {
        self.balance.variation_error(&self.forms)
    }

    /// The null vector v: the direction of the fold, or the first motion of doubled period, as a series of frequencies
    /// ½, 1½ ….
    pub fn null_vector(&self) -> &[f64] {
        &self.forms.v
    }

    /// g, with v and w of this motion in `forms`; NaN if the bordered matrix has no inverse.
    fn border(&mut self) -> f64 {
        let m = self.forms.v.len();
        let matrix = self.bordered.zeroed(m + 1);
        self.balance.jacobian(self.forms.harmonics, matrix, m + 1);
        matrix[m * (m + 1)..m * (m + 1) + m].copy_from_slice(&self.forms.w);
        for (column, c) in matrix.chunks_exact_mut(m + 1).zip(&self.forms.v) {
            column[m] = *c;
        }
        if self.bordered.factor().is_err() {
            return f64::NAN;
        }
        let solve = |solve: &dyn Fn(&mut [f64]), vector: &mut Vec<f64>| {
            vector.fill(0.0);
            vector.push(1.0);
            solve(vector);
            vector.pop().unwrap_or(f64::NAN)
        };
        let g = solve(&|b| self.bordered.solve(b), &mut self.forms.v);
        solve(&|b| self.bordered.solve_transposed(b), &mut self.forms.w);
        g
    }
}

impl<O: Oscillator> System for SingularResponse<O> {
    fn dimension(&self) -> usize {
        self.balance.dimension() + 1
    }

    fn evaluate(&mut self, z: &[f64], mu: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
        let (n, stride) = (self.balance.dimension(), self.balance.dimension() + 2);
        let (lambda, x) = self.split(z);
        let valid = self.mu.is_none_or(|coordinate| self.balance.set_coordinate(coordinate, mu));
        if !(valid && self.balance.set_coordinate(self.lambda, lambda)) {
            return false;
        }
        self.balance.linearise(x);
        self.balance.residual(residual);
        self.balance.by_coordinate(self.lambda, matrix);
        self.balance.jacobian(Harmonics::Integer(self.balance.harmonics()), &mut matrix[stride..], stride);
        let last = &mut matrix[(n + 1) * stride..];
        match self.mu {
            Some(mu) => self.balance.by_coordinate(mu, last),
            None => last.fill(0.0),
        }
        residual[n] = self.border();
        let coordinates = [self.lambda, self.mu.unwrap_or(self.lambda)];
        let [by_lambda, by_mu] = self.gradient.compute(&mut self.balance, x, &self.forms, coordinates);
        for (column, value) in core::iter::once(&by_lambda).chain(&self.gradient.by_x).enumerate() {
            matrix[column * stride + n] = -value;
        }
        matrix[(n + 1) * stride + n] = if self.mu.is_some() { -by_mu } else { 0.0 };
        matrix[..n + 1].iter_mut().for_each(|value| *value *= self.lambda_scale);
        normalise(&mut self.forms.v);
        normalise(&mut self.forms.w);
        residual[n].is_finite()
    }

    fn unit(&self) -> &'static str {
        self.mu.map_or("", |mu| self.balance.unit(mu))
    }
}

impl<O: Oscillator> Spectral for SingularResponse<O> {
    type Oscillator = O;

    fn balance_mut(&mut self) -> &mut HarmonicBalance<O> {
        &mut self.balance
    }

    fn others(&self) -> usize {
        1
    }

    fn set_harmonics(&mut self, harmonics: usize) {
        self.balance.set_harmonics(harmonics);
        self.forms.harmonics = self.kind.harmonics(harmonics);
        let size = 2 * self.forms.harmonics.rows();
        self.forms.v.resize(size, 0.0);
        self.forms.w.resize(size, 0.0);
    }
}
