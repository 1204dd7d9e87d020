//! Basins of attraction over a grid of initial states.

use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::journal::Journal;
use super::parallel::on_all_cores;
use super::{Control, StudyError};
use resonarm_analysis::Forced;
use resonarm_analysis::time_domain::{BasinOutcome, TimeDomainError};
use resonarm_analysis::time_domain::{StableOrbit, StroboscopicMap, further_orbits, outcomes};
use resonarm_dynamics::structure::Dof;

/// States that are computed side by side, and kept together in the journal.
const TOGETHER: usize = 64;
/// Undecided states from which responses are looked for.
const TRIALS: usize = 8;

/// A grid of initial states in two of the coordinates of a state.
#[derive(Clone, Debug, PartialEq)]
pub struct StateGrid {
    /// The two coordinates, by their places in the state, that vary along a row and from row to row.
    pub coordinates: [usize; 2],
    /// First and last value of each.
    pub ends: [[f64; 2]; 2],
    /// Number of values of each, from 2.
    pub counts: [usize; 2],
    /// The state that gives all other coordinates.
    pub others: Vec<f64>,
}

impl StateGrid {
    /// Returns the number of states of the grid.
    pub fn len(&self) -> usize {
        self.counts[0] * self.counts[1]
    }

    /// Says whether the grid has no states.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the distance of neighbouring values of each coordinate.
    pub fn spacing(&self) -> [f64; 2] {
        [0, 1].map(|axis| {
            let [from, to] = self.ends[axis];
            (to - from).abs() / (self.counts[axis] - 1) as f64
        })
    }

    /// Returns the values of both coordinates at a place in the grid, counted along the rows.
    pub fn values(&self, index: usize) -> [f64; 2] {
        let places = [index % self.counts[0], index / self.counts[0]];
        [0, 1].map(|axis| {
            let [from, to] = self.ends[axis];
            let last = (self.counts[axis] - 1) as f64;
            // Weighted ends in place of from + k · spacing: the last value is exactly the end.
            (from * (last - places[axis] as f64) + to * places[axis] as f64) / last
        })
    }

    /// Returns the state at a place in the grid.
    pub fn state(&self, index: usize) -> Vec<f64> {
        let mut state = self.others.clone();
        for (coordinate, value) in self.coordinates.iter().zip(self.values(index)) {
            state[*coordinate] = value;
        }
        state
    }
}

/// A computation of the basins of a structure.
#[derive(Clone, Debug)]
pub struct Basins {
    /// The structure and its drive.
    pub forced: Forced,
    /// The frequency of the drive, Hz.
    pub frequency_hz: f64,
    /// The stable periodic responses that the states may reach.
    pub orbits: Vec<StableOrbit>,
    /// The initial states, at phase 0 of the drive.
    pub grid: StateGrid,
    /// Longest wait, in time constants of the slowest mode.
    pub time_constants: f64,
}

/// Outcomes of some neighbours in the grid.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GridPart {
    part: usize,
    outcomes: Vec<BasinOutcome>,
}

impl Basins {
    /// Starts the computation, with the outcomes in the journal for this configuration.
    ///
    /// # Errors
    /// [`StudyError::TimeDomain`] for a drive under which nothing can be computed, [`StudyError::Journal`] for a
    /// journal that can't be used.
    pub fn begin(self, journal: Option<(&Path, &Value)>) -> Result<BasinComputation, StudyError> {
        StroboscopicMap::new(&self.forced, self.frequency_hz)?;
        let states = self.grid.len();
        let mut parts = vec![None; states.div_ceil(TOGETHER)];
        let journal = match journal {
            Some((path, configuration)) => {
                let (journal, known) = Journal::open::<GridPart>(path, configuration)?;
                for (k, GridPart { part, outcomes }) in known.into_iter().enumerate() {
                    let place = parts.get_mut(part).filter(|_| outcomes.len() == range(part, states).len());
                    // Line 1 states the configuration, so point k is in line k + 2.
                    *place.ok_or_else(|| journal.damaged(k + 2, "part of this grid"))? = Some(outcomes);
                }
                Some(journal)
            }
            None => None,
        };
        Ok(BasinComputation { basins: self, parts, journal })
    }

    /// Follows the trajectories from some of the states to their ends.
    fn outcomes(
        &self,
        states: impl Iterator<Item = usize>,
        stop: &dyn Fn() -> bool,
    ) -> Result<Vec<BasinOutcome>, TimeDomainError> {
        let map = StroboscopicMap::new(&self.forced, self.frequency_hz)?;
        let starts: Vec<Vec<f64>> = states.map(|index| self.grid.state(index)).collect();
        outcomes(&map, &self.orbits, &starts, self.time_constants, stop)
    }
}

/// Returns the states of a part, of so many.
fn range(part: usize, states: usize) -> Range<usize> {
    part * TOGETHER..((part + 1) * TOGETHER).min(states)
}

/// Basins as far as they are computed, and their journal.
#[derive(Debug)]
pub struct BasinComputation {
    basins: Basins,
    parts: Vec<Option<Vec<BasinOutcome>>>,
    journal: Option<Journal>,
}

