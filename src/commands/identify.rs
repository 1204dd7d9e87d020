//! `resonarm identify`: modes and frequency responses from the readings in a recording.

use core::fmt::Write;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::Value;

use crate::commands::frf::{broken_at_wraps, style};
use crate::commands::identify_angles::{self, Domain, Request};
use crate::commands::identify_missing::{self, MissingMode};
use crate::commands::inspect;
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags;
use crate::output::{self, OverwriteFlag};
use resonarm::analysis::{self, Response};
use resonarm::excitation::Waveform;
use resonarm::identify::{
    self, Averaging, Band, CHANNELS, Direction, FrequencyResponseEstimate, Identification, IdentifiedMode,
    IdentifyError, Record,
};
use resonarm::recording::Recording;
use resonarm::scenario::{READS_IMAGES, Scenario};
use resonarm_figures::plot::{Axis, Color, Figure, Legend, Panel, Series};
use resonarm_numeric::number::short;

/// Natural frequencies, damping ratios and frequency responses from the readings in a recording: accelerations of B and
/// C over the force in the impedance head.
///
/// The model of the modes includes the ends of the record, so the record may be shorter than their decay; each number
/// has its standard deviation. The arm must be driven by a force at C. Periods of a multisine or of bursts, and
/// segments of other records (Welch's method: a Hann window, half overlapping), are averaged to H1, H2 and coherence;
/// an impact is taken whole. The document of --json and the CSV of --plot have all three of each response, the figure
/// H1 and the coherence. Modes are numbered as in the scenario's arm; one that is not found is listed with the reason.
/// If no mode is found the exit code is 1.
///
/// With --angles, for a run with any load, it gives the joints' angles over time instead: the accelerations are
/// integrated twice, and the displacements are converted to angles with the arm's lengths and pose in the recording.
/// Vibration at f has the gain 1 − (1 + (f/f0)⁴)⁻³ with the corner f0 of --from-hz. Accelerometers can't measure means,
/// so these are zero. Each angle has the standard deviation due to the instruments' white noise. Four periods of the
/// corner are left out at both ends, except at a start from rest. Clipped readings are refused. The droop of the
/// converters is corrected. Times are those of the readings, earlier than their samples by the converters' delay.
#[derive(Debug, Args)]
pub(crate) struct Identify {
    /// The recording, an MCAP file.
    file: PathBuf,
    /// Lowest frequency, Hz [default: that of the recorded excitation, or 1; with --angles a quarter of the arm's
    /// lowest natural frequency].
    #[arg(long, value_name = "F")]
    from_hz: Option<f64>,
    /// Highest frequency, Hz [default: that of the recorded excitation; of an impact 1 over its length; or 100].
    #[arg(long, value_name = "F")]
    to_hz: Option<f64>,
    /// Direction of the input force.
    #[arg(long, value_enum, default_value_t = Input::Principal)]
    input: Input,
    /// Average segments of this length, s [default: whole periods, or an eighth of the record].
    #[arg(long, value_name = "S")]
    segment_s: Option<f64>,
    /// Plot the responses to STEM.svg and STEM.png; caption, CSV and JSON beside them.
    #[arg(long, value_name = "STEM")]
    plot: Option<PathBuf>,
    /// Write the angles α1 and α2 over time, rad, and their standard deviations to a CSV file.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["to_hz", "input", "segment_s", "plot"])]
    angles: Option<PathBuf>,
    /// Domain in which accelerations are integrated twice [default: frequency].
    #[arg(long, value_name = "DOMAIN", value_enum, requires = "angles")]
    integration: Option<Domain>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// Directions by their names.
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

/// The channels, in the order of [`Record`].
const RESPONSES: [Response; CHANNELS] = [Response::BX, Response::BY, Response::CX, Response::CY];
const UNIT: &str = "m/s² per N";
/// Number of averaged segments of a record without periods.
const SEGMENTS: usize = 8;
/// Highest frequency if nothing else gives one, as a fraction of the sample rate and in Hz.
const HIGHEST_PART: f64 = 0.4;
const HIGHEST_HZ: f64 = 100.0;

#[derive(Serialize)]
struct Document {
    /// The recorded arm and its pose, to compare the modes with.
    configuration: Value,
    recording: String,
    samples: usize,
    duration_s: f64,
    /// Unit vector of the force that is the input.
    direction: [f64; 2],
    from_hz: f64,
    to_hz: f64,
    modes: Vec<NumberedMode>,
    /// Modes of the scenario's arm in the band that were not found.
    missing: Vec<MissingMode>,
    averaging: &'static str,
    averages: usize,
    frequency_hz: Vec<f64>,
    responses: Vec<ResponseCurve>,
}

/// A mode with its number in the scenario's arm; none if it is far from the arm's modes.
#[derive(Serialize)]
struct NumberedMode {
    mode: Option<u8>,
    #[serde(flatten)]
    found: IdentifiedMode,
}

/// A response over all frequencies, complex as [real, imaginary].
#[derive(Serialize)]
struct ResponseCurve {
    response: Response,
    unit: &'static str,
    h1: Vec<[f64; 2]>,
    h2: Vec<[f64; 2]>,
    coherence: Option<Vec<f64>>,
}

impl Identify {
    /// The domain in which accelerations are integrated.
    pub(crate) fn domain(&self) -> Domain {
        self.integration.unwrap_or(Domain::Frequency)
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.overwrite.check_stem(self.plot.as_deref(), output::PLOTTED)?;
        self.overwrite.check(self.angles.clone())?;
        let recording = Recording::open(&self.file)?;
        if let Some(note) = inspect::integrity_note(recording.integrity()) {
            tracing::warn!("{note}");
        }
        let scenario = Scenario::from_configuration(recording.configuration())?;
        if let Some(csv) = &self.angles {
            let domain = self.domain();
            let request = Request { csv, domain, from_hz: self.from_hz, json: self.json };
            return identify_angles::execute(&recording, &scenario, &request);
        }
        let document = self.compute(&recording, &scenario)?;
        for NumberedMode { found, .. } in document.modes.iter().filter(|mode| !mode.found.is_linear) {
            tracing::warn!(
                "{:.3} Hz: the fit leaves {:.1} times the instruments' noise, so the arm did not vibrate linearly: lower the force",
                found.frequency_hz,
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
        let files = match &self.plot {
            Some(stem) => Some(output::plot(stem, &figure(&scenario, &document), &document.csv(), &document)?),
            None => None,
        };
        if self.json {
            output::print_json(&document)?;
        } else {
            output::print(&document.text())?;
            files.map_or(Ok(()), |files| output::print_written(&files))?;
        }
        Ok(Verdict::of(!document.modes.is_empty()))
    }

    fn compute(&self, recording: &Recording, scenario: &Scenario) -> Result<Document, Failure> {
        let rate_hz = 1.0 / recording.origin().dt_s;
        let record = read(recording, scenario, rate_hz, self.input.direction())?;
        let waveform = scenario.excitation.as_ref().map(|excitation| &excitation.profile);
        let band = self.band(waveform, rate_hz);
        let averaging = self.averaging(waveform, &record)?;
        let estimate = identify::frequency_response(&record, band, averaging)?;
        let found = match identify::modes(&record, band) {
            Ok(found) => found,
            Err(IdentifyError::NoResonance { .. }) => Identification { modes: Vec::new(), rejected: Vec::new() },
            Err(error) => return Err(error.into()),
        };
        let arm = analysis::modes(&scenario.build_arm()?);
        let numbers = identify_missing::numbers(&found.modes, &arm);
        let missing = identify_missing::missing(&found, &numbers, &arm, band);
        let numbered = numbers.into_iter().zip(found.modes);
        Ok(Document {
            configuration: configuration::of_arm(scenario)?,
            recording: self.file.display().to_string(),
            samples: record.samples(),
            duration_s: record.samples() as f64 / rate_hz,
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

    /// The band of the flags, or that of the excitation.
    fn band(&self, waveform: Option<&Waveform>, rate_hz: f64) -> Band {
        let highest_hz = HIGHEST_PART * rate_hz;
        let (from_hz, to_hz) = match waveform {
            Some(
                Waveform::SteppedSine { from_hz, to_hz, .. }
                | Waveform::SweptSine { from_hz, to_hz, .. }
                | Waveform::Random { from_hz, to_hz, .. }
                | Waveform::BurstRandom { from_hz, to_hz, .. }
                | Waveform::Multisine { from_hz, to_hz, .. },
            ) => (from_hz.min(*to_hz), from_hz.max(*to_hz)),
            Some(Waveform::SineList { frequencies_hz, .. }) => {
                let ends = |(low, high): (f64, f64), hz: &f64| (low.min(*hz), high.max(*hz));
                frequencies_hz.iter().fold((f64::INFINITY, 0.0), ends)
            }
            Some(Waveform::Impulse { pulse_s, .. }) => (1.0, highest_hz.min(1.0 / pulse_s)),
            Some(Waveform::Dwell { .. } | Waveform::File { .. }) | None => (1.0, highest_hz.min(HIGHEST_HZ)),
        };
        Band { from_hz: self.from_hz.unwrap_or(from_hz), to_hz: self.to_hz.unwrap_or(to_hz) }
    }

    /// The averaging that suits the excitation; by segments if their length was given.
    fn averaging(&self, waveform: Option<&Waveform>, record: &Record) -> Result<Averaging, Failure> {
        let samples = |length_s: f64| libm::round(length_s * record.rate_hz()) as usize;
        if let Some(segment_s) = self.segment_s {
            let averaging = Averaging::Welch(samples(segment_s));
            return if segment_s > 0.0 {
                Ok(averaging)
            } else {
                Err(flags::refused("--segment-s", &"it must be positive"))
            };
        }
        Ok(match waveform {
            Some(Waveform::Impulse { .. }) => Averaging::Single,
            Some(Waveform::Multisine { period_s, .. } | Waveform::BurstRandom { period_s, .. }) => {
                Averaging::Periods(samples(*period_s))
            }
            _ => Averaging::Welch(record.samples() / SEGMENTS),
        })
    }
}

/// The readings of a recording. Those of sample 0 are left out: they only show the initial state.
fn read(recording: &Recording, scenario: &Scenario, rate_hz: f64, input: Direction) -> Result<Record, Failure> {
    let (mut rows, mut clipped) = (Vec::new(), 0);
    for sample in recording.samples()? {
        let sample = sample?;
        clipped += usize::from(sample.clipped.any());
        let ([bx, by], [cx, cy]) = (sample.acceleration_b_m_s2, sample.acceleration_c_m_s2);
        if sample.sample > 0 {
            rows.push((sample.head_force_n, [bx, by, cx, cy]));
        }
    }
    if clipped > 0 {
        return Err(IdentifyError::Clipped { samples: clipped }.into());
    }
    Ok(Record::new(rate_hz, &scenario.rig, rows, input)?)
}

fn curves(estimate: &FrequencyResponseEstimate) -> Vec<ResponseCurve> {
    let curve = |(i, response): (usize, Response)| ResponseCurve {
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
        text += "  mode   undamped frequency (Hz)   damping ratio       residual/noise   shape: B x, B y, C x, C y\n";
        for NumberedMode { mode: number, found: mode } in &self.modes {
            let number = number.map_or(String::from("–"), |number| number.to_string());
            let [bx, by, cx, cy] = mode.shape.map(to_three_places);
            let _infallible = writeln!(
                text,
                "  {number:>4}   {:14.6} ± {:.0e}   {:.3e} ± {:.0e}   {:14.2}   {bx:+.3} {by:+.3} {cx:+.3} {cy:+.3}",
                mode.frequency_hz,
                mode.frequency_deviation_hz,
                mode.damping_ratio,
                mode.damping_ratio_deviation,
                mode.residual
            );
        }
        text
    }

    /// CSV: frequency, then modulus and phase of H1 and of H2 and the coherence of each response.
    fn csv(&self) -> String {
        let mut text = String::from("frequency_hz");
        for ResponseCurve { response, coherence, .. } in &self.responses {
            let name = response.name().replace('-', "_");
            for estimate in ["h1", "h2"] {
                let _infallible = write!(text, ",{name}_{estimate}_modulus_m_s2_per_n,{name}_{estimate}_phase_deg");
            }
            text += &coherence.as_ref().map_or(String::new(), |_| format!(",{name}_coherence"));
        }
        text.push('\n');
        for (k, hz) in self.frequency_hz.iter().enumerate() {
            let _infallible = write!(text, "{hz}");
            for ResponseCurve { h1, h2, coherence, .. } in &self.responses {
                for [re, im] in [h1[k], h2[k]] {
                    let _infallible = write!(text, ",{:e},{}", libm::hypot(re, im), libm::atan2(im, re).to_degrees());
                }
                text += &coherence.as_ref().map_or(String::new(), |coherence| format!(",{}", coherence[k]));
            }
            text.push('\n');
        }
        text
    }
}

/// Rounded to three decimal places, and never −0.
fn to_three_places(value: f64) -> f64 {
    libm::rint(value * 1e3) / 1e3 + 0.0
}

/// Moduli and phases of H1, and the coherences, if there are any.
fn figure(scenario: &Scenario, document: &Document) -> Figure {
    let x = || Axis::linear("frequency (Hz)");
    let mut modulus = Panel::new(x(), Axis::log(format!("H₁ ({UNIT})")));
    let mut phase = Panel::new(x(), Axis::degrees("phase (°)")).legend(Legend::None);
    let mut coherence = Panel::new(x(), Axis::linear("coherence").range(0.0, 1.0)).legend(Legend::None);
    for curve in &document.responses {
        let line = |points| Series::line(curve.response.symbol(), Color::Black, points).style(style(curve.response));
        let points = |value: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
            document.frequency_hz.iter().enumerate().map(|(k, hz)| (*hz, value(k))).collect()
        };
        // A zero has no logarithm: it is left out.
        let size = |k: usize| {
            let [re, im] = curve.h1[k];
            Some(libm::hypot(re, im)).filter(|size| *size > 0.0).unwrap_or(f64::NAN)
        };
        let angle = |k: usize| if size(k).is_nan() { f64::NAN } else { libm::atan2(curve.h1[k][1], curve.h1[k][0]) };
        modulus.series.push(line(points(&size)));
        phase.series.push(line(broken_at_wraps(points(&|k| angle(k).to_degrees()))));
        if let Some(values) = &curve.coherence {
            coherence.series.push(line(points(&|k| values[k])));
        }
    }
    let panels = [modulus, phase, coherence].into_iter().filter(|panel| !panel.series.is_empty());
    let figure = Figure::new("Frequency response from readings").subtitle(captions::pose(&scenario.arm));
    panels.fold(figure, Figure::with)
}
