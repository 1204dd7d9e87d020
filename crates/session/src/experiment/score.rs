//! What was measured in a zone, against what is computed.

use serde::Serialize;

use super::{Zone, ZoneMeasured};
use resonarm_analysis::time_domain::hysteresis;
use resonarm_analysis::{
    AnalysisError, ArmParameter, Backbone, BackboneOptions, BifurcationKind, Branch, BranchOptions, Coordinate,
    Distances, ForcedArm, MeasuredMotion, backbone, nearest, trace,
};
use resonarm_bench::control::{JointAngles, ResponsePoint};
use resonarm_dynamics::arm::Arm;

/// Largest turn between two motions of what is computed: with this it is straight between them, as far as measured
/// points go.
const STRAIGHT_RAD: f64 = 0.01;
/// The computed branch goes beyond the zone by this part of its width.
const MARGIN: f64 = 0.02;
/// Amplitudes measured up and down at one frequency belong to different motions if they differ by more than this part.
const DIFFERENT: f64 = 0.05;

/// What is computed of a zone, and how far off the measured points are.
#[derive(Clone, Debug, Serialize)]
pub struct Score {
    /// The response at the zone's force.
    #[serde(skip)]
    pub branch: Branch,
    /// The backbone up to it.
    #[serde(skip)]
    pub backbone: Backbone,
    /// The frequencies of the computed folds, Hz, ascending.
    pub folds_hz: Vec<f64>,
    /// Points of the walk that lie where the computed motion is unstable.
    pub unstable_points: usize,
    /// Points of the walk that settled.
    pub settled_points: usize,
    /// The largest deviation of settled points of the walk from the place of the branch that is nearest: of the
    /// frequency, relative.
    pub largest_frequency_deviation: f64,
    /// The same of the fundamental of the joint that moves most.
    pub largest_amplitude_deviation: f64,
    /// The largest deviation of the backbone's points in frequency, relative, at their amplitudes.
    pub largest_backbone_deviation: f64,
    /// Where the sine up and the sine down jumped, in this order; none if both met the same motions.
    #[serde(skip)]
    pub jumps: Option<[Jump; 2]>,
}

/// A jump of a stepped sine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// The last frequency before it and the first after it, Hz.
    pub between_hz: [f64; 2],
    /// The computed fold at which it is due, Hz.
    pub fold_hz: Option<f64>,
}

impl Jump {
    /// By how many of its own steps the fold lies outside; 0 within, `None` without a fold.
    pub fn steps_off(&self) -> Option<f64> {
        let [a, b] = self.between_hz;
        let fold_hz = self.fold_hz?;
        let outside = (a.min(b) - fold_hz).max(fold_hz - a.max(b)).max(0.0);
        Some(outside / (b - a).abs())
    }
}

/// Computes what was measured in a zone, for `arm` as it is without a shaker.
///
/// # Errors
/// [`AnalysisError`] if branch or backbone can't be followed.
pub fn score(arm: &Arm, zone: &Zone, measured: &ZoneMeasured) -> Result<Score, AnalysisError> {
    let joint = zone.mode_number.index();
    let branch = computed_branch(arm, zone)?;
    let folds = branch.bifurcations.iter().filter(|event| event.kind == BifurcationKind::Fold);
    let mut folds_hz: Vec<f64> = folds.map(|event| event.orbit.frequency_hz).collect();
    folds_hz.sort_by(f64::total_cmp);
    let backbone = computed_backbone(arm, zone)?;
    let (mut frequency, mut amplitude, mut unstable) = (0.0_f64, 0.0_f64, 0);
    let settled: Vec<_> = measured.walk.points.iter().filter(|point| point.settled).map(|p| motion(p, arm)).collect();
    for point in &settled {
        let Some(place) = nearest(&branch, point, joint, Distances::default()) else { continue };
        frequency = frequency.max(place.frequency_deviation.abs());
        amplitude = amplitude.max(place.amplitude_deviation[joint].abs());
        unstable += usize::from(!place.is_stable);
    }
    let measured_backbone = measured.backbone.points.iter().filter(|point| point.settled).map(|p| motion(p, arm));
    let largest_backbone_deviation = measured_backbone
        .filter_map(|point| Some(point.frequency_hz / frequency_at(&backbone, joint, &point)? - 1.0))
        .fold(0.0_f64, |largest, deviation| largest.max(deviation.abs()));
    Ok(Score {
        jumps: jumps(arm, measured, &folds_hz),
        branch,
        backbone,
        folds_hz,
        unstable_points: unstable,
        settled_points: settled.len(),
        largest_frequency_deviation: frequency,
        largest_amplitude_deviation: amplitude,
        largest_backbone_deviation,
    })
}

