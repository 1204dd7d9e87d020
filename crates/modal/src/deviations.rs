//! Covariance of poles and residues.
//!
//! To first order the errors of the poles and of an output's linear unknowns are linear in the residuals e,
//!
//! ```text
//! δp = H⁻¹ Σₒ Jₒᵀ eₒ/vₒ,   δxₒ = Aₒ⁺ eₒ − Aₒ⁺ Dₒ δp,   eₒ = √wₒ (nₒ − Σᵢ Gₒᵢ nᵢ)
//! ```
//!
//! with H = Σₒ JₒᵀJₒ/vₒ, the own noise nₒ of each response and the noise nᵢ of the references, which all outputs of a run
//! have in common. So each error is Re Σₖ conj(z(k)) n(k) with a complex column z for each source of noise, and the covariance
//! of two errors is σ²/2 Re Σₖ conj(z) z', summed over the sources: a sandwich, which holds for any weights.
//!
//! Without weights and without noise of the references this is H⁻¹ for the poles, and vₒ G_AA⁻¹ + (A⁺D) H⁻¹ (A⁺D)ᵀ for the
//! linear unknowns.

use alloc::vec;
use alloc::vec::Vec;

use crate::columns::{Columns, Lane, add_conjugate_product, combine, gram, products};
use crate::fit::{Fit, Problem, RunFit};
use crate::model::Layout;
use crate::noise::gains;
use crate::run::{Pairs, Run, Variances};

/// A matrix of two rows and columns, over the real and the imaginary part.
pub(crate) type Block = [[f64; 2]; 2];

/// How a residue scatters.
#[derive(Clone, Debug)]
pub(crate) struct Spread {
    /// Covariance of A⁺e for the residue, and with that for the residue at the driving point of the same reference and run.
    own: Block,
    with_drive: Block,
    /// Covariance of A⁺e with the errors of the poles, for the real and the imaginary part.
    with_poles: [Vec<f64>; 2],
    /// A⁺D, for the real and the imaginary part.
    sensitivity: [Vec<f64>; 2],
}

/// Covariance of all results of a fit.
#[derive(Clone, Debug)]
pub(crate) struct Covariance {
    /// Of (Re λ, Im λ) of all poles, by rows.
    pub poles: Vec<f64>,
    /// Of the residues: `[run][output][reference][mode]`.
    residues: Vec<Vec<Vec<Vec<Spread>>>>,
}

/// Place of a residue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    pub run: usize,
    pub output: usize,
    pub reference: usize,
}

impl Covariance {
    /// Returns the covariance of the real and imaginary parts of a residue of a mode.
    pub fn of(&self, place: Place, mode: usize) -> Block {
        let spread = self.spread(place, mode);
        self.joint(spread, spread, spread.own, true)
    }

    /// Returns the covariance of a residue with that at a driving point, of the same reference.
    pub fn with_drive(&self, place: Place, drive: Place, mode: usize) -> Block {
        if place == drive {
            return self.of(place, mode);
        }
        let spread = self.spread(place, mode);
        let other = self.spread(drive, mode);
        let same = place.run == drive.run && place.reference == drive.reference;
        self.joint(spread, other, if same { spread.with_drive } else { [[0.0; 2]; 2] }, place.run == drive.run)
    }

    fn spread(&self, place: Place, mode: usize) -> &Spread {
        &self.residues[place.run][place.output][place.reference][mode]
    }

    /// cov(x − T δp, y − U δp) = cov(x, y) − cov(x, δp) Uᵀ − T cov(δp, y) + T P Uᵀ. Errors of different runs have only the
    /// poles in common, which each run's noise has moved.
    fn joint(&self, x: &Spread, y: &Spread, own: Block, same_run: bool) -> Block {
        let size = x.sensitivity[0].len();
        let mut block = [[0.0; 2]; 2];
        for i in 0..2 {
            for j in 0..2 {
                let poles: f64 = self
                    .poles
                    .chunks_exact(size.max(1))
                    .zip(&x.sensitivity[i])
                    .map(|(row, t)| t * dot(row, &y.sensitivity[j]))
                    .sum();
                let crossed = dot(&x.with_poles[i], &y.sensitivity[j]) + dot(&x.sensitivity[i], &y.with_poles[j]);
                block[i][j] = poles - crossed + if same_run { own[i][j] } else { 0.0 };
            }
        }
        block
    }
}

