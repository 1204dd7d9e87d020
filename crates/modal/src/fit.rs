//! Separable least squares on the poles.
//!
//! Given the poles, residues and transients follow from linear least squares, for each output alone. What is left, e(λ), is
//! minimised over the poles: G. H. Golub, V. Pereyra, "The Differentiation of Pseudo-Inverses and Nonlinear Least Squares
//! Problems Whose Variables Separate", SIAM J. Numer. Anal. 10 (1973), with the Jacobian of L. Kaufman, "A Variable Projection
//! Method for Solving Separable Nonlinear Least Squares Problems", BIT 15 (1975), J = (1 − A A⁺) D, where D are the derivatives
//! of the model with Re λ and Im λ. Steps are those of Gauss and Newton, damped as by K. Levenberg, Quart. Appl. Math. 2 (1944).
//!
//! The cost is Σ dof ln e², over all outputs: that of maximum likelihood where the variance of each output is unknown.
//!
//! Everything but the residual itself follows from sums of products of the columns A and B, B those of derivatives (see
//! [`crate::model`]), D = B S with S the output's coefficients. With G the matrix of these sums and L Lᵀ its part G_AA,
//!
//! ```text
//! x = A⁺y = G_AA⁻¹ Aᵀy,   W = L⁻¹ G_AB,   Jᵀ J = Sᵀ (G_BB − Wᵀ W) S,   Jᵀ e = Sᵀ Bᵀ e,   A⁺ D = L⁻ᵀ W S
//! ```
//!
//! The residual is computed line by line, and x is corrected by its products with A (A. Björck, "Stability Analysis of the
//! Method of Seminormal Equations for Linear Least Squares Problems", Linear Algebra Appl. 88/89 (1987)): so x is as accurate
//! as from a QR factorisation of A, in a third of the time.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Complex;

use crate::cholesky::Cholesky;
use crate::columns::{Columns, LANES, Lane, Residual, combine, gram, products, residuals, square};
use crate::complex::magnitude;
use crate::model::{Layout, ResidueKind};
use crate::run::Run;

/// First damping, and its least.
const DAMPING: f64 = 1e-3;
const LEAST_DAMPING: f64 = 1e-9;
/// Factors on the damping after a step that fails, and one that succeeds.
const RAISED: f64 = 8.0;
const LOWERED: f64 = 0.1;
/// Attempts at a step.
const ATTEMPTS: usize = 8;
/// A fit ends with a step below this part of |Re λ|, or as its [`Precision`] says.
const LEAST_STEP: f64 = 1e-7;
/// Corrections of the linear unknowns, until one changes the squares by less than this part.
const CORRECTIONS: usize = 3;
const LEAST_CORRECTION: f64 = 1e-6;

/// Rounding errors of spectra and fits, as a part of the power of a response: what is below it is no residual of the model, and
/// no mode explains it.
pub(crate) const ROUNDING: f64 = 1e-22;

/// When a fit is precise enough.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Precision {
    /// Most that the last step changes the cost.
    pub gain: f64,
    /// Largest size of that step, as a part of |Re λ|: while poles move far, the gain may still grow.
    pub step: f64,
}

impl Precision {
    /// A thousandth of a standard deviation.
    pub const FULL: Precision = Precision { gain: 1e-6, step: 1e-3 };
}

/// Runs that are fitted with common poles.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    pub runs: Vec<Run>,
    pub residues: ResidueKind,
}

/// Sums of products for the outputs that have the same weights.
#[derive(Clone, Debug)]
struct Sums {
    /// G over all columns, those of A first.
    gram: Vec<f64>,
    columns: usize,
    factor: Cholesky,
    /// G_BB − Wᵀ W by rows.
    schur: Vec<f64>,
    /// G_AA⁻¹ G_AB by rows.
    sensitivity: Vec<f64>,
}

/// The fit of one output.
#[derive(Clone, Debug)]
pub(crate) struct Output {
    /// Linear unknowns, in the places of [`Layout`].
    pub unknowns: Vec<f64>,
    /// Sum of the weighted squares of the residual, with rounding errors.
    pub square: f64,
    /// The slopes Bᵀ e of half the squared error e.
    slopes: Vec<f64>,
    /// Residual of each line, without weights: real parts, then imaginary ones.
    residual: Vec<Lane>,
}

