//! Fit of one mode to the lines of a discrete Fourier transform, in a narrow band around it.
//!
//! Force and accelerations go through the same filter before they are sampled, which removes everything above half the
//! sample rate. The rest is related by the arm's response H like the continuous signals, and the transform of M samples
//! satisfies, without a window,
//!
//! ```text
//! Y(k) = H(z_k) U(k) + T(z_k),   z_k = e^(2πik/M)
//! ```
//!
//! where T, with the same poles as H, describes the ends of the stretch (R. Pintelon, J. Schoukens, "System
//! Identification: A Frequency Domain Approach", 2012, section 6.3). A record in which no motion dies out, for lack of
//! damping, is no problem: T is part of the model. Near a mode with the pole p,
//!
//! ```text
//! H = R/(z − p) + B(z),   T = t/(z − p) + C(z)
//! ```
//!
//! with polynomials B, C for everything distant: the conjugate pole, the other mode, direct feedthrough of the force
//! (local rational modelling: T. McKelvey, G. Guérin, "Non-parametric frequency response estimation using a local
//! rational model", 2012). The pole λ of the continuous arm is p = e^{λ/rate} there: 1/(iω − λ) and (1/rate)/(z/p − 1)
//! differ by a function without a pole, which B absorbs. R, t and the polynomials are linear; for each p they follow
//! from linear least squares, and the residual is minimised over the two numbers of p (variable projection: G. H.
//! Golub, V. Pereyra, "The Differentiation of Pseudo-Inverses and Nonlinear Least Squares Problems Whose Variables
//! Separate", SIAM J. Numer. Anal. 10 (1973)). So λ = rate · ln p.
//!
//! A response that begins at rest and dies out goes through an exponential window e^(−γn), which turns p into p e^(−γ)
//! and removes its end: then T is zero.
//!
//! An averaged response can't give the modes: the arm rings for minutes, so that every segment is short against
//! it, and the leakage of a window looks like damping. This fit finds damping ratios to one or two per cent
//! from half a minute of record.

use alloc::vec::Vec;
use core::f64::consts::TAU;
use core::ops::Range;

use nalgebra::{Complex, Matrix2, Vector2};

use super::least_squares::{dot, solve, square};

/// Degree of the polynomials B and C.
const DEGREE: usize = 2;
/// Number of rounds, since the weights follow from the fit and the fit from the weights.
const ROUNDS: usize = 4;
/// Largest number of steps of a minimisation.
const MOST_STEPS: usize = 60;
/// Step of the central differences, lines.
const DIFFERENCE: f64 = 1e-4;

/// Lines of a transform around a mode, with their noise.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    /// Number M of samples that were transformed.
    pub samples: usize,
    /// Number of the middle line, which is the origin of frequencies.
    pub centre: usize,
    /// Number of the first line.
    pub first: usize,
    /// Lines of the response.
    pub response: Vec<Complex<f64>>,
    /// Lines of the force, if there is one.
    pub force: Option<Vec<Complex<f64>>>,
    /// γM, if the samples went through an exponential window e^(−γn). The model then has no T.
    pub taper: Option<f64>,
    /// Standard deviations of the noise of a line: of the response, and of the force.
    pub noise: [f64; 2],
}

/// Pole of a fitted mode, with its statistics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pole {
    /// Frequency relative to the centre and decay rate, both in lines: p = e^((2πi x₀ − x₁)/M) e^(2πi
    /// centre/M).
    pub x: [f64; 2],
    /// Standard deviations of both, from the noise, or from the residual where that is larger.
    pub deviation: [f64; 2],
    /// Root mean square of the residual over the noise; 1 where the model is right.
    pub residual: f64,
    /// Ratio of the residual's square without the pole, with the polynomials alone, to that with it.
    pub gain: f64,
    /// Residue R/p of H = R/(z − p), in the response's unit over the force's; `None` without a force.
    pub residue: Option<Complex<f64>>,
    /// Share of the head's noise in the power of the force, weighted by the pole's term; 0 without a force.
    /// Least squares bias R and the pole by about this much.
    pub force_noise_share: f64,
}