/// Returns the covariance of a fit; either all runs have weights or none.
pub(crate) fn covariance(problem: &Problem, fit: &Fit) -> Covariance {
    let inverse = fit.covariance();
    let mut found = Covariance { poles: inverse.clone(), residues: Vec::new() };
    if problem.runs.iter().any(|run| run.noise.is_some()) {
        // With weights the covariance of the poles is the sum of what the noise of each run contributes, below.
        found.poles.fill(0.0);
    }
    for (run, fit) in problem.runs.iter().zip(&fit.runs) {
        let Some(variances) = &run.noise else {
            found.residues.push(uniform(run, fit));
            continue;
        };
        let weighted = Weighted::new(run, fit, variances, &inverse);
        found.poles.iter_mut().zip(weighted.poles()).for_each(|(sum, part)| *sum += part);
        found.residues.push(weighted.residues());
    }
    found
}

/// Spreads for uniform noise of each output and exact references.
fn uniform(run: &Run, found: &RunFit) -> Vec<Vec<Vec<Spread>>> {
    let layout = &found.layout;
    let size = 2 * layout.modes;
    let of_output = |output: usize| {
        let sensitivity = found.sensitivity(output);
        let variance = found.variance(run, output);
        let of_reference = |reference: usize| {
            let of_mode = |mode: usize| {
                let unknowns = layout.residue(reference, mode);
                let mut own = [[0.0; 2]; 2];
                // A residue without a real part has its one unknown in the second row; the first stays zero, since what
                // is no unknown does not scatter.
                let skipped = 2 - unknowns.len();
                for (j, column) in unknowns.clone().enumerate() {
                    let mut unit = vec![0.0; layout.unknowns()];
                    unit[column] = variance;
                    found.solve(found.group(output), &mut unit);
                    unknowns.clone().enumerate().for_each(|(i, row)| own[skipped + i][skipped + j] = unit[row]);
                }
                Spread {
                    own,
                    with_drive: [[0.0; 2]; 2],
                    with_poles: [vec![0.0; size], vec![0.0; size]],
                    sensitivity: rows(&sensitivity, layout, reference, mode),
                }
            };
            (0..layout.modes).map(of_mode).collect()
        };
        (0..layout.references).map(of_reference).collect()
    };
    (0..run.outputs()).map(of_output).collect()
}

/// Returns the rows of a residue of A⁺D; zeros for a real part that is no unknown.
fn rows(sensitivity: &[f64], layout: &Layout, reference: usize, mode: usize) -> [Vec<f64>; 2] {
    let size = 2 * layout.modes;
    let row = |unknown: usize| sensitivity[unknown * size..(unknown + 1) * size].to_vec();
    let unknowns = layout.residue(reference, mode);
    match unknowns.len() {
        2 => [row(unknowns.start), row(unknowns.start + 1)],
        _ => [vec![0.0; size], row(unknowns.start)],
    }
}

/// A run with weights. With P = w (B − A A⁺B) the error of the poles is, from the own noise of output o, P Cₒ with the small
/// matrix Cₒ = Sₒ H⁻¹/vₒ.
struct Weighted<'a> {
    run: &'a Run,
    found: &'a RunFit,
    variances: &'a Variances,
    gains: Columns,
    /// A⁺D of each output.
    sensitivities: Vec<Vec<f64>>,
    /// Columns P of each group of outputs with the same weights.
    perpendicular: Vec<Columns>,
    /// Cₒ of each output, by columns.
    pole_coefficients: Vec<Vec<Vec<f64>>>,
    /// For each reference the columns z of δp from its noise.
    common: Vec<Columns>,
}

/// Errors A⁺e of a residue in a group of outputs with the same weights.
struct ResidueErrors {
    /// Columns z for the real and the imaginary part.
    columns: Columns,
    /// Sums of their products with P, by rows.
    with_poles: Vec<f64>,
}

