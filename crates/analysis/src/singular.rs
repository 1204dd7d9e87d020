//! Folds and period doublings of a structure's periodic responses by an extended system (Govaerts, "Numerical Methods
//! for Bifurcations of Dynamical Equilibria", SIAM 2000, Ch. 3: minimally augmented systems).
//!
//! Let J be the derivative of the balance by its unknowns. At a fold J of the response's period is singular. A period
//! doubling is seen in the balance of twice the period: the response X has its even harmonics, a response of the
//! doubled period leaves X along odd ones, and the odd rows and columns of J are singular. With that matrix A the
//! scalar g of
//! ```text
//! ⎡ A   b ⎤ ⎡v⎤   ⎡0⎤        ⎡ Aᵀ  c ⎤ ⎡w⎤   ⎡0⎤
//! ⎢       ⎥ ⎢ ⎥ = ⎢ ⎥        ⎢       ⎥ ⎢ ⎥ = ⎢ ⎥
//! ⎣ cᵀ  0 ⎦ ⎣g⎦   ⎣1⎦        ⎣ bᵀ  0 ⎦ ⎣g⎦   ⎣1⎦
//! ```
//!
//! is zero if and only if A is singular, and dg = −wᵀ dA v. The unknowns are X and a coordinate λ, the equations R = 0
//! and g = 0: the point is regular in them, so Newton's method converges quadratically, and a second coordinate μ makes
//! a curve of them. b and c are the latest w and v, which keeps the bordered matrix well conditioned; the zeros of g
//! don't depend on them.
//!
//! The gradient needs no second derivatives of the forces: they are symmetric, so with all columns of J and those by λ
//! and μ
//!
//! ```text
//! ∂(wᵀA v)/∂(X, λ, μ) = d/dh wᵀ[J, R_λ, R_μ](X + h v)   at h = 0,
//! ```
//!
//! a central difference of two evaluations.

use alloc::vec;
use alloc::vec::Vec;

use super::adapt::Spectral;
use super::balance::Balance;
use super::orbit::Orbit;
use crate::continuation::{Continuation, ContinuationSettings, System, Work};
use crate::dense::{Lu, normalise};
use crate::error::AnalysisError;
use crate::forced::Coordinate;

/// The matrix that is singular.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Singularity {
    /// R_x: a multiplier 1, where the branch turns back in λ.
    Fold,
    /// That of the balance of twice the period, on odd harmonics: a multiplier −1.
    PeriodDoubling,
}

/// The step of the difference, relative to the size of the response: rounding and truncation both change the gradient
/// by some 1e-10 of itself, which costs Newton's method nothing.
pub(super) const DIFFERENCE: f64 = 1e-5;
/// The largest error of a null vector that counts as exact: the error of λ is of the order of its square.
pub(super) const NULL_VECTOR_ERROR: f64 = 1e-7;
/// Harmonics added until a null vector is good enough: how many at once, and how often.
pub(super) const MORE_HARMONICS: (usize, usize) = (2, 16);

/// The equations of a fold or a period doubling: unknowns z = (λ, X), with λ shifted and scaled, and a second
/// coordinate μ.
#[derive(Clone, Debug)]
pub(super) struct Singular {
    /// The balance of the response's period for a fold, of twice that for a doubling.
    balance: Balance,
    kind: Singularity,
    lambda: Coordinate,
    /// λ = origin + scale · z₀.
    lambda_origin: f64,
    lambda_scale: f64,
    mu: Option<Coordinate>,
    /// The unknowns of the balance that are X, and those that are v.
    orbit: Vec<usize>,
    variation: Vec<usize>,
    v: Vec<f64>,
    w: Vec<f64>,
    settings: ContinuationSettings,
    bordered: Lu,
    residual: Vec<f64>,
    /// J and the columns by λ and μ: at X, and at X + h v and X − h v.
    matrices: [Vec<f64>; 3],
}

/// The unknowns of harmonics k = `first`, `first` + `step` … up to H among those of all harmonics.
fn places(unknowns: usize, harmonics: usize, first: usize, step: usize) -> Vec<usize> {
    let rows = |k: usize| (2 * k).saturating_sub(1)..2 * k + 1;
    let of_row = |row: usize| row * unknowns..(row + 1) * unknowns;
    (first..=harmonics).step_by(step).flat_map(rows).flat_map(of_row).collect()
}

