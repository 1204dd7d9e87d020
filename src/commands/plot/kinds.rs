//! Signals over time, spectra, responses and distributions.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::Shown;
use crate::figures::response_curves::broken_at_wraps;
use crate::output::map;
use resonarm::modal::spectra::{CrossSpectra, Estimator, Segments, ShockResponse, Signals as Measured, SpectraError};
use resonarm::rig::Converter;
use resonarm::signals::Signals;
use resonarm::structure::Channel;
use resonarm_figures::plot::{Axis, Color, Dash, Legend, Panel, Series, Style};
use resonarm_numeric::number::rounded;

/// A line in a figure has at most so many points; of more it shows the extremes of stretches.
const MOST_POINTS: usize = 4000;
/// Classes of a histogram.
const CLASSES: usize = 60;
/// The probability of stated intervals.
const CONFIDENCE: f64 = 0.95;
/// Oscillators of a shock response spectrum in an octave.
const IN_OCTAVE: usize = 12;

/// A map in a figure has at most so many tiles along each axis; several lines or segments share one, which shows the largest.
const MOST_TILES: [usize; 2] = [120, 150];
/// Colours, each for so many decibels below the largest density.
const LEVELS: u8 = 10;
const DECIBELS: f64 = 6.0;

/// Returns a label with its unit.
fn label(channel: &Channel) -> String {
    format!("{} ({})", channel.name, channel.quantity.unit())
}

/// Returns the unit of a density.
fn density_unit(channel: &Channel) -> String {
    let unit = channel.quantity.unit();
    if unit.contains('/') { format!("({unit})²/Hz") } else { format!("{unit}²/Hz") }
}

/// Returns the points of a line, at most [`MOST_POINTS`]: of longer stretches the lowest and the highest value.
fn line(x: impl Fn(usize) -> f64, values: &[f64]) -> Vec<(f64, f64)> {
    let stretch = (2 * values.len()).div_ceil(MOST_POINTS);
    if stretch <= 2 {
        return values.iter().enumerate().map(|(k, value)| (x(k), *value)).collect();
    }
    let mut points = Vec::new();
    for start in (0..values.len()).step_by(stretch) {
        let places = start..(start + stretch).min(values.len());
        let by = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
        let low = places.clone().min_by(by).unwrap_or(start);
        let high = places.max_by(by).unwrap_or(start);
        // In the order of time, so that the line does not run back.
        points.extend([low.min(high), low.max(high)].map(|place| (x(place), values[place])));
    }
    points
}

/// Returns the points of a line on a logarithmic axis, on which zeros have no place.
fn positive(x: &[f64], y: &[f64]) -> Vec<(f64, f64)> {
    x.iter().zip(y).map(|(x, y)| (*x, if *y > 0.0 { *y } else { f64::NAN })).collect()
}

/// Mean, root mean square, standard deviation, crest factor, skewness and kurtosis of values.
#[derive(Serialize)]
struct Statistics {
    mean: f64,
    rms: f64,
    #[serde(rename = "standard_deviation")]
    deviation: f64,
    largest: f64,
    skewness: f64,
    kurtosis: f64,
}

impl Statistics {
    fn new(values: &[f64]) -> Statistics {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let moment = |of: fn(f64) -> f64| values.iter().map(|value| of(value - mean)).sum::<f64>() / count;
        let variance = moment(|x| x * x);
        let deviation = variance.sqrt();
        Statistics {
            mean,
            rms: (values.iter().map(|value| value * value).sum::<f64>() / count).sqrt(),
            deviation,
            largest: values.iter().fold(0.0, |largest: f64, value| largest.max(value.abs())),
            skewness: moment(|x| x * x * x) / (variance * deviation),
            kurtosis: moment(|x| x * x * x * x) / (variance * variance),
        }
    }

    fn text(&self, channel: &Channel) -> String {
        let [mean, rms, largest] = [self.mean, self.rms, self.largest].map(|value| rounded(&value, 5));
        let unit = channel.quantity.unit();
        format!("{}: mean {mean}, rms {rms}, largest {largest} {unit}\n", channel.name)
    }
}

