//! Branches of forced motions, and the values read from them.

use serde::{Serialize, Serializer};

use super::{PaperError, Subject};
use resonarm_analysis::{
    AnalysisError, ArmParameter, BifurcationKind, Branch, BranchOptions, Coordinate, ForcedArm, Orbit, Row, modes,
    segments, trace,
};
use resonarm_dynamics::arm::{Arm, Load, Preset};

/// Half the width of the range in which a mode's resonance zone is searched, relative to its natural frequency. The two
/// ranges do not overlap, since f2 > 1.4 f1 at all poses of both presets.
const ZONE: f64 = 0.15;

/// The frequencies of a resonance zone, Hz.
pub(super) fn zone_hz(natural_hz: f64) -> [f64; 2] {
    [natural_hz * (1.0 - ZONE), natural_hz * (1.0 + ZONE)]
}

/// The excitation of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Drive {
    /// A torque at joint 1, N·m: Eq. (31).
    Torque1,
    /// A force along x at the tip, N: Eq. (32).
    ForceX,
}

impl Drive {
    /// The load of one unit.
    pub(super) fn direction(self) -> Load {
        match self {
            Drive::Torque1 => Load::torque_nm(1.0, 0.0),
            Drive::ForceX => Load::force_n(1.0, 0.0),
        }
    }

    /// An amplitude in words.
    pub fn words(self, amplitude: f64) -> String {
        match self {
            Drive::Torque1 => format!("{amplitude} N·m at joint 1"),
            Drive::ForceX => format!("{amplitude} N along x at the tip"),
        }
    }
}

/// Whether small disturbances die out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stability {
    /// They do.
    Stable,
    /// They grow.
    Unstable,
    /// The motion is a bifurcation, where the stability changes or the branch turns.
    Marginal,
}

/// A bifurcation on a branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event(pub BifurcationKind);

impl Serialize for Event {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.0.name())
    }
}

/// A periodic motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Motion {
    /// Frequency of the excitation, Hz.
    pub frequency_hz: f64,
    /// Amplitude of the excitation, N·m or N.
    pub excitation: f64,
    /// The largest |α1| and |α2| over the period, rad.
    pub amplitude_rad: [f64; 2],
    /// Amplitudes of the first harmonics of α1 and α2, rad.
    pub harmonic1_rad: [f64; 2],
    /// Its stability.
    pub stability: Stability,
    /// The kind of bifurcation, if it is one.
    pub bifurcation: Option<Event>,
}

impl Motion {
    fn new(row: &Row, excitation: f64) -> Motion {
        let (orbit, bifurcation) = (row.orbit, row.bifurcation.map(Event));
        let stability = match row.stable() {
            None => Stability::Marginal,
            Some(true) => Stability::Stable,
            Some(false) => Stability::Unstable,
        };
        let (frequency_hz, amplitude_rad, harmonic1_rad) =
            (orbit.frequency_hz, orbit.amplitude_rad, orbit.harmonic1_rad);
        Motion { frequency_hz, excitation, amplitude_rad, harmonic1_rad, stability, bifurcation }
    }

    /// Whether small disturbances die out; `None` at a bifurcation.
    pub fn stable(&self) -> Option<bool> {
        match self.stability {
            Stability::Stable => Some(true),
            Stability::Unstable => Some(false),
            Stability::Marginal => None,
        }
    }
}

/// A branch of forced motions of an arm in a pose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ForcedBranch {
    /// The preset.
    #[serde(serialize_with = "by_name")]
    pub preset: Preset,
    /// β1, degrees.
    pub beta1_deg: f64,
    /// β2, degrees.
    pub beta2_deg: f64,
    /// The excitation of the arm.
    pub drive: Drive,
    /// The natural frequencies of the linearised arm, Hz.
    pub natural_hz: [f64; 2],
    /// The motions in their order, bifurcations among them.
    pub motions: Vec<Motion>,
}

pub(super) fn by_name<S: Serializer>(preset: &Preset, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(preset.name())
}

/// The largest step, relative to the size of the motion: a resonance is a circle in the continuation's coordinates, and
/// gets 60 points.
const SMOOTH_STEP: f64 = 0.1;

fn options(from: f64, to: f64) -> BranchOptions {
    let mut options = BranchOptions::new(from, to);
    options.continuation.largest_step = SMOOTH_STEP;
    options
}

