//! Branches of periodic responses to a forcing, and the values read from them.

use serde::{Serialize, Serializer};

use super::error::PaperError;
use super::subject::Subject;
use resonarm_analysis::{AnalysisError, BifurcationKind, segments};
use resonarm_analysis::{Coordinate, Forced, Orbit, Reading, TraceOptions, trace};
use resonarm_dynamics::structure::{Assembly, BodySpec, Dof, Preset, StructureError};

/// Half the width of the range in which a mode's resonance zone is searched, relative to its natural frequency. The two
/// ranges do not overlap, since f2 > 1.4 f1 at all poses of both presets.
const ZONE: f64 = 0.15;

/// Returns the frequencies of a resonance zone, Hz.
pub(super) fn zone_hz(natural_hz: f64) -> [f64; 2] {
    [natural_hz * (1.0 - ZONE), natural_hz * (1.0 + ZONE)]
}

/// Returns the natural frequencies of the first two modes, Hz.
pub(super) fn natural_hz(arm: &Assembly) -> [f64; 2] {
    [0, 1].map(|mode| arm.modes().get(mode).map_or(f64::NAN, |mode| mode.frequency_hz))
}

/// Returns the angles of the links of a chain, degrees.
fn angles_deg(arm: &Assembly) -> Vec<f64> {
    match &arm.spec().body {
        BodySpec::Chain(chain) => chain.links.iter().map(|link| link.angle_deg).collect(),
        BodySpec::Modal(_) => Vec::new(),
    }
}

/// Returns β2, the angle of link 2 against link 1, degrees.
pub(super) fn beta2_deg(arm: &Assembly) -> f64 {
    angles_deg(arm).get(1).copied().unwrap_or(f64::NAN)
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
    /// Returns the degree of freedom that is driven.
    const fn at(self) -> &'static str {
        match self {
            Drive::Torque1 => "joint1",
            Drive::ForceX => "tip.x",
        }
    }

    /// Returns the arm under this excitation with an amplitude.
    pub(super) fn forced(self, arm: &Assembly, amplitude: f64) -> Result<Forced, StructureError> {
        Ok(Forced::new(arm.clone(), arm.dof(self.at())?, amplitude))
    }

    /// Returns an amplitude of this excitation in words.
    pub fn words(self, amplitude: f64) -> String {
        match self {
            Drive::Torque1 => format!("{amplitude} N·m at joint 1"),
            Drive::ForceX => format!("{amplitude} N along x at the tip"),
        }
    }
}

/// Returns the stability of a response as documents and tables have it.
pub(super) const fn stability(is_stable: Option<bool>) -> &'static str {
    match is_stable {
        Some(true) => "stable",
        Some(false) => "unstable",
        None => "marginal",
    }
}

fn as_stability<S: Serializer>(is_stable: &Option<bool>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(stability(*is_stable))
}

fn as_name<S: Serializer>(kind: &Option<BifurcationKind>, serializer: S) -> Result<S::Ok, S::Error> {
    kind.map(BifurcationKind::name).serialize(serializer)
}

/// A periodic response, stable or not.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PaperOrbit {
    /// Frequency of the excitation, Hz.
    pub frequency_hz: f64,
    /// Amplitude of the excitation, N·m or N.
    pub excitation: f64,
    /// The largest displacement over the period at each degree of freedom that is read, without its sign; rad at joints,
    /// else m.
    pub largest: Vec<f64>,
    /// The amplitude of its fundamental.
    pub amplitude: Vec<f64>,
    /// Whether small disturbances die out; `None` at a bifurcation, where the stability changes or the branch turns.
    #[serde(rename = "stability", serialize_with = "as_stability")]
    pub is_stable: Option<bool>,
    /// The kind of bifurcation, if it is one.
    #[serde(serialize_with = "as_name")]
    pub bifurcation: Option<BifurcationKind>,
}

impl PaperOrbit {
    fn new(orbit: &Orbit, bifurcation: Option<BifurcationKind>) -> PaperOrbit {
        let amplitude = |reading: &Reading| libm::hypot(reading.harmonic1.re, reading.harmonic1.im);
        PaperOrbit {
            frequency_hz: orbit.frequency_hz,
            excitation: orbit.drive,
            largest: orbit.readings.iter().map(|reading| reading.largest).collect(),
            amplitude: orbit.readings.iter().map(amplitude).collect(),
            // At a bifurcation a multiplier is on the unit circle, and rounding would decide.
            is_stable: orbit.is_stable().filter(|_| bifurcation.is_none()),
            bifurcation,
        }
    }
}

/// The measure of a displacement that is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Size {
    /// The largest over the period.
    #[default]
    Largest,
    /// The amplitude of the fundamental.
    Amplitude,
}

/// Degrees of freedom at which the responses of a branch are read, and the measure that is drawn.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Read {
    /// The degrees of freedom by their names.
    pub at: Vec<String>,
    /// The measure of their displacements that is drawn.
    pub size: Size,
}

impl Read {
    /// The largest angles of the joints of both links.
    pub fn joints() -> Read {
        Read { at: ["joint1", "joint2"].map(String::from).to_vec(), size: Size::Largest }
    }

    fn dofs(&self, arm: &Assembly) -> Result<Vec<Dof>, StructureError> {
        self.at.iter().map(|name| arm.dof(name)).collect()
    }
}

/// A branch of an arm's periodic responses in a pose.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ForcedBranch {
    /// The name of the preset or of the structure.
    pub structure: String,
    /// The angles of its links, degrees.
    pub angles_deg: Vec<f64>,
    /// The excitation of the arm.
    pub drive: Drive,
    /// The point at which its periodic responses are read.
    pub read: Read,
    /// The natural frequencies of the first two modes of the linearised arm, Hz.
    pub natural_hz: [f64; 2],
    /// The periodic responses in their order, bifurcations among them.
    #[serde(rename = "motions")]
    pub orbits: Vec<PaperOrbit>,
}

