//! Basins of attraction over a grid of initial states.

use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Control, Journal, StudyError, on_all_cores};
use resonarm_analysis::time_domain::{
    BasinOutcome, StableMotion, StateCoordinate, StroboscopicMap, TimeDomainError, outcomes,
};
use resonarm_dynamics::arm::{Arm, Sine, State};

/// States that are computed side by side, and kept together in the journal.
const TOGETHER: usize = 64;

/// A grid of initial states in two coordinates: of the arm, or, by their numbers from 0, of a list of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateGrid<C = StateCoordinate, S = State> {
    /// The coordinates that vary: along a row, and from row to row.
    pub coordinates: [C; 2],
    /// First value and last of each.
    pub ends: [[f64; 2]; 2],
    /// How many values of each, from 2.
    pub counts: [usize; 2],
    /// The state whose other coordinates all have.
    pub others: S,
}

impl<C, S> StateGrid<C, S> {
    /// How many states there are.
    pub fn len(&self) -> usize {
        self.counts[0] * self.counts[1]
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The distance of neighbouring values of each coordinate.
    pub fn spacing(&self) -> [f64; 2] {
        [0, 1].map(|axis| {
            let [from, to] = self.ends[axis];
            (to - from).abs() / (self.counts[axis] - 1) as f64
        })
    }

    /// The values of both coordinates at a place in the grid, counted along the rows.
    pub fn values(&self, index: usize) -> [f64; 2] {
        let places = [index % self.counts[0], index / self.counts[0]];
        [0, 1].map(|axis| {
            let ([from, to], last) = (self.ends[axis], (self.counts[axis] - 1) as f64);
            (from * (last - places[axis] as f64) + to * places[axis] as f64) / last
        })
    }
}

impl StateGrid {
    /// The state at a place in the grid.
    pub fn state(&self, index: usize) -> State {
        let mut state = self.others;
        for (coordinate, value) in self.coordinates.iter().zip(self.values(index)) {
            coordinate.set(&mut state, value);
        }
        state
    }
}

impl StateGrid<usize, Vec<f64>> {
    /// The state at a place in the grid.
    pub fn state(&self, index: usize) -> Vec<f64> {
        let mut state = self.others.clone();
        for (coordinate, value) in self.coordinates.iter().zip(self.values(index)) {
            state[*coordinate] = value;
        }
        state
    }
}

/// Basins to be computed.
#[derive(Clone, Debug)]
pub struct Basins {
    /// The arm.
    pub arm: Arm,
    /// Its excitation.
    pub sine: Sine,
    /// The motions that the states may reach.
    pub motions: Vec<StableMotion>,
    /// The initial states, at phase 0 of the excitation.
    pub grid: StateGrid,
    /// Longest wait, in time constants of the arm's slowest mode.
    pub time_constants: f64,
}

/// What became of some neighbours in the grid.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GridPart {
    part: usize,
    outcomes: Vec<BasinOutcome>,
}

/// Where the motions from the states of a grid end.
pub trait BasinStudy: Sync + Sized {
    /// How many states there are.
    fn states(&self) -> usize;

    /// Refuses an excitation under which nothing can be computed.
    ///
    /// # Errors
    /// [`TimeDomainError`] says why.
    fn check(&self) -> Result<(), TimeDomainError>;

    /// Where those from some of them end.
    ///
    /// # Errors
    /// [`TimeDomainError::Stopped`] if `stop` said so, another if nothing can be computed.
    fn outcomes(&self, states: Range<usize>, stop: &dyn Fn() -> bool) -> Result<Vec<BasinOutcome>, TimeDomainError>;