fn motion(point: &ResponsePoint, arm: &Arm) -> MeasuredMotion {
    let harmonic1_rad = JointAngles::of(point, arm).harmonic1_rad();
    MeasuredMotion { frequency_hz: point.frequency_hz, harmonic1_rad }
}

fn computed_branch(arm: &Arm, zone: &Zone) -> Result<Branch, AnalysisError> {
    let [low_hz, high_hz] = zone.range_hz;
    let margin_hz = MARGIN * (high_hz - low_hz);
    let mut options = BranchOptions::new(low_hz - margin_hz, high_hz + margin_hz);
    options.continuation.largest_turn_rad = STRAIGHT_RAD;
    let forced = ForcedArm::new(arm.clone(), zone.amplitude.load(), 1.0);
    Ok(trace(forced, low_hz - margin_hz, Coordinate::FrequencyHz, &options)?)
}

fn computed_backbone(arm: &Arm, zone: &Zone) -> Result<Backbone, AnalysisError> {
    let [low_hz, high_hz] = zone.range_hz;
    let mut branch = BranchOptions::new(low_hz, high_hz);
    branch.continuation.largest_turn_rad = STRAIGHT_RAD;
    let options = BackboneOptions { smallest_rad: 1e-4, largest_rad: 1.0, largest_drive: 1.0, branch };
    let forced = ForcedArm::new(arm.clone(), zone.amplitude.load(), 0.0);
    let mode = usize::from(u8::from(zone.mode_number) - 1);
    Ok(backbone(forced, mode, ArmParameter::Amplitude, &options)?)
}

/// The backbone's frequency at the amplitude of a measured motion, between the two points around it.
fn frequency_at(backbone: &Backbone, joint: usize, point: &MeasuredMotion) -> Option<f64> {
    let amplitude = point.harmonic1_rad[joint];
    backbone.points.windows(2).find_map(|pair| {
        let [a, b] = [pair[0].harmonic1_rad[joint], pair[1].harmonic1_rad[joint]];
        let share = (amplitude - a) / (b - a);
        (0.0..=1.0)
            .contains(&share)
            .then(|| pair[0].frequency_hz + share * (pair[1].frequency_hz - pair[0].frequency_hz))
    })
}

/// Where up and down part: up stays on its motion up to the upper fold, down to the lower.
fn jumps(arm: &Arm, measured: &ZoneMeasured, folds_hz: &[f64]) -> Option<[Jump; 2]> {
    // One that did not settle is of no motion.
    let amplitudes = |points: &[ResponsePoint]| -> Vec<(f64, [f64; 2])> {
        let settled = points.iter().filter(|point| point.settled);
        settled.map(|point| (point.frequency_hz, JointAngles::of(point, arm).amplitude_rad)).collect()
    };
    let (up, down) = (amplitudes(&measured.up.points), amplitudes(&measured.down.points));
    // Of the frequencies of the one some may be missing in the other.
    let pairs: Vec<_> = up.iter().filter_map(|a| Some((*a, *down.iter().find(|b| b.0 == a.0)?))).collect();
    let (up, down): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
    let apart = hysteresis(&up, &down, DIFFERENT);
    let (first_hz, last_hz) = (apart.first()?[0], apart.last()?[1]);
    let before_hz = up.iter().map(|point| point.0).take_while(|hz| *hz < first_hz).last()?;
    let after_hz = up.iter().map(|point| point.0).find(|hz| *hz > last_hz)?;
    Some([
        Jump { between_hz: [last_hz, after_hz], fold_hz: folds_hz.last().copied() },
        Jump { between_hz: [first_hz, before_hz], fold_hz: folds_hz.first().copied() },
    ])
}
