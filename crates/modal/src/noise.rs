//! Noise of responses and references: its estimate, the weights that follow, and the references of least noise.
//!
//! The residual of output o has the variance σₒ² + Σᵢ |Gₒᵢ|² σᵢ², since the measured references Uᵢ carry noise σᵢ that the
//! structure does not see: at a sharp resonance it exceeds the noise of the response by far. σₒ² and σᵢ² are the most likely
//! ones for |e|² over all lines and outputs: a regression with the weights 1/variance² of exponentially distributed |e|².
//!
//! A fit with the measured references is too low by about σᵢ²/|Uᵢ|². With C = diag σₒ² + Σᵢ σᵢ² gᵢ gᵢᴴ the covariance of the
//! residuals of all outputs at a line, the most likely references are
//!
//! ```text
//! Ûᵢ = Uᵢ + σᵢ² gᵢᴴ C⁻¹ e,   gᴴ C⁻¹ e = (1 + gᴴ D⁻¹ g S)⁻¹ gᴴ D⁻¹ e,   D = diag σₒ², S = diag σᵢ²
//! ```
//!
//! They take the place of Uᵢ in the columns, and Yₒ − Σᵢ Gₒᵢ (Uᵢ − Ûᵢ) that of Yₒ (R. Pintelon, J. Schoukens, "System
//! Identification: A Frequency Domain Approach", 2nd edition 2012, chapter 9).

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::Complex;
use resonarm_numeric::linear_solve::solve_complex;

use crate::cholesky::Cholesky;
use crate::columns::Columns;
use crate::fit::{Fit, Output, Problem, ROUNDING, RunFit};
use crate::run::{Run, Variances};

/// Rounds of the regression, each with the weights of the one before.
const ROUNDS: usize = 15;
/// A variance falls at most to this part in a round.
const LEAST_PART: f64 = 1e-3;
/// Most outputs of a run that have their own weights.
const OWN_WEIGHTS: usize = 8;
/// Least part of a step, and least change of the likelihood.
const LEAST_STEP: f64 = 1e-3;
const LEAST_CHANGE: f64 = 1e-6;

/// Gains of all outputs over all references: output o and reference i in column o · references + i.
pub(crate) fn gains(run: &Run, found: &RunFit) -> Columns {
    let gain = &found.gain[0];
    let layout = &found.layout;
    let mut all = Columns::zeros(run.grid.lines(), found.outputs.len() * layout.references);
    for (index, output) in found.outputs.iter().enumerate() {
        for reference in 0..layout.references {
            let start = reference * layout.gain();
            let target = all.column_mut(index * layout.references + reference);
            for (column, factor) in gain.iter().zip(&output.unknowns[start..start + layout.gain()]) {
                for (target, value) in target.iter_mut().zip(column) {
                    target.iter_mut().zip(value).for_each(|(target, value)| *target += factor * value);
                }
            }
        }
    }
    all
}

/// Returns |z|² of a column at every line.
fn powers(columns: &Columns, index: usize, lines: usize) -> Vec<f64> {
    let [re, im] = columns.parts(index);
    let all = re.as_flattened().iter().zip(im.as_flattened()).map(|(re, im)| re * re + im * im);
    all.take(lines).collect()
}

/// Returns the median; 0 of no value.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        count if count % 2 == 1 => values[count / 2],
        count => 0.5 * (values[count / 2 - 1] + values[count / 2]),
    }
}

/// Regression of |e|² on σₒ² + Σᵢ |Gₒᵢ|² σᵢ², as if the residuals of the outputs were independent.
struct Regression {
    /// |e|² of each output and line.
    residuals: Vec<Vec<f64>>,
    /// |G|² of output o and reference i at o · references + i.
    gains: Vec<Vec<f64>>,
    /// Least variances of the outputs.
    least: Vec<f64>,
    /// Whether references have noise.
    noisy: bool,
}

impl Regression {
    fn new(run: &Run, found: &RunFit, gains: &Columns) -> Regression {
        let lines = run.grid.lines();
        let power_of = |output: &Output| (0..lines).map(|line| output.residual_at(line).norm_sqr()).collect();
        let least = (0..run.outputs()).map(|output| {
            let power: f64 = powers(&run.measured_responses, output, lines).iter().sum();
            (ROUNDING * power / lines as f64).max(f64::MIN_POSITIVE)
        });
        Regression {
            residuals: found.outputs.iter().map(power_of).collect(),
            gains: (0..gains.count()).map(|index| powers(gains, index, lines)).collect(),
            least: least.collect(),
            noisy: run.noisy_references,
        }
    }

