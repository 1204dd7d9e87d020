//! A small figure of a recording: angles, load and readings over time.

use crate::cli::failure::Failure;
use crate::export::{Part, channels, sample_values, state_values};
use crate::plot::{Axis, Color, Figure, Panel, Series};
use crate::recording::{Record, Recording, RecordingSummary};

/// Spans of time; each is drawn by its least and its largest value, about two spans a px.
const SPANS: usize = 1200;

/// Panels: label of the y axis and the channels.
const PANELS: [(&str, &[&str]); 5] = [
    ("angle (rad)", &["alpha1_rad", "alpha2_rad"]),
    ("torque (N·m)", &["torque1_nm", "torque2_nm"]),
    ("force (N)", &["force_x_n", "force_y_n"]),
    (
        "acceleration (m/s²)",
        &["acceleration_b_x_m_s2", "acceleration_b_y_m_s2", "acceleration_c_x_m_s2", "acceleration_c_y_m_s2"],
    ),
    ("force in head (N)", &["head_force_x_n", "head_force_y_n"]),
];
const COLORS: [Color; 4] = [Color::Blue, Color::Vermillion, Color::Green, Color::Purple];

/// The least and the largest value of a channel in every span of time.
struct Envelope {
    name: &'static str,
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
    let names = [Part::States, Part::Samples].map(|part| channels(part).iter().map(|channel| channel.name));
    let mut envelopes: Vec<Envelope> =
        names.into_iter().flatten().map(|name| Envelope { name, spans: vec![None; SPANS] }).collect();
    let (states, samples) = envelopes.split_at_mut(channels(Part::States).len());
    let span = |sample: u64| ((sample - first) / width) as usize;
    for record in recording.records()? {
        match record? {
            // The end of a run has a state but no load.
            Record::State(state) if state.is_end => {}
            Record::State(state) => {
                let each = states.iter_mut().zip(state_values(&state));
                each.for_each(|(envelope, value)| envelope.add(span(state.sample), value));
            }
            Record::Sample(readings) => {
                let each = samples.iter_mut().zip(sample_values(&readings));
                each.for_each(|(envelope, value)| envelope.add(span(readings.sample), value));
            }
            _ => {}
        }
    }
    let time_s = |span: usize| (first + span as u64 * width) as f64 * summary.origin.dt_s;
    let name = recording.path().file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned());
    let mut figure = Figure::new(name);
    for (label, names) in PANELS {
        let drawn = envelopes.iter().filter(|envelope| names.contains(&envelope.name) && !envelope.is_zero());
        let mut panel = Panel::new(Axis::linear("time (s)"), Axis::linear(label));
        for (envelope, color) in drawn.zip(COLORS) {
            panel = panel.with(Series::line(envelope.name, color, envelope.points(time_s)));
        }
        if !panel.series.is_empty() {
            figure = figure.with(panel);
        }
    }
    match figure.panels[..] {
        [] => Err(Failure::Usage(format!("{}: there is nothing to plot", recording.path().display()))),
        _ => Ok(figure),
    }
}
