//! A small figure of a recording: coordinates, load and readings over time, a panel for each channel.

use crate::failure::Failure;
use resonarm::recording::{Record, Recording, RecordingSummary, Topic};
use resonarm::structure::{Channel, Kind, Quantity};
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Legend, Panel, Series, Style};

/// The number of spans of time; each is drawn by its least and its largest value, about two spans a px.
const SPANS: usize = 1200;

/// The quantities that are drawn, and whether as the instruments read them. Panels of one quantity have equal axes.
const QUANTITIES: [(Quantity, bool); 11] = [
    (Quantity::Angle, false),
    (Quantity::ModalDisplacement, false),
    (Quantity::Displacement, false),
    (Quantity::Torque, false),
    (Quantity::Force, false),
    (Quantity::Current, false),
    (Quantity::Acceleration, true),
    (Quantity::Velocity, true),
    (Quantity::Displacement, true),
    (Quantity::Angle, true),
    (Quantity::Force, true),
];
/// The part of its range by which an axis extends beyond the values.
const MARGIN: f64 = 0.06;
/// Width of the bar over a clipped stretch, px.
const BAR: f64 = 4.0;

/// The least and the largest value of a channel in every span of time, and whether a value in it was clipped.
struct Envelope {
    channel: Channel,
    spans: Vec<Option<[f64; 2]>>,
    clipped: Vec<bool>,
}

impl Envelope {
    fn add(&mut self, span: usize, value: f64) {
        if let Some(span) = self.spans.get_mut(span) {
            let [least, largest] = span.unwrap_or([value; 2]);
            *span = Some([least.min(value), largest.max(value)]);
        }
    }

    /// Returns the points of a line that covers the envelope.
    fn points(&self, time_s: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let spans = self.spans.iter().enumerate().filter_map(|(span, found)| found.map(|found| (time_s(span), found)));
        // Each span is a vertical stroke from its least to its largest value. Joined to the next they fill the
        // envelope, as every sample would.
        spans.flat_map(|(time_s, [least, largest])| [(time_s, least), (time_s, largest)]).collect()
    }

    fn clip(&mut self, span: usize, clipped: u32) {
        if let (Kind::Reading { clip_bit }, Some(span)) = (self.channel.kind, self.clipped.get_mut(span)) {
            *span |= clipped >> clip_bit & 1 == 1;
        }
    }

    /// Returns a line over the clipped spans at the height `y`, with gaps between them.
    fn bar(&self, y: f64, time_s: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let is_clipped = |span: usize| self.clipped.get(span).copied().unwrap_or(false);
        // A clipped span is drawn from its beginning to its end. The NaN after the last of a run breaks the line.
        let ends = |span: usize| match is_clipped(span) {
            true => [Some((time_s(span), y)), Some((time_s(span + 1), y))],
            false => [(span > 0 && is_clipped(span - 1)).then_some((time_s(span), f64::NAN)), None],
        };
        (0..=self.clipped.len()).flat_map(ends).flatten().collect()
    }

    /// Returns the least and the largest value of the channel.
    fn ends(&self) -> Option<[f64; 2]> {
        self.spans.iter().flatten().copied().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    fn is_zero(&self) -> bool {
        self.spans.iter().flatten().all(|[least, largest]| *least == 0.0 && *largest == 0.0)
    }
}

/// Draws the figure of a recording. Channels that are 0 all the time are left out.
pub(super) fn figure(recording: &Recording, summary: &RecordingSummary) -> Result<Figure, Failure> {
    let (first, last) = summary.samples.unwrap_or_default();
    // At most SPANS spans of as many samples each.
    // Of n samples that is ⌈n / SPANS⌉ = (n − 1)/SPANS + 1 in integers.
    let width = (last - first) / SPANS as u64 + 1;
    let channels = [Topic::States, Topic::Samples].map(|topic| recording.channels().of(topic));
    let all = channels.into_iter().flatten();
    let mut envelopes: Vec<Envelope> = all
        .map(|channel| Envelope { channel: *channel, spans: vec![None; SPANS], clipped: vec![false; SPANS] })
        .collect();
    let (states, samples) = envelopes.split_at_mut(channels[0].len());
    let span = |sample: u64| ((sample - first) / width) as usize;
    for record in recording.records()? {
        match record? {
            // The end of a run has a state but no load.
            Record::State(state) if state.is_end => {}
            Record::State(state) => {
                let values = state.values();
                let span = span(state.sample);
                states.iter_mut().zip(&*values).for_each(|(envelope, value)| envelope.add(span, *value));
            }
            Record::Sample(readings) => {
                let values = readings.values();
                let span = span(readings.sample);
                let bits = readings.clipped_bits();
                for (envelope, value) in samples.iter_mut().zip(&*values) {
                    envelope.add(span, *value);
                    envelope.clip(span, bits);
                }
            }
            _ => {}
        }
    }
    let time_s = |span: usize| (first as f64 + span as f64 * width as f64) * summary.origin.dt_s;
    let name = recording.path().file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned());
    let mut figure = Figure::new(name);
    for (quantity, is_read) in QUANTITIES {
        let drawn = || {
            envelopes.iter().filter(move |envelope| {
                let Channel { quantity: of, kind, .. } = envelope.channel;
                of == quantity && matches!(kind, Kind::Reading { .. }) == is_read && !envelope.is_zero()
            })
        };
        let ends = drawn().filter_map(Envelope::ends).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let Some([low, high]) = ends else { continue };
        // A channel that is constant has no range. Its own size, or 1, keeps the line in the middle of the panel.
        let margin = if high > low { MARGIN * (high - low) } else { low.abs().max(1.0) };
        for envelope in drawn() {
            let y = Axis::linear(quantity.unit()).range(low - margin, high + margin);
            let line = Series::line(envelope.channel.name.as_str(), Color::Blue, envelope.points(time_s)).unlabelled();
            let bar = Series::line("clipped", Color::Vermillion, envelope.bar(high + margin / 2.0, time_s));
            let bar = bar.style(Style::Line { color: Color::Vermillion, width: BAR, dash: Dash::Solid });
            let panel = Panel::new(Axis::linear("time (s)"), y).title(envelope.channel.name.as_str()).with(line);
            // One entry in the legend serves all panels.
            let is_first = figure.panels.iter().all(|panel| panel.series.len() == 1);
            let legend = if is_first { Legend::Bottom } else { Legend::None };
            figure = figure.with(if bar.points.is_empty() { panel } else { panel.with(bar).legend(legend) });
        }
    }
    match figure.panels[..] {
        [] => Err(Failure::usage(format!("{}: there is nothing to plot", recording.path().display()))),
        _ => Ok(figure),
    }
}
