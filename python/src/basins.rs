//! Many motions side by side: ensembles, and basins of attraction.

use core::sync::atomic::{AtomicBool, Ordering};

use pyo3::prelude::*;
use pyo3::types::PyByteArray;
use resonarm::analysis::time_domain::{self, BasinOutcome, StateCoordinate, StroboscopicMap, TimeDomainError};
use resonarm::arm::{Sine, State};
use resonarm::plant::PlantSpecError;
use resonarm::study::on_all_cores;

use crate::arm::{Arm, SineParts, push, state};
use crate::errors;
use crate::rows::{Rows, numbers};
use crate::watch::watched;

/// Motions computed side by side on one core.
const TOGETHER: usize = 64;
/// Periods between two checks whether to stop.
const AT_ONCE: u32 = 64;
/// Takes the place of the number of a motion, which counts from 1.
const UNDECIDED: i64 = 0;
const DIVERGES: i64 = -1;

/// The states in an array of Python, given as its bytes.
fn states(bytes: &[u8]) -> PyResult<Vec<State>> {
    let numbers = numbers(bytes);
    let (rows, _rest) = numbers.as_chunks::<4>();
    match rows.iter().find(|row| row.iter().any(|number| !number.is_finite())) {
        Some(row) => Err(errors::value(PlantSpecError::Initial(row.to_vec()))),
        None => Ok(rows.iter().map(state).collect()),
    }
}

/// Follows motions from states at phase 0 of a sine: rows of t, α and α̇ of all of them at the start, after every so
/// many periods and at the end.
#[pyfunction]
pub fn ensemble<'py>(
    py: Python<'py>,
    arm: &Arm,
    sine: SineParts,
    initial: &[u8],
    length: (u32, u32),
) -> PyResult<Bound<'py, PyByteArray>> {
    let (sine, (periods, every)) = (sine.sine(), length);
    let map = StroboscopicMap::new(&arm.inner, sine).map_err(errors::time_domain)?;
    let (states, stopped) = (states(initial)?, AtomicBool::new(false));
    let groups: Vec<&[State]> = states.chunks(TOGETHER).collect();
    let stop = || stopped.load(Ordering::Relaxed);
    let work = || on_all_cores(&groups, |group| followed(&map, group, periods, every, &stop), || ());
    let found = watched(py, &|| stopped.store(true, Ordering::Relaxed), work)?;
    let mut rows = Rows::default();
    for k in 0..=periods.div_ceil(every) {
        let t_s = f64::from(k.saturating_mul(every).min(periods)) / sine.frequency_hz;
        for group in &found {
            group.get(k as usize).into_iter().flatten().for_each(|state| push(&mut rows, t_s, state));
        }
    }
    rows.into_bytes(py)
}

/// A group of motions at the start, after every so many periods and at the end, or up to where it is stopped.
fn followed(
    map: &StroboscopicMap<'_>,
    group: &[State],
    periods: u32,
    every: u32,
    stop: &dyn Fn() -> bool,
) -> Vec<Vec<State>> {
    let (mut states, mut done) = (group.to_vec(), 0);
    let mut kept = vec![states.clone()];
    while done < periods && !stop() {
        let next = (done / every + 1).saturating_mul(every);
        let more = (next.min(periods) - done).min(AT_ONCE);
        map.advance_all(&mut states, more);
        done += more;
        if done == next || done == periods {
            kept.push(states.clone());
        }
    }
    kept
}

/// A stable periodic motion of the arm under a sine.
#[pyclass(frozen, eq, get_all, module = "resonarm._resonarm")]
#[derive(Debug, PartialEq)]
pub struct StableMotion {
    /// Periods of the excitation after which it repeats.
    period: u32,
    /// Largest magnitude of its Floquet multipliers, over its own period.
    largest_multiplier: f64,
    /// The largest |α1| and |α2|, rad.
    amplitude_rad: (f64, f64),
    /// The states at phase 0 of the excitation: α1, α2, rad, α̇1, α̇2, rad/s.
    section: Vec<Section>,
}

/// A state at phase 0: α1, α2, rad, α̇1, α̇2, rad/s.
type Section = (f64, f64, f64, f64);

