//! Branches of periodic motions, and the curves of their bifurcations.

use pyo3::prelude::*;
use pyo3::types::PyByteArray;
use resonarm::analysis::{
    AnalysisError, ArmParameter, Branch, BranchOptions, Coordinate, EndedEarly, ForcedArm, Orbit, SingularCurve,
    SingularPoint, trace, trace_doublings, trace_singular_curves,
};
use resonarm::arm::Load;

use crate::arm::Arm;
use crate::errors;
use crate::rows::Rows;

/// The largest step along a curve of bifurcations, relative to its local size: short enough to be drawn.
const LARGEST_CURVE_STEP: f64 = 0.08;

/// Points; kinds and points of bifurcations.
type BranchRows = (Py<PyByteArray>, Vec<&'static str>, Py<PyByteArray>);
/// Kind, points, places of turns; whether each is a cusp.
type CurveRows = (&'static str, Py<PyByteArray>, Py<PyByteArray>, Vec<bool>);

/// The results: the branch and those that leave it at period doublings, curves, and why it ended early if it did.
#[pyclass(frozen, get_all, module = "resonarm._resonarm")]
pub struct Traced {
    branches: Vec<BranchRows>,
    curves: Vec<CurveRows>,
    ended_early: Option<String>,
}

/// Name and unit of a quantity in which a branch can be followed.
#[pyfunction]
pub fn parameter_label(name: &str) -> PyResult<(String, String)> {
    match coordinate("parameter", name)? {
        Coordinate::FrequencyHz => Ok((String::from("excitation frequency"), String::from("Hz"))),
        Coordinate::Parameter(which) => Ok((which.symbol().to_owned(), which.unit().to_owned())),
    }
}

fn coordinate(flag: &str, name: &str) -> PyResult<Coordinate<ArmParameter>> {
    if name == "frequency" {
        return Ok(Coordinate::FrequencyHz);
    }
    name.parse().map(Coordinate::Parameter).map_err(|_unknown| {
        let known: Vec<&str> = core::iter::once("frequency").chain(ArmParameter::ALL.map(ArmParameter::name)).collect();
        errors::value(format!("{flag} is `{name}`: it must be one of {}", known.join(", ")))
    })
}

/// Follows the motions of an arm under a load (its direction u1, u2, Fx, Fy, its amplitude and frequency) in a
/// parameter from one value to another, with limits of harmonics, points and step length.
#[pyfunction]
pub fn trace_branch(
    py: Python<'_>,
    arm: &Arm,
    drive: ([f64; 4], f64, f64),
    range: (String, f64, f64),
    limits: (usize, usize, f64),
    doubled: bool,
    curves: Option<(String, f64)>,
) -> PyResult<Traced> {
    let (direction, amplitude, frequency_hz) = drive;
    let ((parameter, start, stop), (most_harmonics, most_points, largest_step)) = (range, limits);
    let varied = coordinate("parameter", &parameter)?;
    let curves = match curves {
        Some((name, to)) => Some((coordinate("curves_in", &name)?, to)),
        None => None,
    };
    let [torque1_nm, torque2_nm, force_x_n, force_y_n] = direction;
    let load = Load { torque_nm: [torque1_nm, torque2_nm].into(), force_n: [force_x_n, force_y_n].into() };
    let forced = ForcedArm::new(arm.inner.clone(), load, amplitude);
    let mut options = BranchOptions::new(start, stop);
    options.most_harmonics = most_harmonics;
    options.most_points = most_points;
    options.continuation.largest_step = largest_step;
    let (branches, curves, early) =
        py.detach(|| follow(&forced, frequency_hz, varied, &options, doubled, curves)).map_err(errors::analysis)?;
    Ok(Traced {
        branches: branches.iter().map(|branch| branch_rows(py, branch)).collect::<PyResult<_>>()?,
        curves: curves.iter().map(|(kind, curve)| curve_rows(py, kind, curve)).collect::<PyResult<_>>()?,
        ended_early: early.map(|reason| reason.to_string()),
    })
}

type Found = (Vec<Branch>, Vec<(&'static str, SingularCurve)>, Option<AnalysisError>);

fn follow(
    forced: &ForcedArm,
    frequency_hz: f64,
    varied: Coordinate<ArmParameter>,
    options: &BranchOptions,
    doubled: bool,
    curves: Option<(Coordinate<ArmParameter>, f64)>,
) -> Result<Found, AnalysisError> {
    let mut early = None;
    let branch = match trace(forced.clone(), frequency_hz, varied, options) {
        Err(ended) if ended.so_far.orbits.is_empty() => return Err(ended.reason),
        traced => keep(traced, &mut early),
    };
    let mut found = Vec::new();
    if let Some((second, to)) = curves {
        let mut options = options.between(0.0, to);
        options.continuation.largest_step = options.continuation.largest_step.min(LARGEST_CURVE_STEP);
        for (kind, traced) in trace_singular_curves(forced, &branch, varied, second, &options) {
            found.push((kind.name(), keep(traced, &mut early)));
        }
    }
    let mut branches = Vec::new();
    if doubled {
        for traced in trace_doublings(forced, &branch, varied, options) {
            branches.push(keep(traced, &mut early));
        }
    }
    branches.insert(0, branch);
    Ok((branches, found, early))
}

/// The result of a continuation, complete or not; keeps the first reason why one ended early.
fn keep<T: core::fmt::Debug>(traced: Result<T, EndedEarly<T>>, early: &mut Option<AnalysisError>) -> T {
    traced.unwrap_or_else(|ended| {
        early.get_or_insert(ended.reason);
        *ended.so_far
    })
}

fn branch_rows(py: Python<'_>, branch: &Branch) -> PyResult<BranchRows> {
    let (mut points, mut events) = (Rows::default(), Rows::default());
    branch.orbits.iter().for_each(|orbit| push(&mut points, orbit));
    branch.bifurcations.iter().for_each(|found| push(&mut events, &found.orbit));
    let kinds = branch.bifurcations.iter().map(|found| found.kind.name()).collect();
    Ok((points.into_bytes(py)?.unbind(), kinds, events.into_bytes(py)?.unbind()))
}

fn push(rows: &mut Rows, orbit: &Orbit) {
    rows.numbers(&[orbit.value, orbit.frequency_hz]);
    rows.numbers(&orbit.amplitude_rad);
    rows.numbers(&orbit.harmonic1_rad);
    rows.word(orbit.is_stable());
    rows.word(orbit.period as u64);
    orbit.multipliers().iter().for_each(|z| rows.numbers(&[z.re, z.im]));
}

fn curve_rows(py: Python<'_>, kind: &'static str, curve: &SingularCurve) -> PyResult<CurveRows> {
    let (mut points, mut turns) = (Rows::default(), Rows::default());
    let push = |rows: &mut Rows, point: &SingularPoint| {
        rows.numbers(&[point.lambda, point.mu]);
        rows.numbers(&point.harmonic1_rad);
    };
    curve.points.iter().for_each(|point| push(&mut points, point));
    curve.turns.iter().for_each(|turn| push(&mut turns, &turn.point));
    let cusps = curve.turns.iter().map(|turn| turn.is_cusp).collect();
    Ok((kind, points.into_bytes(py)?.unbind(), turns.into_bytes(py)?.unbind(), cusps))
}