impl<'a> Weighted<'a> {
    /// Prepares the columns of the errors of the poles; `inverse` is H⁻¹ by rows.
    fn new(run: &'a Run, found: &'a RunFit, variances: &'a Variances, inverse: &[f64]) -> Weighted<'a> {
        let layout = &found.layout;
        let size = 2 * layout.modes;
        let slopes = layout.slopes();
        let lines = run.grid.lines();
        let all: Vec<&[Lane]> = found.columns.iter().collect();
        let perpendicular: Vec<Columns> = (0..found.groups())
            .map(|group| {
                let mut columns = Columns::zeros(lines, slopes);
                for slope in 0..slopes {
                    let mut coefficients = vec![0.0; layout.unknowns() + slopes];
                    let known = found.explained(group).iter().skip(slope).step_by(slopes);
                    coefficients.iter_mut().zip(known).for_each(|(coefficient, known)| *coefficient = -known);
                    coefficients[layout.unknowns() + slope] = 1.0;
                    combine(&all, &coefficients, run.weights_of(group), columns.column_mut(slope));
                }
                columns
            })
            .collect();
        let gains = gains(run, found);
        let mut common = vec![Columns::zeros(lines, size); run.inputs()];
        let mut pole_coefficients = Vec::new();
        let mut error = Columns::zeros(lines, 1);
        for (output, fit) in found.outputs.iter().enumerate() {
            // Without noise, as in computed data, the variance is zero; the bound keeps its inverse finite.
            let by_variance = 1.0 / found.variance(run, output).max(f64::MIN_POSITIVE);
            let part: Vec<&[Lane]> = perpendicular[found.group(output)].iter().collect();
            let mut of_output = Vec::new();
            for column in 0..size {
                let pole = |row: usize| by_variance * inverse[row * size + column];
                let mut coefficients = vec![0.0; slopes];
                for mode in 0..layout.modes {
                    let [re, im] = [pole(2 * mode), pole(2 * mode + 1)];
                    for (place, [x, y]) in layout.slopes_of(mode, &fit.unknowns) {
                        coefficients[place] += x * re - y * im;
                        coefficients[place + 1] += y * re + x * im;
                    }
                }
                if variances.references.iter().any(|variance| *variance > 0.0) {
                    combine(&part, &coefficients, None, error.column_mut(0));
                    for (input, common) in common.iter_mut().enumerate() {
                        let gain = gains.parts(output * run.inputs() + input);
                        add_conjugate_product(common.parts_mut(column), gain, error.parts(0));
                    }
                }
                of_output.push(coefficients);
            }
            pole_coefficients.push(of_output);
        }
        let sensitivities = (0..run.outputs()).map(|output| found.sensitivity(output)).collect();
        Weighted { run, found, variances, gains, sensitivities, perpendicular, pole_coefficients, common }
    }

    /// Covariance of the poles from the noise of this run.
    fn poles(&self) -> Vec<f64> {
        let size = 2 * self.found.layout.modes;
        let mut sum = vec![0.0; size * size];
        let squares: Vec<Vec<f64>> =
            self.perpendicular.iter().map(|columns| gram(&columns.iter().collect::<Vec<_>>(), None)).collect();
        for (output, coefficients) in self.pole_coefficients.iter().enumerate() {
            let square = &squares[self.found.group(output)];
            for (column, right) in coefficients.iter().enumerate() {
                let product: Vec<f64> = square.chunks_exact(right.len()).map(|row| dot(row, right)).collect();
                for (row, left) in coefficients.iter().enumerate() {
                    sum[row * size + column] += 0.5 * self.variances.responses[output] * dot(left, &product);
                }
            }
        }
        for (columns, variance) in self.common.iter().zip(&self.variances.references) {
            let part = gram(&columns.iter().collect::<Vec<_>>(), None);
            sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += 0.5 * variance * part);
        }
        sum
    }

