//! Compares the measurement of a zone with the computed response.

use serde::Serialize;

use super::zone::{Zone, ZoneMeasured};
use resonarm_analysis::time_domain::hysteresis;
use resonarm_analysis::{AnalysisError, BifurcationKind, Distances};
use resonarm_analysis::{
    Backbone, BackboneOptions, Branch, Coordinate, Forced, Reading, TraceOptions, backbone, nearest, trace,
};
use resonarm_bench::control::ResponsePoint;
use resonarm_bench::plant::{ReadDof, TestedAssembly};
use resonarm_dynamics::structure::Dof;

/// Largest turn between two computed responses: with this the branch is straight between them, to the accuracy of
/// measured points.
const STRAIGHT_RAD: f64 = 0.01;
/// The computed branch goes beyond the zone by this part of its width.
const MARGIN: f64 = 0.02;
/// Amplitudes measured up and down at one frequency belong to different responses if they differ by more than this
/// part.
const DIFFERENT: f64 = 0.05;
/// Part of the largest amplitude below which an amplitude is not compared: far from the resonance the noise of the
/// instruments alone makes two readings of one response differ by more than [`DIFFERENT`].
const RESOLVED: f64 = 0.01;

/// The computed response of a zone, and the deviations of the measured points from it.
#[derive(Clone, Debug, Serialize)]
pub struct Score {
    /// The response at the zone's load, read where the accelerometers measure it.
    #[serde(skip)]
    pub branch: Branch,
    /// The backbone up to that load, read at the same degrees of freedom.
    #[serde(skip)]
    pub backbone: Backbone,
    /// The degrees of freedom that the accelerometers measure.
    #[serde(skip)]
    pub read: Vec<ReadDof>,
    /// The degree of freedom whose fundamental is compared: the one that moves most among those that never clip in the
    /// walk, if there are any.
    pub at: String,
    /// The frequencies of the computed folds, Hz, ascending.
    pub folds_hz: Vec<f64>,
    /// Points of the walk at which the computed response is unstable.
    pub unstable_points: usize,
    /// Points of the walk that settled.
    pub settled_points: usize,
    /// The largest relative deviation in frequency of settled points of the walk from the nearest point of the branch.
    pub largest_frequency_deviation: f64,
    /// The largest relative deviation of the fundamental at `at`, likewise.
    pub largest_amplitude_deviation: f64,
    /// The largest deviation of the backbone's points in frequency, relative, at their amplitudes.
    pub largest_backbone_deviation: f64,
    /// The jumps of the sine up and the sine down, in this order; `None` if both met the same responses.
    #[serde(skip)]
    pub jumps: Option<[Jump; 2]>,
}

/// A jump of a stepped sine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// The last frequency before it and the first after it, Hz.
    pub between_hz: [f64; 2],
    /// The computed fold at which it is expected, Hz.
    pub fold_hz: Option<f64>,
}

impl Jump {
    /// Distance of the fold from the jump, in steps of the sine; 0 within the jump, `None` without a fold.
    pub fn steps_off(&self) -> Option<f64> {
        let [a, b] = self.between_hz;
        let fold_hz = self.fold_hz?;
        // The distance from an interval: one of the first two terms is positive on each side of it, and none within.
        let outside = (a.min(b) - fold_hz).max(fold_hz - a.max(b)).max(0.0);
        Some(outside / (b - a).abs())
    }
}

/// Returns the modulus of a reading's fundamental.
fn size(reading: &Reading) -> f64 {
    libm::hypot(reading.harmonic1.re, reading.harmonic1.im)
}

/// Returns the amplitude of the displacement that a channel measured, m.
fn amplitude_m(point: &ResponsePoint, channel: usize) -> f64 {
    let displacement = point.displacement_m(channel);
    libm::hypot(displacement.re, displacement.im)
}

