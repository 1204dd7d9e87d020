//! Basins of attraction of a structure.

use core::sync::atomic::{AtomicBool, Ordering};

use pyo3::prelude::*;
use pyo3::types::PyByteArray;
use resonarm::analysis::structure::Forced;
use resonarm::analysis::structure::time_domain::{StableMotion, StroboscopicMap, outcomes, reach, stable_motions};
use resonarm::analysis::time_domain::{BasinOutcome, TimeDomainError};
use resonarm::study::on_all_cores;

use crate::basins::push_outcome;
use crate::errors;
use crate::rows::{Rows, numbers};
use crate::structure::Assembly;
use crate::watch::watched;

/// Motions that a core follows one after the other.
const TOGETHER: usize = 16;

/// A stable periodic motion: its period, the largest magnitude of its multipliers, the largest of each coordinate, and
/// the states at phase 0 of the drive.
type Motion = (u32, f64, Vec<f64>, Vec<Vec<f64>>);

/// The stable motions of a structure under a sine, which initial states may reach.
#[pyclass(frozen, module = "resonarm._resonarm")]
#[derive(Debug)]
pub struct StructureAttractors {
    forced: Forced,
    frequency_hz: f64,
    motions: Vec<StableMotion>,
    /// Why a branch ended early.
    #[pyo3(get)]
    ended_early: Option<String>,
}

#[pymethods]
impl StructureAttractors {
    /// Under a load: degree of freedom, peak, frequency.
    #[new]
    fn new(py: Python<'_>, structure: &Assembly, drive: (String, f64, f64)) -> PyResult<StructureAttractors> {
        let (drive, amplitude, frequency_hz) = drive;
        let drive = structure.dof("drive", &drive)?;
        let (forced, stopped) = (Forced::new(structure.inner.clone(), drive, amplitude), AtomicBool::new(false));
        let stop = || stopped.load(Ordering::Relaxed);
        let work = || stable_motions(&forced, &[drive], frequency_hz, &stop);
        let found = watched(py, &|| stopped.store(true, Ordering::Relaxed), work)?;
        let (motions, early) = found.map_err(errors::time_domain)?;
        let ended_early = early.map(|early| errors::printable(early.reason));
        Ok(StructureAttractors { forced, frequency_hz, motions, ended_early })
    }

    /// The motions, by their largest displacement where the structure is driven.
    #[getter]
    fn motions(&self) -> Vec<Motion> {
        let motion = |motion: &StableMotion| {
            let largest = motion.coordinates.iter().map(|reading| reading.largest).collect();
            (motion.period, motion.largest_multiplier, largest, motion.section.clone())
        };
        self.motions.iter().map(motion).collect()
    }

    /// How far a grid goes in a coordinate or a rate to show what surrounds the motions.
    fn reach(&self, index: usize) -> f64 {
        reach(&self.motions, index, self.frequency_hz)
    }

    /// The motion that each initial state reaches, and the number of periods it takes; states are rows of coordinates,
    /// rates and states of elements.
    fn outcomes<'py>(&self, py: Python<'py>, initial: &[u8], time_constants: f64) -> PyResult<Bound<'py, PyByteArray>> {
        let map = || StroboscopicMap::new(&self.forced, self.frequency_hz);
        let assembly = self.forced.assembly();
        let size = 2 * assembly.coordinates() + assembly.element_states();
        let states: Vec<Vec<f64>> = numbers(initial).chunks(size).map(<[f64]>::to_vec).collect();
        let (groups, stopped) = (states.chunks(TOGETHER).collect::<Vec<_>>(), AtomicBool::new(false));
        let stop = || stopped.load(Ordering::Relaxed);
        let of = |group: &&[Vec<f64>]| outcomes(&map()?, &self.motions, group, time_constants, &stop);
        let work = || on_all_cores(&groups, of, || ());
        let found = watched(py, &|| stopped.store(true, Ordering::Relaxed), work)?;
        let found: Vec<Vec<BasinOutcome>> =
            found.into_iter().collect::<Result<_, TimeDomainError>>().map_err(errors::time_domain)?;
        let mut rows = Rows::default();
        found.into_iter().flatten().for_each(|outcome| push_outcome(&mut rows, outcome));
        rows.into_bytes(py)
    }
}
