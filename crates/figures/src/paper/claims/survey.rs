//! The data on which statements are judged: the resonance zones of an arm, over the ranges of the unstated parameters.

use super::bent::{Bent, bent};
use crate::paper::branch::{Drive, ForcedBranch, Traced, natural_hz, zone_hz};
use crate::paper::error::PaperError;
use crate::paper::settings::Settings;
use crate::paper::subject::Subject;
use resonarm_analysis::{BifurcationKind, Maximum};
use resonarm_dynamics::structure::{Assembly, Preset};

/// A result, or the reason for which it could not be computed.
pub(super) type Seen<T> = Result<T, String>;

/// The excitation of the arm, and where it acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Driven {
    /// A torque at joint 1, N·m.
    Torque { nm: f64 },
    /// A force along x at the tip, N; the tip is on a line of this height, m.
    Force { n: f64, height_m: f64 },
}

impl Driven {
    fn drive(self) -> (Drive, f64) {
        match self {
            Driven::Torque { nm } => (Drive::Torque1, nm),
            Driven::Force { n, .. } => (Drive::ForceX, n),
        }
    }

    fn arm(self, subject: &Subject, beta2_deg: f64) -> Result<Assembly, PaperError> {
        match self {
            Driven::Torque { .. } => subject.bent(beta2_deg),
            Driven::Force { height_m, .. } => subject.on_line_at(beta2_deg, height_m),
        }
    }
}

/// A resonance zone: that of a mode (0 or 1) in a pose under an excitation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub driven: Driven,
    pub beta2_deg: f64,
    pub mode: usize,
}

/// Values read from a zone.
#[derive(Clone, Debug)]
pub(super) struct Zone {
    /// The maxima of each link, the highest first.
    pub maxima: [Vec<Maximum>; 2],
    width_hz: [Option<f64>; 2],
    /// The largest ratio of stable amplitudes of link 1 at one frequency; 1 if there is one response at each.
    pub ratio: f64,
    /// Kinds of the bifurcations.
    bifurcations: Vec<BifurcationKind>,
}

impl Zone {
    fn of(branch: &ForcedBranch) -> Zone {
        Zone {
            maxima: [0, 1].map(|link| branch.maxima(link)),
            width_hz: [0, 1].map(|link| branch.half_power_width_hz(link)),
            ratio: branch.largest_ratio(0).0,
            bifurcations: branch.orbits.iter().filter_map(|orbit| orbit.bifurcation).collect(),
        }
    }

    /// Returns the highest maximum of a link (0 or 1).
    pub fn peak(&self, link: usize) -> Seen<Maximum> {
        self.maxima[link].first().copied().ok_or_else(|| String::from("the zone has no maximum"))
    }

    /// Returns the half-power width of a link, Hz.
    pub fn width_hz(&self, link: usize) -> Seen<f64> {
        self.width_hz[link].ok_or_else(|| String::from("the zone has no maximum"))
    }

    /// Returns the number of bifurcations of a kind.
    pub fn count(&self, kind: BifurcationKind) -> usize {
        self.bifurcations.iter().filter(|found| **found == kind).count()
    }
}

/// Zone and backbone of a place, or the reason for which each could not be computed.
#[derive(Clone, Debug)]
pub(super) struct View {
    place: Place,
    zone: Seen<Zone>,
    bent: Seen<Bent>,
}

/// A pose of Fig. 5, degrees, and the torques at which its curve folds, N·m.
pub(super) type Folds = (f64, Seen<Vec<f64>>);

/// A computation of the survey.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Job {
    Place(Place),
    Pose5(f64),
}

/// Result of a job.
pub(super) enum Done {
    View(Box<View>),
    Folds(Folds),
}

/// Everything computed for a preset before statements are judged.
pub(super) struct Survey<'a> {
    pub subject: &'a Subject,
    pub settings: &'a Settings,
    /// Zones, computed or not.
    pub views: Vec<View>,
    /// Poses of Fig. 5.
    pub over_torque: Vec<Folds>,
}

/// Returns `values` and `own` together, ascending.
fn with(values: &[f64], own: &[f64]) -> Vec<f64> {
    let mut all = [values, own].concat();
    all.sort_by(f64::total_cmp);
    // The figure's own value may be among the scanned ones.
    all.dedup();
    all
}

/// Returns the scanned torques and that of the figure, N·m.
pub(super) fn torques_nm(settings: &Settings, preset: Preset, mode: usize) -> Vec<f64> {
    with(&settings.scan.torque_nm, &[own_torque_nm(settings, preset, mode)])
}

/// Returns the torque of Fig. 4 in a zone, N·m.
pub(super) fn own_torque_nm(settings: &Settings, preset: Preset, mode: usize) -> f64 {
    let four = &settings.figure4;
    *[&four.torque_nm, &four.second_zone_torque_nm][mode].of(preset)
}

/// Returns the scanned forces and those of Figs. 7 and 9, N.
pub(super) fn forces_n(settings: &Settings) -> Vec<f64> {
    with(&settings.scan.force_n, &[settings.figure7.force_n, settings.figure9.force_n])
}

/// Returns the scanned heights and that of the figures, m.
pub(super) fn heights_m(settings: &Settings) -> Vec<f64> {
    with(&settings.scan.height_m, &[settings.line.height_m])
}

