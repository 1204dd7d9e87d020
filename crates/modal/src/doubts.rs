//! When no honest deviation can be stated.

use alloc::vec::Vec;

use crate::complex::magnitude;
use crate::deviations::Covariance;
use crate::fit::{Fit, Problem};
use crate::modes::{Doubt, Mode, RunReport};
use crate::order::{Excess, MOST_UNCERTAIN};
use crate::pole::{block, frequency_hz};

/// Estimated over known noise above which the residual holds more than noise.
const ABOVE_NOISE: f64 = 1.5;
/// Least number of lines in a half-power bandwidth, where the record is not at rest: with 0.62 and 0.31 lines 100 records each
/// scattered as stated, with fewer it was not tried.
const LEAST_LINES: f64 = 0.3;
/// Largest part of a reference's power that is noise.
const MOST_NOISE: f64 = 0.01;
/// Least distance of two poles in deviations.
const LEAST_DISTANCE: f64 = 2.0;

/// Fills in the doubts of all modes. Most thresholds are judgement.
pub(crate) fn doubt(
    modes: &mut [Mode],
    problem: &Problem,
    fit: &Fit,
    covariance: &Covariance,
    reports: &[RunReport],
    excess: Option<Excess>,
) {
    let mut common: Vec<Doubt> = Vec::new();
    let channels = reports.iter().flat_map(|report| {
        let references = report.reference_noise.iter().map(|channel| (channel, true));
        references.chain(report.response_noise.iter().map(|channel| (channel, false)))
    });
    let above: Vec<(usize, bool, f64)> = channels
        .filter_map(|(channel, is_reference)| {
            let ratio = channel.estimated / channel.known?;
            (ratio > ABOVE_NOISE).then_some((channel.dof, is_reference, ratio))
        })
        .collect();
    // What is missing in the model shows in many channels: they are one doubt.
    if let Some((dof, is_reference, ratio)) = above.iter().copied().max_by(|a, b| a.2.total_cmp(&b.2)) {
        common.push(Doubt::AboveInstrument { dof, is_reference, ratio, others: above.len() - 1 });
    }
    if let Some(Excess { frequency_hz, ratio }) = excess {
        common.push(Doubt::NotWhite { frequency_hz, ratio });
    }
    for (index, mode) in modes.iter_mut().enumerate() {
        let doubts = &mut mode.doubts;
        doubts.extend(&common);
        let ratio = mode.computed.damping_ratio / mode.damping_ratio;
        // A deviation that is not a number is no deviation either.
        if ratio.is_nan() || ratio > MOST_UNCERTAIN {
            doubts.push(Doubt::Uncertain { ratio });
        }
        let bandwidth_hz = 2.0 * mode.damping_ratio * mode.frequency_hz;
        let lines = problem.runs.iter().filter(|run| run.transient).map(|run| bandwidth_hz / run.spacing_hz);
        let lines = lines.fold(f64::INFINITY, f64::min);
        if lines < LEAST_LINES {
            doubts.push(Doubt::TooShort { lines });
        }
        doubts.extend(noisy_references(problem, mode.frequency_hz, bandwidth_hz));
        doubts.extend(close(fit, covariance, index));
    }
}

/// References whose noise is a large part of their power in a half-power band, or at the line next to its centre.
fn noisy_references(problem: &Problem, frequency_hz: f64, bandwidth_hz: f64) -> Vec<Doubt> {
    let mut found = Vec::new();
    for run in &problem.runs {
        let Some(variances) = &run.noise else { continue };
        let lines = &run.grid.frequency_hz;
        let distance = |line: &usize| (lines[*line] - frequency_hz).abs();
        let mut near: Vec<usize> = (0..lines.len()).filter(|line| distance(line) <= 0.5 * bandwidth_hz).collect();
        if near.is_empty() {
            // A sharp resonance may lie between two lines, so that none is within its bandwidth.
            near.extend((0..lines.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))));
        }
        for (reference, variance) in variances.references.iter().enumerate() {
            let powers = near.iter().map(|line| run.measured_references.value(reference, *line).norm_sqr());
            let power = powers.sum::<f64>() / near.len() as f64;
            let share = variance / power;
            if share > MOST_NOISE {
                let [dof, _] = run.pairs.dofs(0, reference);
                found.push(Doubt::NoisyReference { dof, share });
            }
        }
    }
    found
}

