//! Branches of a structure's periodic responses, those beside them, and curves of bifurcations.

use pyo3::prelude::*;
use pyo3::types::PyByteArray;
use resonarm::analysis::{AnalysisError, EndedEarly};
use resonarm::analysis::{
    Assess, Bifurcation, Branch, Coordinate, Forced, NotFollowed, Orbit, Origin, OtherBranch, OtherOptions,
    SearchOptions, Searched, SingularCurve, SingularPoint, TraceOptions, phase_zero_state, trace, trace_branches,
    trace_singular_curves,
};

use crate::errors;
use crate::forced::Drive;
use crate::rows::Rows;
use crate::structure::Assembly;

/// The largest step along a curve of bifurcations, relative to its local size: short enough to be drawn.
const LARGEST_CURVE_STEP: f64 = 0.08;

/// A branch: points, kinds, points and beats of bifurcations, those not located by kind and interval, for each degree of
/// freedom that is read the response with the largest displacement; the numbers of states and multipliers in a row.
#[pyclass(frozen, get_all, module = "resonarm._resonarm")]
pub struct TracedBranch {
    points: Py<PyByteArray>,
    kinds: Vec<&'static str>,
    bifurcations: Py<PyByteArray>,
    beats: Vec<(f64, f64)>,
    unlocated: Vec<(&'static str, f64, f64)>,
    peaks: Py<PyByteArray>,
    /// The verdicts on the stability of points, peaks and bifurcations; empty where it is not computed.
    stability: [Vec<&'static str>; 3],
    states: usize,
    multipliers: usize,
}

/// Kind, points, places of turns; whether each is a cusp.
type CurveRows = (&'static str, Py<PyByteArray>, Py<PyByteArray>, Vec<bool>);

/// The beginning of a branch: kind and value of the bifurcation, number of the branch that it leaves if it leaves one,
/// period, whether the branch has a mirror image.
type OriginRow = (&'static str, f64, Option<usize>, usize, bool);

/// What was searched: the reason for which responses of the period of the load were not, the frequencies with random
/// starts, starts at each, the largest displacement tried for each degree of freedom that is read, the least and the
/// largest load along folds, the number of branches that were found and not kept, and the values at which sub-harmonic
/// responses were sought.
type SearchedRow = (Option<&'static str>, Vec<f64>, usize, Vec<f64>, Option<(f64, f64)>, usize, Option<Vec<f64>>);

/// The results: the branch, the branches to which no other leads and those that leave others with their beginnings,
/// beginnings of branches that were not followed with the reasons, what was searched, curves, and why any of these ended
/// early if one did.
#[pyclass(frozen, get_all, module = "resonarm._resonarm")]
pub struct Traced {
    branch: Py<TracedBranch>,
    isolas: Vec<(OriginRow, Py<TracedBranch>)>,
    branches: Vec<(OriginRow, Py<TracedBranch>)>,
    left_out: Vec<(OriginRow, String)>,
    searched: SearchedRow,
    curves: Vec<CurveRows>,
    ended_early: Option<String>,
}

/// Finds the coordinate of a branch that an argument names.
fn coordinate(argument: &str, name: &str, structure: &Assembly) -> PyResult<Coordinate> {
    match name {
        "frequency" => Ok(Coordinate::FrequencyHz),
        "amplitude" => Ok(Coordinate::Amplitude),
        _ => structure
            .inner
            .parameter(name)
            .map(Coordinate::Parameter)
            .map_err(|error| errors::value(format!("{argument} {name}: {error}; or frequency, or amplitude"))),
    }
}

/// Limits of harmonics, points and step length, whether the stability is computed, the tolerance of the harmonics left
/// out, and a state near which the branch starts.
type Settings = (usize, usize, f64, bool, Option<f64>, Option<Vec<f64>>);

/// Follows the periodic responses of a structure under a drive in the frequency, the amplitude or a parameter from one
/// value to another, read at degrees of freedom, and searches for responses beside it, further if that is asked for.
/// Follows the branches that leave others, and the folds and doublings of the first branch in a second coordinate up to a
/// value, if that is asked for.
#[pyfunction]
pub fn trace_branch(
    py: Python<'_>,
    structure: &Assembly,
    drive: Drive,
    range: (String, f64, f64),
    at: Vec<String>,
    settings: Settings,
    beyond: ((bool, bool), Option<(String, f64)>),
) -> PyResult<Traced> {
    let (parameter, start, stop) = range;
    let ((leaving, further), curves_in) = beyond;
    let varied = coordinate("parameter", &parameter, structure)?;
    let second = |(name, to): (String, f64)| PyResult::Ok((coordinate("curves_in", &name, structure)?, to));
    let curves_in = curves_in.map(second).transpose()?;
    let read = at.iter().map(|name| structure.dof("at", name)).collect::<PyResult<Vec<_>>>()?;
    let mut search = if further { SearchOptions::further() } else { SearchOptions::default() };
    // The branches that are asked for include sub-harmonic ones, to which no bifurcation of the first leads.
    search.sub_harmonics |= leaving;
    let wanted = OtherOptions { leaving, search: Some(search) };
    let asked = leaving || further;
    let forced = drive.forced(structure)?;
    let frequency_hz = drive.2;
    let options = set(&settings, TraceOptions::new(&forced, varied, [start, stop], read));
    // The first reason why a branch or a curve ended early.
    let mut early = None;
    let branch = match py.detach(|| trace(&forced, frequency_hz, varied, &options)) {
        // Without a single response there is no branch to return, and the reason is an error at once.
        Err(ended) if ended.so_far.orbits.is_empty() => return Err(errors::analysis(ended.reason)),
        traced => keep(traced, &mut early),
    };
    let found = py.detach(|| trace_branches(&forced, &branch, varied, &options, &wanted));
    let mut others = Vec::new();
    for OtherBranch { origin, traced } in found.branches {
        // Without a request for other branches one of them that ends early has no consequence.
        let mut without = None;
        others.push((origin, keep(traced, if asked { &mut early } else { &mut without })));
    }
    for (_, reason) in &found.left_out {
        if let (NotFollowed::Failed(reason), true) = (reason, asked) {
            early.get_or_insert(reason.clone());
        }
    }
    let mut curves = Vec::new();
    if let Some((second, to)) = curves_in {
        // They begin at the value on the branch, whichever that is.
        let mut along = set(&settings, TraceOptions::new(&forced, second, [0.0, to], options.read.clone()));
        let largest_step = &mut along.branch.continuation.largest_step;
        *largest_step = largest_step.min(LARGEST_CURVE_STEP);
        for (kind, traced) in py.detach(|| trace_singular_curves(&forced, &branch, [varied, second], &along)) {
            curves.push(curve_rows(py, kind.name(), &keep(traced, &mut early))?);
        }
    }
    let of = |branch: &Branch| TracedBranch::new(py, branch, &forced, varied);
    let row = |(origin, branch): &(Origin, Branch)| Ok((origin_row(origin), of(branch)?));
    let (leaving, isolas): (Vec<_>, Vec<_>) = others.iter().partition(|(origin, _)| origin.parent.is_some());
    let left_out = found.left_out.into_iter();
    Ok(Traced {
        branch: of(&branch)?,
        isolas: isolas.into_iter().map(row).collect::<PyResult<_>>()?,
        branches: leaving.into_iter().map(row).collect::<PyResult<_>>()?,
        left_out: left_out.map(|(origin, reason)| (origin_row(&origin), errors::printable(reason))).collect(),
        searched: searched_row(found.searched.unwrap_or_default()),
        curves,
        ended_early: early.map(errors::printable),
    })
}

/// Returns options with the settings.
fn set(settings: &Settings, mut options: TraceOptions) -> TraceOptions {
    let (most_harmonics, most_points, largest_step, stability, tolerance, near) = settings;
    options.branch.most_harmonics = *most_harmonics;
    options.branch.most_points = *most_points;
    options.branch.continuation.largest_step = *largest_step;
    options.branch.truncation = tolerance.unwrap_or(options.branch.truncation);
    options.assess = if *stability { Assess::Multipliers } else { Assess::Nothing };
    options.near.clone_from(near);
    options
}

/// Returns the beginning of a branch.
fn origin_row(origin: &Origin) -> OriginRow {
    (origin.kind.name(), origin.value, origin.parent, origin.period, origin.is_mirrored)
}

/// Returns what was searched.
fn searched_row(searched: Searched) -> SearchedRow {
    let Searched { not_searched, frequencies_hz, starts, largest, loads, attached, sub_harmonics, .. } = searched;
    let not_searched = not_searched.map(|reason| reason.name());
    let sought = sub_harmonics.map(|search| search.values);
    (not_searched, frequencies_hz, starts, largest, loads.map(|[from, to]| (from, to)), attached, sought)
}

/// The result of a continuation, complete or not; keeps the first reason why one ended early.
fn keep<T: core::fmt::Debug>(traced: Result<T, EndedEarly<T>>, early: &mut Option<AnalysisError>) -> T {
    traced.unwrap_or_else(|ended| {
        early.get_or_insert(ended.reason);
        *ended.so_far
    })
}

impl TracedBranch {
    fn new(py: Python<'_>, branch: &Branch, forced: &Forced, varied: Coordinate) -> PyResult<Py<TracedBranch>> {
        let found = || branch.bifurcations.iter().map(|bifurcation| &bifurcation.orbit);
        let all = || branch.orbits.iter().chain(found()).chain(&branch.peaks);
        // Rows have one length, so the orbit with the most multipliers gives it.
        let multipliers = all().map(|orbit| multipliers(orbit).len()).max().unwrap_or(0);
        let assembly = forced.assembly();
        let states = 2 * assembly.coordinates() + assembly.element_states();
        let rows = |orbits: &mut dyn Iterator<Item = &Orbit>| {
            let mut rows = Rows::default();
            for orbit in orbits {
                let state = phase_zero_state(forced, varied, orbit).unwrap_or_else(|| vec![f64::NAN; states]);
                push(&mut rows, orbit, &state, multipliers);
            }
            rows.into_bytes(py).map(Bound::unbind)
        };
        let verdict = |orbit: &Orbit| orbit.stability.as_ref().map_or("", |stability| stability.verdict().name());
        let stability = [
            branch.orbits.iter().map(verdict).collect(),
            branch.peaks.iter().map(verdict).collect(),
            found().map(verdict).collect(),
        ];
        let traced = TracedBranch {
            points: rows(&mut branch.orbits.iter())?,
            kinds: branch.bifurcations.iter().map(|bifurcation| bifurcation.kind.name()).collect(),
            bifurcations: rows(&mut found())?,
            beats: branch.bifurcations.iter().map(beat).collect(),
            unlocated: branch.unlocated.iter().map(|at| (at.kind.name(), at.between[0], at.between[1])).collect(),
            peaks: rows(&mut branch.peaks.iter())?,
            stability,
            states,
            multipliers,
        };
        Py::new(py, traced)
    }
}

/// The rotation number of a Neimark–Sacker point and the frequency of the beat, Hz; NaN at other bifurcations.
fn beat(found: &Bifurcation) -> (f64, f64) {
    found.beat().map_or((f64::NAN, f64::NAN), |beat| (beat.rotation_number, beat.frequency_hz))
}

/// The Floquet multipliers of a periodic response, re and im; none if they are not known.
fn multipliers(orbit: &Orbit) -> Vec<[f64; 2]> {
    let known = orbit.stability.iter().flat_map(|stability| &stability.multipliers);
    known.map(|multiplier| [multiplier.re, multiplier.im]).collect()
}

/// A row; NaN in place of multipliers that there are not.
fn push(rows: &mut Rows, orbit: &Orbit, state: &[f64], count: usize) {
    rows.numbers(&[orbit.value, orbit.frequency_hz, orbit.drive]);
    rows.word(orbit.is_stable() == Some(true));
    rows.word(orbit.harmonics as u64);
    rows.word(orbit.period as u64);
    rows.numbers(&[orbit.truncation_error]);
    rows.numbers(state);
    orbit.readings.iter().for_each(|reading| rows.numbers(&reading.numbers()));
    let mut multipliers = multipliers(orbit);
    multipliers.resize(count, [f64::NAN; 2]);
    rows.numbers(multipliers.as_flattened());
}

fn curve_rows(py: Python<'_>, kind: &'static str, curve: &SingularCurve) -> PyResult<CurveRows> {
    let mut points = Rows::default();
    let mut turns = Rows::default();
    let push = |rows: &mut Rows, point: &SingularPoint| {
        rows.numbers(&[point.lambda, point.mu]);
        point.orbit.readings.iter().for_each(|reading| rows.numbers(&reading.numbers()));
    };
    curve.points.iter().for_each(|point| push(&mut points, point));
    curve.turns.iter().for_each(|turn| push(&mut turns, &turn.point));
    let cusps = curve.turns.iter().map(|turn| turn.is_cusp).collect();
    Ok((kind, points.into_bytes(py)?.unbind(), turns.into_bytes(py)?.unbind(), cusps))
}
