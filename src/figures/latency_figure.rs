//! Latencies as a figure: histograms of lateness and of work time.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::failure::Failure;
use crate::help::heading;
use crate::output::{self, Inputs, OverwriteFlag};
use resonarm::realtime::LatencyHistogram;
use resonarm_figures::plot::{Axis, Color, Figure, Panel, Series};

/// The number of bars in a decade of latency.
const BARS: f64 = 20.0;
/// The lower end of the axis of counts, below one: empty bars have this height.
const NONE: f64 = 0.5;
/// The lower end of the first bar, ns: shorter latencies count there.
const SHORTEST_NS: u64 = 100;

/// Where to draw latencies.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::OUTPUT)]
pub(crate) struct LatencyPlotFlag {
    /// Plot histograms of lateness and work time to STEM.svg and STEM.png.
    ///
    /// The histograms count how late samples were and how long their work took. The caption is in STEM.txt.
    #[arg(long, value_name = "STEM")]
    pub plot: Option<PathBuf>,
}

impl LatencyPlotFlag {
    /// Rejects existing files, and a folder that does not exist.
    pub fn check(&self, overwrite: bool, inputs: &Inputs) -> Result<(), Failure> {
        OverwriteFlag { overwrite }.check_stem(self.plot.as_deref(), &Figure::ENDINGS, inputs)?;
        self.plot.as_deref().map_or(Ok(()), output::check_folder)
    }
}

/// A curve: its name and its histograms.
pub(crate) struct LatencyCurve<'a> {
    pub name: &'static str,
    pub color: Color,
    pub counted: Vec<&'a LatencyHistogram>,
}

/// Writes the figure: a panel for each list of curves, under its title. Returns the files.
pub(crate) fn write(
    stem: &Path,
    subtitle: &str,
    panels: &[(Option<String>, Vec<LatencyCurve>)],
) -> Result<Vec<PathBuf>, Failure> {
    let figure = Figure::new("Latency of the real-time loop").subtitle(subtitle);
    let figure = panels.iter().fold(figure, |figure, (title, curves)| figure.with(panel(title.clone(), curves)));
    output::draw(figure, stem)
}

fn panel(title: Option<String>, curves: &[LatencyCurve]) -> Panel {
    let bars: Vec<_> = curves.iter().map(|curve| bars(&curve.counted)).collect();
    let most = bars.iter().flatten().map(|(_, count)| *count).max().unwrap_or(1);
    // Twice the highest bar leaves room above it.
    let y = Axis::log("samples").range(NONE, 2.0 * most as f64);
    let panel = Panel { title, ..Panel::new(Axis::log("latency (µs)"), y) };
    curves
        .iter()
        .zip(&bars)
        .fold(panel, |panel, (curve, bars)| panel.with(Series::line(curve.name, curve.color, outline(bars))))
}

/// Returns the number of the bar of a latency: bar k goes from 10^(k/20) ns to 10^((k+1)/20) ns.
fn bar(latency_ns: u64) -> i32 {
    libm::floor(BARS * libm::log10(latency_ns.max(SHORTEST_NS) as f64)) as i32
}

/// Returns the bars from the first to the last non-empty one, with their counts.
fn bars(counted: &[&LatencyHistogram]) -> Vec<(i32, u64)> {
    let all = || counted.iter().flat_map(|histogram| histogram.counts()).map(|(ns, count)| (bar(ns), count));
    let (Some(first), Some(last)) = (all().map(|(bar, _)| bar).min(), all().map(|(bar, _)| bar).max()) else {
        return Vec::new();
    };
    let mut bars: Vec<(i32, u64)> = (first..=last).map(|bar| (bar, 0)).collect();
    for (bar, count) in all() {
        bars[(bar - first) as usize].1 += count;
    }
    bars
}

/// Returns the outline of the bars, µs and counts, from the base line and back to it.
fn outline(bars: &[(i32, u64)]) -> Vec<(f64, f64)> {
    // The outline is a single line, so that several histograms can be drawn over each other. It starts and ends at
    // the base line, which closes the first and the last bar.
    let edge_us = |bar: i32| libm::pow(10.0, f64::from(bar) / BARS) * 1e-3;
    let (Some((first, _)), Some((last, _))) = (bars.first(), bars.last()) else { return Vec::new() };
    let tops = bars.iter().flat_map(|(bar, count)| {
        let height = if *count > 0 { *count as f64 } else { NONE };
        [(edge_us(*bar), height), (edge_us(bar + 1), height)]
    });
    [(edge_us(*first), NONE)].into_iter().chain(tops).chain([(edge_us(last + 1), NONE)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_latency_is_in_a_bar_and_the_outline_starts_and_ends_on_the_base_line() {
        let mut one = LatencyHistogram::new().unwrap();
        let mut other = LatencyHistogram::new().unwrap();
        [10_000, 10_100, 20_000].iter().for_each(|ns| one.record(*ns));
        [10_050, 30, 30_000_000_000].iter().for_each(|ns| other.record(*ns));
        let bars = bars(&[&one, &other]);
        assert_eq!(bars.iter().map(|(_, count)| count).sum::<u64>(), 6);
        // From 100 ns to 30 s, the histogram's limit: 8.48 decades.
        assert_eq!((bars[0], bars.len(), bars[40]), ((40, 1), 170, (80, 3)));
        let points = outline(&bars);
        let ends = [points[0], points[points.len() - 1]];
        assert!(ends.iter().all(|(_, count)| *count == NONE) && (points[1].0 - 0.1).abs() < 1e-12, "{ends:?}");
        assert!(outline(&[]).is_empty());
    }
}
