//! The computed branch of the live view: the motions on which the responses that are read should lie.

use crate::figures::branches::stretches;
use resonarm::analysis::BifurcationKind;
use resonarm::analysis::structure::{Branch, Coordinate, Forced, Orbit, Reading, TraceOptions, trace};
use resonarm::scenario::{Scenario, ScenarioError};
use resonarm::structure::Dof;
use resonarm_live::{BranchLines, ComputeBranch};

/// Largest turn between two motions of the computed branch: coarser than in a figure, and faster to compute.
const TURN_RAD: f64 = 0.1;
/// The branch goes beyond the responses by this part of their frequencies.
const MARGIN: f64 = 0.02;

/// Computes the branch of the load at which the scenario's responses are read; `None` without a load, of a structure
/// that a program makes, and of an FMU.
pub(crate) fn compute(scenario: &Scenario) -> Result<Option<ComputeBranch>, ScenarioError> {
    let Some(amplitude) = scenario.amplitude().filter(|_| scenario.foreign_structure().is_none()) else {
        return Ok(None);
    };
    let tested = scenario.under_test()?;
    let drives = tested.drives(amplitude);
    let load = drives.iter().map(|(_, load)| load * load).sum::<f64>().sqrt();
    let shares: Vec<(Dof, f64)> = drives.into_iter().map(|(dof, one)| (dof, one / load)).collect();
    let read: Vec<Dof> = tested.read().into_iter().map(|read| read.dof).collect();
    Ok(Some(Box::new(move |low_hz, high_hz| {
        let forced = Forced::at_several(tested.assembly.clone(), &shares, load);
        let ends = [(1.0 - MARGIN) * low_hz, (1.0 + MARGIN) * high_hz];
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, read.clone());
        options.branch.continuation.largest_turn_rad = TURN_RAD;
        let branch = trace(&forced, ends[0], Coordinate::FrequencyHz, &options);
        let warn = |early: &_| tracing::warn!("the branch of the live view can't be computed: {early}");
        branch.inspect_err(warn).ok().map(|branch| lines(&branch))
    })))
}

/// Fundamentals of the displacements that are read.
fn lines(branch: &Branch) -> BranchLines {
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