/// Computes the response measured in a zone, for a structure as it is without a shaker.
///
/// # Errors
/// [`AnalysisError`] if branch or backbone can't be followed.
pub fn score(tested: &TestedAssembly, zone: &Zone, measured: &ZoneMeasured) -> Result<Score, AnalysisError> {
    let read = tested.read();
    let dofs: Vec<Dof> = read.iter().map(|place| place.dof).collect();
    let forced = forced(tested, zone);
    let branch = computed_branch(&forced, zone, dofs.clone())?;
    let at = compared_at(&branch, &read, &measured.walk.points);
    let channel = read.get(at).map_or(0, |place| place.channel);
    let folds = branch.bifurcations.iter().filter(|event| event.kind == BifurcationKind::Fold);
    let mut folds_hz: Vec<f64> = folds.map(|event| event.orbit.frequency_hz).collect();
    folds_hz.sort_by(f64::total_cmp);
    let backbone = computed_backbone(&forced, zone, dofs)?;
    let mut frequency = 0.0_f64;
    let mut amplitude = 0.0_f64;
    let mut unstable = 0;
    let settled: Vec<&ResponsePoint> = measured.walk.points.iter().filter(|point| point.settled).collect();
    for point in &settled {
        let read = [point.frequency_hz, amplitude_m(point, channel)];
        let Some(place) = nearest(&branch.orbits, at, read, Distances::default()) else { continue };
        frequency = frequency.max(place.frequency_deviation.abs());
        amplitude = amplitude.max(place.amplitude_deviation.abs());
        unstable += usize::from(place.is_stable == Some(false));
    }
    let measured_backbone = measured.backbone.points.iter().filter(|point| point.settled);
    let largest_backbone_deviation = measured_backbone
        .filter_map(|point| {
            let expected_hz = frequency_at(&backbone, at, amplitude_m(point, channel))?;
            Some(point.frequency_hz / expected_hz - 1.0)
        })
        .fold(0.0_f64, |largest, deviation| largest.max(deviation.abs()));
    Ok(Score {
        jumps: jumps(channel, [&measured.up.points, &measured.down.points], &folds_hz),
        at: read.get(at).map_or(String::new(), |place| place.name.clone()),
        branch,
        backbone,
        read,
        folds_hz,
        unstable_points: unstable,
        settled_points: settled.len(),
        largest_frequency_deviation: frequency,
        largest_amplitude_deviation: amplitude,
        largest_backbone_deviation,
    })
}

/// Returns the structure under the zone's load.
fn forced(tested: &TestedAssembly, zone: &Zone) -> Forced {
    let driven = tested.driven(&zone.amplitude);
    let size = driven.iter().map(|(_, load)| load * load).sum::<f64>().sqrt();
    // The load is a unit direction times its size, so the amplitude of `Forced` is the amplitude that was commanded.
    let shares: Vec<(Dof, f64)> = driven.iter().map(|(dof, load)| (*dof, load / size)).collect();
    Forced::at_several(tested.assembly.clone(), &shares, size)
}

/// Returns the number of the reading that is compared.
fn compared_at(branch: &Branch, read: &[ReadDof], walk: &[ResponsePoint]) -> usize {
    let rank = |at: usize| {
        let is_clipped = walk.iter().any(|point| point.settled && point.clipped[read[at].channel]);
        let largest = branch.orbits.iter().map(|orbit| size(&orbit.readings[at])).fold(0.0, f64::max);
        (!is_clipped, largest)
    };
    let best = (0..read.len()).max_by(|a, b| {
        let (clean_a, largest_a) = rank(*a);
        let (clean_b, largest_b) = rank(*b);
        clean_a.cmp(&clean_b).then(largest_a.total_cmp(&largest_b))
    });
    best.unwrap_or_default()
}

fn computed_branch(forced: &Forced, zone: &Zone, read: Vec<Dof>) -> Result<Branch, AnalysisError> {
    let [low_hz, high_hz] = zone.range_hz;
    let margin_hz = MARGIN * (high_hz - low_hz);
    let ends = [low_hz - margin_hz, high_hz + margin_hz];
    let mut options = TraceOptions::new(forced, Coordinate::FrequencyHz, ends, read);
    options.branch.continuation.largest_turn_rad = STRAIGHT_RAD;
    Ok(trace(forced, ends[0], Coordinate::FrequencyHz, &options)?)
}

fn computed_backbone(forced: &Forced, zone: &Zone, read: Vec<Dof>) -> Result<Backbone, AnalysisError> {
    let mode = zone.mode_number.index();
    let mut options = BackboneOptions::new(forced, mode, f64::INFINITY, forced.amplitude(), read);
    options.branch.continuation.largest_turn_rad = STRAIGHT_RAD;
    Ok(backbone(forced, &options)?)
}

