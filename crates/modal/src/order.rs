//! Number of modes.
//!
//! Modes are left out, and added, as long as that improves the likelihood by more than what a mode's unknowns gain by chance:
//! 1.5 times the penalty p ln n of G. Schwarz, "Estimating the Dimension of a Model", Ann. Statist. 6 (1978), with p the real
//! unknowns of a mode and n the real data.
//!
//! Removal with the other poles held overstates a false pole beside a true one, a *twin*, and weights that come from a fit with
//! a false pole protect it. So each suspect is left out once more, the other modes are fitted again with new weights, and the
//! whole likelihoods are compared.

use alloc::vec::Vec;
use core::f64::consts::TAU;

use nalgebra::Complex;

use crate::complex::magnitude;
use crate::fit::{Fit, Precision, Problem};
use crate::noise::{Normalised, likelihood, median, normalised, weigh};
use crate::pole::{block, damping_ratio, deviations, pole};
use crate::run::Band;
use resonarm_numeric::distribution::chi_square_survival;

/// Factor on the penalty.
const FACTOR: f64 = 1.5;
/// Largest damping ratio of a mode.
pub(crate) const MOST_DAMPING: f64 = 0.3;
/// Largest relative deviation of a damping ratio.
pub(crate) const MOST_UNCERTAIN: f64 = 0.3;
/// Modes up to which more are added. The start finds only half of the modes that are over several octaves, as they are crowded
/// on its circle; each further one must improve the likelihood, so that this number is not reached by a linear structure.
const MOST_MODES: usize = 64;
/// A residual is white if its smoothed power would exceed its median as much with more than this probability, anywhere in
/// the band, were it noise.
const CHANCE: f64 = 1e-4;
/// Standard deviations above the median from which that probability is computed.
const HIGH: f64 = 4.0;
/// Lines over which a residual is smoothed: at least these, and a 200th of all.
const LEAST_SMOOTHED: usize = 8;
const SMOOTHED_PART: usize = 200;
/// Damping ratio of a third attempt at a missing mode.
const WEAK_DAMPING: f64 = 1e-3;
/// A new mode whose gain exceeds the penalty this many times ends the attempts.
const CLEAR: f64 = 20.0;
/// A suspect is nearer to another pole than this many |Re λ| and `NEAR_HZ`.
const NEAR: f64 = 8.0;
const NEAR_HZ: f64 = 1.0;
/// Suspects that are tried in each round.
const SUSPECTS: usize = 6;

/// Steps of the fits.
const FIRST: usize = 6;
const WEIGHTED: usize = 4;
const BACKWARD: usize = 12;
const EARLY: usize = 3;
const FORWARD: usize = 12;
const FINAL: usize = 8;

/// A line where the residual is larger than noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Excess {
    pub frequency_hz: f64,
    /// Smoothed power over its median.
    pub ratio: f64,
}

/// Penalty of a mode.
fn penalty(problem: &Problem) -> f64 {
    let unknowns = |run: &crate::run::Run| {
        let residues = problem.residues.unknowns() * run.inputs();
        run.outputs() * (residues + if run.transient { 2 } else { 0 })
    };
    let count = 2 + problem.runs.iter().map(unknowns).sum::<usize>();
    FACTOR * count as f64 * libm::log(problem.data() as f64)
}

/// Precision of fits whose likelihoods are compared by the penalty.
fn coarse(problem: &Problem) -> Precision {
    Precision { gain: 1e-3 * penalty(problem), step: 0.1 }
}

/// Whether a pole is one of a mode in the band.
fn is_mode(pole: Complex<f64>, band: Band) -> bool {
    (band.from_hz..band.to_hz).contains(&(pole.im / TAU)) && damping_ratio(pole) < MOST_DAMPING
}

/// Relative deviations of the damping ratios, for uniform noise.
fn uncertainties(fit: &Fit) -> Vec<f64> {
    let covariance = fit.covariance();
    let count = fit.poles.len();
    let of = |(index, pole): (usize, &Complex<f64>)| {
        let [_, deviation] = deviations(*pole, block(&covariance, count, index));
        deviation / damping_ratio(*pole)
    };
    fit.poles.iter().enumerate().map(of).collect()
}

/// Finds the modes of the band from starting poles; `None` if none is left.
///
/// With `weighted`, weights follow from the noise of responses and references. The runs have those of the last fit at the end.
pub(crate) fn select(
    problem: &mut Problem,
    start: &[Complex<f64>],
    band: Band,
    weighted: bool,
) -> Option<Vec<Complex<f64>>> {
    problem.runs.iter_mut().for_each(crate::run::Run::reset);
    let mut fit = problem.minimise(start, FIRST, coarse(problem));
    if weighted {
        for _ in 0..2 {
            weigh(problem, &fit);
            fit = problem.minimise(&fit.poles, WEIGHTED, coarse(problem));
        }
    }
    fit = settle(problem, fit.poles, band, weighted)?;
    while fit.poles.len() < MOST_MODES {
        let Some(better) = add(problem, &fit, band) else { break };
        let count = fit.poles.len();
        fit = settle(problem, better.poles, band, weighted)?;
        if fit.poles.len() <= count {
            break;
        }
    }
    let mut poles = if weighted { without_twins(problem, fit) } else { fit.poles };
    poles.sort_by(|a, b| a.im.total_cmp(&b.im));
    Some(poles)
}

