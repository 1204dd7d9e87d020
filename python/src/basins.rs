//! Many responses of a structure at once: ensembles, and basins of attraction.

use pyo3::prelude::*;
use pyo3::types::PyByteArray;
use resonarm::analysis::Forced;
use resonarm::analysis::time_domain::{BasinOutcome, TimeDomainError};
use resonarm::analysis::time_domain::{StableOrbit, StroboscopicMap, further_orbits, outcomes, reach, stable_orbits};
use resonarm::structure::Dof;
use resonarm::study::on_all_cores;

use crate::errors;
use crate::forced::Drive;
use crate::rows::{Rows, numbers};
use crate::structure::Assembly;
use crate::watch::stoppable;

/// Motions that a core follows together.
const TOGETHER: usize = 64;
/// Periods between two checks whether to stop.
const AT_ONCE: u32 = 64;
/// Takes the place of the number of a response, which counts from 1.
const UNDECIDED: i64 = 0;
const DIVERGES: i64 = -1;

/// The states in an array of Python, given as its bytes: coordinates, rates, states of elements.
fn states(forced: &Forced, bytes: &[u8]) -> PyResult<Vec<Vec<f64>>> {
    let assembly = forced.assembly();
    let size = 2 * assembly.coordinates() + assembly.element_states();
    let states: Vec<Vec<f64>> = numbers(bytes).chunks(size).map(<[f64]>::to_vec).collect();
    match states.iter().position(|state| state.iter().any(|number| !number.is_finite())) {
        Some(at) => Err(errors::value(format!("initial is not finite in row {at}: it must have finite numbers"))),
        None => Ok(states),
    }
}

/// Follows responses from states at phase 0 of a drive: rows of t, coordinates, rates and states of elements of all of
/// them at the start, after every so many periods and at the end.
#[pyfunction]
pub fn ensemble<'py>(
    py: Python<'py>,
    structure: &Assembly,
    drive: Drive,
    initial: &[u8],
    length: (u32, u32),
) -> PyResult<Bound<'py, PyByteArray>> {
    let forced = drive.forced(structure)?;
    let frequency_hz = drive.2;
    let (periods, every) = length;
    let states = states(&forced, initial)?;
    // Refused before any thread begins.
    let map = || StroboscopicMap::new(&forced, frequency_hz);
    map().map_err(errors::time_domain)?;
    let groups: Vec<_> = states.chunks(TOGETHER).collect();
    let found = stoppable(py, |stop| {
        on_all_cores(&groups, |group: &&[Vec<f64>]| followed(&map()?, group, periods, every, stop), || ())
    })?;
    let found: Vec<Vec<Vec<Vec<f64>>>> =
        found.into_iter().collect::<Result<_, TimeDomainError>>().map_err(errors::time_domain)?;
    let mut rows = Rows::default();
    for k in 0..=periods.div_ceil(every) {
        // The last row is that of the end, which may follow the one before by fewer periods.
        let t_s = f64::from(k.saturating_mul(every).min(periods)) / frequency_hz;
        for state in found.iter().filter_map(|group| group.get(k as usize)).flatten() {
            rows.numbers(&[t_s]);
            rows.numbers(state);
        }
    }
    rows.into_bytes(py)
}

/// The states of a group at the start, after every so many periods and at the end, or up to where it is stopped.
fn followed(
    map: &StroboscopicMap,
    group: &[Vec<f64>],
    periods: u32,
    every: u32,
    stop: &dyn Fn() -> bool,
) -> Result<Vec<Vec<Vec<f64>>>, TimeDomainError> {
    let mut states = group.to_vec();
    let mut done = 0;
    let mut kept = vec![states.clone()];
    while done < periods && !stop() {
        let next = (done / every + 1).saturating_mul(every);
        // Not further than the next state that is kept, and not so far that a request to stop waits long.
        let more = (next.min(periods) - done).min(AT_ONCE);
        map.advance_all(&mut states, more)?;
        done += more;
        if done == next || done == periods {
            kept.push(states.clone());
        }
    }
    Ok(kept)
}

/// The degrees of freedom at which a structure is driven, where its responses are read.
fn driven(forced: &Forced) -> Vec<Dof> {
    forced.drives().iter().map(|(dof, _share)| *dof).collect()
}

