//! Curves of folds as the load varies: where one comes back to the load, a branch has a fold. As the load rises, a fold of
//! the main branch may meet that of an isola, and lead down to it.

use alloc::vec::Vec;

use super::{SAME, Searcher};
use crate::adapt::adapt;
use crate::balance::Balance;
use crate::branch::trace;
use crate::branch_options::{BifurcationKind, BranchOptions};
use crate::continuation::{Continuation, ContinuationSettings, Point, at_parameter};
use crate::dense::norm;
use crate::forced::Coordinate;
use crate::orbit::{Branch, Orbit};
use crate::singular::{Singular, Singularity};
use crate::trace_options::{Assess, TraceOptions};

/// The truncation error along a curve: folds move far less than their responses.
const TRUNCATION: f64 = 1e-3;
/// The largest step along a curve, and the most points of it.
const LARGEST_STEP: f64 = 0.5;
const MOST_POINTS: usize = 400;
/// A curve is left where its frequency is beyond these multiples of the ends of the range.
const RANGE: [f64; 2] = [0.5, 2.0];
/// The first step along a branch from one of its folds, relative to the size of the response, and how often it is
/// halved.
const BESIDE: (f64, usize) = (1e-2, 8);
/// Higher loads whose branches may have folds that the branch does not have, over its load.
const HIGHER_LOADS: [f64; 2] = [2.0, 4.0];

/// A fold at some load.
#[derive(Clone, Debug)]
struct Fold {
    frequency_hz: f64,
    load: f64,
    x: Vec<f64>,
}

/// What a curve of folds passes.
#[derive(Default)]
struct Passed {
    /// The folds at the load that is searched, each with its null vector, the direction of its branch.
    folds: Vec<(Fold, Vec<f64>)>,
    /// Whether the curve comes back to its start.
    is_closed: bool,
}

impl Fold {
    fn of(orbit: &Orbit) -> Fold {
        Fold { frequency_hz: orbit.frequency_hz, load: orbit.drive, x: orbit.coefficients.clone() }
    }
}