    /// Returns the variances that maximise the likelihood of exponentially distributed |e|².
    ///
    /// Each round solves the regression with weights from the variances so far, R. A. Fisher's scoring. Where the solution is
    /// less likely, which happens while a variance is far too small and its few lines have all the weight, the step is halved.
    fn variances(&self, inputs: usize) -> Variances {
        // The median of an exponential distribution of mean 1 is ln 2.
        let middle = |residual: &Vec<f64>| median(&mut residual.clone()) / core::f64::consts::LN_2;
        let responses = self.residuals.iter().map(middle).zip(&self.least).map(|(value, least)| value.max(*least));
        let mut found = Variances { responses: responses.collect(), references: vec![0.0; inputs] };
        let mut value = self.likelihood(&found);
        for _ in 0..ROUNDS {
            let solution = self.solve(&found);
            let mut part = 1.0;
            let step = loop {
                let between = |from: &[f64], to: &[f64]| {
                    from.iter().zip(to).map(|(from, to)| from + part * (to - from)).collect::<Vec<f64>>()
                };
                let tried = Variances {
                    responses: between(&found.responses, &solution.responses),
                    references: between(&found.references, &solution.references),
                };
                let tried_value = self.likelihood(&tried);
                if tried_value <= value {
                    break Some((tried, tried_value));
                }
                part *= 0.5;
                if part < LEAST_STEP {
                    break None;
                }
            };
            let Some((tried, tried_value)) = step else { break };
            let change = value - tried_value;
            found = tried;
            value = tried_value;
            if change < LEAST_CHANGE {
                break;
            }
        }
        found
    }

    /// Returns the noise of the references that a response shows at a line.
    fn through(&self, variances: &Variances, output: usize, line: usize) -> f64 {
        let inputs = variances.references.len();
        variances
            .references
            .iter()
            .zip(&self.gains[output * inputs..])
            .map(|(variance, gain)| variance * gain[line])
            .sum()
    }

    /// Returns −ln L = Σ ln v + |e|²/v.
    fn likelihood(&self, variances: &Variances) -> f64 {
        let of_output = |(output, residual): (usize, &Vec<f64>)| {
            let own = variances.responses[output];
            let line = |(line, power): (usize, &f64)| {
                let variance = own + self.through(variances, output, line);
                libm::log(variance) + power / variance
            };
            residual.iter().enumerate().map(line).sum::<f64>()
        };
        self.residuals.iter().enumerate().map(of_output).sum()
    }

    /// Solves the regression with the weights of these variances.
    fn solve(&self, variances: &Variances) -> Variances {
        let inputs = variances.references.len();
        // For each output: Σ w, Σ w |Gᵢ|², Σ w |e|²; over all outputs: what is left for the references without σₒ².
        let mut own = Vec::with_capacity(self.residuals.len());
        let mut shared = vec![0.0; inputs * inputs];
        let mut right = vec![0.0; inputs];
        let mut sizes = vec![0.0; inputs];
        for (output, residual) in self.residuals.iter().enumerate() {
            let gain = |input: usize, line: usize| self.gains[output * inputs + input][line];
            let mut weight_sum = 0.0;
            let mut powers = 0.0;
            let mut sums = vec![0.0; inputs];
            let mut products = vec![0.0; inputs * inputs];
            let mut moments = vec![0.0; inputs];
            for (line, power) in residual.iter().enumerate() {
                // Relative to the variance of the response, so that squares neither overflow nor vanish.
                let response = variances.responses[output];
                let relative = response / (response + self.through(variances, output, line));
                let weight = relative * relative;
                weight_sum += weight;
                powers += weight * power;
                for i in 0..inputs {
                    sums[i] += weight * gain(i, line);
                    moments[i] += weight * gain(i, line) * power;
                    for j in 0..inputs {
                        products[i * inputs + j] += weight * gain(i, line) * gain(j, line);
                    }
                }
            }
            let scale = 1.0 / (variances.responses[output] * variances.responses[output]);
            for i in 0..inputs {
                right[i] += scale * (moments[i] - sums[i] * powers / weight_sum);
                sizes[i] += scale * products[i * inputs + i];
                for j in 0..inputs {
                    shared[i * inputs + j] += scale * (products[i * inputs + j] - sums[i] * sums[j] / weight_sum);
                }
            }
            own.push((weight_sum, sums, powers));
        }
        let mut references = vec![0.0; inputs];
        if self.noisy {
            // A gain that is the same at all lines can't be told from the noise of the response: the matrix is then
            // singular but for this.
            (0..inputs).for_each(|i| shared[i * inputs + i] += 1e-12 * sizes[i]);
            references = non_negative(&shared, &right);
        }
        let response = |(output, (weight_sum, sums, powers)): (usize, (f64, Vec<f64>, f64))| {
            let inner: f64 = sums.iter().zip(&references).map(|(sum, reference)| sum * reference).sum();
            ((powers - inner) / weight_sum).max(LEAST_PART * variances.responses[output]).max(self.least[output])
        };
        Variances { responses: own.into_iter().enumerate().map(response).collect(), references }
    }
}