impl BasinComputation {
    /// Returns the outcome of each state, in the order of the grid; `None` until all are computed.
    pub fn outcomes(&self) -> Option<Vec<BasinOutcome>> {
        let parts: Option<Vec<&Vec<BasinOutcome>>> = self.parts.iter().map(Option::as_ref).collect();
        parts.map(|parts| parts.into_iter().flatten().copied().collect())
    }

    /// Returns the number of states that are computed.
    pub fn done(&self) -> usize {
        self.parts.iter().flatten().map(Vec::len).sum()
    }

    /// Returns the number of states in all.
    pub fn total(&self) -> usize {
        self.basins.grid.len()
    }

    /// Says whether results are kept in a journal.
    pub fn is_kept(&self) -> bool {
        self.journal.is_some()
    }

    /// Computes the missing outcomes, on as many threads as there are cores, until it is stopped.
    ///
    /// # Errors
    /// [`StudyError::TimeDomain`] if nothing can be computed, [`StudyError::Journal`] if the journal can't be written.
    pub fn compute_missing(self, control: &Control<'_>) -> Result<BasinComputation, StudyError> {
        let done = AtomicU64::new(self.done() as u64);
        let failed = AtomicBool::new(false);
        let journal = Mutex::new(self.journal);
        // An error on one thread stops the others, since the computation fails in any case.
        let stop = || (control.stop)() || failed.load(Ordering::Relaxed);
        let compute = |part: usize| -> Result<Option<Vec<BasinOutcome>>, StudyError> {
            let outcomes = match self.basins.outcomes(range(part, self.basins.grid.len()), &stop) {
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
        // Known parts are jobs, too, so that the results come back in the order of the grid.
        let jobs: Vec<(usize, Option<Vec<BasinOutcome>>)> = self.parts.into_iter().enumerate().collect();
        let work = |(part, known): &(usize, Option<Vec<BasinOutcome>>)| match known {
            Some(outcomes) => Ok(Some(outcomes.clone())),
            None => compute(*part).inspect_err(|_error| failed.store(true, Ordering::Relaxed)),
        };
        let parts = on_all_cores(&jobs, work, || ()).into_iter().collect::<Result<_, _>>()?;
        let journal = journal.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok(BasinComputation { basins: self.basins, parts, journal })
    }

    /// Looks for the stable responses on which undecided states settle, from a few of these states, and computes the fates
    /// of all undecided states anew if there are any. Does nothing while outcomes are missing. What it finds is not kept
    /// in the journal.
    ///
    /// # Errors
    /// [`StudyError::TimeDomain`] if a trajectory can't be followed.
    pub fn settle_undecided(self, read: &[Dof], control: &Control<'_>) -> Result<BasinComputation, StudyError> {
        let Some(mut outcomes) = self.outcomes() else { return Ok(self) };
        let is_undecided = |index: &usize| outcomes[*index] == BasinOutcome::Undecided;
        let undecided: Vec<usize> = (0..outcomes.len()).filter(is_undecided).collect();
        let mut basins = self.basins;
        let apart = undecided.len().div_ceil(TRIALS).max(1);
        let starts: Vec<Vec<f64>> = undecided.iter().step_by(apart).map(|index| basins.grid.state(*index)).collect();
        let further = further_orbits(&basins.forced, read, basins.frequency_hz, &basins.orbits, &starts, control.stop);
        let further = match further {
            Err(TimeDomainError::Stopped) => vec![],
            found => found?,
        };
        if further.is_empty() {
            return Ok(BasinComputation { basins, ..self });
        }
        basins.orbits.extend(further);
        let groups: Vec<&[usize]> = undecided.chunks(TOGETHER).collect();
        let of = |group: &&[usize]| basins.outcomes(group.iter().copied(), control.stop);
        for (group, found) in groups.iter().zip(on_all_cores(&groups, of, || ())) {
            match found {
                // They stay undecided.
                Err(TimeDomainError::Stopped) => {}
                found => group.iter().zip(found?).for_each(|(index, outcome)| outcomes[*index] = outcome),
            }
        }
        let parts = outcomes.chunks(TOGETHER).map(|part| Some(part.to_vec())).collect();
        Ok(BasinComputation { basins, parts, journal: self.journal })
    }

    /// Returns the stable responses, those that were found from undecided states last.
    pub fn orbits(&self) -> &[StableOrbit] {
        &self.basins.orbits
    }

    /// Removes the journal. Call it when the results are written and there is nothing left to resume.
    ///
    /// # Errors
    /// [`StudyError::Journal`] if the journal can't be removed.
    pub fn finish(self) -> Result<(), StudyError> {
        Ok(self.journal.map_or(Ok(()), Journal::remove)?)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{QUIET, folds_hz, hardening};
    use super::*;
    use core::f64::consts::TAU;
    use resonarm_analysis::time_domain::{reach, stable_orbits};
    use resonarm_dynamics::structure::{
        Assembly, Axis, BodySpec, ElementSpec, Law, ModalSpec, ModeSpec, Place, ShapeSpec, StructureSpec,
    };

    /// Of the hardening oscillator, in the middle between its folds.
    fn basins(counts: [usize; 2]) -> (Basins, Dof) {
        let (forced, dof) = hardening();
        let folds = folds_hz(&forced, dof);
        let frequency_hz = 0.5 * (folds[0] + folds[1]);
        let (orbits, early) = stable_orbits(&forced, &[dof], frequency_hz, &|| false).unwrap();
        assert!(orbits.len() == 2 && early.is_none(), "{orbits:?}");
        let ends = [0, 1].map(|index| reach(&orbits, index, frequency_hz)).map(|far| [-far, far]);
        let grid = StateGrid { coordinates: [0, 1], ends, counts, others: vec![0.0; 2] };
        (Basins { forced, frequency_hz, orbits, grid, time_constants: 40.0 }, dof)
    }

    /// The outcomes on all cores are those of one state after the other, and both responses are reached.
    #[test]
    fn fates_on_all_cores_are_those_of_one_state_after_the_other() {
        let (basins, _) = basins([13, 11]);
        let alone: Vec<BasinOutcome> =
            (0..143).map(|state| basins.outcomes(state..state + 1, &|| false).unwrap()[0]).collect();
        let computed = basins.begin(None).unwrap().compute_missing(&QUIET).unwrap().outcomes().unwrap();
        assert_eq!(computed, alone);
        for wanted in [0, 1] {
            let reaches =
                |outcome: &BasinOutcome| matches!(outcome, BasinOutcome::Reaches { orbit, .. } if *orbit == wanted);
            assert!(computed.iter().any(reaches), "{wanted}: {computed:?}");
        }
    }

    /// The response of three periods of x″ + 0.01x′ + x + x³ = 4 sin 4.5t is on no branch of the drive's own period. Its
    /// state at phase 0 is that of another code's shooting.
    #[test]
    fn a_response_of_three_periods_is_found_from_undecided_states() {
        let place = Place::Dof { point: "tip".into(), axis: Axis::X };
        let body = ModalSpec {
            modes: vec![ModeSpec { frequency_hz: 1.0 / TAU, damping_ratio: 0.005 }],
            shapes: vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![1.0] }],
        };
        let law = Law::Cubic { stiffness3: 1.0, stiffness5: 0.0 };
        let elements = vec![ElementSpec::Point { at: place, to: None, law }];
        let assembly = Assembly::new(&StructureSpec { body: BodySpec::Modal(body), elements }).unwrap();
        let dof = assembly.dof("tip.x").unwrap();
        let forced = Forced::new(assembly, dof, 4.0);
        let frequency_hz = 4.5 / TAU;
        let (orbits, _) = stable_orbits(&forced, &[dof], frequency_hz, &|| false).unwrap();
        assert!(orbits.iter().all(|orbit| orbit.period == 1), "{orbits:?}");
        let [x, v] = [1.1686692211643264, 0.11509686260901884];
        let ends = [[x - 0.01, x + 0.01], [v - 0.01, v + 0.01]];
        let grid = StateGrid { coordinates: [0, 1], ends, counts: [2, 2], others: vec![0.0; 2] };
        let count = orbits.len();
        let basins = Basins { forced, frequency_hz, orbits, grid, time_constants: 10.0 };
        let computed = basins.begin(None).unwrap().compute_missing(&QUIET).unwrap();
        assert_eq!(computed.outcomes().unwrap(), [BasinOutcome::Undecided; 4]);
        let computed = computed.settle_undecided(&[dof], &QUIET).unwrap();
        assert_eq!(computed.orbits().len(), count + 1);
        let found = &computed.orbits()[count];
        assert_eq!(found.period, 3);
        assert!((found.readings[0].largest / 1.2007087 - 1.0).abs() < 1e-6, "{found:?}");
        let reaches =
            |outcome: &BasinOutcome| matches!(outcome, BasinOutcome::Reaches { orbit, .. } if *orbit == count);
        assert!(computed.outcomes().unwrap().iter().all(reaches));
    }

    /// Stopped after any part, it goes on to the same outcomes.
    #[test]
    fn continues_as_if_never_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let configuration = serde_json::json!({});
        let begun = |counts| basins(counts).0.begin(Some((&path, &configuration))).unwrap();
        let whole = begun([10, 20]).compute_missing(&QUIET).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let outcomes = whole.outcomes().unwrap();
        drop(whole);
        let lines: Vec<&str> = text.split_inclusive('\n').collect();
        assert_eq!((lines.len(), outcomes.len()), (5, 200));
        std::fs::write(&path, lines[..3].concat() + &lines[3][..9]).unwrap();
        let resumed = begun([10, 20]);
        assert!(resumed.outcomes().is_none() && resumed.done() < 200 && resumed.done() > 0);
        let resumed = resumed.compute_missing(&QUIET).unwrap();
        assert_eq!(resumed.outcomes().unwrap(), outcomes);
        resumed.finish().unwrap();
        assert!(!path.exists());
    }
}