    /// Spreads of all residues.
    fn residues(&self) -> Vec<Vec<Vec<Spread>>> {
        let layout = &self.found.layout;
        let mut all = vec![vec![Vec::new(); layout.references]; self.run.outputs()];
        for reference in 0..layout.references {
            let drive = match &self.run.pairs {
                Pairs::All { references, responses } => {
                    responses.iter().position(|response| *response == references[reference])
                }
                Pairs::Each(_) => None,
            };
            for mode in 0..layout.modes {
                let errors: Vec<ResidueErrors> =
                    (0..self.found.groups()).map(|group| self.residue_errors(group, reference, mode)).collect();
                let of = |output: usize| &errors[self.found.group(output)];
                // The error at the driving point from the noise of each reference.
                let driven: Vec<Columns> = drive.map_or_else(Vec::new, |drive| {
                    (0..self.run.inputs()).map(|input| self.through(drive, input, &of(drive).columns)).collect()
                });
                for (output, spreads) in all.iter_mut().enumerate() {
                    let mut spread = self.spread(output, of(output), &driven);
                    if drive == Some(output) {
                        spread.with_drive = spread.own;
                    }
                    spread.sensitivity = rows(&self.sensitivities[output], layout, reference, mode);
                    spreads[reference].push(spread);
                }
            }
        }
        all
    }

    fn residue_errors(&self, group: usize, reference: usize, mode: usize) -> ResidueErrors {
        let layout = &self.found.layout;
        let unknowns = layout.residue(reference, mode);
        let all: Vec<&[Lane]> = self.found.columns.iter().collect();
        let mut columns = Columns::zeros(self.run.grid.lines(), 2);
        for (part, unknown) in (2 - unknowns.len()..2).zip(unknowns) {
            let mut coefficients = vec![0.0; layout.unknowns()];
            coefficients[unknown] = 1.0;
            self.found.solve(group, &mut coefficients);
            combine(&all, &coefficients, self.run.weights_of(group), columns.column_mut(part));
        }
        let poles: Vec<&[Lane]> = self.perpendicular[group].iter().collect();
        let with_poles = products(&columns.iter().collect::<Vec<_>>(), &poles);
        ResidueErrors { columns, with_poles }
    }

    /// Columns of an output's error as the noise of a reference makes it.
    fn through(&self, output: usize, input: usize, columns: &Columns) -> Columns {
        let mut found = Columns::zeros(self.run.grid.lines(), columns.count());
        let gain = self.gains.parts(output * self.run.inputs() + input);
        for column in 0..columns.count() {
            add_conjugate_product(found.parts_mut(column), gain, columns.parts(column));
        }
        found
    }

    /// Spread of a residue without its sensitivity. `driven` are the columns of the error at the driving point.
    fn spread(&self, output: usize, errors: &ResidueErrors, driven: &[Columns]) -> Spread {
        let size = 2 * self.found.layout.modes;
        let mut own = [[0.0; 2]; 2];
        let mut with_drive = [[0.0; 2]; 2];
        let all: Vec<&[Lane]> = errors.columns.iter().collect();
        // σ² is the variance of a complex number, of which the real and the imaginary part have half each.
        let half = 0.5 * self.variances.responses[output];
        add_block(&mut own, &products(&all, &all), half);
        let slopes = self.found.layout.slopes();
        let mut with_poles = [0, 1].map(|part| {
            let row = &errors.with_poles[part * slopes..(part + 1) * slopes];
            self.pole_coefficients[output]
                .iter()
                .map(|coefficients| half * dot(row, coefficients))
                .collect::<Vec<f64>>()
        });
        for (input, variance) in self.variances.references.iter().enumerate() {
            if *variance == 0.0 {
                continue;
            }
            let through = self.through(output, input, &errors.columns);
            let through: Vec<&[Lane]> = through.iter().collect();
            add_block(&mut own, &products(&through, &through), 0.5 * variance);
            let sums = products(&through, &self.common[input].iter().collect::<Vec<_>>());
            for (target, row) in with_poles.iter_mut().zip(sums.chunks_exact(size)) {
                target.iter_mut().zip(row).for_each(|(target, sum)| *target += 0.5 * variance * sum);
            }
            if let Some(driven) = driven.get(input) {
                let sums = products(&through, &driven.iter().collect::<Vec<_>>());
                add_block(&mut with_drive, &sums, 0.5 * variance);
            }
        }
        Spread { own, with_drive, with_poles, sensitivity: [Vec::new(), Vec::new()] }
    }
}

/// Adds a multiple of a matrix by rows to a block.
fn add_block(block: &mut Block, sums: &[f64], factor: f64) {
    block.as_flattened_mut().iter_mut().zip(sums).for_each(|(value, sum)| *value += factor * sum);
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
