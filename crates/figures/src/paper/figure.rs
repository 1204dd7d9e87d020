//! The figures as data: their curves and panels.

use serde::Serialize;

use super::branch::{Drive, ForcedBranch, Read, Size, Traced, by_name, natural_hz, zone_hz};
use super::error::PaperError;
use super::measured::{MeasuredPoint, MeasuredZone, MeasuredZones};
use super::settings::Settings;
use super::subject::Subject;
use resonarm_dynamics::structure::{Assembly, BodySpec, Link, Preset};
use resonarm_session::study::on_all_cores;

/// The figures of the paper that show computed curves of periodic responses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Figure {
    /// `fig4`: amplitude of link 1 over the frequency of a torque, at several poses.
    Fig4,
    /// `fig5`: amplitude of link 1 over the amplitude of a torque.
    Fig5,
    /// `fig7`: amplitudes over the frequency of a force at the tip, on the line of Fig. 6.
    Fig7,
    /// `fig9`: amplitudes over the frequency in the measured position.
    Fig9,
}

impl Figure {
    /// Returns its name on the command line and of its files.
    pub const fn name(self) -> &'static str {
        match self {
            Figure::Fig4 => "fig4",
            Figure::Fig5 => "fig5",
            Figure::Fig7 => "fig7",
            Figure::Fig9 => "fig9",
        }
    }
}

/// A curve to compute.
#[derive(Clone, Debug)]
struct Job {
    label: String,
    arm: Assembly,
    drive: Drive,
    varied: Varied,
}

/// The quantity that varies along a curve.
#[derive(Clone, Copy, Debug)]
enum Varied {
    Frequency { amplitude: f64, range_hz: [f64; 2] },
    Amplitude { largest: f64, frequency_hz: f64 },
}

/// The curves of one panel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Panel {
    /// Title of the panel.
    pub title: String,
    /// The number of the reading that is shown, from 1: the joint of this link, or a degree of freedom that was measured.
    pub reading: usize,
    /// The quantity that varies.
    pub abscissa: Abscissa,
    /// Whether the amplitude is drawn by its logarithm.
    pub logarithmic: bool,
    /// The range of the abscissa that is shown; all of it if none is given.
    pub range: Option<[f64; 2]>,
    /// Whether each curve is labelled with its name; if not, there is one curve, or the title has all names.
    pub names: bool,
    /// The curves, as indices in [`FigureCurves::curves`].
    pub curves: Vec<usize>,
}

/// The quantity that varies along the curves of a panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Abscissa {
    /// The frequency of the excitation, Hz.
    FrequencyHz,
    /// The amplitude of the torque at joint 1, N·m.
    Torque1Nm,
}

/// A branch with its name in the figure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LabelledCurve {
    /// Name of the curve.
    pub label: String,
    /// The branch of periodic responses.
    #[serde(flatten)]
    pub branch: ForcedBranch,
}

/// Data of a figure: its curves, panels and conditions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FigureCurves {
    /// Figure of the paper that this is.
    pub figure: Figure,
    /// The name of the preset or of the structure.
    pub name: String,
    /// The links, the same in all curves but for their angles, which each curve has.
    pub links: Vec<Link>,
    /// Title of the figure.
    pub title: String,
    /// The conditions under which it was computed.
    pub conditions: String,
    /// Panels, which refer to the curves.
    pub panels: Vec<Panel>,
    /// Curves, of which a panel shows some.
    pub curves: Vec<LabelledCurve>,
    /// Points measured on a bench, drawn over the curves of every panel.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub measured: Vec<MeasuredPoint>,
}

/// The plan of a figure before it is computed.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The figure, whose curves are still missing.
    drawn: FigureCurves,
    read: Read,
    jobs: Vec<Job>,
}

impl Plan {
    /// Plans the curves and panels of a figure.
    ///
    /// # Errors
    /// [`PaperError`] if the settings ask for an impossible pose.
    pub fn new(figure: Figure, preset: Preset, settings: &Settings) -> Result<Plan, PaperError> {
        let subject = Subject::new(preset, settings)?;
        let (title, conditions) = match figure {
            Figure::Fig4 => {
                ("Amplitude–frequency characteristics of link 1, torque at joint 1", String::from(", curves by β₂"))
            }
            Figure::Fig5 => (
                "Amplitude of link 1 against amplitude of the torque at joint 1",
                format!(", {} Hz, curves by β₂", settings.figure5.frequency_hz),
            ),
            Figure::Fig7 => (
                "Amplitude–frequency characteristics, force at the tip along x",
                format!(", tip at the height y = {} m, curves by β₂", settings.line.height_m).replace('-', "−"),
            ),
            Figure::Fig9 => (
                "Amplitude–frequency characteristics in the measured position",
                format!(", β₂ = {}°, {} N along x at the tip", settings.figure9.beta2_deg, settings.figure9.force_n),
            ),
        };
        let conditions = format!("{}{conditions}", subject.label()?);
        let drawn = FigureCurves {
            figure,
            name: preset.name().to_owned(),
            links: subject.chain.links.clone(),
            title: title.to_owned(),
            conditions,
            panels: vec![],
            curves: vec![],
            measured: vec![],
        };
        let mut plan = Plan { drawn, read: Read::joints(), jobs: vec![] };
        match figure {
            Figure::Fig4 => plan.fill_figure4(&subject, settings)?,
            Figure::Fig5 => plan.fill_figure5(&subject, settings)?,
            Figure::Fig7 => plan.fill_figure7(&subject, settings)?,
            Figure::Fig9 => plan.fill_figure9(&subject, settings)?,
        }
        Ok(plan)
    }