/// Leaves out modes, with new weights after each time, until all stay: weights of a fit that was far from its end, or had a
/// false pole, can protect one.
fn settle(problem: &mut Problem, mut poles: Vec<Complex<f64>>, band: Band, weighted: bool) -> Option<Fit> {
    let mut settled = None;
    loop {
        let fit = leave_out(problem, poles, band)?;
        if !weighted || settled == Some(fit.poles.len()) {
            return Some(fit);
        }
        settled = Some(fit.poles.len());
        weigh(problem, &fit);
        poles = fit.poles;
    }
}

/// Leaves out modes outside the band, with an uncertain damping ratio, or without gain.
fn leave_out(problem: &Problem, mut poles: Vec<Complex<f64>>, band: Band) -> Option<Fit> {
    let penalty = penalty(problem);
    loop {
        let fit = problem.minimise(&poles, BACKWARD, coarse(problem));
        let inside: Vec<Complex<f64>> = fit.poles.iter().copied().filter(|pole| is_mode(*pole, band)).collect();
        if inside.is_empty() {
            return None;
        }
        if inside.len() < fit.poles.len() {
            poles = inside;
            continue;
        }
        let gains = uncertainties(&fit)
            .into_iter()
            .enumerate()
            .map(|(mode, uncertainty)| if uncertainty > MOST_UNCERTAIN { 0.0 } else { fit.removal(problem, mode) });
        let mut weak: Vec<(f64, usize)> = gains.enumerate().map(|(mode, gain)| (gain, mode)).collect();
        weak.retain(|(gain, _)| *gain < penalty);
        if weak.is_empty() {
            return Some(fit);
        }
        // The weaker half at once, so that the last one goes alone, if at all.
        weak.sort_by(|a, b| a.0.total_cmp(&b.0));
        weak.truncate(weak.len().div_ceil(2));
        if weak.len() == fit.poles.len() {
            return None;
        }
        let left = |mode: &usize| weak.iter().all(|(_, out)| out != mode);
        poles = (0..fit.poles.len()).filter(left).map(|mode| fit.poles[mode]).collect();
    }
}

/// Returns the line where the residuals of all runs with the same lines, over their variances and smoothed over neighbouring
/// lines, exceed their median the most, if that is more than noise does.
pub(crate) fn excess(problem: &Problem, fit: &Fit) -> Option<Excess> {
    struct Sums<'a> {
        frequency_hz: &'a [f64],
        normalised: Normalised,
        outputs: usize,
    }
    let mut all: Vec<Sums<'_>> = Vec::new();
    for (run, found) in problem.runs.iter().zip(&fit.runs) {
        let frequency_hz = run.grid.frequency_hz.as_slice();
        let normalised = normalised(run, found);
        if let Some(sums) = all.iter_mut().find(|sums| sums.frequency_hz == frequency_hz) {
            let Normalised { power, variance } = &mut sums.normalised;
            power.iter_mut().zip(normalised.power).for_each(|(sum, power)| *sum += power);
            variance.iter_mut().zip(normalised.variance).for_each(|(sum, variance)| *sum += variance);
            sums.outputs += run.outputs();
        } else {
            all.push(Sums { frequency_hz, normalised, outputs: run.outputs() });
        }
    }
    let mut worst: Option<(f64, Excess)> = None;
    for Sums { frequency_hz, normalised, outputs } in all {
        let width = LEAST_SMOOTHED.max(frequency_hz.len() / SMOOTHED_PART);
        let [power, variance] = [&normalised.power, &normalised.variance].map(|of| moving_average(of, width));
        let middle = median(&mut power.clone()).max(f64::MIN_POSITIVE);
        let trials = (frequency_hz.len() / width).max(1) as f64;
        for (line, frequency_hz) in frequency_hz.iter().enumerate() {
            let deviation = libm::sqrt(variance[line] / width as f64) / outputs as f64;
            let ratio = power[line] / middle;
            if ratio < 1.0 + HIGH * deviation {
                continue;
            }
            // A mean of exponentially distributed powers is about χ²-distributed over its degrees of freedom ν, with the
            // relative variance 2/ν.
            let freedom = 2.0 / (deviation * deviation);
            let chance = trials * chi_square_survival(ratio * freedom, freedom);
            let above = (ratio - 1.0) / deviation;
            if chance < CHANCE && worst.is_none_or(|(most, _)| above > most) {
                worst = Some((above, Excess { frequency_hz: *frequency_hz, ratio }));
            }
        }
    }
    worst.map(|(_, excess)| excess)
}