/// Returns the computations for a preset.
pub(super) fn jobs(subject: &Subject, settings: &Settings) -> Result<Vec<Job>, PaperError> {
    let mut driven: Vec<(Driven, Vec<f64>)> = Vec::new();
    // Both zones are computed under the torques of either, since some statements compare them under one torque.
    let torques = with(&torques_nm(settings, subject.preset, 0), &torques_nm(settings, subject.preset, 1));
    driven.extend(torques.into_iter().map(|nm| (Driven::Torque { nm }, settings.figure4.beta2_deg.clone())));
    let seven = &settings.figure7;
    let positions = with(&seven.beta2_deg, &[seven.detail_beta2_deg, settings.figure9.beta2_deg]);
    for height_m in heights_m(settings) {
        let along = |n| (Driven::Force { n, height_m }, positions.clone());
        driven.extend(forces_n(settings).into_iter().map(along));
    }
    let strong = &settings.scan;
    let torques = strong.strong_torque_nm.iter();
    driven.extend(torques.map(|nm| (Driven::Torque { nm: *nm }, strong.strong_beta2_deg.clone())));
    let places = driven.into_iter().flat_map(|(driven, poses)| {
        let zones = move |beta2_deg| [0, 1].map(|mode| Job::Place(Place { driven, beta2_deg, mode }));
        poses.into_iter().flat_map(zones)
    });
    // Statements share zones: each is computed once.
    let mut jobs: Vec<Job> = Vec::new();
    for place in places {
        if !jobs.contains(&place) {
            jobs.push(place);
        }
    }
    jobs.extend(poses_of_figure5(subject, settings)?.into_iter().map(Job::Pose5));
    Ok(jobs)
}

/// Returns the poses at which the frequency of Fig. 5 is near to the first natural frequency, degrees.
fn poses_of_figure5(subject: &Subject, settings: &Settings) -> Result<Vec<f64>, PaperError> {
    let step = settings.scan.figure5_step_deg;
    let nearness = settings.scan.figure5_nearness;
    let mut poses = Vec::new();
    for k in 0..=(180.0 / step) as u32 {
        // Not by adding the step, whose rounding would add up.
        let beta2_deg = f64::from(k) * step;
        let first_hz = natural_hz(&subject.bent(beta2_deg)?)[0];
        if (settings.figure5.frequency_hz / first_hz - 1.0).abs() <= nearness {
            poses.push(beta2_deg);
        }
    }
    Ok(poses)
}

/// Computes one of the jobs.
pub(super) fn done(subject: &Subject, settings: &Settings, job: Job) -> Done {
    match job {
        Job::Place(place) => Done::View(Box::new(view(subject, place))),
        Job::Pose5(beta2_deg) => {
            Done::Folds((beta2_deg, folds_over_torque(subject, settings, beta2_deg).map_err(|why| why.to_string())))
        }
    }
}

fn view(subject: &Subject, place: Place) -> View {
    let Place { driven, beta2_deg, mode } = place;
    let zone = || -> Result<Zone, PaperError> {
        let arm = driven.arm(subject, beta2_deg)?;
        let range_hz = zone_hz(natural_hz(&arm)[mode]);
        let (drive, amplitude) = driven.drive();
        Ok(Zone::of(&Traced::joints(subject, &arm, drive).over_frequency(amplitude, range_hz)?))
    };
    // Zone and backbone fail separately: a statement that needs one of them can be judged without the other.
    let bent = || bent(subject, &driven.arm(subject, beta2_deg)?, mode, driven.drive());
    View { place, zone: zone().map_err(|why| why.to_string()), bent: bent().map_err(|why| why.to_string()) }
}

fn folds_over_torque(subject: &Subject, settings: &Settings, beta2_deg: f64) -> Result<Vec<f64>, PaperError> {
    let five = &settings.figure5;
    let arm = subject.bent(beta2_deg)?;
    let largest_nm = *five.largest_torque_nm.of(subject.preset);
    let branch = Traced::joints(subject, &arm, Drive::Torque1).over_amplitude(largest_nm, five.frequency_hz)?;
    Ok(branch.bifurcations(BifurcationKind::Fold).map(|fold| fold.excitation).collect())
}

impl<'a> Survey<'a> {
    /// Collects the results of the jobs.
    pub fn new(subject: &'a Subject, settings: &'a Settings, done: impl Iterator<Item = Done>) -> Survey<'a> {
        let mut survey = Survey { subject, settings, views: Vec::new(), over_torque: Vec::new() };
        for done in done {
            match done {
                Done::View(view) => survey.views.push(*view),
                Done::Folds(folds) => survey.over_torque.push(folds),
            }
        }
        survey
    }

    fn view(&self, place: Place) -> Seen<&View> {
        // Compared exactly: the places asked for come from the same settings as those computed.
        self.views
            .iter()
            .find(|view| view.place == place)
            .ok_or_else(|| format!("the zone was not computed: {place:?}"))
    }

    /// Returns the values read from a zone.
    pub fn zone(&self, driven: Driven, beta2_deg: f64, mode: usize) -> Seen<&Zone> {
        self.view(Place { driven, beta2_deg, mode })?.zone.as_ref().map_err(String::clone)
    }

    /// Returns the backbone of a zone up to the excitation, or the reason for which it could not be computed.
    pub fn bent(&self, driven: Driven, beta2_deg: f64, mode: usize) -> Seen<&Bent> {
        self.view(Place { driven, beta2_deg, mode })?.bent.as_ref().map_err(String::clone)
    }

    /// Returns all zones that could be computed, with their places.
    pub fn zones(&self) -> impl Iterator<Item = (Place, &Zone)> {
        self.views.iter().filter_map(|view| Some((view.place, view.zone.as_ref().ok()?)))
    }
}