impl Searcher<'_> {
    /// Follows the folds of all known branches over the load, and the branches of the folds that they lead to.
    pub(super) fn fold_curves(&mut self) {
        let load = self.forced.amplitude();
        if !(self.search.more_folds || self.forced.assembly().is_smooth()) {
            return;
        }
        // Folds that a curve has passed already.
        let mut passed: Vec<Fold> = Vec::new();
        while let Some(fold) = self.fold_beside(&passed) {
            self.fold_curve(&fold, &mut passed);
        }
        if self.search.more_folds {
            for factor in HIGHER_LOADS {
                for fold in self.folds_under(factor * load) {
                    self.fold_curve(&fold, &mut passed);
                }
            }
        }
    }

    /// Returns a fold of a known branch that is none of these.
    fn fold_beside(&self, passed: &[Fold]) -> Option<Fold> {
        let mut folds = self.known().flat_map(folds).map(Fold::of);
        folds.find(|fold| !passed.iter().any(|passed| self.is_same(passed, fold)))
    }

    /// Returns the folds of the branch under another load; those before its end, if it ends early.
    fn folds_under(&mut self, load: f64) -> Vec<Fold> {
        let forced = self.forced.with_amplitude(load);
        let mut options = TraceOptions { assess: Assess::Nothing, near: None, ..self.options.clone() };
        options.branch.truncation = options.branch.truncation.max(TRUNCATION);
        let traced = trace(&forced, options.branch.from, Coordinate::FrequencyHz, &options);
        let branch = traced.unwrap_or_else(|early| *early.so_far);
        self.work += branch.work;
        folds(&branch).map(Fold::of).collect()
    }

    /// Says whether two folds are one.
    fn is_same(&self, a: &Fold, b: &Fold) -> bool {
        let settings = &self.options.branch.continuation;
        let shared = a.x.len().min(b.x.len());
        let away: Vec<f64> = a.x[..shared].iter().zip(&b.x).map(|(a, b)| a - b).collect();
        let near = (a.frequency_hz - b.frequency_hz).abs() < SAME * settings.lambda_scale(b.frequency_hz);
        a.load == b.load && near && norm(&away) < libm::sqrt(TRUNCATION) * settings.size(&b.x)
    }

    /// Follows the curve of a fold in both directions, and the branches of the folds at which it comes to the load.
    fn fold_curve(&mut self, fold: &Fold, passed: &mut Vec<Fold>) {
        passed.push(fold.clone());
        for direction in [1.0, -1.0] {
            let Passed { folds, is_closed } = self.along(fold, direction).unwrap_or_default();
            for (fold, null_vector) in folds {
                if !passed.iter().any(|passed| self.is_same(passed, &fold)) {
                    self.consider_fold(&fold, &null_vector);
                    passed.push(fold);
                }
            }
            if is_closed {
                return;
            }
        }
    }

    /// Follows the curve of a fold towards higher or lower loads, until it leaves the loads or the frequencies, or is
    /// back. `None` if it can't be followed at all.
    fn along(&mut self, fold: &Fold, direction: f64) -> Option<Passed> {
        let load = self.forced.amplitude();
        let mut loads = [load / self.search.load_factor, load * self.search.load_factor];
        loads.sort_by(f64::total_cmp);
        let [low_hz, high_hz] = self.range();
        let least = self.harmonics();
        let branch = BranchOptions {
            from: loads[0],
            to: loads[1],
            least_harmonics: least,
            truncation: self.options.branch.truncation.max(TRUNCATION),
            continuation: ContinuationSettings {
                // Both the frequency and the load are positive, and of the order of their first values.
                parameter_floor: f64::MIN_POSITIVE,
                largest_step: LARGEST_STEP,
                ..self.options.branch.continuation
            },
            ..self.options.branch
        };
        let settings = branch.continuation;
        let forced = self.forced.with_amplitude(fold.load);
        let m = self.balance(fold.frequency_hz, least).unknowns.count();
        // The fold has moved by little in the balance with few harmonics.
        let mut balance = Balance::new(&forced, fold.frequency_hz, Coordinate::FrequencyHz, least);
        let mut x = fold.x.clone();
        x.resize(m * (2 * least + 1), 0.0);
        balance.evaluate_orbit(&x);
        let mut singular =
            Singular::near(&balance, Singularity::Fold, Some(Coordinate::Amplitude), &settings, &x).ok()?;
        let start = singular.join(fold.frequency_hz, &x);
        let mut continuation = Continuation::start(&mut singular, settings, &start, fold.load, direction).ok()?;
        let mut reached = self.loads.unwrap_or([load; 2]);
        let mut passed = Passed::default();
        for _ in 0..MOST_POINTS {
            if adapt(&mut singular, &mut continuation, &branch).is_err() {
                break;
            }
            let before = continuation.point().clone();
            let Ok(after) = continuation.advance(&mut singular).cloned() else { break };
            let at = after.lambda.clamp(loads[0], loads[1]);
            reached = [reached[0].min(at), reached[1].max(at)];
            if (before.lambda - load) * (after.lambda - load) < 0.0
                && let Ok(point) = at_parameter(&mut singular, &settings, [&before, &after], load)
            {
                let (frequency_hz, x) = singular.split(&point.x);
                let at = Fold { frequency_hz, load, x: x.to_vec() };
                if fold.load == load && self.is_same(fold, &at) {
                    passed.is_closed = true;
                    break;
                }
                passed.folds.push((at, singular.null_vector()));
            }
            let (hz, _) = singular.split(&after.x);
            let beyond = after.lambda < loads[0] || after.lambda > loads[1];
            if beyond || hz < RANGE[0] * low_hz || hz > RANGE[1] * high_hz {
                break;
            }
        }
        self.loads = Some(reached);
        let work = continuation.work();
        // Each evaluation of the equations of a fold takes three of the balance.
        self.work.evaluations += 3 * work.evaluations;
        self.work.factorizations += 2 * work.factorizations;
        Some(passed)
    }

    /// Follows the branch of a fold found with few harmonics, if it is a new one.
    fn consider_fold(&mut self, fold: &Fold, null_vector: &[f64]) {
        let [low, high] = self.range();
        if !(low..=high).contains(&fold.frequency_hz) {
            return;
        }
        let branch = &self.options.branch;
        let m = self.balance(low, self.harmonics()).unknowns.count();
        let mut direction = null_vector.to_vec();
        direction.push(0.0);
        let mut step = BESIDE.0;
        for _ in 0..BESIDE.1 {
            let mut balance = self.balance(fold.frequency_hz, fold.x.len() / m / 2);
            let begun = Continuation::start_along(
                &mut balance,
                branch.continuation,
                &fold.x,
                fold.frequency_hz,
                &direction,
                step,
            );
            if let Ok(mut seed) = begun
                && adapt(&mut balance, &mut seed, branch).is_ok()
            {
                let beside: &Point = seed.point();
                if (low..=high).contains(&beside.lambda) && !self.is_known(beside) {
                    self.follow(balance, seed);
                }
                return;
            }
            step *= 0.5;
        }
    }
}

/// Returns the responses at the folds of a branch.
fn folds(branch: &Branch) -> impl Iterator<Item = &Orbit> {
    branch.bifurcations.iter().filter(|found| found.kind == BifurcationKind::Fold).map(|found| &found.orbit)
}
