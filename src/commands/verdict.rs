//! `resonarm verdict`: whether a recording meets a specification.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::plot::table;
use super::spec::figure_of;
use super::verdict_words::{Undecided, begins_text, db, level_measured, percent};
use crate::commands::verdict_report;
use crate::failure::Failure;
use crate::help::heading;
use crate::output::{self, Inputs, JsonFlag, OverwriteFlag, map};
use crate::recordings::{self, TimeRange};
use crate::specifications::{self, level_curve, level_label, level_panel, pulse_panel};
use resonarm::judge::{Document, Droop, Found, JudgeOptions, Judged, judge};
use resonarm::specification::Test;
use resonarm::specification::verdict::{
    LimitVerdict, RandomVerdict, ShockVerdict, SinePoint, SineVerdict, SrsLine, SrsVerdict,
};
use resonarm_figures::plot::{Color, Figure, Marker, Series};
use resonarm_numeric::number::{rounded, short};

// The verdict on a record; that of a command is another type.
use resonarm::specification::verdict::Verdict as RecordVerdict;

const EXAMPLES: &str = "\
Examples:
  resonarm verdict spec.toml run.mcap
  resonarm verdict navmat-p-9492 run.mcap --channels c.x --plot verdict
  resonarm verdict sweep.toml run.mcap --channels c.x --reference head_force_x_n
  resonarm verdict spec.toml run.mcap --junit verdict.xml --report verdict.html
  resonarm verdict spec.toml run.mcap --from-s 50 --undecided pass --json

Exit codes: 0 in, 1 out or, unless --undecided pass is given, undecided; always 1 if no test begins in the record. docs/specifications.md describes how each kind of test \
is judged.";

/// Judges whether a recording meets a specification: in, out or undecided.
///
/// Every line and every instant has an interval of 95 % confidence: it is in if the whole interval is within the tolerance, and
/// out if the interval is beyond it. The record is out only if it proves that the tolerance is exceeded, with a probability of
/// error of 1 % for the whole, and in if all is in. Else it is undecided, and the degrees of freedom that would decide it are
/// stated.
///
/// A random test is judged over the longest stretch at full level, unless --from-s or --to-s is given; a sine from its first whole
/// sweep on and a shock from its first shot on, unless --from-s is given. What a controller plays before is left out. The
/// readings are judged, with the droop of their converters.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Verdict {
    /// Specification, a TOML file, or the name of a preset.
    spec: PathBuf,
    /// Recording, an MCAP file.
    file: PathBuf,
    /// Control channels, as c.x or acceleration_c_x_m_s2 [default: those of the specification].
    #[arg(long, help_heading = heading::RECORDS, value_name = "NAMES", value_delimiter = ',')]
    channels: Vec<String>,
    /// Drive or measured force, which gives the phase of a sine [default: the control channel itself].
    #[arg(long, help_heading = heading::RECORDS, value_name = "NAME")]
    reference: Option<String>,
    #[command(flatten)]
    range: TimeRange,
    /// Whether a record that does not decide passes, with exit code 0, or fails, with 1. A record in which no test begins fails.
    #[arg(long, help_heading = heading::TEST, value_name = "WHICH", value_enum, default_value_t = Undecided::Fail)]
    undecided: Undecided,
    /// Plot to STEM.svg and STEM.png, with caption, CSV and JSON.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "STEM")]
    plot: Option<PathBuf>,
    /// Also write the parts of the verdict as JUnit XML to this file.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Also write a report with the figure to this file, one HTML page that loads nothing.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
}

