//! One mode fitted to the lines of a discrete Fourier transform in a narrow band around it.
//!
//! A linear arm whose force is held and whose readings are taken at the same instant of every hold is, in discrete
//! time, a rational function of z. The transform of M samples then obeys, exactly and without a window,
//!
//! ```text
//! Y(k) = H(z_k) U(k) + T(z_k),   z_k = e^(2πik/M)
//! ```
//!
//! where T, with the same poles as H, carries how the stretch begins and ends (R. Pintelon, J. Schoukens, "System
//! Identification: A Frequency Domain Approach", 2012, section 6.3). Damping so light that no motion dies out during a
//! record costs nothing: T is part of the model. Near a mode with the pole p,
//!
//! ```text
//! H = R/(z − p) + B(z),   T = t/(z − p) + C(z)
//! ```
//!
//! with polynomials B, C for all that is far away: the conjugate pole, the other mode, what follows the force at once
//! (local rational modelling: T. McKelvey, G. Guérin 2012). R, t and the polynomials are linear; for each p they follow
//! from linear least squares, and what is left is minimised over the two numbers of p (variable projection: G. H.
//! Golub, V. Pereyra 1973). A pole p in z is s = rate · ln p in continuous time, exactly, since the force is held.

use alloc::vec::Vec;
use core::f64::consts::TAU;
use core::ops::Range;

use nalgebra::{Complex, Matrix2, Vector2};

use super::least_squares::{dot, solve, square};

/// Degree of the polynomials.
const DEGREE: usize = 2;
/// Weights follow from the fit, and the fit from the weights: so many rounds.
const ROUNDS: usize = 4;
/// Most steps of a minimisation.
const MOST_STEPS: usize = 60;
/// Step of the central differences, lines.
const DIFFERENCE: f64 = 1e-4;

/// Lines around a mode, and their noise.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    /// The number M of samples that were transformed.
    pub samples: usize,
    /// Number of the line in the middle, at which frequencies count 0.
    pub centre: usize,
    /// Number of the first line.
    pub first: usize,
    /// The response.
    pub response: Vec<Complex<f64>>,
    /// The force; `None` where there is none.
    pub force: Option<Vec<Complex<f64>>>,
    /// Standard deviations of a line's noise: of the response, and of the force.
    pub noise: [f64; 2],
}

/// A fitted pole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pole {
    /// Frequency over the centre's and decay rate, both in lines: p = e^((2πi x₀ − x₁)/M) e^(2πi centre/M).
    pub x: [f64; 2],
    /// Standard deviations of both, from the noise, or from the residual where that is larger.
    pub deviation: [f64; 2],
    /// Root mean square of the residual over the noise: 1 where the model is right.
    pub residual: f64,
    /// How many times as large the residual's square is without the pole, with the polynomials alone.
    pub gain: f64,
}

impl Lines {
    /// Fits the pole, beginning from the peak at the offset `peak` from the centre, lines. `None` if there are fewer
    /// lines than unknowns.
    pub fn fit(&self, peak: f64) -> Option<Pole> {
        let unknowns = (DEGREE + 2) * if self.force.is_some() { 2 } else { 1 } + 1;
        let freedom = self.response.len().checked_sub(unknowns).filter(|freedom| *freedom > 0)? as f64;
        let mut weights = alloc::vec![1.0 / self.noise[0]; self.response.len()];
        let starts = [0.3, 3.0, 30.0].into_iter().flat_map(|decay| [-0.3, 0.3].map(|offset| [peak + offset, decay]));
        let mut best = (f64::INFINITY, [peak, 1.0]);
        for x in starts {
            let cost = square(&self.residual(x, &weights).0);
            if cost < best.0 {
                best = (cost, x);
            }
        }
        let mut x = best.1;
        let mut information = Matrix2::zeros();
        for _ in 0..ROUNDS {
            (x, information) = self.minimise(x, &weights);
            weights = self.weights(x, &weights);
        }
        // Circular noise of variance 1 a line: information 2 Re J*J.
        let covariance = (information * 2.0).try_inverse()?;
        let left = square(&self.residual(x, &weights).0);
        let residual = libm::sqrt(left / freedom);
        let polynomials = self.columns(1..DEGREE + 2, x, &weights);
        let gain = square(&solve(polynomials, &self.weighted(&weights)).0) / left;
        let deviation = [covariance.m11, covariance.m22].map(|variance| libm::sqrt(variance) * residual.max(1.0));
        Some(Pole { x, deviation, residual, gain })
    }

    /// What the best R, t, B and C leave at a pole, weighted, and these.
    fn residual(&self, x: [f64; 2], weights: &[f64]) -> (Vec<Complex<f64>>, Vec<Complex<f64>>) {
        solve(self.columns(0..DEGREE + 2, x, weights), &self.weighted(weights))
    }

