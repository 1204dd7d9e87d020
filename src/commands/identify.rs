//! `resonarm identify`: modes and frequency responses from the readings in a recording.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::Value;

use crate::commands::identify_angles::{self, Domain, Request};
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::figures::response_curves::broken_at_wraps;
use crate::flags;
use crate::help::heading;
use crate::output::{self, Inputs, JsonFlag, OverwriteFlag};
use crate::recordings;
use resonarm::analysis::{self, Pole};
use resonarm::excitation::Waveform;
use resonarm::identification::{MissingMode, averaging, band, missing_modes, mode_numbers, record, samples_in};
use resonarm::identify::{
    self, Averaging, Band, CHANNELS, Direction, FrequencyResponseEstimate, Identification, IdentifiedMode,
    IdentifyError, Record,
};
use resonarm::plant::{Places, TestedAssembly};
use resonarm::recording::Recording;
use resonarm::scenario::{READS_IMAGES, Scenario};
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Legend, Panel, Series, Style};
use resonarm_numeric::number::short;

/// Identifies poles and frequency responses from the readings in a recording.
///
/// The responses are the accelerations of B and C over the force in the impedance head.
///
/// A pole λ is stated by its frequency |λ|/2π and its damping ratio −Re λ/|λ|. With damping that is not proportional they
/// differ from those of the undamped structure; `resonarm modes` states both.
///
/// The model of the modes includes the ends of the record, so the record may be shorter than their decay; frequencies
/// and damping ratios have their standard deviation, shapes have none. The structure must be driven by a force where
/// the head is. Periods of a multisine or of bursts, and segments of other records (Welch's method: a Hann window, half
/// overlapping), are averaged to H1, H2 and coherence; an impact is taken whole. The document of --json and the CSV of
/// --plot have all three of each response, the figure H1 and the coherence. Modes are numbered as in the scenario's
/// structure; one that is not found is listed with the reason. If no mode is found the exit code is 1.
///
/// With --angles, for a run with any load, it gives the joints' angles over time instead: the accelerations are
/// integrated twice, and the displacements are converted to angles with the lengths and the pose of the two links in the
/// recording's scenario, at whose ends B and C must be.
/// Vibration at f has the gain 1 − (1 + (f/f0)⁴)⁻³ with the corner f0 of --from-hz. Accelerometers can't measure means,
/// so these are zero. Each angle has the standard deviation due to the instruments' white noise. Four periods of the
/// corner are left out at both ends, except at a start from rest. Clipped readings are refused. The droop of the
/// converters is corrected. Times are those of the readings, earlier than their samples by the converters' delay.
#[derive(Debug, Args)]
pub(crate) struct Identify {
    /// Recording, an MCAP file.
    file: PathBuf,
    /// Lowest frequency, Hz [default: that of the recorded excitation, or 1].
    ///
    /// With --angles the default is a quarter of the structure's lowest natural frequency.
    #[arg(long, help_heading = heading::RANGE, value_name = "F")]
    from_hz: Option<f64>,
    /// Highest frequency, Hz [default: that of the recorded excitation, or 100].
    ///
    /// The default for an impact is 1 over its length.
    #[arg(long, help_heading = heading::RANGE, value_name = "F")]
    to_hz: Option<f64>,
    /// Direction of the input force.
    #[arg(long, help_heading = heading::COMPUTATION, value_enum, default_value_t = Input::Principal)]
    input: Input,
    /// Length of the segments to average, s [default: whole periods, or an eighth of the record].
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "S")]
    segment_s: Option<f64>,
    /// Plot the responses to STEM.svg and STEM.png, with caption, CSV and JSON.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "STEM")]
    plot: Option<PathBuf>,
    /// Write the angles of the joints over time to this CSV file, in place of identifying poles.
    ///
    /// The columns are α1 and α2, rad, and their standard deviations.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE", conflicts_with_all = ["to_hz", "input", "segment_s", "plot"])]
    angles: Option<PathBuf>,
    /// Domain in which accelerations are integrated twice [default: frequency].
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "DOMAIN", value_enum, requires = "angles")]
    integration: Option<Domain>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
}

/// The directions of a response.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Input {
    /// The direction in which the head reads most.
    Principal,
    /// Along x.
    HeadX,
    /// Along y.
    HeadY,
}

impl Input {
    const fn direction(self) -> Direction {
        match self {
            Input::Principal => Direction::Principal,
            Input::HeadX => Direction::X,
            Input::HeadY => Direction::Y,
        }
    }
}

