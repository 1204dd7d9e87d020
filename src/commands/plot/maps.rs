//! Draws spectra over time, as maps.

use serde_json::{Value, json};

use super::Shown;
use super::kinds::{converter, density_unit};
use resonarm::modal::spectra::{CrossSpectra, Segments, Signals as Measured, SpectraError};
use resonarm::signals::Signals;
use resonarm::structure::Channel;
use resonarm_figures::plot::{Axis, Color, Legend, Panel, Series};
use resonarm_numeric::number::rounded;

/// A map in a figure has at most so many tiles along each axis; several lines or segments share one, which shows the largest.
const MOST_TILES: [usize; 2] = [120, 150];
/// Colours, each for so many decibels below the largest density.
const LEVELS: u8 = 10;
const DECIBELS: f64 = 6.0;

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
        let panel = panel(channel, &rows, &times, &frequency_hz);
        let numbers = [(String::from("psd"), json!(rows))].into_iter().collect();
        shown.push(numbers, columns.collect(), [panel], "");
    }
    shown.columns.insert(0, (String::from("frequency_hz"), frequency_hz.clone()));
    shown.text = format!("{} segments of {} s\n", starts.len(), segments.length as f64 / signals.rate_hz);
    let common = [("time_s", json!(times)), ("frequency_hz", json!(frequency_hz))];
    shown.common = common.into_iter().map(|(name, value): (&str, Value)| (name.to_owned(), value)).collect();
    shown.common.extend(converter(signals));
    Ok(shown)
}

/// Draws densities as tiles, coloured by their size.
fn panel(channel: &Channel, rows: &[Vec<f64>], times: &[f64], frequency_hz: &[f64]) -> Panel {
    let [along_time, along_frequency] =
        [rows.len().div_ceil(MOST_TILES[0]), frequency_hz.len().div_ceil(MOST_TILES[1])];
    let largest = rows.iter().flatten().copied().fold(0.0, f64::max);
    let title = format!("{}, 0 dB: {} {}", channel.name, rounded(&largest, 3), density_unit(channel));
    let mut levels: Vec<Vec<(f64, f64)>> = vec![Vec::new(); usize::from(LEVELS)];
    for (part, times) in rows.chunks(along_time).zip(times.chunks(along_time)) {
        for start in (0..frequency_hz.len()).step_by(along_frequency) {
            let lines = start..(start + along_frequency).min(frequency_hz.len());
            let density = part.iter().flat_map(|row| &row[lines.clone()]).copied().fold(0.0, f64::max);
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