    /// The computation, with what is in the journal for this configuration.
    ///
    /// # Errors
    /// [`StudyError::TimeDomain`] for an excitation under which nothing can be computed, [`StudyError::Journal`] for a
    /// journal that can't be used.
    fn begin(self, journal: Option<(&Path, &Value)>) -> Result<BasinComputation<Self>, StudyError> {
        self.check()?;
        let mut parts = vec![None; self.states().div_ceil(TOGETHER)];
        let journal = match journal {
            Some((path, configuration)) => {
                let (journal, known) = Journal::open::<GridPart>(path, configuration)?;
                for (k, GridPart { part, outcomes }) in known.into_iter().enumerate() {
                    let place = parts.get_mut(part).filter(|_| outcomes.len() == range(part, self.states()).len());
                    *place.ok_or_else(|| journal.damaged(k + 2, "part of this grid"))? = Some(outcomes);
                }
                Some(journal)
            }
            None => None,
        };
        Ok(BasinComputation { basins: self, parts, journal })
    }
}

/// The states of a part, of so many.
fn range(part: usize, states: usize) -> Range<usize> {
    part * TOGETHER..((part + 1) * TOGETHER).min(states)
}

impl BasinStudy for Basins {
    fn states(&self) -> usize {
        self.grid.len()
    }

    fn check(&self) -> Result<(), TimeDomainError> {
        StroboscopicMap::new(&self.arm, self.sine).map(drop)
    }

    fn outcomes(&self, states: Range<usize>, stop: &dyn Fn() -> bool) -> Result<Vec<BasinOutcome>, TimeDomainError> {
        let map = StroboscopicMap::new(&self.arm, self.sine)?;
        let starts: Vec<State> = states.map(|index| self.grid.state(index)).collect();
        outcomes(&map, &self.motions, &starts, self.time_constants, stop)
    }
}

/// Basins as far as they are computed, and where they are kept.
#[derive(Debug)]
pub struct BasinComputation<S: BasinStudy = Basins> {
    basins: S,
    parts: Vec<Option<Vec<BasinOutcome>>>,
    journal: Option<Journal>,
}

impl<S: BasinStudy> BasinComputation<S> {
    /// What became of the states, in the order of the grid; `None` until all are computed.
    pub fn outcomes(&self) -> Option<Vec<BasinOutcome>> {
        let parts: Option<Vec<&Vec<BasinOutcome>>> = self.parts.iter().map(Option::as_ref).collect();
        parts.map(|parts| parts.into_iter().flatten().copied().collect())
    }

    /// How many states are computed.
    pub fn done(&self) -> usize {
        self.parts.iter().flatten().map(Vec::len).sum()
    }

    /// How many there are.
    pub fn total(&self) -> usize {
        self.basins.states()
    }

    /// Whether what is computed is kept in a journal.
    pub fn is_kept(&self) -> bool {
        self.journal.is_some()
    }

    /// Computes what is missing, on as many threads as there are cores, until it is stopped.
    ///
    /// # Errors
    /// [`StudyError::TimeDomain`] if nothing can be computed, [`StudyError::Journal`] if the journal can't be written.
    pub fn compute_missing(self, control: &Control<'_>) -> Result<BasinComputation<S>, StudyError> {
        let done = AtomicU64::new(self.done() as u64);
        let (failed, journal) = (AtomicBool::new(false), Mutex::new(self.journal));
        let stop = || (control.stop)() || failed.load(Ordering::Relaxed);
        let compute = |part: usize| -> Result<Option<Vec<BasinOutcome>>, StudyError> {
            let outcomes = match self.basins.outcomes(range(part, self.basins.states()), &stop) {
                Err(TimeDomainError::Stopped) => return Ok(None),
                computed => computed?,
            };
            if let Some(journal) = journal.lock().unwrap_or_else(PoisonError::into_inner).as_mut() {
                journal.append(&GridPart { part, outcomes: outcomes.clone() })?;
            }
            let more = outcomes.len() as u64;
            (control.done)(done.fetch_add(more, Ordering::Relaxed) + more);
            Ok(Some(outcomes))
        };
        let jobs: Vec<(usize, Option<Vec<BasinOutcome>>)> = self.parts.into_iter().enumerate().collect();
        let work = |(part, known): &(usize, Option<Vec<BasinOutcome>>)| match known {
            Some(outcomes) => Ok(Some(outcomes.clone())),
            None => compute(*part).inspect_err(|_error| failed.store(true, Ordering::Relaxed)),
        };
        let parts = on_all_cores(&jobs, work, || ()).into_iter().collect::<Result<_, _>>()?;
        let journal = journal.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(BasinComputation { basins: self.basins, parts, journal })
    }