/// The names of the channels, accelerometer and axis, in the order of [`Record`].
const RESPONSES: [&str; CHANNELS] = ["b-x", "b-y", "c-x", "c-y"];
/// The names of the channels in figures.
const TITLES: [&str; CHANNELS] = ["B x", "B y", "C x", "C y"];
const UNIT: &str = "m/s² per N";

#[derive(Serialize)]
struct Document {
    /// The recorded structure, to compare the modes with.
    configuration: Value,
    /// Name and unit of each coordinate; none of a structure whose equations are not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    coordinates: Option<Value>,
    /// The degrees of freedom of the shapes' components: at B along x and y, and at C; none where an accelerometer
    /// reads nothing, and of a structure whose equations are not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    at: Option<[Option<String>; 4]>,
    recording: String,
    samples: usize,
    duration_s: f64,
    /// Unit vector of the force that is the input.
    direction: [f64; 2],
    from_hz: f64,
    to_hz: f64,
    modes: Vec<NumberedMode>,
    /// Modes of the scenario's structure in the band that were not found.
    missing: Vec<MissingMode>,
    averaging: &'static str,
    averages: usize,
    frequency_hz: Vec<f64>,
    responses: Vec<ResponseCurve>,
}

/// A mode with its number in the scenario's structure; none if it is far from its modes.
#[derive(Serialize)]
struct NumberedMode {
    mode: Option<u8>,
    #[serde(flatten)]
    found: IdentifiedMode,
}

/// A response over all frequencies, complex as [real, imaginary].
#[derive(Serialize)]
struct ResponseCurve {
    response: &'static str,
    unit: &'static str,
    h1: Vec<[f64; 2]>,
    h2: Vec<[f64; 2]>,
    coherence: Option<Vec<f64>>,
}

/// Returns the pole frequencies of a structure's modes; not a number for a mode that does not oscillate, so that
/// nothing is near it.
fn pole_frequencies_hz(poles: &[Option<Pole>]) -> Vec<f64> {
    poles.iter().map(|pole| pole.map_or(f64::NAN, |pole| pole.pole_frequency_hz)).collect()
}

impl Identify {
    pub(crate) fn domain(&self) -> Domain {
        self.integration.unwrap_or(Domain::Frequency)
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        let inputs = Inputs::of([&self.file]);
        self.overwrite.check_stem(self.plot.as_deref(), output::PLOTTED, &inputs)?;
        self.overwrite.check(self.angles.clone(), &inputs)?;
        let recording = recordings::open(&self.file)?;
        let scenario = Scenario::from_configuration(recording.configuration())?;
        if let Some(csv) = &self.angles {
            let domain = self.domain();
            let request = Request { csv, domain, from_hz: self.from_hz, json: self.json };
            return Ok(identify_angles::execute(&recording, &scenario, &request)?.and(recordings::verdict(&recording)));
        }
        let tested = configuration::computable(&scenario)?;
        let document = self.compute(&recording, &scenario, tested.as_ref())?;
        for NumberedMode { found, .. } in document.modes.iter().filter(|mode| !mode.found.is_linear) {
            tracing::warn!(
                "{:.3} Hz: the residual of the fit is {:.1} times the instruments' noise: either the structure did not vibrate linearly (lower the force), or the instruments have almost no noise",
                found.pole_frequency_hz,
                found.residual
            );
        }
        document.missing.iter().for_each(|missing| tracing::warn!("{missing}"));
        if document.modes.is_empty() && document.missing.is_empty() {
            let (from_hz, to_hz) = (document.from_hz, document.to_hz);
            tracing::warn!("{}", IdentifyError::NoResonance { from_hz, to_hz });
        }
        if scenario.reads_images() {
            tracing::warn!("{READS_IMAGES}");
        }
        let drawn = || (figure(&scenario, tested.as_ref(), &document), document.csv());
        let files = output::plot(self.plot.as_deref(), &document, drawn)?;
        self.json.show(&document, || document.text(), &files)?;
        Ok(Verdict::of(!document.modes.is_empty()).and(recordings::verdict(&recording)))
    }