impl Verdict {
    pub fn execute(&self) -> Result<crate::failure::Verdict, Failure> {
        let inputs = Inputs::of(specifications::files(&self.spec).into_iter().chain([self.file.clone()]));
        self.overwrite.check_stem(self.plot.as_deref(), output::PLOTTED, &inputs)?;
        self.overwrite.check(self.junit.iter().chain(&self.report).cloned(), &inputs)?;
        let specification = specifications::read(&self.spec)?;
        let recording = recordings::open(&self.file)?;
        let TimeRange { from_s, to_s } = self.range;
        let options = JudgeOptions {
            channels: self.channels.clone(),
            reference: self.reference.clone(),
            range_s: [from_s, to_s],
        };
        let judged = judge(&specification, &recording, &options)
            .map_err(|error| Failure::usage(format!("{}: {error}", self.file.display())))?;
        if judged.clipped > 0 {
            let clipped = judged.clipped;
            tracing::warn!("{clipped} values of the channels are clipped: the record can't show that the test is in");
        }
        let is_level_missing = judged.level.as_ref().is_some_and(|level| level.longest.is_none());
        if is_level_missing {
            tracing::warn!("the record has no stretch within 2 dB of the specified rms: all of it is judged");
        }
        let names = map(json!({
            "specification": self.spec, "recording": self.file, "reference": self.reference, "undecided": self.undecided,
        }));
        let document = Document::new(names, &specification, &recording, &judged);
        let drawn = || self.figure(&document, &judged);
        let mut files = output::plot(self.plot.as_deref(), &document, drawn)?;
        if let Some(path) = &self.junit {
            files.push(output::write(path.clone(), &verdict_report::junit(&document, self.undecided))?);
        }
        if let Some(path) = &self.report {
            let title = specifications::title(&specification, &self.spec);
            let (figure, _) = self.figure(&document, &judged);
            let report = verdict_report::report(&document, &title, &self.judged_text(&judged), &figure)?;
            files.push(output::write(path.clone(), &report)?);
        }
        self.json.show(&document, || self.text(&document, &judged), &files)?;
        let passes = judged.passes(self.undecided == Undecided::Pass);
        Ok(crate::failure::Verdict::of(passes).and(recordings::verdict(&recording)))
    }

    /// Says what of which recording was judged.
    fn judged_text(&self, judged: &Judged) -> String {
        let is_full = judged.level.as_ref().is_some_and(|level| level.longest.is_some());
        let level = if is_full { ", at full level" } else { "" };
        let [from_s, to_s] = judged.range_s;
        let file = self.file.display();
        let channels = judged.channels.join(", ");
        format!("{file}: {channels} from {} to {} s{level}", rounded(&from_s, 3), rounded(&to_s, 3))
    }

    fn text(&self, document: &Document<'_>, judged: &Judged) -> String {
        let title = specifications::title(document.specification, &self.spec);
        let mut text = format!("{title} ({})\n{}\n", document.specification.test.kind(), self.judged_text(judged));
        if let Some(level) = &judged.level {
            text += &format!("level: {}; {}\n", level.verdict.name(), level_measured(level));
        }
        text += &format!("{}\n", begins_text(document));
        text += &match document.found {
            Found::Random(found) => random_text(found),
            Found::Sine(found) => sine_text(found),
            Found::Shock(found) => shock_text(found),
            Found::Srs(found) => srs_text(found),
            Found::NotBegun(_) => String::new(),
        };
        if document.clipped > 0 {
            text += &format!("clipped: {} values\n", document.clipped);
        }
        // A smaller droop would be stated as 0 dB.
        if let Some(Droop { frequency_hz, gain_db }) = document.converters.filter(|droop| droop.gain_db < -0.01) {
            let hz = figure_of(frequency_hz);
            text += &format!("converters: the readings are {} at {hz} Hz, the acceleration is higher\n", db(gain_db));
        }
        let is_missing = document.verdict == RecordVerdict::Undecided && document.begins_s.is_none();
        let reason = if is_missing { "; no test begins in the record" } else { "" };
        text + &format!("verdict: {}{reason}\n", document.verdict.name())
    }

    fn figure(&self, document: &Document<'_>, judged: &Judged) -> (Figure, String) {
        let title = specifications::title(document.specification, &self.spec);
        let subtitle = format!("{}: {}", self.file.display(), document.verdict.name());
        let figure = Figure::new(title).subtitle(subtitle);
        let test = &document.specification.test;
        let place = |hz: f64, value: f64, verdict: RecordVerdict| ((hz, value), verdict == RecordVerdict::Out);
        let (measured, is_out): (Vec<(f64, f64)>, Vec<bool>) = match document.found {
            Found::Random(found) => {
                found.lines.iter().map(|line| place(line.frequency_hz, line.density, line.verdict)).unzip()
            }
            Found::Sine(found) => {
                found.points.iter().map(|point| place(point.frequency_hz, point.tracked_m_s2, point.verdict)).unzip()
            }
            Found::Srs(found) => {
                let line = |line: &SrsLine| place(line.frequency_hz, line.response_m_s2, line.verdict);
                let full = found.shots.iter().filter(|shot| shot.is_full);
                full.flat_map(|shot| shot.lines.iter().map(line).chain([GAP])).unzip()
            }
            Found::Shock(found) => return shock_figure(figure, test, found, judged),
            Found::NotBegun(_) => (Vec::new(), Vec::new()),
        };
        let columns = [
            ("frequency_hz", measured.iter().map(|(hz, _)| *hz).collect::<Vec<_>>()),
            ("measured", measured.iter().map(|(_, value)| *value).collect()),
            // A table holds numbers alone: 1 is out.
            ("is_out", is_out.iter().map(|is_out| f64::from(u8::from(*is_out))).collect()),
        ];
        let Some(curve) = level_curve(test) else { return (figure, table(&columns)) };
        let out: Vec<(f64, f64)> =
            measured.iter().zip(&is_out).filter(|(_, out)| **out).map(|(point, _)| *point).collect();
        let panel = level_panel(&curve, level_label(test))
            .with(Series::line("measured", Color::Blue, measured))
            .with_any(Series::markers("out", Color::Vermillion, Marker::Cross, out));
        (figure.with(panel), table(&columns))
    }
}