    fn weighted(&self, weights: &[f64]) -> Vec<Complex<f64>> {
        self.response.iter().zip(weights).map(|(y, weight)| y * *weight).collect()
    }

    /// Of these shapes, 1/(z − p), then powers of the frequency; first times the force, if there is one, then alone.
    fn columns(&self, which: Range<usize>, x: [f64; 2], weights: &[f64]) -> Vec<Vec<Complex<f64>>> {
        let shapes: Vec<Vec<Complex<f64>>> = which.map(|which| self.shape(which, x)).collect();
        let forced = self.force.iter().flat_map(|force| {
            shapes.iter().map(move |shape| {
                let terms = shape.iter().zip(force).zip(weights);
                terms.map(|((shape, force), weight)| shape * force * *weight).collect()
            })
        });
        let free =
            shapes.iter().map(|shape| shape.iter().zip(weights).map(|(shape, weight)| shape * *weight).collect());
        forced.chain(free).collect()
    }

    fn shape(&self, which: usize, x: [f64; 2]) -> Vec<Complex<f64>> {
        let half = 0.5 * self.response.len() as f64;
        let offset = |k: usize| (self.first + k) as f64 - self.centre as f64;
        let pole = exponential(x, self.samples);
        let value = |k: usize| match which {
            0 => (exponential([offset(k), 0.0], self.samples) - pole).inv(),
            power => Complex::new(libm::pow(offset(k) / half, (power - 1) as f64), 0.0),
        };
        (0..self.response.len()).map(value).collect()
    }

    /// Noise of the force acts through H: weights 1/√(σ_y² + |H|² σ_u²), with H of the fit so far.
    fn weights(&self, x: [f64; 2], weights: &[f64]) -> Vec<f64> {
        if self.force.is_none() {
            return weights.to_vec();
        }
        let coefficients = self.residual(x, weights).1;
        let shapes: Vec<_> = (0..DEGREE + 2).map(|which| self.shape(which, x)).collect();
        let weight = |k: usize| {
            let response: Complex<f64> =
                shapes.iter().zip(&coefficients).map(|(shape, factor)| shape[k] * factor).sum();
            let [response_noise, force_noise] = self.noise;
            1.0 / libm::sqrt(response_noise * response_noise + response.norm_sqr() * force_noise * force_noise)
        };
        (0..self.response.len()).map(weight).collect()
    }

    /// Levenberg–Marquardt steps to the least residual; Re J*J there.
    fn minimise(&self, start: [f64; 2], weights: &[f64]) -> ([f64; 2], Matrix2<f64>) {
        let (mut x, mut damping) = (start, 1e-2);
        let mut residual = self.residual(x, weights).0;
        let (mut normal, mut gradient) = self.linearise(x, weights, &residual);
        for _ in 0..MOST_STEPS {
            let damped = normal + Matrix2::from_diagonal(&normal.diagonal()) * damping;
            let Some(step) = damped.try_inverse().map(|inverse| -(inverse * gradient)) else { break };
            let next = [x[0] + step[0], x[1] + step[1]];
            let tried = self.residual(next, weights).0;
            if square(&tried) < square(&residual) {
                (x, residual, damping) = (next, tried, (damping * 0.1_f64).max(1e-12));
                (normal, gradient) = self.linearise(x, weights, &residual);
                if step.amax() < 1e-9 {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e9 {
                    break;
                }
            }
        }
        (x, normal)
    }

    /// Re J*J and Re J*r of the residual r, by central differences.
    fn linearise(&self, x: [f64; 2], weights: &[f64], r: &[Complex<f64>]) -> (Matrix2<f64>, Vector2<f64>) {
        let derivative = |which: usize| -> Vec<Complex<f64>> {
            let [up, down] = [DIFFERENCE, -DIFFERENCE].map(|step| {
                let mut moved = x;
                moved[which] += step;
                self.residual(moved, weights).0
            });
            up.iter().zip(&down).map(|(up, down)| (up - down) / (2.0 * DIFFERENCE)).collect()
        };
        let j = [derivative(0), derivative(1)];
        let normal = Matrix2::from_fn(|row, column| dot(&j[row], &j[column]).re);
        (normal, Vector2::new(dot(&j[0], r).re, dot(&j[1], r).re))
    }
}

/// e^((2πi x₀ − x₁)/M).
fn exponential([turns, decay]: [f64; 2], samples: usize) -> Complex<f64> {
    let (sine, cosine) = libm::sincos(TAU * turns / samples as f64);
    Complex::new(cosine, sine) * libm::exp(-decay / samples as f64)
}
