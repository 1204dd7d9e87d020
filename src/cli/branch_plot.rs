//! Branches as figures: stable blue, unstable red and dashed.

use crate::analysis::{self, BifurcationKind, Branch, Row};
use crate::plot::{Axis, Color, Figure, Legend, Marker, Panel, Series};

use super::captions;

/// Two panels, |α1| and |α2| over what varies.
pub(super) fn figure(conditions: String, axis_label: &str, branches: &[&Branch]) -> Figure {
    let mut figure = Figure::new("Periodic motions of the forced arm").subtitle(conditions);
    for joint in 0..2 {
        let panel = Panel::new(Axis::linear(axis_label), Axis::linear(captions::largest(joint)));
        let panel = if joint == 1 { panel.legend(Legend::None) } else { panel };
        figure = figure.with(with_branches(panel, branches, joint));
    }
    figure
}

/// The panel with the branches of one joint's amplitude and their bifurcations.
pub(super) fn with_branches(mut panel: Panel, branches: &[&Branch], joint: usize) -> Panel {
    for (k, branch) in branches.iter().enumerate() {
        for series in
            [Series::stable(stretches(branch, joint, true)), Series::unstable(stretches(branch, joint, false))]
        {
            panel = panel.with(if k == 0 { series } else { series.unlabelled() });
        }
    }
    for (kind, label, shape) in [
        (BifurcationKind::Fold, "fold", Marker::Circle),
        (BifurcationKind::PeriodDoubling, "period doubling", Marker::Square),
        (BifurcationKind::NeimarkSacker, "Neimark–Sacker", Marker::Triangle),
        (BifurcationKind::BranchPoint, "branch point", Marker::Diamond),
    ] {
        let events = branches.iter().flat_map(|branch| &branch.bifurcations).filter(|event| event.kind == kind);
        let points: Vec<_> = events.map(|event| (event.orbit.value, event.orbit.amplitude_rad[joint])).collect();
        if !points.is_empty() {
            panel = panel.with(Series::markers(label, Color::Black, shape, points));
        }
    }
    panel
}

/// The stretches of one stability of a joint's amplitude.
fn stretches(branch: &Branch, joint: usize, stable: bool) -> Vec<(f64, f64)> {
    let at = |row: &Row| (row.orbit.value, row.orbit.amplitude_rad[joint]);
    analysis::stretches(&branch.rows(), Row::stable, stable, at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{BranchOptions, Coordinate, ForcedArm, trace};
    use crate::arm::{Arm, Load, Pose, Preset};

    /// Strong excitation at the 1:2 resonance: the colours change at the period doublings, although no motion of the walk is there.
    #[test]
    fn colours_change_at_the_bifurcations() {
        let pose = Pose { beta1_deg: 0.0, beta2_deg: 75.0 };
        let arm = Arm::new(Preset::Irb1600Fitted.parameters().unwrap(), pose).unwrap();
        let forced = ForcedArm::new(arm, Load::torque_nm(1.0, 0.0), 800.0);
        let branch = trace(forced, 46.0, Coordinate::FrequencyHz, &BranchOptions::new(46.0, 50.0)).unwrap();
        let doublings: Vec<f64> = branch.bifurcations.iter().map(|event| event.orbit.value).collect();
        assert!((doublings[0] - 46.1742).abs() < 1e-3 && (doublings[1] - 46.3572).abs() < 1e-3, "{doublings:?}");
        let unstable = stretches(&branch, 1, false);
        let hz: Vec<f64> = unstable.iter().map(|point| point.0).filter(|hz| hz.is_finite()).collect();
        assert_eq!((hz.first(), hz.last()), (doublings.first(), doublings.last()));
    }
}