impl ForcedBranch {
    /// The motions over the frequency, from one value to another, under an excitation of this amplitude.
    ///
    /// # Errors
    /// [`PaperError::Analysis`] says which branch could not be followed, where and why.
    pub fn over_frequency(
        subject: &Subject,
        arm: &Arm,
        (drive, amplitude): (Drive, f64),
        [from_hz, to_hz]: [f64; 2],
    ) -> Result<ForcedBranch, PaperError> {
        let forced = ForcedArm::new(arm.clone(), drive.direction(), amplitude);
        let branch =
            trace(forced, from_hz, Coordinate::FrequencyHz, &options(from_hz, to_hz)).map_err(AnalysisError::from);
        ForcedBranch::of(subject, arm, drive, branch.map(|branch| joined(&branch, |_| amplitude)), amplitude)
    }

    /// The motions over the amplitude of the excitation, from none to `largest`, at one frequency.
    ///
    /// # Errors
    /// As [`ForcedBranch::over_frequency`].
    pub fn over_amplitude(
        subject: &Subject,
        arm: &Arm,
        (drive, largest): (Drive, f64),
        frequency_hz: f64,
    ) -> Result<ForcedBranch, PaperError> {
        let forced = ForcedArm::new(arm.clone(), drive.direction(), 0.0);
        let amplitude = Coordinate::Parameter(ArmParameter::Amplitude);
        let branch = trace(forced, frequency_hz, amplitude, &options(0.0, largest)).map_err(AnalysisError::from);
        ForcedBranch::of(subject, arm, drive, branch.map(|branch| joined(&branch, |orbit| orbit.value)), largest)
    }

    fn of(
        subject: &Subject,
        arm: &Arm,
        drive: Drive,
        motions: Result<Vec<Motion>, AnalysisError>,
        amplitude: f64,
    ) -> Result<ForcedBranch, PaperError> {
        let (preset, pose) = (subject.preset(), arm.pose());
        let beta2_deg = pose.beta2_deg;
        let failed = |source| PaperError::Analysis { preset, beta2_deg, drive: drive.words(amplitude), source };
        let motions = motions.map_err(failed)?;
        let natural_hz = modes(arm).map(|mode| mode.frequency_hz);
        Ok(ForcedBranch { preset, beta1_deg: pose.beta1_deg, beta2_deg, drive, natural_hz, motions })
    }

    /// The motions between two frequencies, Hz.
    pub fn within(&self, [from_hz, to_hz]: [f64; 2]) -> impl Iterator<Item = &Motion> {
        self.motions.iter().filter(move |motion| (from_hz..=to_hz).contains(&motion.frequency_hz))
    }

    /// Neighbouring motions in pairs, and whether those between them are stable. Between two bifurcations they are
    /// assumed to be unstable.
    pub fn segments(&self) -> impl Iterator<Item = (&Motion, &Motion, bool)> {
        segments(&self.motions, Motion::stable)
    }

    /// The ranges in which the resonance zones of both modes are searched, Hz.
    pub fn zones_hz(&self) -> [[f64; 2]; 2] {
        self.natural_hz.map(zone_hz)
    }

    /// The bifurcations of a kind.
    pub fn bifurcations(&self, kind: BifurcationKind) -> impl Iterator<Item = &Motion> {
        self.motions.iter().filter(move |motion| motion.bifurcation == Some(Event(kind)))
    }
}

/// The motions of a branch, with its bifurcations inserted in order.
fn joined(branch: &Branch, excitation: impl Fn(&Orbit) -> f64) -> Vec<Motion> {
    branch.rows().iter().map(|row| Motion::new(row, excitation(row.orbit))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::Settings;

    /// Within the folds the branch has two stable motions and one unstable between them, and the changes are at the
    /// folds.
    #[test]
    fn stability_changes_at_the_bifurcations() {
        let subject = Subject::new(Preset::Irb1600Fitted, &Settings::embedded().unwrap()).unwrap();
        let arm = subject.bent(60.0).unwrap();
        let branch = ForcedBranch::over_frequency(&subject, &arm, (Drive::Torque1, 60.0), [21.0, 23.5]).unwrap();
        let folds: Vec<f64> = branch.bifurcations(BifurcationKind::Fold).map(|fold| fold.frequency_hz).collect();
        assert!((folds[0] - 22.1349).abs() < 1e-4 && (folds[1] - 22.0635).abs() < 1e-4, "{folds:?}");
        let stable: Vec<bool> = branch.segments().map(|(.., is_stable)| is_stable).collect();
        assert_eq!(stable.chunk_by(|a, b| a == b).count(), 3);
        assert!(branch.motions.iter().all(|motion| motion.excitation == 60.0));
    }
}