/// Means over `width` values around each one; values beyond the ends are zero.
fn moving_average(values: &[f64], width: usize) -> Vec<f64> {
    let after = (width - 1) / 2;
    let of = |at: usize| {
        let from = (at + after + 1).saturating_sub(width);
        let to = (at + after + 1).min(values.len());
        values[from..to].iter().sum::<f64>() / width as f64
    };
    (0..values.len()).map(of).collect()
}

/// Returns a better fit with one more mode where the residual is larger than noise.
fn add(problem: &Problem, fit: &Fit, band: Band) -> Option<Fit> {
    let excess = excess(problem, fit)?;
    let penalty = penalty(problem);
    let mut damping: Vec<f64> = fit.poles.iter().map(|pole| damping_ratio(*pole)).collect();
    let typical = median(&mut damping);
    let distance = |pole: &Complex<f64>| (pole.im / TAU - excess.frequency_hz).abs();
    let near = (0..fit.poles.len()).min_by(|a, b| distance(&fit.poles[*a]).total_cmp(&distance(&fit.poles[*b])))?;
    let split = {
        let mut poles = fit.poles.clone();
        let centre = fit.poles[near];
        // Two modes that were taken for one begin |Re λ| apart, half of its half-power bandwidth.
        let half = Complex::new(0.0, 0.5 * centre.re.abs());
        poles[near] = centre + half;
        poles.push(centre - half);
        poles
    };
    let with = |damping_ratio: f64| {
        let mut poles = fit.poles.clone();
        poles.push(pole(excess.frequency_hz, damping_ratio));
        poles
    };
    // What fits best before the poles move mostly fits best afterwards.
    let starts = [split, with(WEAK_DAMPING), with((3.0 * typical).min(MOST_DAMPING)), with(typical)];
    let mut starts = starts.map(|poles| problem.evaluate(&poles));
    starts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut best: Option<Fit> = None;
    let gain = |best: &Option<Fit>| best.as_ref().map_or(0.0, |best| fit.cost - best.cost);
    for start in starts {
        if gain(&best) > CLEAR * penalty {
            break;
        }
        let near = problem.minimise_from(start, EARLY, coarse(problem));
        let near_cost = near.cost;
        let nearer = problem.minimise_from(near, 1, coarse(problem));
        // If even steps as good as the last one would not be enough, the attempt ends.
        let promised = fit.cost - nearer.cost + FORWARD as f64 * (near_cost - nearer.cost);
        if promised < penalty {
            continue;
        }
        let tried = problem.minimise_from(nearer, FORWARD, coarse(problem));
        let modes = tried.poles.iter().all(|pole| is_mode(*pole, band));
        if !modes || uncertainties(&tried).into_iter().any(|uncertainty| uncertainty > MOST_UNCERTAIN) {
            continue;
        }
        if best.as_ref().is_none_or(|best| tried.cost < best.cost) {
            best = Some(tried);
        }
    }
    if gain(&best) < penalty { None } else { best }
}

/// Poles near to another, narrowest first.
fn suspects(poles: &[Complex<f64>]) -> Vec<usize> {
    let near = |mode: usize, other: usize| {
        let wide = poles[mode].re.abs().max(poles[other].re.abs());
        mode != other && magnitude(poles[mode] - poles[other]) < NEAR * wide + TAU * NEAR_HZ
    };
    let mut found: Vec<usize> =
        (0..poles.len()).filter(|mode| (0..poles.len()).any(|other| near(*mode, other))).collect();
    found.sort_by(|a, b| poles[*a].re.abs().total_cmp(&poles[*b].re.abs()));
    found.truncate(SUSPECTS);
    found
}

/// Leaves out poles beside others without which the likelihood, with new weights, is as good. The weights are those of the
/// fit.
fn without_twins(problem: &mut Problem, mut fit: Fit) -> Vec<Complex<f64>> {
    let penalty = penalty(problem);
    let mut least = None;
    'round: loop {
        for suspect in suspects(&fit.poles) {
            let least_now = *least.get_or_insert_with(|| likelihood(problem, &fit));
            let mut others = fit.poles.clone();
            others.remove(suspect);
            let (tried, value) = fit_anew(problem, &others, least_now + CLEAR * penalty);
            if value - least_now < penalty {
                fit = tried;
                least = Some(value);
                continue 'round;
            }
        }
        return fit.poles;
    }
}

/// Fits without weights, and then twice with weights from the residuals, and returns the likelihood. If that is above `most`
/// after the first time, the second one is left out.
fn fit_anew(problem: &mut Problem, poles: &[Complex<f64>], most: f64) -> (Fit, f64) {
    problem.runs.iter_mut().for_each(crate::run::Run::reset);
    let mut fit = problem.minimise(poles, FINAL, coarse(problem));
    let mut value = f64::NEG_INFINITY;
    for _ in 0..2 {
        if value > most {
            break;
        }
        weigh(problem, &fit);
        fit = problem.minimise(&fit.poles, FINAL, coarse(problem));
        value = likelihood(problem, &fit);
    }
    (fit, value)
}