/// Returns a response as one of twice the period: its harmonics become the even ones.
pub(super) fn doubled(x: &[f64], unknowns: usize) -> Vec<f64> {
    // 2H + 1 rows are H harmonics, which become 2H of twice the period.
    let harmonics = x.len() / unknowns - 1;
    let mut series = vec![0.0; unknowns * (2 * harmonics + 1)];
    for (place, value) in places(unknowns, harmonics, 0, 2).into_iter().zip(x) {
        series[place] = *value;
    }
    series
}

impl Singular {
    /// The equations near the response `x` of a balance whose coordinates are set, and whose matrix is nearly singular.
    /// # Errors
    /// [`AnalysisError::Singular`] if the matrix has no inverse at all there: start slightly beside the point.
    pub fn near(
        balance: &Balance,
        kind: Singularity,
        mu: Option<Coordinate>,
        settings: &ContinuationSettings,
        x: &[f64],
    ) -> Result<Singular, AnalysisError> {
        let lambda = balance.coordinate;
        let harmonics = balance.harmonics();
        let balance = match kind {
            Singularity::Fold => balance.clone(),
            Singularity::PeriodDoubling => {
                // The response ends with the even harmonic 2H, its variation with the odd one beyond.
                let orders = [2 * balance.period(), 2 * harmonics + 1];
                Balance::of_period(&balance.forced, orders, balance.frequency_hz, lambda)
            }
        };
        let lambda_origin = balance.value(lambda);
        // A change of λ by Λ is one of z₀ by X, the size of the response.
        let lambda_scale = settings.lambda_scale(lambda_origin) / settings.size(x);
        let mut singular = Singular {
            balance,
            kind,
            lambda,
            lambda_origin,
            lambda_scale,
            mu,
            orbit: vec![],
            variation: vec![],
            v: vec![],
            w: vec![],
            settings: *settings,
            bordered: Lu::default(),
            residual: vec![],
            matrices: Default::default(),
        };
        singular.set_harmonics(harmonics);
        let full = singular.embedded(x);
        singular.differentiate(&full, 0);
        let m = singular.v.len();
        let stride = singular.balance.dimension();
        let matrix = singular.bordered.zeroed(m);
        copy(&singular.matrices[0], stride, &singular.variation, matrix, m);
        singular.bordered.factor()?;
        [singular.v, singular.w] = singular.bordered.null_vectors();
        Ok(singular)
    }

    /// Solves for the singular response near `x`, at its λ: without a second coordinate, and for a smooth structure
    /// with as many harmonics as the null vector needs.
    ///
    /// # Errors
    /// [`AnalysisError::Singular`], [`AnalysisError::NoSolution`] if there is none near, or if its null vector needs too
    /// many harmonics [`AnalysisError::TooManyHarmonics`].
    pub fn solved(
        balance: &Balance,
        kind: Singularity,
        settings: &ContinuationSettings,
        x: &[f64],
    ) -> Result<(Singular, Vec<f64>, Work), AnalysisError> {
        let mut singular = Singular::near(balance, kind, None, settings, x)?;
        let start = singular.join(singular.lambda_origin, x);
        let mut continuation = Continuation::start(&mut singular, *settings, &start, 0.0, 1.0)?;
        for _ in 0..MORE_HARMONICS.1 {
            // The series of a law that isn't smooth hardly ends: there are as many harmonics as the response has.
            let smooth = singular.balance.forced.assembly.is_smooth();
            if !smooth || singular.balance.variation_error(&singular.null_vector()) < NULL_VECTOR_ERROR {
                return Ok((singular, continuation.point().x.clone(), continuation.work()));
            }
            let harmonics = singular.harmonics() + MORE_HARMONICS.0;
            singular.set_harmonics(harmonics);
            continuation.resize(&mut singular)?;
        }
        let harmonics = singular.harmonics();
        Err(AnalysisError::TooManyHarmonics { at: balance.place(singular.lambda_origin), harmonics })
    }

    /// Returns the same equations with a second coordinate.
    pub fn with(self, mu: Coordinate) -> Singular {
        Singular { mu: Some(mu), ..self }
    }

