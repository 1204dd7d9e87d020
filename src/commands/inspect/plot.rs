//! A small figure of a recording: coordinates, load and readings over time.

use crate::failure::Failure;
use resonarm::recording::{Record, Recording, RecordingSummary, Topic};
use resonarm::structure::{Channel, Kind, Quantity};
use resonarm_figures::plot::{Axis, Color, Figure, Panel, Series};

/// Spans of time; each is drawn by its least and its largest value, about two spans a px.
const SPANS: usize = 1200;

/// Panels: name of the y axis, what is drawn, and whether as the instruments read it.
const PANELS: [(&str, Quantity, bool); 8] = [
    ("angle", Quantity::Angle, false),
    ("modal coordinate", Quantity::ModalDisplacement, false),
    ("displacement", Quantity::Displacement, false),
    ("torque", Quantity::Torque, false),
    ("force", Quantity::Force, false),
    ("current", Quantity::Current, false),
    ("acceleration", Quantity::Acceleration, true),
    ("force in head", Quantity::Force, true),
];
const COLORS: [Color; 4] = [Color::Blue, Color::Vermillion, Color::Green, Color::Purple];

/// The least and the largest value of a channel in every span of time.
struct Envelope {
    channel: Channel,
    spans: Vec<Option<[f64; 2]>>,
}

impl Envelope {
    fn add(&mut self, span: usize, value: f64) {
        if let Some(span) = self.spans.get_mut(span) {
            let [least, largest] = span.unwrap_or([value; 2]);
            *span = Some([least.min(value), largest.max(value)]);
        }
    }

    /// The points of a line that covers the envelope.
    fn points(&self, time_s: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let spans = self.spans.iter().enumerate().filter_map(|(span, found)| found.map(|found| (time_s(span), found)));
        spans.flat_map(|(time_s, [least, largest])| [(time_s, least), (time_s, largest)]).collect()
    }

    fn is_zero(&self) -> bool {
        self.spans.iter().flatten().all(|[least, largest]| *least == 0.0 && *largest == 0.0)
    }
}

/// The figure of a recording. Channels that are 0 all the time are left out.
pub(super) fn figure(recording: &Recording, summary: &RecordingSummary) -> Result<Figure, Failure> {
    let (first, last) = summary.samples.unwrap_or_default();
    // At most SPANS spans of as many samples each.
    let width = (last - first) / SPANS as u64 + 1;
    let channels = [Topic::States, Topic::Samples].map(|topic| recording.channels().of(topic));
    let all = channels.into_iter().flatten();
    let mut envelopes: Vec<Envelope> =
        all.map(|channel| Envelope { channel: *channel, spans: vec![None; SPANS] }).collect();
    let (states, samples) = envelopes.split_at_mut(channels[0].len());
    let span = |sample: u64| ((sample - first) / width) as usize;
    for record in recording.records()? {
        match record? {
            // The end of a run has a state but no load.
            Record::State(state) if state.is_end => {}
            Record::State(state) => {
                let (values, span) = (state.values(), span(state.sample));
                states.iter_mut().zip(&*values).for_each(|(envelope, value)| envelope.add(span, *value));
            }
            Record::Sample(readings) => {
                let (values, span) = (readings.values(), span(readings.sample));
                samples.iter_mut().zip(&values).for_each(|(envelope, value)| envelope.add(span, *value));
            }
            _ => {}
        }
    }
    let time_s = |span: usize| (first + span as u64 * width) as f64 * summary.origin.dt_s;
    let name = recording.path().file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned());
    let mut figure = Figure::new(name);
    for (name, quantity, is_read) in PANELS {
        let drawn = envelopes.iter().filter(|envelope| {
            let Channel { quantity: of, kind, .. } = envelope.channel;
            of == quantity && matches!(kind, Kind::Reading { .. }) == is_read && !envelope.is_zero()
        });
        let label = format!("{name} ({})", quantity.unit());
        let mut panel = Panel::new(Axis::linear("time (s)"), Axis::linear(label));
        for (envelope, color) in drawn.zip(COLORS.into_iter().cycle()) {
            panel = panel.with(Series::line(envelope.channel.name, color, envelope.points(time_s)));
        }
        if !panel.series.is_empty() {
            figure = figure.with(panel);
        }
    }
    match figure.panels[..] {
        [] => Err(Failure::usage(format!("{}: there is nothing to plot", recording.path().display()))),
        _ => Ok(figure),
    }
}