/// Every channel in a panel of its own, over time.
pub(super) fn time(signals: &Signals) -> Shown {
    let at = |k: usize| signals.start_s + k as f64 / signals.rate_hz;
    let times: Vec<f64> = (0..signals.count()).map(at).collect();
    let mut shown = Shown::new(map(json!({ "time_s": &times })), ("time_s", times));
    for (channel, values) in signals.channels.iter().zip(&signals.values) {
        let statistics = Statistics::new(values);
        let mut numbers = map(json!(statistics));
        numbers.insert(String::from("values"), json!(values));
        let panel = Panel::new(Axis::linear("time (s)"), Axis::linear(label(channel)));
        let line = Series::line(channel.name.as_str(), Color::Blue, line(at, values)).unlabelled();
        shown.push(
            numbers,
            vec![(channel.name.to_string(), values.clone())],
            [panel.with(line)],
            &statistics.text(channel),
        );
    }
    shown
}

/// Values of channels over those of the first.
pub(super) fn xy(signals: &Signals) -> Shown {
    let of_x = &signals.channels[0];
    let x = &signals.values[0];
    let mut shown = Shown::new(map(json!({ "x": x })), (of_x.name.as_str(), x.clone()));
    for (channel, values) in signals.channels.iter().zip(&signals.values).skip(1) {
        let points = x.iter().copied().zip(values.iter().copied()).collect();
        let panel = Panel::new(Axis::linear(label(of_x)), Axis::linear(label(channel)));
        let panel = panel.with(Series::line(channel.name.as_str(), Color::Blue, points).unlabelled());
        let text = Statistics::new(values).text(channel);
        shown.push(map(json!({ "values": values })), vec![(channel.name.to_string(), values.clone())], [panel], &text);
    }
    shown
}

/// Distributions of the values, with the normal distribution of the same mean and deviation.
pub(super) fn histogram(signals: &Signals) -> Shown {
    let mut shown = Shown::default();
    for (channel, values) in signals.channels.iter().zip(&signals.values) {
        let statistics = Statistics::new(values);
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // A channel that never changes has one class of the width 1.
        let width = if high > low { (high - low) / CLASSES as f64 } else { 1.0 };
        let mut density = vec![0.0; CLASSES];
        for value in values {
            // The highest value is the upper end of the last class.
            density[(((value - low) / width) as usize).min(CLASSES - 1)] += 1.0 / (width * values.len() as f64);
        }
        let edges: Vec<f64> = (0..=CLASSES).map(|k| low + k as f64 * width).collect();
        let steps =
            edges.windows(2).zip(&density).flat_map(|(edge, density)| [(edge[0], *density), (edge[1], *density)]);
        let normal = |x: f64| {
            let z = (x - statistics.mean) / statistics.deviation;
            libm::exp(-0.5 * z * z) / (statistics.deviation * core::f64::consts::TAU.sqrt())
        };
        let curve = (0..=4 * CLASSES).map(|k| low + 0.25 * k as f64 * width).map(|x| (x, normal(x))).collect();
        let panel = Panel::new(Axis::linear(label(channel)), Axis::linear("probability density"))
            .with(Series::line("measured", Color::Blue, steps.collect()))
            .with(Series::line("normal distribution", Color::Vermillion, curve));
        let mut numbers = map(json!(statistics));
        numbers.extend(map(json!({ "edges": &edges, "density": &density })));
        let skewness = rounded(&statistics.skewness, 4);
        let kurtosis = rounded(&statistics.kurtosis, 4);
        let text = format!("{}  skewness {skewness}, kurtosis {kurtosis}\n", statistics.text(channel));
        let columns = vec![
            (format!("{}_from", channel.name), edges[..CLASSES].to_vec()),
            (format!("{}_density", channel.name), density),
        ];
        shown.push(numbers, columns, [panel], &text);
    }
    shown
}

/// Begins the results of averaged spectra: their lines, and how many averages they have.
fn averaged(spectra: &CrossSpectra, segments: &Segments, rate_hz: f64) -> Shown {
    let [low, high] = spectra.confidence_factors(CONFIDENCE);
    let length_s = segments.length as f64 / rate_hz;
    let common = map(json!({
        "frequency_hz": spectra.frequency_hz,
        "segment_s": length_s,
        "averages": spectra.averages,
        "degrees_of_freedom": spectra.degrees_of_freedom,
        "noise_bandwidth_hz": spectra.noise_bandwidth_hz,
        "density_within": { "probability": CONFIDENCE, "factors": [low, high] },
    }));
    let text = format!(
        "{} segments of {} s: lines {} Hz apart, {} degrees of freedom; with {} % probability a density is {} to {} times \
         what is stated\n",
        spectra.averages,
        rounded(&length_s, 4),
        rounded(&(1.0 / length_s), 4),
        rounded(&spectra.degrees_of_freedom, 3),
        CONFIDENCE * 100.0,
        rounded(&low, 3),
        rounded(&high, 3)
    );
    Shown { text, ..Shown::new(common, ("frequency_hz", spectra.frequency_hz.clone())) }
}