/// Point that breaks a line.
const GAP: ((f64, f64), bool) = ((f64::NAN, f64::NAN), false);

fn random_text(found: &RandomVerdict) -> String {
    let [inside, undecided, out] = found.counts;
    let freedom = rounded(&found.degrees_of_freedom, 0);
    let mut text = format!(
        "profile: {}; of {} lines {inside} are in, {undecided} undecided, {out} out, by {freedom} degrees of freedom\n",
        found.profile.name(),
        found.lines.len()
    );
    if found.profile == RecordVerdict::Out {
        let lines: Vec<String> = found.proven_hz.iter().take(10).map(|hz| short(hz).to_string()).collect();
        let more = if found.proven_hz.len() > lines.len() { ", …" } else { "" };
        text += &format!(
            "  proven out for the whole: {} lines{}{}{more}, and {} means of adjacent lines\n",
            found.proven_hz.len(),
            if lines.is_empty() { "" } else { " at Hz " },
            lines.join(", "),
            found.proven_means
        );
    }
    if let Some(deciding) = found.deciding_dof {
        text += &format!("  about {} degrees of freedom would decide it\n", rounded(&deciding, 0));
    } else if found.profile == RecordVerdict::Undecided {
        text += "  more degrees of freedom won't decide it: the deviation itself is at the tolerance\n";
    }
    let [low, high] = found.deviation_db;
    text += &format!("lines: {} to {}\n", db(low), db(high));
    let rms = &found.rms;
    let [low, high] = rms.interval.map(|ratio| db(20.0 * libm::log10(ratio)));
    text += &format!(
        "rms: {}{} m/s², specified {} m/s² between the edges; with 95 % probability {low} to {high}\n",
        rms.verdict.map_or(String::new(), |verdict| format!("{}; ", verdict.name())),
        figure_of(rms.rms_m_s2),
        figure_of(rms.demand_m_s2)
    );
    text += &limits_text(&found.limits);
    for (beyond, name) in found.beyond.iter().zip(["alarm", "abort"]) {
        if let Some(lines) = beyond {
            text += &format!("lines beyond the {name}: {lines}\n");
        }
    }
    if found.is_too_short {
        text += "the record has fewer degrees of freedom than the specification asks for\n";
    }
    text + &format!(
        "control: {} lines beyond {} dB; a perfect controller has as many with probability {}\n",
        found.counted,
        short(&found.counted_beyond_db),
        figure_of(found.perfect_probability)
    )
}

fn limits_text(limits: &[LimitVerdict]) -> String {
    let line = |limit: &LimitVerdict| {
        let channel = &limit.channel;
        let at = rounded(&limit.largest_hz, 3);
        format!("limit of {channel}: {}; largest {} at {at} Hz\n", limit.verdict.name(), db(limit.largest_db))
    };
    limits.iter().map(line).collect()
}

