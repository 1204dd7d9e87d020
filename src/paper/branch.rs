//! Branches of forced motions, and what is read off them.

use serde::{Serialize, Serializer};

use super::{PaperError, Subject};
use crate::analysis::{
    ArmParameter, Bifurcation, BifurcationKind, Branch, BranchOptions, Coordinate, ForcedArm, Orbit, modes, trace,
};
use crate::arm::{Arm, Load, Preset};

/// What drives the arm.
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
    /// The motion is a bifurcation, where this changes or the branch turns.
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
    /// What bifurcation it is, if it is one.
    pub bifurcation: Option<Event>,
}

impl Motion {
    fn new(orbit: &Orbit, excitation: f64, bifurcation: Option<Event>) -> Motion {
        let stability = match bifurcation {
            Some(_) => Stability::Marginal,
            None if orbit.is_stable() => Stability::Stable,
            None => Stability::Unstable,
        };
        let (frequency_hz, amplitude_rad, harmonic1_rad) =
            (orbit.frequency_hz, orbit.amplitude_rad, orbit.harmonic1_rad);
        Motion { frequency_hz, excitation, amplitude_rad, harmonic1_rad, stability, bifurcation }
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
    /// What drives the arm.
    pub drive: Drive,
    /// The natural frequencies of the linearised arm, Hz.
    pub natural_hz: [f64; 2],
    /// The motions in their order, bifurcations among them.
    pub motions: Vec<Motion>,
}

pub(super) fn by_name<S: Serializer>(preset: &Preset, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(preset.name())
}

/// The largest step, relative to the size of the motion: a resonance is a circle to the walk, and this makes 60 points of one.
const SMOOTH_STEP: f64 = 0.1;

fn options(from: f64, to: f64) -> BranchOptions {
    let mut options = BranchOptions::new(from, to);
    options.walk.largest_step = SMOOTH_STEP;
    options
}

impl ForcedBranch {
    /// The motions over the frequency, from one to the other, under an excitation of this amplitude.
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
        let branch = trace(forced, from_hz, Coordinate::FrequencyHz, &options(from_hz, to_hz));
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
        let branch = trace(forced, frequency_hz, amplitude, &options(0.0, largest));
        ForcedBranch::of(subject, arm, drive, branch.map(|branch| joined(&branch, |orbit| orbit.value)), largest)
    }