    /// To be called when the results are written: there is nothing left to resume.
    ///
    /// # Errors
    /// [`StudyError::Journal`] if the journal can't be removed.
    pub fn finish(self) -> Result<(), StudyError> {
        Ok(self.journal.map_or(Ok(()), Journal::remove)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_analysis::time_domain::{SettleOptions, settle, stable_motions};
    use resonarm_dynamics::arm::{Load, Parameters, Pose, Preset};

    /// Between the folds, with five times the damping and an excitation that bends the resonance as far for it.
    fn basins(counts: [usize; 2]) -> Basins {
        let parameters = Preset::Irb1600Fitted.parameters().unwrap();
        let damped = Parameters {
            damping1_nm_s_rad: 5.0 * parameters.damping1_nm_s_rad,
            damping2_nm_s_rad: 5.0 * parameters.damping2_nm_s_rad,
            ..parameters
        };
        let arm = Arm::new(damped, Pose { beta1_deg: 0.0, beta2_deg: 60.0 }).unwrap();
        let sine = Sine { amplitude: Load::torque_nm(600.0, 0.0), frequency_hz: 21.98 };
        let (motions, early) = stable_motions(&arm, &sine).unwrap();
        assert!(early.is_empty());
        let coordinates = [StateCoordinate::Alpha1, StateCoordinate::AlphaDot1];
        let grid = StateGrid { coordinates, ends: [[-0.6, 0.6], [-80.0, 80.0]], counts, others: State::default() };
        Basins { arm, sine, motions, grid, time_constants: 40.0 }
    }

    const QUIET: Control<'static> = Control { stop: &|| false, done: &|_done| () };

    /// Each state reaches the motion that it settles in when it is followed alone, by the rules of a sweep.
    #[test]
    fn a_state_reaches_what_it_settles_in() {
        let basins = basins([9, 8]);
        assert_eq!(basins.motions.len(), 2, "{:?}", basins.motions);
        let (arm, sine, grid, motions) = (basins.arm.clone(), basins.sine, basins.grid, basins.motions.clone());
        let outcomes = basins.begin(None).unwrap().compute_missing(&QUIET).unwrap().outcomes().unwrap();
        let map = StroboscopicMap::new(&arm, sine).unwrap();
        let mut reached = [0; 2];
        for (index, outcome) in outcomes.iter().enumerate() {
            let settled = settle(&map, &grid.state(index), &SettleOptions::default(), &|| false).unwrap();
            match outcome {
                BasinOutcome::Reaches { motion, .. } => {
                    let (a, b) = (motions[*motion].amplitude_rad[0], settled.amplitude_rad[0]);
                    assert!((a / b - 1.0).abs() < 1e-6, "{index}: {a} {b}");
                    reached[*motion] += 1;
                }
                other => assert_eq!((settled.period, *other), (None, BasinOutcome::Undecided), "{index}"),
            }
        }
        assert!(reached.iter().all(|count| *count > 5), "{reached:?}");
    }

    /// Stopped after any part, it goes on to the same outcomes.
    #[test]
    fn continues_as_if_never_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let configuration = serde_json::json!({});
        let whole = basins([10, 20]).begin(Some((&path, &configuration))).unwrap().compute_missing(&QUIET).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let outcomes = whole.outcomes().unwrap();
        drop(whole);
        let lines: Vec<&str> = text.split_inclusive('\n').collect();
        assert_eq!((lines.len(), outcomes.len()), (5, 200));
        std::fs::write(&path, lines[..3].concat() + &lines[3][..9]).unwrap();
        let resumed = basins([10, 20]).begin(Some((&path, &configuration))).unwrap();
        assert!(resumed.outcomes().is_none() && resumed.done() < 200 && resumed.done() > 0);
        let resumed = resumed.compute_missing(&QUIET).unwrap();
        assert_eq!(resumed.outcomes().unwrap(), outcomes);
        resumed.finish().unwrap();
        assert!(!path.exists());
    }
}