/// The fit of a run.
#[derive(Clone, Debug)]
pub(crate) struct RunFit {
    pub layout: Layout,
    /// Columns of the gain of a unit reference, and of its derivatives.
    pub gain: [Columns; 2],
    /// Columns A and B.
    pub columns: Columns,
    /// One if the outputs have the same weights, else one for each output.
    sums: Vec<Sums>,
    pub outputs: Vec<Output>,
}

/// The fit of all runs for given poles.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub poles: Vec<Complex<f64>>,
    pub runs: Vec<RunFit>,
    /// Σ dof ln e².
    pub cost: f64,
    /// Jᵀ J over the variances by rows, over (Re λ, Im λ) of each pole.
    pub information: Vec<f64>,
    /// Jᵀ e over the variances.
    gradient: Vec<f64>,
}

impl Output {
    /// Complex residual at a line, without weights.
    pub fn residual_at(&self, line: usize) -> Complex<f64> {
        let (re, im) = self.residual.split_at(self.residual.len() / 2);
        Complex::new(re[line / LANES][line % LANES], im[line / LANES][line % LANES])
    }
}

impl RunFit {
    /// Degrees of freedom of a residual.
    pub fn freedom(&self, run: &Run) -> f64 {
        (2 * run.grid.lines()) as f64 - self.layout.unknowns() as f64
    }

    /// Variance of the real and of the imaginary part of the weighted residual of an output.
    pub fn variance(&self, run: &Run, output: usize) -> f64 {
        self.outputs[output].square / self.freedom(run)
    }

    /// Number of groups of outputs with the same weights.
    pub fn groups(&self) -> usize {
        self.sums.len()
    }

    /// Group of an output.
    pub fn group(&self, output: usize) -> usize {
        if self.sums.len() > 1 { output } else { 0 }
    }

    fn sums(&self, output: usize) -> &Sums {
        &self.sums[self.group(output)]
    }

    /// Overwrites b by G_AA⁻¹ b of a group.
    pub fn solve(&self, group: usize, b: &mut [f64]) {
        self.sums[group].factor.solve(b);
    }

    /// A⁺ B of a group by rows.
    pub fn explained(&self, group: usize) -> &[f64] {
        &self.sums[group].sensitivity
    }

    /// S of an output: for each pole, the places of pairs of columns of B and their coefficients.
    fn coefficients(&self, output: usize) -> Vec<Vec<(usize, [f64; 2])>> {
        let unknowns = &self.outputs[output].unknowns;
        (0..self.layout.modes).map(|mode| self.layout.slopes_of(mode, unknowns).collect()).collect()
    }

    /// A⁺ D of an output by rows: the change of each linear unknown, with opposite sign, with the poles.
    pub fn sensitivity(&self, output: usize) -> Vec<f64> {
        let slopes = self.layout.slopes();
        let sums = self.sums(output);
        let coefficients = self.coefficients(output);
        let mut found = Vec::new();
        for row in sums.sensitivity.chunks_exact(slopes.max(1)) {
            found.extend(coefficients.iter().flat_map(|pairs| pole_products(row, pairs)));
        }
        found
    }

    /// Increase of the squares of an output if a mode is left out, and the other poles stay: with x_S its unknowns, x_Sᵀ
    /// [(G_AA⁻¹)_SS]⁻¹ x_S.
    fn removal(&self, output: usize, mode: usize) -> f64 {
        let sums = self.sums(output);
        let unknowns: Vec<usize> =
            self.layout.of_mode(mode).into_iter().filter(|k| sums.factor.determines(*k)).collect();
        let count = self.layout.unknowns();
        let forward: Vec<Vec<f64>> = unknowns
            .iter()
            .map(|unknown| {
                let mut unit = vec![0.0; count];
                unit[*unknown] = 1.0;
                sums.factor.forward(&mut unit);
                unit
            })
            .collect();
        let size = unknowns.len();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let part: Vec<f64> = (0..size * size).map(|k| dot(&forward[k / size], &forward[k % size])).collect();
        let values: Vec<f64> = unknowns.iter().map(|unknown| self.outputs[output].unknowns[*unknown]).collect();
        let mut solved = values.clone();
        Cholesky::new(size, &part, size).solve(&mut solved);
        dot(&values, &solved)
    }
}