    fn of(
        subject: &Subject,
        arm: &Arm,
        drive: Drive,
        motions: Result<Vec<Motion>, crate::analysis::AnalysisError>,
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

    /// Neighbouring motions in pairs, and whether those between them are stable. Between two bifurcations they are taken to be
    /// unstable.
    pub fn segments(&self) -> impl Iterator<Item = (&Motion, &Motion, bool)> {
        self.motions.windows(2).map(|pair| (&pair[0], &pair[1], is_stable(&pair[0], &pair[1])))
    }

    /// Where the resonance zones of both modes are looked for, Hz.
    pub fn zones_hz(&self) -> [[f64; 2]; 2] {
        self.natural_hz.map(super::figure::zone_hz)
    }

    /// The bifurcations of a kind.
    pub fn bifurcations(&self, kind: BifurcationKind) -> impl Iterator<Item = &Motion> {
        self.motions.iter().filter(move |motion| motion.bifurcation == Some(Event(kind)))
    }

    /// The motion with the largest amplitude of a link (0 or 1).
    ///
    /// # Errors
    /// [`PaperError::NoMotion`] if the branch has none in the range.
    pub fn peak(&self, link: usize, range_hz: [f64; 2]) -> Result<&Motion, PaperError> {
        let larger = |a: &&Motion, b: &&Motion| a.amplitude_rad[link].total_cmp(&b.amplitude_rad[link]);
        self.within(range_hz).max_by(larger).ok_or(PaperError::NoMotion {
            preset: self.preset,
            beta2_deg: self.beta2_deg,
            from_hz: range_hz[0],
            to_hz: range_hz[1],
        })
    }

    /// The width of a resonance, Hz: of the frequencies at which a link moves more than 1/√2 of its peak, stable or not.
    ///
    /// # Errors
    /// As [`ForcedBranch::peak`].
    pub fn half_power_width_hz(&self, link: usize, range_hz: [f64; 2]) -> Result<f64, PaperError> {
        let level = self.peak(link, range_hz)?.amplitude_rad[link] * core::f64::consts::FRAC_1_SQRT_2;
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for pair in self.motions.windows(2) {
            let [a, b] = [0, 1].map(|i| (pair[i].frequency_hz, pair[i].amplitude_rad[link] - level));
            // Where the segment crosses the level, and its ends above it.
            let crossing = a.0 + (b.0 - a.0) * a.1 / (a.1 - b.1);
            let above =
                [(a.1 >= 0.0).then_some(a.0), (b.1 >= 0.0).then_some(b.0), (a.1 * b.1 < 0.0).then_some(crossing)];
            for hz in above.into_iter().flatten().filter(|hz| (range_hz[0]..=range_hz[1]).contains(hz)) {
                (low, high) = (low.min(hz), high.max(hz));
            }
        }
        Ok(high - low)
    }

    /// The maxima of a link's amplitude along the branch that stand out on both sides by more than `share` of themselves.
    pub fn maxima(&self, link: usize, share: f64) -> Vec<&Motion> {
        let mut maxima = Vec::new();
        let Some(first) = self.motions.first() else { return maxima };
        let (mut highest, mut lowest, mut rising) = (first, first, true);
        for motion in &self.motions {
            let amplitude = motion.amplitude_rad[link];
            if rising {
                if amplitude > highest.amplitude_rad[link] {
                    highest = motion;
                } else if amplitude < (1.0 - share) * highest.amplitude_rad[link] {
                    maxima.push(highest);
                    (lowest, rising) = (motion, false);
                }
            } else if amplitude < lowest.amplitude_rad[link] {
                lowest = motion;
            } else if (1.0 - share) * amplitude > lowest.amplitude_rad[link] {
                (highest, rising) = (motion, true);
            }
        }
        maxima
    }

    /// The largest ratio between amplitudes of a link in stable motions of one frequency, and that frequency in Hz; 1 where
    /// there is one motion only.
    pub fn largest_ratio(&self, link: usize) -> (f64, f64) {
        let stable: Vec<[(f64, f64); 2]> = self
            .segments()
            .filter(|(.., is_stable)| *is_stable)
            .map(|(a, b, _)| [a, b].map(|motion| (motion.frequency_hz, motion.amplitude_rad[link])))
            .collect();
        let mut largest = (1.0, f64::NAN);
        for motion in &self.motions {
            let hz = motion.frequency_hz;
            let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
            for [a, b] in stable.iter().filter(|[a, b]| a.0.min(b.0) <= hz && hz <= a.0.max(b.0) && a.0 != b.0) {
                let amplitude = a.1 + (b.1 - a.1) * (hz - a.0) / (b.0 - a.0);
                (least, most) = (least.min(amplitude), most.max(amplitude));
            }
            if most / least > largest.0 {
                largest = (most / least, hz);
            }
        }
        largest
    }
}

fn is_stable(a: &Motion, b: &Motion) -> bool {
    let either = |stability| a.stability == stability || b.stability == stability;
    either(Stability::Stable) && !either(Stability::Unstable)
}

/// The motions of a branch with its bifurcations in their places.
fn joined(branch: &Branch, excitation: impl Fn(&Orbit) -> f64) -> Vec<Motion> {
    let mut events = branch.bifurcations.iter().peekable();
    let mut motions = Vec::with_capacity(branch.orbits.len() + branch.bifurcations.len());
    let event = |bifurcation: &Bifurcation| {
        Motion::new(&bifurcation.orbit, excitation(&bifurcation.orbit), Some(Event(bifurcation.kind)))
    };
    for (index, orbit) in branch.orbits.iter().enumerate() {
        while let Some(bifurcation) = events.next_if(|bifurcation| bifurcation.index <= index) {
            motions.push(event(bifurcation));
        }
        motions.push(Motion::new(orbit, excitation(orbit), None));
    }
    motions.extend(events.map(event));
    motions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::Settings;

    fn motion(frequency_hz: f64, amplitude: f64, stability: Stability) -> Motion {
        let amplitude_rad = [amplitude; 2];
        Motion {
            frequency_hz,
            excitation: 1.0,
            amplitude_rad,
            harmonic1_rad: amplitude_rad,
            stability,
            bifurcation: None,
        }
    }

    fn branch(motions: Vec<Motion>) -> ForcedBranch {
        let (preset, drive) = (Preset::Irb1600Fitted, Drive::Torque1);
        ForcedBranch { preset, beta1_deg: 0.0, beta2_deg: 0.0, drive, natural_hz: [1.0, 2.0], motions }
    }

    #[test]
    fn measures_are_those_of_a_curve_drawn_by_hand() {
        use Stability::*;
        // Up to a fold at (4, 3), back below to another at (2, 1), on to (6, 0.5).
        let points =
            [(0.0, 0.0, Stable), (4.0, 3.0, Marginal), (3.0, 2.0, Unstable), (2.0, 1.0, Marginal), (6.0, 0.5, Stable)];
        let s = branch(points.map(|(hz, amplitude, stability)| motion(hz, amplitude, stability)).to_vec());
        // At the upper fold: 3 above, 1 − 0.5 · 2/4 below.
        assert_eq!(s.largest_ratio(0), (4.0, 4.0));
        assert_eq!(s.peak(0, [0.0, 6.0]).unwrap().frequency_hz, 4.0);
        assert_eq!(s.peak(0, [0.0, 3.5]).unwrap().frequency_hz, 3.0);
        let level = 3.0 / core::f64::consts::SQRT_2;
        assert!((s.half_power_width_hz(0, [0.0, 6.0]).unwrap() - (4.0 - level * 4.0 / 3.0)).abs() < 1e-12);
        assert_eq!(s.maxima(0, 0.01).len(), 1);
        let waves = [0.0, 2.0, 1.99, 2.5, 1.0, 1.5, 0.0].map(|amplitude| motion(1.0, amplitude, Stable));
        let tops =
            |share| branch(waves.to_vec()).maxima(1, share).iter().map(|top| top.amplitude_rad[1]).collect::<Vec<_>>();
        assert_eq!(tops(0.01), [2.5, 1.5]);
        assert_eq!(tops(0.001), [2.0, 2.5, 1.5]);
        assert!(s.peak(0, [7.0, 8.0]).is_err());
    }

    /// Within the folds the branch has two stable motions and one unstable between them, and the changes are at the folds.
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