/// Names the converters whose droop is taken out of densities, as JSON; states have none.
fn converter(signals: &Signals) -> Map<String, Value> {
    map(json!({ "converter": signals.converter.map(Converter::name) }))
}

/// Power spectral densities of all channels, without the droop of the converters.
pub(super) fn psd(signals: &Signals, segments: &Segments) -> Result<Shown, SpectraError> {
    let values: Vec<&[f64]> = signals.values.iter().map(Vec::as_slice).collect();
    let record = Measured { inputs: &[], outputs: &values };
    let mut spectra = CrossSpectra::estimate(signals.rate_hz, &[record], segments)?;
    spectra.outputs.iter_mut().for_each(|density| signals.correct_droop(&spectra.frequency_hz, density));
    let mut shown = averaged(&spectra, segments, signals.rate_hz);
    shown.common.extend(converter(signals));
    let spacing_hz = signals.rate_hz / segments.length as f64;
    for (channel, density) in signals.channels.iter().zip(&spectra.outputs) {
        let unit = density_unit(channel);
        let rms = (density.iter().sum::<f64>() * spacing_hz).sqrt();
        let panel = Panel::new(Axis::linear("frequency (Hz)"), Axis::log(format!("{} ({unit})", channel.name)));
        let line = Series::line(channel.name.as_str(), Color::Blue, positive(&spectra.frequency_hz, density));
        let highest = density.iter().copied().zip(&spectra.frequency_hz).max_by(|a, b| a.0.total_cmp(&b.0));
        let (peak, peak_hz) = highest.map_or((f64::NAN, f64::NAN), |(peak, hz)| (peak, *hz));
        let text = format!(
            "{}: rms {} {}, largest density {} {unit} at {} Hz\n",
            channel.name,
            rounded(&rms, 5),
            channel.quantity.unit(),
            rounded(&peak, 4),
            rounded(&peak_hz, 5)
        );
        let numbers = map(json!({ "psd": density, "psd_unit": unit, "rms": rms }));
        shown.push(numbers, vec![(format!("{}_psd", channel.name), density.clone())], [panel.with(line)], &text);
    }
    Ok(shown)
}

/// Frequency responses H1 of channels to the first, with their coherence.
pub(super) fn frf(signals: &Signals, segments: &Segments) -> Result<Shown, SpectraError> {
    let spectra = responses_spectra(signals, segments)?;
    let found = spectra.responses(Estimator::H1)?;
    let mut shown = averaged(&spectra, segments, signals.rate_hz);
    let reference = &signals.channels[0];
    // Without a relation the coherence is above this in 5 % of the lines: 1 − 0.05^(1/(n − 1)), n = ν/2 (Bendat, Piersol).
    let noise = 1.0 - libm::pow(0.05, 1.0 / (0.5 * spectra.degrees_of_freedom - 1.0).max(1.0));
    for (output, channel) in signals.channels.iter().skip(1).enumerate() {
        let response = &found.responses[output][0];
        let coherence = &found.coherence[output];
        let unit = format!("{} per {}", channel.quantity.unit(), reference.quantity.unit());
        let modulus: Vec<f64> = response.iter().map(|value| libm::hypot(value.re, value.im)).collect();
        let phase_deg: Vec<f64> = response.iter().map(|value| libm::atan2(value.im, value.re).to_degrees()).collect();
        let deviation = found.standard_deviation(output, 0).unwrap_or_default();
        let x = || Axis::linear("frequency (Hz)");
        let name = format!("{} over {}", channel.name, reference.name);
        let moduli = Panel::new(x(), Axis::log(format!("modulus ({unit})"))).legend(Legend::Below);
        // Lines of noise alone are left out of the figure; a single segment has no coherence.
        let is_shown = |line: usize| spectra.averages == 1 || coherence[line] > noise;
        let kept = |of: &[f64]| -> Vec<f64> {
            of.iter().enumerate().map(|(line, value)| if is_shown(line) { *value } else { f64::NAN }).collect()
        };
        let moduli = moduli.with(Series::line(name, Color::Blue, positive(&spectra.frequency_hz, &kept(&modulus))));
        let phases = spectra.frequency_hz.iter().copied().zip(kept(&phase_deg)).collect();
        let phases = Panel::new(x(), Axis::degrees("phase (°)"))
            .with(Series::line("phase", Color::Blue, broken_at_wraps(phases)).unlabelled());
        let values: Vec<[f64; 2]> = response.iter().map(|value| [value.re, value.im]).collect();
        let numbers = map(json!({
            "frf": values, "frf_unit": unit, "coherence": coherence, "standard_deviation": deviation,
        }));
        let columns = [("modulus", modulus), ("phase_deg", phase_deg), ("coherence", coherence.clone())];
        let columns = columns.map(|(part, values)| (format!("{}_{part}", channel.name), values)).to_vec();
        let text = coherence_text(channel, &spectra.frequency_hz, coherence);
        shown.push(numbers, columns, [moduli, phases], &text);
    }
    Ok(shown)
}