/// Makes a row with the number of the response that is reached, and that of the periods.
fn push_outcome(rows: &mut Rows, outcome: BasinOutcome) {
    let (orbit, periods) = match outcome {
        // Counted from 1, so that 0 and −1 are free for the states that reach no response.
        BasinOutcome::Reaches { orbit, periods } => (orbit as i64 + 1, periods),
        BasinOutcome::Undecided => (UNDECIDED, 0),
        BasinOutcome::Diverges => (DIVERGES, 0),
    };
    rows.word(orbit.cast_unsigned());
    rows.word(periods);
}

/// A stable periodic response: its period, the largest magnitude of its multipliers, the largest of each coordinate,
/// and the states at phase 0 of the drive.
type Motion = (u32, f64, Vec<f64>, Vec<Vec<f64>>);

/// The stable periodic responses of a structure under a drive, which initial states may reach.
#[pyclass(frozen, module = "resonarm._resonarm")]
#[derive(Debug)]
pub struct Attractors {
    forced: Forced,
    frequency_hz: f64,
    orbits: Vec<StableOrbit>,
    /// Reason why a branch ended early.
    #[pyo3(get)]
    ended_early: Option<String>,
}

#[pymethods]
impl Attractors {
    #[new]
    fn new(py: Python<'_>, structure: &Assembly, drive: Drive) -> PyResult<Attractors> {
        let forced = drive.forced(structure)?;
        let frequency_hz = drive.2;
        let found = stoppable(py, |stop| stable_orbits(&forced, &driven(&forced), frequency_hz, stop))?;
        let (orbits, early) = found.map_err(errors::time_domain)?;
        let ended_early = early.map(|early| errors::printable(early.reason));
        Ok(Attractors { forced, frequency_hz, orbits, ended_early })
    }

    /// These, and the stable periodic responses on which other states settle.
    fn with_those_of(&self, py: Python<'_>, initial: &[u8]) -> PyResult<Attractors> {
        let states = states(&self.forced, initial)?;
        let read = driven(&self.forced);
        let further =
            stoppable(py, |stop| further_orbits(&self.forced, &read, self.frequency_hz, &self.orbits, &states, stop))?
                .map_err(errors::time_domain)?;
        Ok(Attractors {
            forced: self.forced.clone(),
            orbits: [&self.orbits[..], &further].concat(),
            ended_early: self.ended_early.clone(),
            ..*self
        })
    }

    /// The stable periodic responses, by their largest displacement where the structure is driven first, those of
    /// `with_those_of` last.
    #[getter]
    fn motions(&self) -> Vec<Motion> {
        let row = |orbit: &StableOrbit| {
            let largest = orbit.coordinates.iter().map(|reading| reading.largest).collect();
            (orbit.period, orbit.largest_multiplier, largest, orbit.section.clone())
        };
        self.orbits.iter().map(row).collect()
    }

    /// Returns how far a grid goes in a coordinate or a rate to show what surrounds the responses.
    fn reach(&self, index: usize) -> f64 {
        reach(&self.orbits, index, self.frequency_hz)
    }

    /// Returns the response that each initial state reaches, and the number of periods it takes: on all cores, or on
    /// the calling thread alone. States are rows of coordinates, rates and states of elements.
    fn outcomes<'py>(
        &self,
        py: Python<'py>,
        initial: &[u8],
        time_constants: f64,
        on_cores: bool,
    ) -> PyResult<Bound<'py, PyByteArray>> {
        let map = || StroboscopicMap::new(&self.forced, self.frequency_hz);
        let states = states(&self.forced, initial)?;
        let groups: Vec<_> = states.chunks(TOGETHER).collect();
        let of =
            |group: &[Vec<f64>], stop: &dyn Fn() -> bool| outcomes(&map()?, &self.orbits, group, time_constants, stop);
        let found = if on_cores {
            stoppable(py, |stop| on_all_cores(&groups, |group: &&[Vec<f64>]| of(group, stop), || ()))?
        } else {
            // For the chunks of a map, which are short: an interrupt waits for those that have begun.
            py.detach(|| groups.iter().map(|group| of(group, &|| false)).collect())
        };
        let found: Vec<Vec<BasinOutcome>> =
            found.into_iter().collect::<Result<_, TimeDomainError>>().map_err(errors::time_domain)?;
        let mut rows = Rows::default();
        found.into_iter().flatten().for_each(|outcome| push_outcome(&mut rows, outcome));
        rows.into_bytes(py)
    }
}
