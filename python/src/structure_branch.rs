//! Branches of a structure's periodic motions.

use pyo3::prelude::*;
use pyo3::types::PyByteArray;
use resonarm::analysis::EndedEarly;
use resonarm::analysis::structure::{Assess, Branch, Coordinate, Forced, Orbit, Reading, TraceOptions, trace};

use crate::errors;
use crate::rows::Rows;
use crate::structure::Assembly;

/// The results: points, kinds and points of bifurcations, those not located by kind and interval, for each degree of
/// freedom that is read the motion with the largest displacement; the number of multipliers in a row, and why it ended
/// early if it did.
#[pyclass(frozen, get_all, module = "resonarm._resonarm")]
pub struct TracedStructure {
    points: Py<PyByteArray>,
    kinds: Vec<&'static str>,
    bifurcations: Py<PyByteArray>,
    unlocated: Vec<(&'static str, f64, f64)>,
    peaks: Py<PyByteArray>,
    multipliers: usize,
    ended_early: Option<String>,
}

/// Follows the motions of a structure under a load (degree of freedom, peak, frequency) in the frequency or the
/// amplitude from one value to another, read at degrees of freedom, with limits of harmonics, points and step length,
/// and with their stability if that is asked for.
#[pyfunction]
pub fn trace_structure(
    py: Python<'_>,
    structure: &Assembly,
    drive: (String, f64, f64),
    range: (bool, f64, f64),
    at: Vec<String>,
    limits: (usize, usize, f64),
    stability: bool,
) -> PyResult<TracedStructure> {
    let ((drive, amplitude, frequency_hz), (is_amplitude, start, stop)) = (drive, range);
    let drive = structure.dof("drive", &drive)?;
    let read = at.iter().map(|name| structure.dof("at", name)).collect::<PyResult<Vec<_>>>()?;
    let coordinate = if is_amplitude { Coordinate::Amplitude } else { Coordinate::FrequencyHz };
    let forced = Forced::new(structure.inner.clone(), drive, amplitude);
    let mut options = TraceOptions::new(&forced, coordinate, [start, stop], read);
    let (most_harmonics, most_points, largest_step) = limits;
    options.branch.most_harmonics = most_harmonics;
    options.branch.most_points = most_points;
    options.branch.continuation.largest_step = largest_step;
    options.assess = if stability { Assess::Multipliers } else { Assess::Nothing };
    match py.detach(|| trace(&forced, frequency_hz, coordinate, &options)) {
        Ok(branch) => TracedStructure::new(py, &branch, None),
        Err(EndedEarly { reason, so_far }) if so_far.orbits.is_empty() => Err(errors::analysis(reason)),
        Err(EndedEarly { reason, so_far }) => TracedStructure::new(py, &so_far, Some(errors::printable(reason))),
    }
}

impl TracedStructure {
    fn new(py: Python<'_>, branch: &Branch, ended_early: Option<String>) -> PyResult<TracedStructure> {
        let found = || branch.bifurcations.iter().map(|bifurcation| &bifurcation.orbit);
        let all = || branch.orbits.iter().chain(found()).chain(&branch.peaks);
        let multipliers = all().map(|orbit| multipliers(orbit).len()).max().unwrap_or(0);
        let rows = |orbits: &mut dyn Iterator<Item = &Orbit>| {
            let mut rows = Rows::default();
            orbits.for_each(|orbit| push(&mut rows, orbit, multipliers));
            rows.into_bytes(py).map(Bound::unbind)
        };
        Ok(TracedStructure {
            points: rows(&mut branch.orbits.iter())?,
            kinds: branch.bifurcations.iter().map(|bifurcation| bifurcation.kind.name()).collect(),
            bifurcations: rows(&mut found())?,
            unlocated: branch.unlocated.iter().map(|at| (at.kind.name(), at.between[0], at.between[1])).collect(),
            peaks: rows(&mut branch.peaks.iter())?,
            multipliers,
            ended_early,
        })
    }
}

/// The Floquet multipliers of a motion, re and im; none if they are not known.
fn multipliers(orbit: &Orbit) -> Vec<[f64; 2]> {
    let known = orbit.stability.iter().flat_map(|stability| &stability.multipliers);
    known.map(|multiplier| [multiplier.re, multiplier.im]).collect()
}

/// A row; NaN in place of multipliers that there are not.
fn push(rows: &mut Rows, orbit: &Orbit, count: usize) {
    rows.numbers(&[orbit.value, orbit.frequency_hz, orbit.drive]);
    rows.word(orbit.is_stable() == Some(true));
    rows.word(orbit.harmonics as u64);
    for Reading { largest, mean, harmonic1 } in &orbit.readings {
        rows.numbers(&[*largest, *mean, harmonic1.re, harmonic1.im]);
    }
    let mut multipliers = multipliers(orbit);
    multipliers.resize(count, [f64::NAN; 2]);
    rows.numbers(multipliers.as_flattened());
}