/// Solves for variances; one that comes out negative is 0, the most negative one first.
fn non_negative(matrix: &[f64], right: &[f64]) -> Vec<f64> {
    let size = right.len();
    let mut kept: Vec<usize> = (0..size).collect();
    loop {
        let part: Vec<f64> = kept.iter().flat_map(|i| kept.iter().map(move |j| matrix[i * size + j])).collect();
        let mut solved: Vec<f64> = kept.iter().map(|i| right[*i]).collect();
        Cholesky::new(kept.len(), &part, kept.len()).solve(&mut solved);
        let least = (0..kept.len()).min_by(|a, b| solved[*a].total_cmp(&solved[*b]));
        match least {
            Some(index) if solved[index] < 0.0 => {
                kept.remove(index);
            }
            _ => {
                let mut found = vec![0.0; size];
                kept.iter().zip(solved).for_each(|(i, value)| found[*i] = value);
                return found;
            }
        }
    }
}

/// Sets the weights of a run: 1/(σₒ² + Σᵢ |Gₒᵢ|² σᵢ²) for each output, or for many outputs the same for all, 1/⟨1 + Σᵢ |Gₒᵢ|²
/// σᵢ²/σₒ²⟩ with the mean over the outputs. One matrix of sums then serves all outputs, where each would need its own. The
/// covariance holds for any weights.
fn set_weights(run: &mut Run, gains: &Columns, variances: &Variances) {
    let lines = run.grid.lines();
    let inputs = run.inputs();
    let outputs = run.outputs();
    let total = |output: usize| {
        let mut total = vec![variances.responses[output]; lines];
        for (input, variance) in variances.references.iter().enumerate() {
            let powers = powers(gains, output * inputs + input, lines);
            total.iter_mut().zip(powers).for_each(|(total, power)| *total += variance * power);
        }
        total
    };
    let columns: Vec<Vec<f64>> = if outputs > OWN_WEIGHTS {
        let mut mean = vec![0.0; lines];
        for output in 0..outputs {
            let scale = 1.0 / (outputs as f64 * variances.responses[output]);
            mean.iter_mut().zip(total(output)).for_each(|(mean, total)| *mean += scale * total);
        }
        vec![mean]
    } else {
        (0..outputs).map(total).collect()
    };
    let mut weights = Columns::zeros(lines, columns.len());
    for (index, totals) in columns.iter().enumerate() {
        let values: Vec<Complex<f64>> = totals.iter().map(|total| Complex::new(1.0 / total, 1.0 / total)).collect();
        weights.set(index, &values);
    }
    run.weights = weights;
}

/// Puts the most likely references of a run in place of the measured ones.
fn correct_run(run: &mut Run, found: &RunFit, gains: &Columns, variances: &Variances) {
    let lines = run.grid.lines();
    let inputs = run.inputs();
    let outputs = run.outputs();
    let mut references = vec![Vec::with_capacity(lines); inputs];
    let mut responses = vec![Vec::with_capacity(lines); outputs];
    for line in 0..lines {
        let gain = |output: usize, input: usize| gains.value(output * inputs + input, line);
        let mut matrix = vec![Complex::new(0.0, 0.0); inputs * inputs];
        let mut shift = vec![Complex::new(0.0, 0.0); inputs];
        for output in 0..outputs {
            let by_variance = 1.0 / variances.responses[output];
            for i in 0..inputs {
                let scaled = gain(output, i).conj() * by_variance;
                shift[i] += scaled * found.outputs[output].residual_at(line);
                for j in 0..inputs {
                    matrix[i * inputs + j] += scaled * gain(output, j) * variances.references[j];
                }
            }
        }
        (0..inputs).for_each(|i| matrix[i * inputs + i] += 1.0);
        // The matrix has no eigenvalue below 1, so it is solved.
        if solve_complex(&mut matrix, &mut shift).is_none() {
            shift.fill(Complex::new(0.0, 0.0));
        }
        shift.iter_mut().zip(&variances.references).for_each(|(shift, variance)| *shift *= *variance);
        for (input, values) in references.iter_mut().enumerate() {
            values.push(run.measured_references.value(input, line) + shift[input]);
        }
        for (output, values) in responses.iter_mut().enumerate() {
            let moved: Complex<f64> = (0..inputs).map(|input| gain(output, input) * shift[input]).sum();
            values.push(run.measured_responses.value(output, line) + moved);
        }
    }
    references.iter().enumerate().for_each(|(input, values)| run.references.set(input, values));
    responses.iter().enumerate().for_each(|(output, values)| run.responses.set(output, values));
}