    /// Splits a solution z into λ, in its unit, and X.
    pub fn split<'a>(&self, z: &'a [f64]) -> (f64, &'a [f64]) {
        (self.lambda_origin + z[0] * self.lambda_scale, &z[1..])
    }

    /// Returns the z of λ and X.
    pub fn join(&self, lambda: f64, x: &[f64]) -> Vec<f64> {
        let mut z = vec![(lambda - self.lambda_origin) / self.lambda_scale];
        z.extend_from_slice(x);
        z
    }

    /// Returns v as a response of the balance: for a doubling one of twice the period, with the odd harmonics alone.
    pub fn null_vector(&self) -> Vec<f64> {
        let mut full = vec![0.0; self.balance.dimension()];
        self.variation.iter().zip(&self.v).for_each(|(place, v)| full[*place] = *v);
        full
    }

    /// Returns X among the unknowns of the balance.
    fn embedded(&self, x: &[f64]) -> Vec<f64> {
        let mut full = vec![0.0; self.balance.dimension()];
        self.orbit.iter().zip(x).for_each(|(place, x)| full[*place] = *x);
        full
    }

    /// Computes J and the columns by the coordinates at a response of the balance.
    fn differentiate(&mut self, full: &[f64], which: usize) {
        let size = full.len();
        let coordinates = [self.lambda, self.mu.unwrap_or(self.lambda)];
        let count = if self.mu.is_some() { 2 } else { 1 };
        self.residual.resize(size, 0.0);
        self.matrices[which].resize(size * (size + 2), 0.0);
        let residual = &mut self.residual;
        let matrix = &mut self.matrices[which];
        self.balance.derivatives(full, &coordinates[..count], residual, matrix, size);
    }

    /// Returns g, with v and w of this response; NaN if the bordered matrix has no inverse.
    fn border(&mut self) -> f64 {
        let m = self.v.len();
        let size = self.balance.dimension();
        let matrix = self.bordered.zeroed(m + 1);
        copy(&self.matrices[0], size, &self.variation, matrix, m + 1);
        matrix[m * (m + 1)..m * (m + 1) + m].copy_from_slice(&self.w);
        for (column, c) in matrix.chunks_exact_mut(m + 1).zip(&self.v) {
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
        let g = solve(&|b| self.bordered.solve(b), &mut self.v);
        solve(&|b| self.bordered.solve_transposed(b), &mut self.w);
        g
    }

    /// Writes ∂(wᵀA v) by λ, X and μ.
    fn gradient(&mut self, full: &[f64], x: &[f64], mut write: impl FnMut(usize, f64)) {
        let n = self.orbit.len();
        let size = full.len();
        let v = self.null_vector();
        let length = libm::sqrt(v.iter().map(|v| v * v).sum());
        let step = DIFFERENCE * self.settings.size(x) / length;
        let residual = self.residual.clone();
        for (which, h) in [(1, step), (2, -step)] {
            let moved: Vec<f64> = full.iter().zip(&v).map(|(x, v)| x + h * v).collect();
            self.differentiate(&moved, which);
        }
        // The differences have overwritten R of the response itself.
        self.residual = residual;
        let [_, above, below] = &self.matrices;
        let along = |column: usize| -> f64 {
            let [above, below] = [above, below].map(|matrix| &matrix[column * size..(column + 1) * size]);
            let rows = self.variation.iter().zip(&self.w);
            rows.map(|(row, w)| w * (above[*row] - below[*row])).sum::<f64>() / (2.0 * step)
        };
        write(0, along(size));
        self.orbit.iter().enumerate().for_each(|(i, place)| write(1 + i, along(*place)));
        write(n + 1, if self.mu.is_some() { along(size + 1) } else { 0.0 });
    }

    /// Returns the response of a solution as an orbit's coefficients, with its balance set to it.
    pub fn orbit(&mut self, z: &[f64], mu: f64, read: impl FnOnce(&Balance) -> Orbit) -> Orbit {
        let current = self.harmonics();
        let needed = ((z.len() - 1) / self.balance.unknowns.count() - 1) / 2;
        if needed != current {
            self.set_harmonics(needed);
        }
        let (_, x) = self.split(z);
        let x = x.to_vec();
        // The coordinates were valid when the point was solved for.
        let _ = self.evaluate_orbit(z, mu);
        let harmonics = [self.period(), needed];
        let mut single = Balance::of_period(&self.balance.forced, harmonics, self.balance.frequency_hz, self.lambda);
        single.evaluate_orbit(&x);
        let orbit = read(&single);
        if needed != current {
            self.set_harmonics(current);
        }
        orbit
    }

    /// Sets λ and μ and returns whether such a structure exists.
    #[must_use]
    fn set(&mut self, lambda: f64, mu: f64) -> bool {
        let exists = self.mu.is_none_or(|coordinate| self.balance.set(coordinate, mu));
        exists && self.balance.set(self.lambda, lambda)
    }
}