impl Lines {
    /// Fits the pole, starting from the peak at the offset `peak` from the centre, lines. `None` if there are
    /// fewer lines than unknowns.
    pub fn fit(&self, peak: f64) -> Option<Pole> {
        let parts = usize::from(self.force.is_some()) + usize::from(self.has_transient());
        let unknowns = (DEGREE + 2) * parts + 1;
        let freedom = self.response.len().checked_sub(unknowns).filter(|freedom| *freedom > 0)? as f64;
        let mut weights = alloc::vec![1.0 / self.noise[0]; self.response.len()];
        let shift = self.taper.unwrap_or(0.0);
        // The minimisation is local, so several decay rates and offsets are tried and the best one starts the
        // minimisation.
        let starts = [0.3, 3.0, 30.0]
            .map(|decay| decay + shift)
            .into_iter()
            .flat_map(|decay| [-0.3, 0.3].map(|offset| [peak + offset, decay]));
        let mut best = (f64::INFINITY, [peak, 1.0]);
        for x in starts {
            let cost = square(&self.residual(x, &weights).0);
            if cost < best.0 {
                best = (cost, x);
            }
        }
        let mut x = best.1;
        for _ in 0..ROUNDS {
            x = self.minimise(x, &weights);
            // The noise of the force acts through the response, which is only known from the fit.
            weights = self.weights(x, &weights);
        }
        let covariance = self.covariance(x, &weights)?;
        let left = square(&self.residual(x, &weights).0);
        let residual = libm::sqrt(left / freedom);
        let polynomials = self.columns(1..DEGREE + 2, x, &weights);
        let gain = square(&solve(polynomials, &self.weighted(&weights)).0) / left;
        // A residual larger than the noise means that the model is not quite right, and the deviations are
        // widened by it.
        let deviation = [covariance.m11, covariance.m22].map(|variance| libm::sqrt(variance) * residual.max(1.0));
        let force_noise_share = self.force_noise_share(x, &weights);
        let residue = self.residue(x, &weights);
        // The exponential window adds its own decay to that of the pole.
        let x = [x[0], x[1] - shift];
        Some(Pole { x, deviation, residual, gain, residue, force_noise_share })
    }

    /// Returns whether T, the ends of the record, is in the model. A response that begins at rest and dies out
    /// has no T; it would describe the whole response, with the poles of what drives the arm.
    fn has_transient(&self) -> bool {
        self.taper.is_none()
    }

    /// Returns the covariance of x by the noise of the lines, which has variance 1 per line and is circular.
    /// With the normal matrix N = Re J*J and the noise's correlation C it is ½ N⁻¹ Re(J*CJ) N⁻¹. Without a
    /// window C is the unit matrix.
    fn covariance(&self, x: [f64; 2], weights: &[f64]) -> Option<Matrix2<f64>> {
        let j = self.jacobian(x, weights);
        let inverse = Matrix2::from_fn(|row, column| dot(&j[row], &j[column]).re).try_inverse()?;
        let middle = Matrix2::from_fn(|row, column| {
            let spread: Vec<Complex<f64>> = (0..j[column].len()).map(|k| self.correlated(&j[column], k)).collect();
            dot(&j[row], &spread).re
        });
        Some(inverse * middle * inverse * 0.5)
    }

    /// Returns element `k` of C v. The transform of noise under e^(−γn) has, between lines d apart, the
    /// correlation Σ e^(−2γn + 2πidn/M)/Σ e^(−2γn) = 1/(1 − iπd/(γM)).
    fn correlated(&self, v: &[Complex<f64>], k: usize) -> Complex<f64> {
        let Some(taper) = self.taper else { return v[k] };
        let turn = |l: usize| core::f64::consts::PI * (l as f64 - k as f64) / taper;
        v.iter().enumerate().map(|(l, value)| value / Complex::new(1.0, -turn(l))).sum()
    }

    /// Returns R/p, which neither the origin of frequencies nor the exponential window changes: z and p rotate
    /// and shrink alike.
    fn residue(&self, x: [f64; 2], weights: &[f64]) -> Option<Complex<f64>> {
        self.force.as_ref()?;
        let coefficients = self.residual(x, weights).1;
        coefficients.first().map(|residue| residue / exponential(x, self.samples))
    }

    fn force_noise_share(&self, x: [f64; 2], weights: &[f64]) -> f64 {
        let Some(force) = &self.force else { return 0.0 };
        let shape = self.shape(0, x);
        let sizes = || shape.iter().zip(weights).map(|(shape, weight)| shape.norm_sqr() * weight * weight);
        let noise = self.noise[1] * self.noise[1] * sizes().sum::<f64>();
        noise / sizes().zip(force).map(|(size, force)| size * force.norm_sqr()).sum::<f64>()
    }