/// Another pole at a distance that could be chance.
fn close(fit: &Fit, covariance: &Covariance, mode: usize) -> Option<Doubt> {
    let count = fit.poles.len();
    let spread = |mode: usize| {
        let block = block(&covariance.poles, count, mode);
        block[0][0] + block[1][1]
    };
    let distances = (0..count).filter(|other| *other != mode).map(|other| {
        let distance = magnitude(fit.poles[mode] - fit.poles[other]);
        (distance / libm::sqrt(spread(mode) + spread(other)), other)
    });
    let (distance, other) = distances.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (distance < LEAST_DISTANCE).then(|| Doubt::Close { frequency_hz: frequency_hz(fit.poles[other]), distance })
}

/// Comparison of a mode at two levels of excitation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeShift {
    /// Index of the mode in the first identification.
    pub first: usize,
    /// Index of the mode in the second identification.
    pub second: usize,
    /// Difference of the natural frequencies, second − first, in its standard deviations.
    pub frequency_z: f64,
    /// Difference of the natural frequencies over the first one.
    pub frequency_shift: f64,
    /// Difference of the damping ratios in its standard deviations.
    pub damping_z: f64,
    /// Difference of the damping ratios over the first one.
    pub damping_shift: f64,
    /// Whether the mode is nonlinear: a difference above four deviations, and above what rounding can do: 1e-6 of the
    /// frequency, 1e-4 of the damping ratio. Without noise deviations are as small as rounding errors.
    pub nonlinear: bool,
}

/// Differences in deviations, and relative ones, above which a structure is not linear.
const NONLINEAR_Z: f64 = 4.0;
const LEAST_FREQUENCY_SHIFT: f64 = 1e-6;
const LEAST_DAMPING_SHIFT: f64 = 1e-4;

/// Compares the modes of a structure that was driven at two levels. Modes belong together that are nearest to each other and
/// within the sum of their half-power bandwidths.
pub fn compare_levels(first: &[Mode], second: &[Mode]) -> Vec<ModeShift> {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (i, a) in first.iter().enumerate() {
        for (j, b) in second.iter().enumerate() {
            let distance = magnitude(a.pole - b.pole);
            if distance < 2.0 * (a.pole.re.abs() + b.pole.re.abs()) {
                pairs.push((distance, i, j));
            }
        }
    }
    // The nearest pair is taken first and neither mode again, so that of two close modes each finds its own.
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut found: Vec<ModeShift> = Vec::new();
    for (_, i, j) in pairs {
        if found.iter().any(|shift| shift.first == i || shift.second == j) {
            continue;
        }
        let a = &first[i];
        let b = &second[j];
        // The two identifications have independent noise: their variances add. Without noise both are zero, and the
        // bound keeps the quotient finite.
        let z = |difference: f64, a: f64, b: f64| difference / libm::hypot(a, b).max(f64::MIN_POSITIVE);
        let frequency = b.frequency_hz - a.frequency_hz;
        let damping = b.damping_ratio - a.damping_ratio;
        let shift = ModeShift {
            first: i,
            second: j,
            frequency_z: z(frequency, a.computed.frequency_hz, b.computed.frequency_hz),
            frequency_shift: frequency / a.frequency_hz,
            damping_z: z(damping, a.computed.damping_ratio, b.computed.damping_ratio),
            damping_shift: damping / a.damping_ratio,
            nonlinear: false,
        };
        let by_frequency = shift.frequency_z.abs() > NONLINEAR_Z && shift.frequency_shift.abs() > LEAST_FREQUENCY_SHIFT;
        let by_damping = shift.damping_z.abs() > NONLINEAR_Z && shift.damping_shift.abs() > LEAST_DAMPING_SHIFT;
        found.push(ModeShift { nonlinear: by_frequency || by_damping, ..shift });
    }
    found.sort_by_key(|shift| shift.first);
    found
}

/// Compares the modes at two levels as [`compare_levels`]. If one of them is nonlinear the structure is, and every mode of both
/// gets a [`Doubt::Nonlinear`].
pub fn judge_levels(first: &mut [Mode], second: &mut [Mode]) -> Vec<ModeShift> {
    let shifts = compare_levels(first, second);
    if shifts.iter().any(|shift| shift.nonlinear) {
        let z = shifts.iter().fold(0.0_f64, |z, shift| z.max(shift.frequency_z.abs()).max(shift.damping_z.abs()));
        first.iter_mut().chain(second).for_each(|mode| mode.doubts.push(Doubt::Nonlinear { z }));
    }
    shifts
}