pub(super) fn by_name<S: Serializer>(preset: &Preset, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(preset.name())
}

/// The arm, excitation and readings for which a branch is traced.
pub(super) struct Traced<'a> {
    /// The name of the preset or of the structure.
    pub structure: &'a str,
    pub arm: &'a Assembly,
    pub drive: Drive,
    pub read: Read,
}

impl<'a> Traced<'a> {
    /// Reads the arm of a subject at the angles of its joints.
    pub fn joints(subject: &Subject, arm: &'a Assembly, drive: Drive) -> Traced<'a> {
        Traced { structure: subject.preset.name(), arm, drive, read: Read::joints() }
    }

    /// Returns the periodic responses over the frequency, from one value to another, under an excitation of this
    /// amplitude.
    ///
    /// # Errors
    /// [`PaperError::Analysis`] with the branch that could not be followed, the place and the reason.
    pub fn over_frequency(&self, amplitude: f64, [from_hz, to_hz]: [f64; 2]) -> Result<ForcedBranch, PaperError> {
        let forced = self.drive.forced(self.arm, amplitude)?;
        self.along(&forced, from_hz, Coordinate::FrequencyHz, [from_hz, to_hz], amplitude)
    }

    /// Returns the periodic responses over the amplitude of the excitation, from none to `largest`, at one frequency.
    ///
    /// # Errors
    /// As [`Traced::over_frequency`].
    pub fn over_amplitude(&self, largest: f64, frequency_hz: f64) -> Result<ForcedBranch, PaperError> {
        // The amplitude is the coordinate of the branch, which begins at rest.
        let forced = self.drive.forced(self.arm, 0.0)?;
        self.along(&forced, frequency_hz, Coordinate::Amplitude, [0.0, largest], largest)
    }

    fn along(
        &self,
        forced: &Forced,
        frequency_hz: f64,
        coordinate: Coordinate,
        ends: [f64; 2],
        amplitude: f64,
    ) -> Result<ForcedBranch, PaperError> {
        let mut options = TraceOptions::new(forced, coordinate, ends, self.read.dofs(self.arm)?);
        // The statements count only responses that are computed to the tolerance.
        options.branch.ends_if_truncated = true;
        let branch = trace(forced, frequency_hz, coordinate, &options).map_err(AnalysisError::from);
        let branch = branch.map_err(|source| PaperError::Analysis {
            structure: self.structure.to_owned(),
            beta2_deg: beta2_deg(self.arm),
            drive: self.drive.words(amplitude),
            source: Box::new(source),
        })?;
        Ok(ForcedBranch {
            structure: self.structure.to_owned(),
            angles_deg: angles_deg(self.arm),
            drive: self.drive,
            read: self.read.clone(),
            natural_hz: natural_hz(self.arm),
            orbits: branch.with_bifurcations(PaperOrbit::new),
        })
    }
}

impl ForcedBranch {
    /// Returns the size of a response at a reading, by its number: the largest displacement or the amplitude, as the
    /// branch is read.
    pub fn size(&self, orbit: &PaperOrbit, reading: usize) -> f64 {
        let sizes = match self.read.size {
            Size::Largest => &orbit.largest,
            Size::Amplitude => &orbit.amplitude,
        };
        sizes.get(reading).copied().unwrap_or(f64::NAN)
    }

    /// Returns the responses between two frequencies, Hz.
    pub fn within(&self, [from_hz, to_hz]: [f64; 2]) -> impl Iterator<Item = &PaperOrbit> {
        self.orbits.iter().filter(move |orbit| (from_hz..=to_hz).contains(&orbit.frequency_hz))
    }

    /// Returns neighbouring responses in pairs, and whether those between them are stable. Between two bifurcations
    /// they are assumed to be unstable.
    pub fn segments(&self) -> impl Iterator<Item = (&PaperOrbit, &PaperOrbit, bool)> {
        segments(&self.orbits, |orbit| orbit.is_stable)
    }

    /// The ranges in which the resonance zones of both modes are searched, Hz.
    pub fn zones_hz(&self) -> [[f64; 2]; 2] {
        self.natural_hz.map(zone_hz)
    }

    /// Returns the bifurcations of a kind.
    pub fn bifurcations(&self, kind: BifurcationKind) -> impl Iterator<Item = &PaperOrbit> {
        self.orbits.iter().filter(move |orbit| orbit.bifurcation == Some(kind))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::Settings;

    /// Within the folds the branch has two stable responses and one unstable between them, and the changes are at the
    /// folds.
    #[test]
    fn stability_changes_at_the_bifurcations() {
        let subject = Subject::new(Preset::Irb1600Fitted, &Settings::embedded().unwrap()).unwrap();
        let arm = subject.bent(60.0).unwrap();
        let branch = Traced::joints(&subject, &arm, Drive::Torque1).over_frequency(60.0, [21.0, 23.5]).unwrap();
        let folds: Vec<f64> = branch.bifurcations(BifurcationKind::Fold).map(|fold| fold.frequency_hz).collect();
        // The upper fold comes first, since the branch is followed from low frequencies on.
        assert!((folds[0] - 22.1349).abs() < 1e-4 && (folds[1] - 22.0635).abs() < 1e-4, "{folds:?}");
        let stable: Vec<bool> = branch.segments().map(|(.., is_stable)| is_stable).collect();
        assert_eq!(stable.chunk_by(|a, b| a == b).count(), 3);
        assert!(branch.orbits.iter().all(|orbit| orbit.excitation == 60.0));
    }
}