#[pymethods]
impl StableMotion {
    #[new]
    fn new(period: u32, largest_multiplier: f64, amplitude_rad: (f64, f64), section: Vec<Section>) -> StableMotion {
        StableMotion { period, largest_multiplier, amplitude_rad, section }
    }

    fn __getnewargs__(&self) -> (u32, f64, (f64, f64), Vec<Section>) {
        (self.period, self.largest_multiplier, self.amplitude_rad, self.section.clone())
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        (self.period, self.largest_multiplier, self.amplitude_rad).into_pyobject(py)?.hash()
    }

    fn __repr__(&self) -> String {
        let StableMotion { period, largest_multiplier, amplitude_rad: (a1, a2), .. } = self;
        format!(
            "StableMotion(period={period}, largest_multiplier={largest_multiplier:.6}, amplitude_rad=({a1:.6}, {a2:.6}))"
        )
    }
}

/// A row with the number of the motion that is reached, and that of the periods.
pub fn push_outcome(rows: &mut Rows, outcome: BasinOutcome) {
    let (motion, periods) = match outcome {
        BasinOutcome::Reaches { motion, periods } => (motion as i64 + 1, periods),
        BasinOutcome::Undecided => (UNDECIDED, 0),
        BasinOutcome::Diverges => (DIVERGES, 0),
    };
    rows.word(motion.cast_unsigned());
    rows.word(periods);
}

/// The stable motions of an arm under a sine, which initial states may reach.
#[pyclass(frozen, module = "resonarm._resonarm")]
#[derive(Debug)]
pub struct Attractors {
    arm: resonarm::arm::Arm,
    sine: Sine,
    motions: Vec<time_domain::StableMotion>,
    /// Why a branch ended early.
    #[pyo3(get)]
    ended_early: Option<String>,
}

#[pymethods]
impl Attractors {
    #[new]
    fn new(py: Python<'_>, arm: &Arm, sine: SineParts) -> PyResult<Attractors> {
        let (arm, sine) = (arm.inner.clone(), sine.sine());
        let found = py.detach(|| time_domain::stable_motions(&arm, &sine));
        let (motions, early) = found.map_err(errors::time_domain)?;
        Ok(Attractors { arm, sine, motions, ended_early: early.first().map(|early| early.reason.to_string()) })
    }

    /// The motions, by their largest |α1|.
    #[getter]
    fn motions(&self) -> Vec<StableMotion> {
        let motion = |motion: &time_domain::StableMotion| StableMotion {
            period: motion.period,
            largest_multiplier: motion.largest_multiplier,
            amplitude_rad: motion.amplitude_rad.into(),
            section: motion.section.iter().map(|state| StateCoordinate::ALL.map(|of| of.of(state)).into()).collect(),
        };
        self.motions.iter().map(motion).collect()
    }

    /// The motion that each initial state reaches, and the number of periods it takes: on all cores, or on the
    /// calling thread alone.
    fn outcomes<'py>(
        &self,
        py: Python<'py>,
        initial: &[u8],
        time_constants: f64,
        on_cores: bool,
    ) -> PyResult<Bound<'py, PyByteArray>> {
        let map = StroboscopicMap::new(&self.arm, self.sine).map_err(errors::time_domain)?;
        let (states, stopped) = (states(initial)?, AtomicBool::new(false));
        let groups: Vec<&[State]> = states.chunks(TOGETHER).collect();
        let stop = || stopped.load(Ordering::Relaxed);
        let of = |group: &&[State]| time_domain::outcomes(&map, &self.motions, group, time_constants, &stop);
        let found = if on_cores {
            watched(py, &|| stopped.store(true, Ordering::Relaxed), || on_all_cores(&groups, of, || ()))?
        } else {
            py.detach(|| groups.iter().map(of).collect())
        };
        let found: Vec<Vec<BasinOutcome>> =
            found.into_iter().collect::<Result<_, TimeDomainError>>().map_err(errors::time_domain)?;
        let mut rows = Rows::default();
        found.into_iter().flatten().for_each(|outcome| push_outcome(&mut rows, outcome));
        rows.into_bytes(py)
    }
}