    /// Plans Fig. 9 of a measured structure: a curve for each zone, under its force, and the points over it.
    pub fn measured(measured: &MeasuredZones) -> Plan {
        let zones = &measured.zones;
        let forces: Vec<String> = zones.iter().map(|zone| format!("{} N", zone.force_n)).collect();
        let title = "Amplitude–frequency characteristics in the measured position, measured on computed";
        let drawn = FigureCurves {
            figure: Figure::Fig9,
            name: measured.name.clone(),
            links: match &measured.structure.spec().body {
                BodySpec::Chain(chain) => chain.links.clone(),
                BodySpec::Modal(_) => vec![],
            },
            title: title.to_owned(),
            conditions: format!("{}, {} along x at the tip", measured.label, forces.join(" and ")),
            panels: vec![],
            curves: vec![],
            measured: zones.iter().flat_map(|zone| zone.points.clone()).collect(),
        };
        let read = Read { at: measured.read.clone(), size: Size::Amplitude };
        let mut plan = Plan { drawn, read, jobs: vec![] };
        let add = |zone: &MeasuredZone| {
            let force = (Drive::ForceX, zone.force_n);
            plan.over_frequency(format!("{} N", zone.force_n), measured.structure.clone(), force, zone.range_hz)
        };
        let curves: Vec<usize> = zones.iter().map(add).collect();
        // Readings are counted from 1, as in `Panel::reading`.
        for (name, (letter, number)) in measured.read.iter().zip(('a'..).zip(1..)) {
            plan.panel(format!("({letter}) {name}"), number, Some(measured.range_hz()), curves.clone());
        }
        plan
    }

    /// Returns the number of its curves.
    pub fn curve_count(&self) -> usize {
        self.jobs.len()
    }

    /// Computes the curves over all cores; `done` is called after each.
    ///
    /// # Errors
    /// [`PaperError::Analysis`] with the curve that could not be followed, the place and the reason.
    pub fn compute(self, done: impl Fn() + Sync) -> Result<FigureCurves, PaperError> {
        let work = |job: &Job| {
            let traced =
                Traced { structure: &self.drawn.name, arm: &job.arm, drive: job.drive, read: self.read.clone() };
            let branch: Result<ForcedBranch, _> = match job.varied {
                Varied::Frequency { amplitude, range_hz } => traced.over_frequency(amplitude, range_hz),
                Varied::Amplitude { largest, frequency_hz } => traced.over_amplitude(largest, frequency_hz),
            };
            branch.map(|branch| LabelledCurve { label: job.label.clone(), branch })
        };
        // In the order of the jobs, by which the panels refer to the curves.
        let curves = on_all_cores(&self.jobs, work, done).into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(FigureCurves { curves, ..self.drawn })
    }

    /// Adds a curve over the frequency and returns its place.
    fn over_frequency(&mut self, label: String, arm: Assembly, drive: (Drive, f64), range_hz: [f64; 2]) -> usize {
        let varied = Varied::Frequency { amplitude: drive.1, range_hz };
        self.jobs.push(Job { label, arm, drive: drive.0, varied });
        self.jobs.len() - 1
    }

    /// Adds a panel over the frequency, and returns it for changes.
    fn panel(
        &mut self,
        title: impl Into<String>,
        reading: usize,
        range: Option<[f64; 2]>,
        curves: Vec<usize>,
    ) -> &mut Panel {
        let title = title.into();
        let abscissa = Abscissa::FrequencyHz;
        let panels = &mut self.drawn.panels;
        panels.push(Panel { title, reading, abscissa, logarithmic: false, range, names: true, curves });
        let last = panels.len() - 1;
        &mut panels[last]
    }

    fn fill_figure4(&mut self, subject: &Subject, settings: &Settings) -> Result<(), PaperError> {
        let four = &settings.figure4;
        let preset = subject.preset;
        let torque = *four.torque_nm.of(preset);
        let second = *four.second_zone_torque_nm.of(preset);
        let mut whole = vec![];
        let mut zones = vec![];
        for &beta2_deg in &four.beta2_deg {
            let arm = subject.bent(beta2_deg)?;
            let label = pose(beta2_deg);
            let zone = zone_hz(natural_hz(&arm)[1]);
            // Panels (a) and (b) show the same curves, panel (c) others, under the torque of the second zone.
            whole.push(self.over_frequency(label.clone(), arm.clone(), (Drive::Torque1, torque), settings.range_hz));
            zones.push(self.over_frequency(label, arm, (Drive::Torque1, second), zone));
        }
        let entire = format!("(a) Entire spectrum, {torque} N·m");
        self.panel(entire, 1, Some(settings.range_hz), whole.clone()).logarithmic = true;
        self.panel(format!("(b) First resonance zone, {torque} N·m"), 1, None, whole);
        self.panel(format!("(c) Second resonance zone, {second} N·m"), 1, None, zones);
        Ok(())
    }