/// Returns the backbone's frequency at an amplitude of the reading of this number, between the two points around it.
fn frequency_at(backbone: &Backbone, at: usize, amplitude: f64) -> Option<f64> {
    backbone.points.windows(2).find_map(|pair| {
        // Linear between neighbouring points, which are close enough for it (`STRAIGHT_RAD`). If both amplitudes are
        // equal the share is not finite, and the pair is passed over.
        let [a, b] = [&pair[0], &pair[1]].map(|orbit| size(&orbit.readings[at]));
        let share = (amplitude - a) / (b - a);
        (0.0..=1.0)
            .contains(&share)
            .then(|| pair[0].frequency_hz + share * (pair[1].frequency_hz - pair[0].frequency_hz))
    })
}

/// Returns where up and down differ in the displacement that a channel measures: the sine up stays on its branch up to
/// the upper fold, the sine down to the lower.
fn jumps(channel: usize, up_and_down: [&[ResponsePoint]; 2], folds_hz: &[f64]) -> Option<[Jump; 2]> {
    // A point that did not settle belongs to no response.
    let amplitudes = |points: &[ResponsePoint]| -> Vec<(f64, [f64; 1])> {
        let settled = points.iter().filter(|point| point.settled);
        settled.map(|point| (point.frequency_hz, [amplitude_m(point, channel)])).collect()
    };
    let [up, down] = up_and_down.map(amplitudes);
    // Some frequencies of one sine may be missing in the other. The comparison is exact, since both lists were made
    // from the same frequencies.
    let pairs = up.iter().filter_map(|a| Some((*a, *down.iter().find(|b| b.0 == a.0)?)));
    let largest_m = up.iter().chain(&down).map(|(_, [amplitude_m])| *amplitude_m).fold(0.0, f64::max);
    let (up, down): (Vec<_>, Vec<_>) = pairs.filter(|(a, b)| a.1[0].max(b.1[0]) > RESOLVED * largest_m).unzip();
    let apart = hysteresis(&up, &down, DIFFERENT);
    let first_hz = apart.first()?[0];
    let last_hz = apart.last()?[1];
    let before_hz = up.iter().map(|point| point.0).take_while(|hz| *hz < first_hz).last()?;
    let after_hz = up.iter().map(|point| point.0).find(|hz| *hz > last_hz)?;
    Some([
        // Going up, the response leaves its branch at the upper fold, behind the last frequency at which up and down
        // differ; going down at the lower fold, before the first.
        Jump { between_hz: [last_hz, after_hz], fold_hz: folds_hz.last().copied() },
        Jump { between_hz: [first_hz, before_hz], fold_hz: folds_hz.first().copied() },
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_numeric::Phasor;

    /// Channel of the accelerometer C along x.
    const C_X: usize = 4;

    /// A point with a displacement of C along x, m.
    fn point(frequency_hz: f64, displacement_m: f64) -> ResponsePoint {
        let omega_rad_s = core::f64::consts::TAU * frequency_hz;
        let mut harmonics = [[Phasor::new(0.0, 0.0); 3]; 6];
        harmonics[C_X][0] = Phasor::new(-omega_rad_s * omega_rad_s * displacement_m, 0.0);
        ResponsePoint::of_harmonics(frequency_hz, 10.0, &harmonics)
    }

    /// Up and down are apart from 21 to 22 Hz. Far from the resonance the noise alone makes the two readings of one
    /// response differ by 20 %, up to the last frequency.
    #[test]
    fn noise_far_from_the_resonance_hides_no_jump() {
        let up = [(19.0, 2e-5), (20.0, 2e-2), (21.0, 4e-2), (22.0, 6e-2), (23.0, 1e-2), (24.0, 1.2e-5)];
        let down = [(24.0, 1e-5), (23.0, 1e-2), (22.0, 2e-2), (21.0, 3e-2), (20.0, 2e-2), (19.0, 2.4e-5)];
        let points = |amplitudes: [(f64, f64); 6]| amplitudes.map(|(hz, m)| point(hz, m));
        let found = jumps(C_X, [&points(up), &points(down)], &[20.7, 22.4]);
        let expected = [
            Jump { between_hz: [22.0, 23.0], fold_hz: Some(22.4) },
            Jump { between_hz: [21.0, 20.0], fold_hz: Some(20.7) },
        ];
        assert_eq!(found, Some(expected));
    }
}