/// The coherence of channels with the first.
pub(super) fn coherence(signals: &Signals, segments: &Segments) -> Result<Shown, SpectraError> {
    let spectra = responses_spectra(signals, segments)?;
    let mut shown = averaged(&spectra, segments, signals.rate_hz);
    for (output, channel) in signals.channels.iter().skip(1).enumerate() {
        let coherence = spectra.coherence(0, output).unwrap_or_default();
        let points = spectra.frequency_hz.iter().copied().zip(coherence.iter().copied()).collect();
        let axis = Axis::linear(format!("coherence with {}", signals.channels[0].name)).range(0.0, 1.05);
        let panel = Panel::new(Axis::linear("frequency (Hz)"), axis);
        let panel = panel.with(Series::line(channel.name.as_str(), Color::Blue, points));
        let text = coherence_text(channel, &spectra.frequency_hz, &coherence);
        let columns = vec![(format!("{}_coherence", channel.name), coherence.clone())];
        shown.push(map(json!({ "coherence": coherence })), columns, [panel], &text);
    }
    Ok(shown)
}

fn responses_spectra(signals: &Signals, segments: &Segments) -> Result<CrossSpectra, SpectraError> {
    let values: Vec<&[f64]> = signals.values.iter().map(Vec::as_slice).collect();
    let (inputs, outputs) = values.split_at(1);
    CrossSpectra::estimate(signals.rate_hz, &[Measured { inputs, outputs }], segments)
}

fn coherence_text(channel: &Channel, frequency_hz: &[f64], coherence: &[f64]) -> String {
    let lowest = coherence.iter().zip(frequency_hz).filter(|(value, _)| value.is_finite());
    let lowest = lowest.min_by(|a, b| a.0.total_cmp(b.0));
    lowest.map_or_else(String::new, |(value, hz)| {
        format!("{}: lowest coherence {} at {} Hz\n", channel.name, rounded(value, 3), rounded(hz, 5))
    })
}

/// Shock response spectra of all channels, from an oscillator that turns twice in the record to a tenth of the sample rate,
/// above which the samples miss peaks.
pub(super) fn srs(signals: &Signals, quality: f64) -> Result<Shown, SpectraError> {
    let [low_hz, high_hz] = [2.0 * signals.rate_hz / signals.count() as f64, 0.1 * signals.rate_hz];
    let octaves = libm::log2(high_hz / low_hz).max(0.0);
    let count = (octaves * IN_OCTAVE as f64) as usize + 1;
    let frequency_hz: Vec<f64> =
        (0..count).map(|k| high_hz * libm::exp2(-((count - 1 - k) as f64) / IN_OCTAVE as f64)).collect();
    let common = map(json!({ "frequency_hz": frequency_hz, "quality": quality }));
    let mut shown = Shown::new(common, ("frequency_hz", frequency_hz.clone()));
    for (channel, values) in signals.channels.iter().zip(&signals.values) {
        let found = ShockResponse::estimate(signals.rate_hz, values, quality, &frequency_hz)?;
        let sides = [("maximax", found.maximax()), ("positive", found.positive), ("negative", found.negative)];
        let mut panel =
            Panel::new(Axis::log("natural frequency (Hz)"), Axis::log(label(channel))).legend(Legend::Below);
        for ((name, side), color) in sides.iter().zip([Color::Grey, Color::Blue, Color::Vermillion]) {
            let line = Series::line(*name, color, positive(&frequency_hz, side));
            // Wider, so that it is seen beneath the side that it equals.
            let wide = Style::Line { color, width: 4.0, dash: Dash::Solid };
            panel = panel.with(if *name == "maximax" { line.style(wide) } else { line });
        }
        let highest = sides[0].1.iter().zip(&frequency_hz).max_by(|a, b| a.0.total_cmp(b.0));
        let text = highest.map_or_else(String::new, |(value, hz)| {
            let unit = channel.quantity.unit();
            format!("{}: largest response {} {unit} at {} Hz\n", channel.name, rounded(value, 5), rounded(hz, 4))
        });
        let numbers = sides.iter().map(|(name, side)| ((*name).to_owned(), json!(side))).collect();
        let columns = sides.map(|(name, side)| (format!("{}_{name}", channel.name), side)).to_vec();
        shown.push(numbers, columns, [panel], &text);
    }
    Ok(shown)
}