    fn compute(
        &self,
        recording: &Recording,
        scenario: &Scenario,
        tested: Option<&TestedAssembly>,
    ) -> Result<Document, Failure> {
        let record = record(recording, scenario, self.input.direction())?;
        let waveform = scenario.excitation.as_ref().map(|excitation| &excitation.profile);
        let usual = band(waveform, record.rate_hz());
        let band = Band { from_hz: self.from_hz.unwrap_or(usual.from_hz), to_hz: self.to_hz.unwrap_or(usual.to_hz) };
        let averaging = self.averaging(waveform, &record)?;
        let estimate = identify::frequency_response(&record, band, averaging)?;
        let found = match identify::modes(&record, band) {
            Ok(found) => found,
            // The measured responses are still worth printing, so a band without a resonance is a result, not an
            // error.
            Err(IdentifyError::NoResonance { .. }) => Identification { modes: Vec::new(), rejected: Vec::new() },
            Err(error) => return Err(error.into()),
        };
        // Poles are compared with poles; a mode that does not oscillate has none and is not found.
        let poles = tested.map_or(Vec::new(), |tested| analysis::structure_poles(&tested.assembly));
        let known_hz = pole_frequencies_hz(&poles);
        let numbers = mode_numbers(&found.modes, &known_hz);
        let missing = missing_modes(&found, &numbers, &known_hz, band);
        let numbered = numbers.into_iter().zip(found.modes);
        Ok(Document {
            coordinates: tested.map(|tested| configuration::coordinates(&tested.assembly)),
            configuration: configuration::of_scenario(scenario)?,
            at: tested.map(|tested| {
                let [[bx, by], [cx, cy]] = [tested.places.accelerometer_b.along, tested.places.accelerometer_c.along];
                [bx, by, cx, cy].map(|dof| dof.map(|dof| tested.dof_name(dof)))
            }),
            recording: self.file.display().to_string(),
            samples: record.samples(),
            duration_s: record.samples() as f64 / record.rate_hz(),
            direction: record.direction(),
            from_hz: band.from_hz,
            to_hz: band.to_hz,
            modes: numbered.map(|(mode, found)| NumberedMode { mode, found }).collect(),
            missing,
            averaging: match averaging {
                Averaging::Welch(_) => "welch",
                Averaging::Periods(_) => "periods",
                Averaging::Single => "single",
            },
            averages: estimate.averages,
            responses: curves(&estimate),
            frequency_hz: estimate.frequency_hz,
        })
    }

    /// Returns the averaging of the flags, or the one that suits the excitation.
    fn averaging(&self, waveform: Option<&Waveform>, record: &Record) -> Result<Averaging, Failure> {
        match self.segment_s {
            None => Ok(averaging(waveform, record)),
            Some(segment_s) if segment_s > 0.0 => Ok(Averaging::Welch(samples_in(segment_s, record))),
            Some(_) => Err(flags::refused("--segment-s", &"it must be positive")),
        }
    }
}

fn curves(estimate: &FrequencyResponseEstimate) -> Vec<ResponseCurve> {
    let curve = |(i, response): (usize, &'static str)| ResponseCurve {
        response,
        unit: UNIT,
        h1: estimate.h1[i].iter().map(|z| [z.re, z.im]).collect(),
        h2: estimate.h2[i].iter().map(|z| [z.re, z.im]).collect(),
        coherence: estimate.coherence.as_ref().map(|coherence| coherence[i].clone()),
    };
    RESPONSES.into_iter().enumerate().map(curve).collect()
}

impl Document {
    fn text(&self) -> String {
        let [x, y] = self.direction.map(to_three_places);
        let mut text = format!(
            "{}: {:.3} s, force along ({x:.3}, {y:.3}), {} to {} Hz; {} averages\n\n",
            self.recording,
            self.duration_s,
            short(&self.from_hz),
            short(&self.to_hz),
            self.averages
        );
        text +=
            "  mode   pole frequency |λ|/2π (Hz)   damping ratio       residual/noise   shape: B x, B y, C x, C y\n";
        for NumberedMode { mode: number, found: mode } in &self.modes {
            let number = number.map_or(String::from("–"), |number| number.to_string());
            let [bx, by, cx, cy] = mode.shape.map(to_three_places);
            text += &format!(
                "  {number:>4}   {:17.6} ± {:.0e}   {:.3e} ± {:.0e}   {:14.2}   {bx:+.3} {by:+.3} {cx:+.3} {cy:+.3}\n",
                mode.pole_frequency_hz,
                mode.pole_frequency_deviation_hz,
                mode.pole_damping_ratio,
                mode.pole_damping_ratio_deviation,
                mode.residual
            );
        }
        text
    }

