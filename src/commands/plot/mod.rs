//! `resonarm plot`: channels of a recording over time, their spectra and statistics.

mod kinds;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::failure::{Failure, Verdict};
use crate::flags;
use crate::help::heading;
use crate::output::{self, Inputs, PlotFlags, map};
use crate::recordings::{self, TimeRange};
use resonarm::modal::spectra::{Detrend, Segments, Window};
use resonarm::signals::Signals;
use resonarm_figures::plot::{Figure, Panel};
use resonarm_numeric::number::{rounded, short};

const EXAMPLES: &str = "\
Examples:
  resonarm plot run.mcap --of time --channels acceleration_c_m_s2
  resonarm plot run.mcap --of psd --channels acceleration_b_m_s2 --plot psd
  resonarm plot run.mcap --of frf --reference head_force_x_n \\
      --channels acceleration_c_x_m_s2 --plot frf
  resonarm plot shock.mcap --of srs --channels acceleration_b_x_m_s2 --json

psd, spectrogram, frf and coherence average segments of the record as SciPy's welch and csd do with detrend=False: densities \
are one-sided, in unit²/Hz. psd and spectrogram correct readings for the droop of the recording's converters. A resonance whose half-power bandwidth is not several lines wide comes out too low and too wide.
srs is the largest absolute acceleration of oscillators on a base with the acceleration of the channel (Smallwood 1981).";

/// The kinds of figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Kind {
    Time,
    Psd,
    Spectrogram,
    Frf,
    Coherence,
    Xy,
    Histogram,
    Srs,
}

impl Kind {
    /// Returns the name by which the user chooses the kind.
    fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    const fn title(self) -> &'static str {
        match self {
            Kind::Time => "Signals over time",
            Kind::Psd => "Power spectral densities",
            Kind::Spectrogram => "Power spectral densities over time",
            Kind::Frf => "Measured frequency responses",
            Kind::Coherence => "Coherence",
            Kind::Xy => "Signals over another",
            Kind::Histogram => "Distributions",
            Kind::Srs => "Shock response spectra",
        }
    }
}

/// The most panels of a figure that can be read.
const MOST_CHANNELS: usize = 12;
/// A segment is at most this part of a record whose spectra are shown over time.
const SHORT_SEGMENT_PART: f64 = 0.02;

/// Shows channels of a recording: over time, as spectra, or as distributions.
///
/// Numbers go to standard output, arrays to JSON. With --plot the figure is written with a caption, CSV and JSON.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Plot {
    /// Recording, an MCAP file.
    file: PathBuf,
    /// What is shown of the channels.
    #[arg(long, help_heading = heading::RECORDS, value_name = "KIND", value_enum)]
    of: Kind,
    /// Channels, or vectors of them, as acceleration_b_m_s2.
    #[arg(long, help_heading = heading::RECORDS, value_name = "NAMES", value_delimiter = ',')]
    channels: Vec<String>,
    /// Channel of the excitation, for frf and coherence; of the abscissa, for xy.
    #[arg(long, help_heading = heading::RECORDS, value_name = "NAME")]
    reference: Option<String>,
    #[command(flatten)]
    range: TimeRange,
    /// Length of a segment, s [default: a power of two of samples, up to a fifth of the record].
    ///
    /// Of a spectrogram it is up to a fiftieth.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "S")]
    segment_s: Option<f64>,
    /// Part of a segment that it shares with the next one, from 0 to below 1.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "PART", default_value_t = 0.5)]
    overlap: f64,
    /// Window of a segment.
    #[arg(long, help_heading = heading::COMPUTATION, value_parser = flags::one_of(Window::ALL, Window::name), default_value = "hann")]
    window: Window,
    /// Trend that is taken off each segment: none, constant, its mean, or linear.
    #[arg(long, help_heading = heading::COMPUTATION, value_parser = flags::one_of(Detrend::ALL, Detrend::name), default_value = "none")]
    detrend: Detrend,
    /// First frequency of the figure, Hz [default: 0, of srs that of two turns in the record].
    #[arg(long, help_heading = heading::RANGE, value_name = "F")]
    from_hz: Option<f64>,
    /// Last frequency of the figure, Hz [default: half of the sample rate, of srs a tenth].
    #[arg(long, help_heading = heading::RANGE, value_name = "F")]
    to_hz: Option<f64>,
    /// Quality Q = 1/2ζ of the oscillators of srs, above 0.5.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "Q", default_value_t = 10.0)]
    quality: f64,
    #[command(flatten)]
    output: PlotFlags,
}