    /// Returns the weighted residual of the best R, t, B and C for a pole, and their values.
    fn residual(&self, x: [f64; 2], weights: &[f64]) -> (Vec<Complex<f64>>, Vec<Complex<f64>>) {
        solve(self.columns(0..DEGREE + 2, x, weights), &self.weighted(weights))
    }

    fn weighted(&self, weights: &[f64]) -> Vec<Complex<f64>> {
        self.response.iter().zip(weights).map(|(y, weight)| y * *weight).collect()
    }

    /// Returns the columns of the linear model: 1/(z − p), then powers of the frequency; first times the force,
    /// if there is one, then alone.
    fn columns(&self, which: Range<usize>, x: [f64; 2], weights: &[f64]) -> Vec<Vec<Complex<f64>>> {
        let shapes: Vec<Vec<Complex<f64>>> = which.map(|which| self.shape(which, x)).collect();
        let forced = self.force.iter().flat_map(|force| {
            shapes.iter().map(move |shape| {
                let terms = shape.iter().zip(force).zip(weights);
                terms.map(|((shape, force), weight)| shape * force * *weight).collect()
            })
        });
        let free = shapes.iter().filter(|_| self.has_transient());
        let free = free.map(|shape| shape.iter().zip(weights).map(|(shape, weight)| shape * *weight).collect());
        forced.chain(free).collect()
    }

    fn shape(&self, which: usize, x: [f64; 2]) -> Vec<Complex<f64>> {
        // Frequencies are scaled to ±1 over the band, which keeps the powers of the polynomials comparable.
        let half = 0.5 * self.response.len() as f64;
        let offset = |k: usize| (self.first + k) as f64 - self.centre as f64;
        let pole = exponential(x, self.samples);
        let value = |k: usize| match which {
            0 => (exponential([offset(k), 0.0], self.samples) - pole).inv(),
            power => Complex::new(libm::pow(offset(k) / half, (power - 1) as f64), 0.0),
        };
        (0..self.response.len()).map(value).collect()
    }

    /// Returns the weights 1/√(σ_y² + |H|² σ_u²), with H of the fit so far: noise of the force acts through H.
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

    /// Minimises the residual by Levenberg–Marquardt steps.
    fn minimise(&self, start: [f64; 2], weights: &[f64]) -> [f64; 2] {
        let (mut x, mut damping) = (start, 1e-2);
        let mut residual = self.residual(x, weights).0;
        let (mut normal, mut gradient) = self.linearise(x, weights, &residual);
        for _ in 0..MOST_STEPS {
            let damped = normal + Matrix2::from_diagonal(&normal.diagonal()) * damping;
            let Some(step) = damped.try_inverse().map(|inverse| -(inverse * gradient)) else { break };
            let next = [x[0] + step[0], x[1] + step[1]];
            let tried = self.residual(next, weights).0;
            if square(&tried) < square(&residual) {
                // Multiplying the damping by 10 or 0.1 follows Marquardt: short gradient steps far from the
                // minimum, Gauss–Newton steps close to it.
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
        x
    }

    /// Returns Re J*J and Re J*r for the residual r.
    fn linearise(&self, x: [f64; 2], weights: &[f64], r: &[Complex<f64>]) -> (Matrix2<f64>, Vector2<f64>) {
        let j = self.jacobian(x, weights);
        let normal = Matrix2::from_fn(|row, column| dot(&j[row], &j[column]).re);
        (normal, Vector2::new(dot(&j[0], r).re, dot(&j[1], r).re))
    }

    /// Returns J, the derivatives of the residual by x, by central differences.
    fn jacobian(&self, x: [f64; 2], weights: &[f64]) -> [Vec<Complex<f64>>; 2] {
        [0, 1].map(|which: usize| {
            let [up, down] = [DIFFERENCE, -DIFFERENCE].map(|step| {
                let mut moved = x;
                moved[which] += step;
                self.residual(moved, weights).0
            });
            up.iter().zip(&down).map(|(up, down)| (up - down) / (2.0 * DIFFERENCE)).collect()
        })
    }
}

/// Returns e^((2πi x₀ − x₁)/M).
fn exponential([turns, decay]: [f64; 2], samples: usize) -> Complex<f64> {
    let (sine, cosine) = libm::sincos(TAU * turns / samples as f64);
    Complex::new(cosine, sine) * libm::exp(-decay / samples as f64)
}