    /// Returns the CSV: frequency, then modulus and phase of H1 and of H2 and the coherence of each response.
    fn csv(&self) -> String {
        let mut text = String::from("frequency_hz");
        for ResponseCurve { response, coherence, .. } in &self.responses {
            let name = response.replace('-', "_");
            for estimate in ["h1", "h2"] {
                text += &format!(",{name}_{estimate}_modulus_m_s2_per_n,{name}_{estimate}_phase_deg");
            }
            text += &coherence.as_ref().map_or(String::new(), |_| format!(",{name}_coherence"));
        }
        text.push('\n');
        for (k, hz) in self.frequency_hz.iter().enumerate() {
            text += &format!("{hz}");
            for ResponseCurve { h1, h2, coherence, .. } in &self.responses {
                for [re, im] in [h1[k], h2[k]] {
                    text += &format!(",{:e},{}", libm::hypot(re, im), libm::atan2(im, re).to_degrees());
                }
                text += &coherence.as_ref().map_or(String::new(), |coherence| format!(",{}", coherence[k]));
            }
            text.push('\n');
        }
        text
    }
}

/// Rounds to three decimal places, and never to −0.
fn to_three_places(value: f64) -> f64 {
    // In IEEE 754, −0 + 0 is +0. Any other number is unchanged.
    libm::rint(value * 1e3) / 1e3 + 0.0
}

/// The least coherence at which phases are drawn: below it they are those of the noise.
const LEAST_COHERENCE: f64 = 0.5;

/// Draws a row for each response: modulus and phase of H1, and the coherence, if there is one. The responses of the
/// identified modes are drawn over them. All moduli have one axis.
fn figure(scenario: &Scenario, tested: Option<&TestedAssembly>, document: &Document) -> Figure {
    let sizes = |curve: &ResponseCurve| curve.h1.iter().map(|[re, im]| libm::hypot(*re, *im)).collect::<Vec<f64>>();
    let read: Vec<&ResponseCurve> =
        document.responses.iter().filter(|curve| sizes(curve).iter().any(|size| *size > 0.0)).collect();
    let all = || read.iter().flat_map(|curve| sizes(curve)).filter(|size| *size > 0.0);
    // A factor of two beyond the values at both ends of the logarithmic axis, the same for all rows, so that they can
    // be compared by eye.
    let range = [all().fold(f64::INFINITY, f64::min) / 2.0, all().fold(0.0, f64::max) * 2.0];
    let has_coherence = read.iter().any(|curve| curve.coherence.is_some());
    let mut figure = Figure::new("Frequency response from readings");
    figure.columns = if has_coherence { 3 } else { 2 };
    for (row, curve) in read.iter().enumerate() {
        let identified = tested.and_then(|tested| Identified::new(tested, document, row_of(document, curve)));
        for panel in panels(document, curve, identified.as_ref(), range) {
            // One legend, for all.
            let is_first = figure.panels.is_empty() && row == 0;
            figure = figure.with(panel.legend(if is_first { Legend::Bottom } else { Legend::None }));
        }
    }
    match (tested, scenario.foreign_structure()) {
        (Some(tested), _) => figure.subtitle(captions::structure(scenario, tested, &[])),
        (None, Some(section)) => figure.subtitle(captions::foreign_label(section)),
        (None, None) => figure,
    }
}

/// Returns the number of a response among all.
fn row_of(document: &Document, curve: &ResponseCurve) -> usize {
    document.responses.iter().position(|other| other.response == curve.response).unwrap_or_default()
}