fn sine_text(found: &SineVerdict) -> String {
    let beyond = |ratio: f64| format!("{:+.1} %", 100.0 * (ratio - 1.0));
    let [inside, undecided, out] = found.shares.map(percent);
    let [low, high] = found.extremes.map(beyond);
    let [low_hz, high_hz] = found.extremes_hz.map(figure_of);
    let mut text = format!(
        "amplitude: {}; in for {inside} of the time, undecided for {undecided}, out for {out}\n  lowest {low} at {low_hz} Hz, \
         highest {high} at {high_hz} Hz\n",
        found.amplitude.name()
    );
    type Reading = fn(&SinePoint) -> f64;
    let readings: [(&str, Reading); 3] = [
        ("fundamental", |point| point.tracked_m_s2),
        ("√2 rms", |point| point.rms_m_s2),
        ("peak", |point| point.peak_m_s2),
    ];
    for (name, reading) in readings {
        let mut ratios: Vec<f64> = found.points.iter().map(|point| reading(point) / point.demand_m_s2).collect();
        ratios.sort_by(f64::total_cmp);
        if let (Some(low), Some(median), Some(high)) = (ratios.first(), ratios.get(ratios.len() / 2), ratios.last()) {
            text += &format!("  {name}: {} to {}, median {}\n", beyond(*low), beyond(*high), beyond(*median));
        }
    }
    text += &format!("whole sweeps: {} of {}\n", found.whole, found.asked);
    for pass in &found.passes {
        let still = pass.still.map_or(String::new(), |still| format!(", still for {} of it", percent(still)));
        let [from, to, rate] = [pass.from_hz, pass.to_hz, pass.rate].map(figure_of);
        let octaves = rounded(&pass.departure_octaves, 3);
        text += &format!("sweep from {from} to {to} Hz: rate {rate}, departure at most {octaves} octaves{still}\n");
    }
    if let Some(rate) = found.rate {
        text += &format!("rate: {}\n", rate.name());
    }
    if found.is_continuous == Some(false) {
        text += "the sweep is stepped\n";
    }
    text + &limits_text(&found.limits)
}

fn shock_text(found: &ShockVerdict) -> String {
    let mut text = format!("shots at full level: {} of {}\n", found.full, found.asked);
    for shot in &found.shots {
        let level = 20.0 * libm::log10(shot.amplitude);
        text += &format!("at {} s, {}: ", rounded(&shot.t_s, 4), db(level));
        if !shot.is_full {
            text += "below full level\n";
            continue;
        }
        let verdict = shot.verdict.name();
        let error = percent(shot.error);
        let change = 100.0 * shot.velocity_change;
        text += &format!("{verdict}; error {error} of the peak, velocity change {change:+.1} %");
        if let Some(end) = shot.end_velocity {
            text += &format!(", end velocity {} of it", percent(end));
        }
        if let Some(outside) = shot.outside {
            text += &format!(", outside of the pulse {} of the peak", percent(outside));
        }
        text.push('\n');
    }
    if found.is_first_low == Some(false) {
        text += "the first shot is more than 10 % above its level\n";
    }
    text
}

fn srs_text(found: &SrsVerdict) -> String {
    let mut text = format!("shots at full level: {} of {}\n", found.full, found.asked);
    for shot in &found.shots {
        let [inside, undecided, out] = shot.shares.map(percent);
        let verdict = if shot.is_full { shot.verdict.name() } else { "below full level" };
        text += &format!(
            "at {} s, {}: {verdict}; {inside} of the lines in, {undecided} undecided, {out} out; peak {} m/s²\n",
            rounded(&shot.t_s, 4),
            db(shot.level_db),
            figure_of(shot.peak_m_s2)
        );
    }
    text
}

/// Draws the shots at full level over the pulse with its band.
fn shock_figure(figure: Figure, test: &Test, found: &ShockVerdict, judged: &Judged) -> (Figure, String) {
    let Test::Shock(test) = test else { return (figure, String::new()) };
    let before_s = test.pre_s.unwrap_or(test.duration_s);
    let after_s = test.post_s.unwrap_or(test.duration_s);
    let mut shots = Vec::new();
    let mut columns = [("start_s", Vec::new()), ("time_s", Vec::new()), ("acceleration_m_s2", Vec::new())];
    for shot in found.shots.iter().filter(|shot| shot.is_full) {
        for (k, sample) in judged.reading.iter().enumerate() {
            let t_s = k as f64 / judged.rate_hz - shot.t_s;
            if t_s >= -before_s && t_s <= test.duration_s + after_s {
                shots.push((t_s, *sample));
                for ((_, column), value) in columns.iter_mut().zip([judged.range_s[0] + shot.t_s, t_s, *sample]) {
                    column.push(value);
                }
            }
        }
        shots.push(GAP.0);
    }
    let pulse = |shift: f64| -> Vec<(f64, f64)> {
        // So many points are smooth in a figure.
        let at = |k: u32| test.duration_s * f64::from(k) / 500.0;
        (0..=500).map(|k| (at(k), test.acceleration_m_s2(at(k)) + shift)).collect()
    };
    let half = test.band * test.peak_m_s2;
    let panel =
        pulse_panel([-half, half].map(pulse), pulse(0.0)).with_any(Series::line("measured", Color::Blue, shots));
    (figure.with(panel), table(&columns))
}
