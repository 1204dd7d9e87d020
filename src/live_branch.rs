//! The computed branch of the live view, on which the responses that are read should lie.

use crate::drive::Drive;
use crate::figures::branches::stretches;
use crate::read_at::size;
use resonarm::analysis::{BifurcationKind, Branch, Coordinate, Orbit, Reading, TraceOptions, trace};
use resonarm::scenario::{Scenario, ScenarioError};
use resonarm::structure::Dof;
use resonarm_live::{BranchLines, ComputeBranch};

/// Largest turn between two responses of the computed branch: coarser than in a figure, and faster to compute.
const TURN_RAD: f64 = 0.1;
/// The part of the responses' frequencies by which the branch extends beyond them.
const MARGIN: f64 = 0.02;

/// Computes the branch of the load at which the scenario's responses are read; `None` without a load, and of a structure
/// whose equations are unknown: one that a program makes, and an FMU.
pub(crate) fn compute(scenario: &Scenario) -> Result<Option<ComputeBranch>, ScenarioError> {
    let Some(amplitude) = scenario.amplitude().filter(|_| scenario.foreign_structure().is_none()) else {
        return Ok(None);
    };
    let tested = scenario.under_test()?;
    let Some(drive) = Drive::of_exciter(amplitude, &tested) else { return Ok(None) };
    let read: Vec<Dof> = tested.read().iter().map(|read| read.dof).collect();
    Ok(Some(Box::new(move |low_hz, high_hz| {
        let forced = drive.forced(&tested.assembly);
        let ends = [(1.0 - MARGIN) * low_hz, (1.0 + MARGIN) * high_hz];
        let mut options = TraceOptions::new(&forced, Coordinate::FrequencyHz, ends, read.clone());
        options.branch.continuation.largest_turn_rad = TURN_RAD;
        let branch = trace(&forced, ends[0], Coordinate::FrequencyHz, &options);
        let warn = |early: &_| tracing::warn!("the branch of the live view can't be computed: {early}");
        branch.inspect_err(warn).ok().map(|branch| lines(&branch))
    })))
}

/// Returns the fundamentals of the displacements that are read.
fn lines(branch: &Branch) -> BranchLines {
    let size = |reading: &Reading| size(reading.harmonic1);
    let at = |orbit: &Orbit| core::iter::once(orbit.value).chain(orbit.readings.iter().map(size)).collect::<Vec<f64>>();
    let mut lines = BranchLines::default();
    for (stretch, is_stable) in stretches(branch) {
        let line = if is_stable == Some(false) { &mut lines.unstable } else { &mut lines.stable };
        // Breaks the drawn line between stretches of equal stability.
        line.push(None);
        line.extend(stretch.iter().map(|orbit| Some(at(orbit))));
    }
    let folds = branch.bifurcations.iter().filter(|found| found.kind == BifurcationKind::Fold);
    lines.folds = folds.map(|found| at(&found.orbit)).collect();
    lines
}