    fn fill_figure5(&mut self, subject: &Subject, settings: &Settings) -> Result<(), PaperError> {
        let five = &settings.figure5;
        let preset = subject.preset;
        let largest = *five.largest_torque_nm.of(preset);
        let frequency_hz = five.frequency_hz;
        for &beta2_deg in five.beta2_deg.of(preset) {
            let arm = subject.bent(beta2_deg)?;
            let varied = Varied::Amplitude { largest, frequency_hz };
            self.jobs.push(Job { label: pose(beta2_deg), arm, drive: Drive::Torque1, varied });
        }
        let curves = (0..self.jobs.len()).collect();
        self.panel("", 1, Some([0.0, largest]), curves).abscissa = Abscissa::Torque1Nm;
        Ok(())
    }

    fn fill_figure7(&mut self, subject: &Subject, settings: &Settings) -> Result<(), PaperError> {
        let seven = &settings.figure7;
        let preset = subject.preset;
        let force = (Drive::ForceX, seven.force_n);
        let mut whole = vec![];
        for &beta2_deg in &seven.beta2_deg {
            let arm = subject.on_line(beta2_deg)?;
            whole.push(self.over_frequency(pose(beta2_deg), arm, force, settings.range_hz));
        }
        let range_hz = Some(settings.range_hz);
        self.panel(format!("(a) Link 1, {} N", force.1), 1, range_hz, whole.clone()).logarithmic = true;
        self.panel(format!("(b) Link 2, {} N", force.1), 2, range_hz, whole).logarithmic = true;
        let detail = seven.detail_beta2_deg;
        let arm = subject.on_line(detail)?;
        let details = [
            (1, "(c) Link 1, second zone", 1, seven.second_zone_force_n.of(preset)),
            (0, "(d) Link 2, first zone", 2, seven.first_zone_force_n.of(preset)),
        ];
        for (mode, title, link, forces) in details {
            let zone = zone_hz(natural_hz(&arm)[mode]);
            let add =
                |force: &f64| self.over_frequency(format!("{force} N"), arm.clone(), (Drive::ForceX, *force), zone);
            let curves = forces.iter().map(add).collect();
            let listed: Vec<String> = forces.iter().map(f64::to_string).collect();
            // Peaks above each other leave no room for names.
            let title = format!("{title}, β₂ = {detail}°, from low to high {} N", listed.join(", "));
            self.panel(title, link, None, curves).names = false;
        }
        Ok(())
    }

    fn fill_figure9(&mut self, subject: &Subject, settings: &Settings) -> Result<(), PaperError> {
        let nine = &settings.figure9;
        let arm = subject.on_line(nine.beta2_deg)?;
        let force = (Drive::ForceX, nine.force_n);
        // The only curve needs no name. Both panels show it.
        let curve = self.over_frequency(String::new(), arm, force, nine.range_hz);
        self.panel("(a) Link 1", 1, Some(nine.range_hz), vec![curve]).names = false;
        self.panel("(b) Link 2", 2, Some(nine.range_hz), vec![curve]).names = false;
        Ok(())
    }
}

fn pose(beta2_deg: f64) -> String {
    format!("{beta2_deg}°")
}

/// Fig. 3: natural frequencies over β2.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NaturalFrequencies {
    /// Preset that they belong to.
    #[serde(serialize_with = "by_name")]
    pub preset: Preset,
    /// The links of the straight arm.
    pub links: Vec<Link>,
    /// β2, degrees; β1 is 0.
    pub beta2_deg: Vec<f64>,
    /// f1 and f2 at each β2, Hz.
    pub frequency_hz: Vec<[f64; 2]>,
}

/// Returns natural frequencies from β2 = −180° to 180°, a degree apart.
///
/// # Errors
/// As [`Subject::new`].
pub fn natural_frequencies(preset: Preset, settings: &Settings) -> Result<NaturalFrequencies, PaperError> {
    let subject = Subject::new(preset, settings)?;
    let beta2_deg: Vec<f64> = (-180..=180).map(f64::from).collect();
    let frequencies = |beta2_deg: &f64| Ok(natural_hz(&subject.bent(*beta2_deg)?));
    let frequency_hz = beta2_deg.iter().map(frequencies).collect::<Result<_, PaperError>>()?;
    Ok(NaturalFrequencies { preset, links: subject.chain.links.clone(), beta2_deg, frequency_hz })
}