impl Sums {
    /// Prepares the sums of products of A's `unknowns` columns and those of B behind them.
    fn new(gram: Vec<f64>, columns: usize, unknowns: usize) -> Sums {
        let slopes = columns - unknowns;
        let factor = Cholesky::new(unknowns, &gram, columns);
        // Columns of W, and of L⁻ᵀ W.
        let mut forward = vec![vec![0.0; unknowns]; slopes];
        let mut sensitivity = vec![0.0; unknowns * slopes];
        for (j, column) in forward.iter_mut().enumerate() {
            (0..unknowns).for_each(|i| column[i] = gram[i * columns + unknowns + j]);
            factor.forward(column);
            let mut solved = column.clone();
            factor.backward(unknowns, &mut solved);
            (0..unknowns).for_each(|i| sensitivity[i * slopes + j] = solved[i]);
        }
        let mut schur = vec![0.0; slopes * slopes];
        for i in 0..slopes {
            for j in 0..slopes {
                let explained: f64 = forward[i].iter().zip(&forward[j]).map(|(a, b)| a * b).sum();
                schur[i * slopes + j] = gram[(unknowns + i) * columns + unknowns + j] - explained;
            }
        }
        Sums { gram, columns, factor, schur, sensitivity }
    }
}

/// Σ over the pairs of (x p + y q) and (x q − y p) of a row: its products with the derivatives of a pole.
fn pole_products(row: &[f64], pairs: &[(usize, [f64; 2])]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for (place, [x, y]) in pairs {
        let p = row[*place];
        let q = row[place + 1];
        sums[0] += x * p + y * q;
        sums[1] += x * q - y * p;
    }
    sums
}

impl Problem {
    pub fn layout(&self, run: &Run, modes: usize) -> Layout {
        Layout { modes, references: run.inputs(), residues: self.residues, transient: run.transient }
    }

    /// Number of real data.
    pub fn data(&self) -> usize {
        self.runs.iter().map(|run| 2 * run.grid.lines() * run.outputs()).sum()
    }

    /// Fits residues and transients for given poles, by default with the Jacobian.
    pub fn evaluate(&self, poles: &[Complex<f64>]) -> Fit {
        let runs: Vec<RunFit> = self.runs.iter().map(|run| self.fit_run(run, poles)).collect();
        let mut fit = Fit { poles: poles.to_vec(), runs, cost: 0.0, information: Vec::new(), gradient: Vec::new() };
        let size = 2 * poles.len();
        fit.information = vec![0.0; size * size];
        fit.gradient = vec![0.0; size];
        for (run, found) in self.runs.iter().zip(&fit.runs) {
            for (index, output) in found.outputs.iter().enumerate() {
                fit.cost += found.freedom(run) * libm::log(output.square.max(f64::MIN_POSITIVE));
                let by_variance = 1.0 / found.variance(run, index).max(f64::MIN_POSITIVE);
                let sums = found.sums(index);
                let slopes = found.layout.slopes();
                let coefficients = found.coefficients(index);
                // Schur · S by rows, then Sᵀ of it.
                let rows: Vec<Vec<f64>> = sums
                    .schur
                    .chunks_exact(slopes.max(1))
                    .map(|row| coefficients.iter().flat_map(|pairs| pole_products(row, pairs)).collect())
                    .collect();
                for column in 0..size {
                    let column_values: Vec<f64> = rows.iter().map(|row| row[column]).collect();
                    for (pole, pairs) in coefficients.iter().enumerate() {
                        for (k, value) in pole_products(&column_values, pairs).into_iter().enumerate() {
                            fit.information[(2 * pole + k) * size + column] += value * by_variance;
                        }
                    }
                }
                for (pole, pairs) in coefficients.iter().enumerate() {
                    for (k, value) in pole_products(&output.slopes, pairs).into_iter().enumerate() {
                        fit.gradient[2 * pole + k] += value * by_variance;
                    }
                }
            }
        }
        fit
    }