/// The results of a kind.
#[derive(Default)]
struct Shown {
    /// What all channels have in common: frequencies, times, averages.
    common: Map<String, Value>,
    /// Numbers of each channel, in order.
    channels: Vec<Map<String, Value>>,
    /// Columns of the table: names and values.
    columns: Vec<(String, Vec<f64>)>,
    panels: Vec<Panel>,
    /// The lines of text that are printed.
    text: String,
}

impl Shown {
    /// Results that all channels have in common, with the first column of the table.
    fn new(common: Map<String, Value>, (name, column): (&str, Vec<f64>)) -> Shown {
        Shown { common, columns: vec![(name.to_owned(), column)], ..Shown::default() }
    }

    /// Adds the results of a channel.
    fn push(
        &mut self,
        numbers: Map<String, Value>,
        columns: Vec<(String, Vec<f64>)>,
        panels: impl IntoIterator<Item = Panel>,
        text: &str,
    ) {
        self.channels.push(numbers);
        self.columns.extend(columns);
        self.panels.extend(panels);
        self.text += text;
    }
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    #[serde(flatten)]
    common: Map<String, Value>,
    channels: Map<String, Value>,
}

impl Plot {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        self.output.check(output::PLOTTED, &Inputs::of([&self.file]))?;
        let recording = recordings::open(&self.file)?;
        let names: Vec<&String> = self.reference.iter().chain(&self.channels).collect();
        let TimeRange { from_s, to_s } = self.range;
        let signals = Signals::read(&recording, &names, [from_s, to_s]).map_err(|error| self.refused(&error))?;
        let first = self.check(&signals)?;
        let clipped = signals.channels.iter().zip(&signals.clipped).filter(|(_, count)| **count > 0);
        for (channel, count) in clipped {
            let name = channel.name;
            let all = signals.count();
            tracing::warn!("{count} of {all} values of {name} are clipped: what is shown of it is wrong");
        }
        let shown = self.shown(&signals)?;
        let mut channels = Map::new();
        // The reference comes first, and is not shown itself.
        let of = signals.channels.iter().zip(&signals.clipped).skip(first);
        for ((channel, clipped), numbers) in of.zip(shown.channels) {
            let mut own = map(json!({ "unit": channel.quantity.unit(), "clipped": clipped }));
            own.extend(numbers);
            channels.insert(channel.name.to_string(), Value::Object(own));
        }
        let document = Document { configuration: self.configuration(&signals), common: shown.common, channels };
        let mut panels = shown.panels;
        let columns = shown.columns;
        panels.iter_mut().for_each(|panel| self.limit(panel, signals.rate_hz));
        let figure = || {
            let figure = Figure::new(self.of.title()).subtitle(self.file.display().to_string());
            (panels.into_iter().fold(figure, Figure::with), table(&columns))
        };
        self.output.show(&document, figure, || shown.text)?;
        Ok(recordings::verdict(&recording))
    }

    fn refused(&self, error: &dyn core::fmt::Display) -> Failure {
        Failure::usage(format!("{}: {error}", self.file.display()))
    }

    /// Checks the flags against each other and the channels, and returns the number of the first channel that is shown.
    fn check(&self, signals: &Signals) -> Result<usize, Failure> {
        if signals.count() == 0 {
            return Err(self.refused(&"it has no values of these channels"));
        }
        let needs = matches!(self.of, Kind::Frf | Kind::Coherence | Kind::Xy);
        let of = self.of.name();
        let first = match &self.reference {
            Some(_) if !needs => Err(Failure::usage(format!("--of {of} has no reference: leave --reference out"))),
            None if needs => Err(Failure::usage(format!(
                "--of {of} needs --reference NAME, the channel of the abscissa or \
                 the excitation"
            ))),
            Some(name) if signals.channels[0].name.as_str() != name => Err(Failure::usage(format!(
                "--reference {name} is a vector: name one of its components, as {}",
                signals.channels[0].name
            ))),
            reference => Ok(usize::from(reference.is_some())),
        }?;
        let shown = signals.channels.len() - first;
        if shown == 0 {
            return Err(Failure::usage("--channels names no channel beside the reference: name at least one"));
        }
        if shown > MOST_CHANNELS && self.output.plot.is_some() {
            return Err(Failure::usage(format!(
                "{shown} channels are too many for a figure: choose up to {MOST_CHANNELS}, or leave --plot out"
            )));
        }
        let from_hz = self.from_hz.unwrap_or(0.0);
        let to_hz = self.to_hz.unwrap_or(f64::INFINITY);
        if !(from_hz >= 0.0 && from_hz < to_hz) || (self.of == Kind::Srs && self.from_hz == Some(0.0)) {
            return Err(Failure::usage("--from-hz and --to-hz must rise, from 0 on; of srs they are above 0"));
        }
        if !(0.0..1.0).contains(&self.overlap) {
            let overlap = short(&self.overlap);
            return Err(Failure::usage(format!("--overlap is {overlap}: it must be from 0 to below 1")));
        }
        Ok(first)
    }

    /// Limits the frequencies of a panel.
    fn limit(&self, panel: &mut Panel, rate_hz: f64) {
        let axis = match self.of {
            Kind::Psd | Kind::Frf | Kind::Coherence | Kind::Srs => &mut panel.x,
            Kind::Spectrogram => &mut panel.y,
            Kind::Time | Kind::Xy | Kind::Histogram => return,
        };
        if self.from_hz.is_none() && self.to_hz.is_none() {
            return;
        }
        let [lowest, highest] = if self.of == Kind::Srs { [1.0, 0.1] } else { [0.0, 0.5] };
        axis.range = Some((self.from_hz.unwrap_or(lowest), self.to_hz.unwrap_or(highest * rate_hz)));
    }

    /// Returns the segments that are averaged.
    fn segments(&self, signals: &Signals) -> Result<Segments, Failure> {
        let count = signals.count();
        let length = match self.segment_s {
            Some(segment_s) => {
                let length = libm::round(segment_s * signals.rate_hz);
                if !(2.0..=count as f64).contains(&length) {
                    let longest = count as f64 / signals.rate_hz;
                    let got = short(&segment_s);
                    return Err(Failure::usage(format!(
                        "--segment-s is {got} s: it must be at least two samples, and at most the length of the record, \
                         {} s",
                        rounded(&longest, 6)
                    )));
                }
                length as usize
            }
            None => {
                let part = if self.of == Kind::Spectrogram { SHORT_SEGMENT_PART } else { Segments::USUAL_PART };
                Segments::power_of_two(count, part).ok_or_else(|| {
                    self.refused(&format!("{count} samples are too few for a spectrum: give a longer range"))
                })?
            }
        };
        let overlap = (self.overlap * length as f64) as usize;
        Ok(Segments { length, overlap, window: self.window, detrend: self.detrend })
    }

    fn shown(&self, signals: &Signals) -> Result<Shown, Failure> {
        let shown = match self.of {
            Kind::Time => Ok(kinds::time(signals)),
            Kind::Psd => kinds::psd(signals, &self.segments(signals)?),
            Kind::Spectrogram => kinds::spectrogram(signals, &self.segments(signals)?),
            Kind::Frf => kinds::frf(signals, &self.segments(signals)?),
            Kind::Coherence => kinds::coherence(signals, &self.segments(signals)?),
            Kind::Xy => Ok(kinds::xy(signals)),
            Kind::Histogram => Ok(kinds::histogram(signals)),
            Kind::Srs => kinds::srs(signals, self.quality),
        };
        shown.map_err(|error| self.refused(&error))
    }

    fn configuration(&self, signals: &Signals) -> Value {
        json!({
            "recording": self.file,
            "of": self.of.name(),
            "reference": self.reference,
            "from_s": signals.start_s,
            "samples": signals.count(),
            "rate_hz": signals.rate_hz,
            "window": self.window.name(),
            "overlap": self.overlap,
            "detrend": self.detrend.name(),
        })
    }
}

/// Returns comma-separated values (RFC 4180); columns that end early have empty cells.
pub(crate) fn table<N: AsRef<str>>(columns: &[(N, Vec<f64>)]) -> String {
    let mut text = columns.iter().map(|(name, _)| name.as_ref()).collect::<Vec<_>>().join(",");
    text.push('\n');
    for row in 0..columns.iter().map(|(_, values)| values.len()).max().unwrap_or(0) {
        let cell =
            |(_, values): &(N, Vec<f64>)| values.get(row).map_or_else(String::new, |value| short(value).to_string());
        text += &columns.iter().map(cell).collect::<Vec<_>>().join(",");
        text.push('\n');
    }
    text
}
