//! The computed branch of the live view: the motions on which the responses that are read should lie.

use crate::figures::branches::stretches;
use resonarm::analysis::structure::{self, Coordinate, Forced, Orbit, Reading, TraceOptions, trace};
use resonarm::analysis::{BifurcationKind, Branch, Row, response_around, segments};
use resonarm::arm::{Arm, Load};
use resonarm::excitation::Amplitude;
use resonarm::plant::TestedAssembly;
use resonarm::scenario::{Scenario, ScenarioError};
use resonarm::structure::Dof;
use resonarm_live::{BranchLines, ComputeBranch};

/// Largest turn between two motions of the computed branch: coarser than in a figure, and faster to compute.
const TURN_RAD: f64 = 0.1;
/// The branch of a structure goes beyond the responses by this part of their frequencies.
const MARGIN: f64 = 0.02;

/// Computes the branch of the load at which the scenario's responses are read; `None` without a load, of a structure
/// that a program makes, of an FMU, and of one that is driven along more than one degree of freedom.
pub(crate) fn compute(scenario: &Scenario) -> Result<Option<ComputeBranch>, ScenarioError> {
    let Some(amplitude) = scenario.amplitude() else { return Ok(None) };
    if scenario.structure.is_none() {
        return Ok(Some(of_arm(scenario.build_arm()?, amplitude.load())));
    }
    if scenario.foreign_structure().is_some() {
        return Ok(None);
    }
    let tested = scenario.tested_structure()?;
    Ok(tested.and_then(|tested| of_structure(tested, amplitude)))
}

/// Walks the branch of motions of the arm under `load`.
fn of_arm(arm: Arm, load: Load) -> ComputeBranch {
    Box::new(move |low_hz, high_hz| {
        let branch = response_around(&arm, &load, [low_hz, high_hz], TURN_RAD);
        branch.map(|branch| lines_of_arm(&branch)).inspect_err(|error| warn(error)).ok()
    })
}

fn warn(error: &dyn core::fmt::Display) {
    tracing::warn!("the branch of the live view can't be computed: {error}");
}

fn lines_of_arm(branch: &Branch) -> BranchLines {
    let at = |row: &Row| vec![row.orbit.value, row.orbit.amplitude_rad[0], row.orbit.amplitude_rad[1]];
    let rows = branch.rows();
    let mut lines = BranchLines::default();
    for (a, b, is_stable) in segments(&rows, Row::stable) {
        let line = if is_stable { &mut lines.stable } else { &mut lines.unstable };
        if line.last() != Some(&Some(at(a))) {
            line.extend([None, Some(at(a))]);
        }
        line.push(Some(at(b)));
    }
    let folds = rows.iter().filter(|row| row.bifurcation == Some(BifurcationKind::Fold));
    lines.folds = folds.map(at).collect();
    lines
}

/// Walks the branch of motions of a structure that is driven along one degree of freedom.
fn of_structure(tested: TestedAssembly, amplitude: &Amplitude) -> Option<ComputeBranch> {
    let Some((drive, load)) = tested.driven(amplitude) else {
        tracing::warn!("the live view computes no branch: the load acts along more than one degree of freedom");
        return None;
    };
    let read: Vec<Dof> = tested.read().into_iter().map(|read| read.dof).collect();
    Some(Box::new(move |low_hz, high_hz| {
        let forced = Forced::new(tested.assembly.clone(), drive, load);
        let ends = [(1.0 - MARGIN) * low_hz, (1.0 + MARGIN) * high_hz];
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, read.clone());
        options.branch.continuation.largest_turn_rad = TURN_RAD;
        let branch = trace(&forced, ends[0], Coordinate::FrequencyHz, &options);
        branch.map(|branch| lines_of_structure(&branch)).inspect_err(|early| warn(&early.reason)).ok()
    }))
}

/// Fundamentals of the displacements that are read.
fn lines_of_structure(branch: &structure::Branch) -> BranchLines {
    let size = |reading: &Reading| libm::hypot(reading.harmonic1.re, reading.harmonic1.im);
    let at = |orbit: &Orbit| core::iter::once(orbit.value).chain(orbit.readings.iter().map(size)).collect::<Vec<f64>>();
    let mut lines = BranchLines::default();
    for (stretch, is_stable) in stretches(branch) {
        let line = if is_stable == Some(false) { &mut lines.unstable } else { &mut lines.stable };
        line.push(None);
        line.extend(stretch.iter().map(|orbit| Some(at(orbit))));
    }
    let folds = branch.bifurcations.iter().filter(|found| found.kind == BifurcationKind::Fold);
    lines.folds = folds.map(|found| at(&found.orbit)).collect();
    lines
}