    fn fit_run(&self, run: &Run, poles: &[Complex<f64>]) -> RunFit {
        let layout = self.layout(run, poles.len());
        let gain = run.grid.gain_columns(poles, self.residues);
        let columns = run.grid.columns(poles, &run.references, &layout, &gain);
        let all: Vec<&[Lane]> = columns.iter().collect();
        let (sums, right): (Vec<Sums>, Vec<Vec<f64>>) = if run.weights.count() <= 1 {
            let weights = run.weights_of(0);
            let sums = Sums::new(gram(&all, weights), all.len(), layout.unknowns());
            let mut weighted = Columns::zeros(run.grid.lines(), run.outputs());
            for (output, target) in run.responses.iter().enumerate() {
                combine(&[target], &[1.0], weights, weighted.column_mut(output));
            }
            let targets: Vec<&[Lane]> = weighted.iter().collect();
            let flat = products(&all[..layout.unknowns()], &targets);
            let right = |output: usize| flat.iter().skip(output).step_by(targets.len()).copied().collect();
            (vec![sums], (0..targets.len()).map(right).collect())
        } else {
            let weighted = |(target, weights): (&[Lane], &[Lane])| {
                let with_target: Vec<&[Lane]> = all.iter().copied().chain([target]).collect();
                let size = with_target.len();
                let flat = gram(&with_target, Some(weights));
                let right = (0..layout.unknowns()).map(|k| flat[k * size + size - 1]).collect();
                let sums = flat.chunks_exact(size).take(size - 1).flat_map(|row| &row[..size - 1]).copied().collect();
                (Sums::new(sums, size - 1, layout.unknowns()), right)
            };
            run.responses.iter().zip(run.weights.iter()).map(weighted).unzip()
        };
        // Outputs with the same weights go side by side.
        let together = if sums.len() > 1 { 1 } else { right.len().max(1) };
        let outputs = right
            .chunks(together)
            .enumerate()
            .flat_map(|(group, right)| {
                let first = group * together;
                let targets: Vec<&[Lane]> = (first..first + right.len()).map(|k| run.responses.column(k)).collect();
                fit_outputs(&targets, run.weights_of(first), &all, &sums[group], right)
            })
            .collect();
        RunFit { layout, gain, columns, sums, outputs }
    }

    /// Minimises the cost over the poles, in at most `iterations` steps.
    pub fn minimise(&self, poles: &[Complex<f64>], iterations: usize, precision: Precision) -> Fit {
        self.minimise_from(self.evaluate(poles), iterations, precision)
    }

    /// Minimises the cost over the poles, from a fit on.
    pub fn minimise_from(&self, mut fit: Fit, iterations: usize, precision: Precision) -> Fit {
        let mut damping = DAMPING;
        for _ in 0..iterations {
            let mut next = None;
            for _ in 0..ATTEMPTS {
                let Some((moved, size, gain)) = fit.step(damping) else { break };
                // A step that changes nothing that could be measured needs no further evaluation.
                if size < 1e-2 * LEAST_STEP || (gain < 1e-2 * precision.gain && size < precision.step) {
                    return fit;
                }
                let tried = self.evaluate(&moved);
                if tried.cost <= fit.cost + 1e-9 {
                    next = Some((tried, size));
                    break;
                }
                damping *= RAISED;
            }
            let Some((tried, size)) = next else { return fit };
            let gain = fit.cost - tried.cost;
            fit = tried;
            damping = (damping * LOWERED).max(LEAST_DAMPING);
            if size < LEAST_STEP || (gain < precision.gain && size < precision.step) {
                return fit;
            }
        }
        fit
    }
}

/// Fits outputs with the same weights, given Aᵀ y of each.
fn fit_outputs(
    targets: &[&[Lane]],
    weights: Option<&[Lane]>,
    all: &[&[Lane]],
    sums: &Sums,
    right: &[Vec<f64>],
) -> Vec<Output> {
    let mut unknowns = right.to_vec();
    unknowns.iter_mut().for_each(|unknowns| sums.factor.solve(unknowns));
    let coefficients: Vec<&[f64]> = unknowns.iter().map(Vec::as_slice).collect();
    let found = residuals(targets, all, &coefficients, weights);
    let corrected = |((target, unknowns), found)| correct_output(target, weights, all, sums, unknowns, found);
    targets.iter().copied().zip(unknowns).zip(found).map(corrected).collect()
}