/// Draws the panels of a response, from left to right.
fn panels(
    document: &Document,
    curve: &ResponseCurve,
    identified: Option<&Identified>,
    [low, high]: [f64; 2],
) -> Vec<Panel> {
    // The axis covers all frequencies, also where phases are left out.
    let [first, last] = [document.frequency_hz.first(), document.frequency_hz.last()];
    let ends = first.zip(last).filter(|(first, last)| first < last);
    let x = || ends.map_or(Axis::linear("frequency (Hz)"), |(a, b)| Axis::linear("frequency (Hz)").range(*a, *b));
    let points = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        document.frequency_hz.iter().enumerate().map(|(k, hz)| (*hz, value(k))).collect()
    };
    // A zero has no logarithm: it is left out.
    let size = |[re, im]: [f64; 2]| Some(libm::hypot(re, im)).filter(|size| *size > 0.0).unwrap_or(f64::NAN);
    let angle = |[re, im]: [f64; 2]| libm::atan2(im, re).to_degrees();
    let is_noise = |k: usize| curve.coherence.as_ref().is_some_and(|coherence| coherence[k] < LEAST_COHERENCE);
    let measured = |points| Series::line("measured", Color::Blue, points);
    let fitted = Style::Line { color: Color::Vermillion, width: 1.6, dash: Dash::Dashed };
    let mut modulus =
        Panel::new(x(), Axis::log(format!("H₁ ({UNIT})")).range(low, high)).title(TITLES[row_of(document, curve)]);
    modulus = modulus.with(measured(points(&|k| size(curve.h1[k]))));
    let is_known = |k: usize| !size(curve.h1[k]).is_nan();
    // A response of nothing but noise keeps its phases.
    let is_all_noise = !(0..document.frequency_hz.len()).any(|k| is_known(k) && !is_noise(k));
    // Below the least coherence the phase is random and would fill the panel from edge to edge.
    let is_drawn = |k: usize| is_known(k) && (is_all_noise || !is_noise(k));
    let phases = points(&|k| if is_drawn(k) { angle(curve.h1[k]) } else { f64::NAN });
    let mut phase =
        Panel::new(x(), Axis::degrees("phase (°)").range(-190.0, 190.0)).with(measured(broken_at_wraps(phases)));
    if let Some(identified) = identified {
        let at = |k: usize| identified.at(document.frequency_hz[k]);
        let line = |points| Series::line("identified modes", Color::Vermillion, points).style(fitted);
        modulus = modulus.with(line(points(&|k| size(at(k)))));
        phase = phase.with(line(broken_at_wraps(points(&|k| angle(at(k))))));
    }
    let coherence = curve.coherence.as_ref().map(|values| {
        Panel::new(x(), Axis::linear("coherence").range(0.0, 1.05)).with(measured(points(&|k| values[k])))
    });
    [Some(modulus), Some(phase), coherence].into_iter().flatten().collect()
}

/// The response of the identified modes at one accelerometer axis, to the force at C.
struct Identified {
    modes: Vec<IdentifiedPart>,
}

/// The part of a mode in a response: −ω² `residue` / (ω_r² − ω² + 2iζω_r ω).
struct IdentifiedPart {
    /// Frequency ω_r of the pole, rad/s.
    rate: f64,
    damping_ratio: f64,
    residue: f64,
}

impl Identified {
    /// Returns the response of the identified modes; `None` if no accelerometer is where the force acts, which the
    /// shapes must show, or if a mode has no shape with its mass.
    fn new(tested: &TestedAssembly, document: &Document, channel: usize) -> Option<Identified> {
        let Places { exciter, accelerometer_b, accelerometer_c, .. } = &tested.places;
        // The mode must be known at the driven point, where an accelerometer is only if it shares its place with the
        // exciter. The numbers are its first channel in `RESPONSES`.
        let driven = [(accelerometer_c, 2), (accelerometer_b, 0)].into_iter().find(|(placed, _)| *placed == exciter);
        let (_, first) = driven.filter(|_| !document.modes.is_empty())?;
        let [dx, dy] = document.direction;
        let part = |mode: &NumberedMode| {
            let shape = mode.found.shape_per_sqrt_kg?;
            Some(IdentifiedPart {
                rate: core::f64::consts::TAU * mode.found.pole_frequency_hz,
                damping_ratio: mode.found.pole_damping_ratio,
                // Shapes φ are of unit modal mass. A unit force along d excites the mode by d·φ at the driven point,
                // and the channel reads the modal acceleration times its own φ.
                residue: shape.get(channel)? * (dx * shape[first] + dy * shape[first + 1]),
            })
        };
        Some(Identified { modes: document.modes.iter().map(part).collect::<Option<_>>()? })
    }

    /// Returns the acceleration over the force at a frequency, complex.
    fn at(&self, hz: f64) -> [f64; 2] {
        let w = core::f64::consts::TAU * hz;
        self.modes.iter().fold([0.0, 0.0], |[re, im], &IdentifiedPart { rate, damping_ratio, residue }| {
            // Each part is −ω²R/(a + ib) = −ω²R(a − ib)/(a² + b²), with a = ω_r² − ω² and b = 2ζω_rω.
            let (a, b) = (rate * rate - w * w, 2.0 * damping_ratio * rate * w);
            let scale = -w * w * residue / (a * a + b * b);
            [re + scale * a, im - scale * b]
        })
    }
}