/// Densities of single segments over time and frequency, without the droop of the converters.
pub(super) fn spectrogram(signals: &Signals, segments: &Segments) -> Result<Shown, SpectraError> {
    let step = segments.length - segments.overlap;
    let starts: Vec<usize> = (0..=signals.count() - segments.length).step_by(step).collect();
    let middle_s = |start: &usize| signals.start_s + (*start as f64 + 0.5 * segments.length as f64) / signals.rate_hz;
    let times: Vec<f64> = starts.iter().map(middle_s).collect();
    let mut shown = Shown::default();
    let mut frequency_hz = Vec::new();
    for (channel, values) in signals.channels.iter().zip(&signals.values) {
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for start in &starts {
            let part = &values[*start..start + segments.length];
            let record = Measured { inputs: &[], outputs: &[part] };
            let mut spectra = CrossSpectra::estimate(signals.rate_hz, &[record], segments)?;
            spectra.outputs.iter_mut().for_each(|density| signals.correct_droop(&spectra.frequency_hz, density));
            rows.append(&mut spectra.outputs);
            frequency_hz = spectra.frequency_hz;
        }
        let columns = rows.iter().zip(&times).map(|(row, time)| (format!("{}_at_{time}_s", channel.name), row.clone()));
        let panel = map_panel(channel, &rows, &times, &frequency_hz);
        shown.push(map(json!({ "psd": rows })), columns.collect(), [panel], "");
    }
    shown.columns.insert(0, (String::from("frequency_hz"), frequency_hz.clone()));
    shown.text = format!("{} segments of {} s\n", starts.len(), segments.length as f64 / signals.rate_hz);
    shown.common = map(json!({ "time_s": times, "frequency_hz": frequency_hz }));
    shown.common.extend(converter(signals));
    Ok(shown)
}

/// Draws densities as tiles, coloured by their size.
fn map_panel(channel: &Channel, rows: &[Vec<f64>], times: &[f64], frequency_hz: &[f64]) -> Panel {
    let [along_time, along_frequency] =
        [rows.len().div_ceil(MOST_TILES[0]), frequency_hz.len().div_ceil(MOST_TILES[1])];
    let largest = rows.iter().flatten().copied().fold(0.0, f64::max);
    let title = format!("{}, 0 dB: {} {}", channel.name, rounded(&largest, 3), density_unit(channel));
    let mut levels: Vec<Vec<(f64, f64)>> = vec![Vec::new(); usize::from(LEVELS)];
    for (part, times) in rows.chunks(along_time).zip(times.chunks(along_time)) {
        for start in (0..frequency_hz.len()).step_by(along_frequency) {
            let lines = start..(start + along_frequency).min(frequency_hz.len());
            let density = part.iter().flat_map(|row| &row[lines.clone()]).copied().fold(0.0, f64::max);
            // Infinite for a density of 0: the conversion to an integer saturates, and gives the lowest level.
            let below_db = -10.0 * libm::log10(density / largest);
            let level = usize::from(LEVELS - 1).saturating_sub((below_db / DECIBELS) as usize);
            let middle = |of: &[f64]| 0.5 * (of[0] + of[of.len() - 1]);
            levels[level].push((middle(times), middle(&frequency_hz[lines])));
        }
    }
    let spacing = |of: &[f64], together: usize| if of.len() > 1 { (of[1] - of[0]) * together as f64 } else { 1.0 };
    let size = [spacing(times, along_time), spacing(frequency_hz, along_frequency)];
    let mut panel =
        Panel::new(Axis::linear("time (s)"), Axis::linear("frequency (Hz)")).title(title).legend(Legend::Below);
    for (level, points) in (0..LEVELS).zip(levels).rev() {
        let below = f64::from(LEVELS - 1 - level) * DECIBELS;
        let label = match level {
            0 => format!("below −{below} dB"),
            level if level == LEVELS - 1 => format!("0 to −{DECIBELS} dB"),
            _ => format!("−{below} to −{} dB", below + DECIBELS),
        };
        panel = panel.with_any(Series::tiles(label, Color::Level(level), size, points));
    }
    panel
}