/// Sets the weights of all runs from the residuals of a fit to the measured references.
pub(crate) fn weigh(problem: &mut Problem, fit: &Fit) {
    for (run, found) in problem.runs.iter_mut().zip(&fit.runs) {
        let gains = gains(run, found);
        let variances = Regression::new(run, found, &gains).variances(run.inputs());
        set_weights(run, &gains, &variances);
        run.noise = Some(variances);
    }
}

/// Puts the most likely references of all runs in place of the measured ones, given a fit to those and variances that come
/// from it.
pub(crate) fn correct(problem: &mut Problem, fit: &Fit) {
    for (run, found) in problem.runs.iter_mut().zip(&fit.runs) {
        if let Some(variances) = run.noise.clone() {
            let gains = gains(run, found);
            correct_run(run, found, &gains, &variances);
        }
    }
}

/// Power of the residuals of a run over their variances, at every line.
pub(crate) struct Normalised {
    /// Sum over the outputs, whose mean is their number if the residuals are noise.
    pub power: Vec<f64>,
    /// Variance of that sum: the number of outputs, and more where the noise of the references makes their residuals alike.
    pub variance: Vec<f64>,
}

/// Returns Σₒ |eₒ|²/Cₒₒ of a run at every line, C being the covariance of the residuals of all outputs, and its variance Σₒₚ
/// |Cₒₚ|²/(Cₒₒ Cₚₚ), that of complex Gaussian noise.
pub(crate) fn normalised(run: &Run, found: &RunFit) -> Normalised {
    let outputs = run.outputs();
    let inputs = run.inputs();
    let gains = gains(run, found);
    let variances = run.noise.clone().unwrap_or_else(|| Variances {
        // The real and the imaginary part have this variance each.
        responses: (0..outputs).map(|output| 2.0 * found.variance(run, output)).collect(),
        references: vec![0.0; inputs],
    });
    let noisy = variances.references.iter().any(|variance| *variance > 0.0);
    let at_line = |line: usize| {
        let through: Vec<Complex<f64>> = (0..outputs * inputs)
            .map(|k| gains.value(k, line) * libm::sqrt(variances.references[k % inputs]))
            .collect();
        let of_output = |output: usize| &through[output * inputs..(output + 1) * inputs];
        let own =
            |output: usize| variances.responses[output] + of_output(output).iter().map(Complex::norm_sqr).sum::<f64>();
        let totals: Vec<f64> = (0..outputs).map(own).collect();
        let power = |output: &Output| output.residual_at(line).norm_sqr();
        let powers = totals.iter().zip(&found.outputs).map(|(total, output)| power(output) / total);
        let mut variance = outputs as f64;
        for a in 0..if noisy { outputs } else { 0 } {
            for b in 0..a {
                let common: Complex<f64> = of_output(a).iter().zip(of_output(b)).map(|(a, b)| a * b.conj()).sum();
                variance += 2.0 * common.norm_sqr() / (totals[a] * totals[b]);
            }
        }
        (powers.sum::<f64>(), variance)
    };
    let (power, variance) = (0..run.grid.lines()).map(at_line).unzip();
    Normalised { power, variance }
}

/// Returns −2 ln L of a fit with the variances that follow from its own residuals: Σ 2 (ln v + |e|²/v).
pub(crate) fn likelihood(problem: &Problem, fit: &Fit) -> f64 {
    let of_run = |(run, found): (&Run, &RunFit)| {
        let regression = Regression::new(run, found, &gains(run, found));
        2.0 * regression.likelihood(&regression.variances(run.inputs()))
    };
    problem.runs.iter().zip(&fit.runs).map(of_run).sum()
}