/// Copies the rows and columns of these places into a matrix with columns of `stride` numbers.
fn copy(from: &[f64], size: usize, places: &[usize], into: &mut [f64], stride: usize) {
    for (column, out) in places.iter().zip(into.chunks_exact_mut(stride)) {
        let from = &from[column * size..(column + 1) * size];
        out.iter_mut().zip(places).for_each(|(out, row)| *out = from[*row]);
    }
}

impl System for Singular {
    fn dimension(&self) -> usize {
        self.orbit.len() + 1
    }

    fn evaluate(&mut self, z: &[f64], mu: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
        let n = self.orbit.len();
        let stride = self.orbit.len() + 2;
        let size = self.balance.dimension();
        let (lambda, x) = self.split(z);
        if !self.set(lambda, mu) {
            return false;
        }
        let full = self.embedded(x);
        self.differentiate(&full, 0);
        for (row, place) in self.orbit.iter().enumerate() {
            residual[row] = self.residual[*place];
        }
        let here = &self.matrices[0];
        copy(here, size, &self.orbit, &mut matrix[stride..(n + 1) * stride], stride);
        for (row, place) in self.orbit.iter().enumerate() {
            matrix[row] = here[size * size + place] * self.lambda_scale;
            matrix[(n + 1) * stride + row] = if self.mu.is_some() { here[(size + 1) * size + place] } else { 0.0 };
        }
        residual[n] = self.border();
        let scale = self.lambda_scale;
        self.gradient(&full, x, |column, value| {
            // dg = −wᵀ dA v; the first unknown is λ over its scale.
            matrix[column * stride + n] = -value * if column == 0 { scale } else { 1.0 };
        });
        normalise(&mut self.v);
        normalise(&mut self.w);
        residual[n].is_finite()
    }

    fn unit(&self) -> &'static str {
        self.mu.map_or("", |mu| self.balance.unit_of(mu))
    }
}

impl Spectral for Singular {
    fn balance(&self) -> &Balance {
        &self.balance
    }

    fn others(&self) -> usize {
        1
    }

    fn harmonics(&self) -> usize {
        match self.kind {
            Singularity::Fold => self.balance.harmonics(),
            Singularity::PeriodDoubling => (self.balance.harmonics() - 1) / 2,
        }
    }

    fn period(&self) -> usize {
        match self.kind {
            Singularity::Fold => self.balance.period(),
            Singularity::PeriodDoubling => self.balance.period() / 2,
        }
    }

    fn set_harmonics(&mut self, harmonics: usize) {
        let m = self.balance.unknowns.count();
        (self.orbit, self.variation) = match self.kind {
            Singularity::Fold => {
                self.balance.set_harmonics(harmonics);
                (places(m, harmonics, 0, 1), places(m, harmonics, 0, 1))
            }
            Singularity::PeriodDoubling => {
                self.balance.set_harmonics(2 * harmonics + 1);
                (places(m, 2 * harmonics, 0, 2), places(m, 2 * harmonics + 1, 1, 2))
            }
        };
        self.v.resize(self.variation.len(), 0.0);
        self.w.resize(self.variation.len(), 0.0);
    }

    fn evaluate_orbit(&mut self, z: &[f64], mu: f64) -> bool {
        let (lambda, x) = self.split(z);
        let exists = self.set(lambda, mu);
        if exists {
            let full = self.embedded(x);
            self.balance.evaluate_orbit(&full);
        }
        exists
    }
}
