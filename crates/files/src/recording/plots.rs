//! The plotting topics: states, loads and readings again, every n-th sample, one message each.

use super::channels::Channels;
use super::layout::Plot;
use super::record::{SampleRecord, StateRecord};
use super::schema::Topic;
use resonarm_bench::rig::Load;
use resonarm_numeric::decimate::{Decimated, Decimator};

/// Returns the value as it is plotted: a filtered value, which is exact to 1e-4 of the amplitude, rounded to 24 bits,
/// since the bits below can't be compressed. An unfiltered value stays unchanged.
fn plotted(every: u64, value: f64) -> f64 {
    const DROPPED: u64 = (1 << 29) - 1;
    match value.is_finite() && every > 1 {
        // Half of the last kept bit is added before the rest is dropped: it rounds to nearest. A carry into the
        // exponent is right, too: the next power of two follows the largest mantissa.
        true => f64::from_bits((value.to_bits() + (DROPPED >> 1) + 1) & !DROPPED),
        false => value,
    }
}

/// Gathers the messages for plotting.
pub struct Plots {
    /// Interval of the messages, in samples.
    every: u64,
    channels: Channels,
    states: Decimator,
    states_ready: Vec<Decimated>,
    readings: Decimator,
    readings_ready: Vec<Decimated>,
    /// The load that was held last.
    held: Load,
    /// Memory for a row of states.
    row: Vec<f64>,
}

impl Plots {
    /// Makes messages for every `every`-th sample of these channels; 0 makes none.
    pub fn new(every: u64, channels: &Channels) -> Plots {
        let [states, readings] = [Topic::States, Topic::Samples].map(|topic| channels.of(topic).len());
        Plots {
            every,
            channels: channels.clone(),
            states: Decimator::new(every, states),
            states_ready: Vec::new(),
            readings: Decimator::new(every, readings),
            readings_ready: Vec::new(),
            held: Load::default(),
            row: Vec::with_capacity(states),
        }
    }

    /// Takes the next state and load. At the end of a run, which has no load, the last one stays.
    pub fn state(&mut self, record: &StateRecord) {
        if !record.is_end {
            self.held = record.load;
        }
        self.row.clear();
        self.row.extend_from_slice(&record.values_with(&self.held));
        self.states.push(record.sample, &self.row, 0, &mut self.states_ready);
    }

    /// Takes the next readings.
    pub fn reading(&mut self, record: &SampleRecord) {
        let clipped = record.clipped_bits();
        self.readings.push(record.sample, &record.values(), clipped, &mut self.readings_ready);
    }

    /// Marks the end of the run: no further records come.
    pub fn end(&mut self) {
        self.states.end(&mut self.states_ready);
        self.readings.end(&mut self.readings_ready);
    }

    /// Takes the plotting messages that are complete, in order within each topic.
    pub fn ready(&mut self) -> Vec<Plot> {
        let mut plots = Vec::new();
        let every = self.every;
        let mut each = |rows: &mut Vec<Decimated>, types: &[Topic]| {
            for mut row in rows.drain(..) {
                row.values.iter_mut().for_each(|value| *value = plotted(every, *value));
                let message = |of: &Topic| Plot::new(*of, &self.channels, row.index, &row.values, row.flags);
                plots.extend(types.iter().map(message));
            }
        };
        each(&mut self.states_ready, &[Topic::State, Topic::Command]);
        each(&mut self.readings_ready, &[Topic::Sensors]);
        plots
    }
}