/// Corrects the unknowns of an output by the products of its residual.
fn correct_output(
    target: &[Lane],
    weights: Option<&[Lane]>,
    all: &[&[Lane]],
    sums: &Sums,
    mut unknowns: Vec<f64>,
    mut found: Residual,
) -> Output {
    let count = unknowns.len();
    let rounding = ROUNDING * square(target, weights);
    for attempt in 0..CORRECTIONS {
        let products = &found.products[..count];
        let mut correction = products.to_vec();
        sums.factor.solve(&mut correction);
        let gain: f64 = correction.iter().zip(products).map(|(change, product)| change * product).sum();
        unknowns.iter_mut().zip(&correction).for_each(|(unknown, change)| *unknown += change);
        if gain <= LEAST_CORRECTION * found.square || attempt == CORRECTIONS - 1 {
            // |e − A δ|² = |e|² − δᵀ Aᵀ e, and Bᵀ(e − A δ) = Bᵀ e − G_BA δ.
            let square = (found.square - gain).max(0.0) + rounding;
            let slopes = (count..all.len())
                .map(|row| {
                    let known = &sums.gram[row * sums.columns..row * sums.columns + count];
                    let change: f64 = known.iter().zip(&correction).map(|(sum, change)| sum * change).sum();
                    found.products[row] - change
                })
                .collect();
            return Output { unknowns, square, slopes, residual: found.values };
        }
        found = residuals(&[target], all, &[&unknowns], weights).remove(0);
    }
    Output {
        unknowns,
        square: found.square + rounding,
        slopes: found.products[count..].to_vec(),
        residual: found.values,
    }
}

impl Fit {
    /// Returns the poles after a damped step, its largest part of |Re λ|, and the decrease of the cost that it promises;
    /// `None` if the step is not finite.
    fn step(&self, damping: f64) -> Option<(Vec<Complex<f64>>, f64, f64)> {
        let size = self.gradient.len();
        let mut damped = self.information.clone();
        for k in 0..size {
            let diagonal = self.information[k * size + k];
            // In proportion to the diagonal, so that the poles of narrow modes, which the data determine far better,
            // are damped as much as those of wide ones.
            damped[k * size + k] += damping * if diagonal > 0.0 { diagonal } else { 1.0 };
        }
        let mut step = self.gradient.clone();
        Cholesky::new(size, &damped, size).solve(&mut step);
        let gain: f64 = step.iter().zip(&self.gradient).map(|(step, gradient)| step * gradient).sum();
        if !gain.is_finite() {
            return None;
        }
        let changes: Vec<Complex<f64>> = step.chunks_exact(2).map(|pair| Complex::new(pair[0], pair[1])).collect();
        let relative = |(pole, change): (&Complex<f64>, &Complex<f64>)| magnitude(*change) / pole.re.abs();
        let largest = self.poles.iter().zip(&changes).map(relative).fold(0.0, f64::max);
        // No pole moves by more than |Re λ|.
        let factor = if largest > 1.0 { 1.0 / largest } else { 1.0 };
        let moved = self.poles.iter().zip(&changes).map(|(pole, change)| {
            let moved = pole + change * factor;
            // A pole that would become unstable gets a third of its damping.
            let stable = moved.re <= -1e-6 * magnitude(moved);
            if stable { moved } else { Complex::new(-0.3 * pole.re.abs(), moved.im) }
        });
        Some((moved.collect(), largest * factor, gain))
    }

    /// Increase of the cost if a mode is left out, and the other poles stay.
    pub fn removal(&self, problem: &Problem, mode: usize) -> f64 {
        let mut increase = 0.0;
        for (run, found) in problem.runs.iter().zip(&self.runs) {
            for (index, output) in found.outputs.iter().enumerate() {
                let ratio = found.removal(index, mode) / output.square.max(f64::MIN_POSITIVE);
                increase += found.freedom(run) * libm::log1p(ratio);
            }
        }
        increase
    }

    /// The inverse of the information by rows: the covariance of (Re λ, Im λ) of all poles, if the weights are the inverse
    /// variances of independent noise. Infinite for poles that the data don't determine.
    pub fn covariance(&self) -> Vec<f64> {
        let size = self.gradient.len();
        let factor = Cholesky::new(size, &self.information, size);
        let mut inverse = vec![0.0; size * size];
        for column in 0..size {
            let mut unit = vec![0.0; size];
            unit[column] = 1.0;
            factor.solve(&mut unit);
            (0..size).for_each(|row| inverse[row * size + column] = unit[row]);
            if !factor.determines(column) {
                inverse[column * size + column] = f64::INFINITY;
            }
        }
        inverse
    }
}
