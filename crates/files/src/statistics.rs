//! Statistics of a recording: channels in numbers, and counts of frames and events.

use std::collections::BTreeMap;

use resonarm_protocol::{DecodeError, Receiver};
use serde::Serialize;

use crate::decoder::{Decoded, DecodedMessage, Decoder, Outcome};
use crate::recording::{Direction, FrameRecord, Record, Recording, RecordingError, Topic};
use resonarm_bench::structure::{Channel, ChannelName};
use resonarm_scenario::Scenario;

/// Statistics of a recording, by channels, frames and events.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RecordingStatistics {
    /// States, loads and readings, channel by channel.
    pub channels: Vec<ChannelStatistics>,
    /// Messages of the network, or of the scenario's own protocol, by name.
    pub messages: BTreeMap<String, u64>,
    /// Frames of the network that a receiver rejects, by kind of fault.
    pub refused_frames: BTreeMap<String, u64>,
    /// Frames lost on the bus, according to the counters of the received ones.
    pub lost_frames: u64,
    /// Frames of other networks and protocols.
    pub foreign_frames: u64,
    /// Number of events by their name.
    pub events: BTreeMap<String, u64>,
}

/// Statistics of a channel, in its unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChannelStatistics {
    /// Its name, with the unit.
    pub name: ChannelName,
    /// Smallest value in the recording.
    pub least: f64,
    /// Largest value in the recording.
    pub largest: f64,
    /// Arithmetic mean over all samples.
    pub mean: f64,
    /// Root mean square, in the channel's unit.
    pub rms: f64,
}

/// Reads a recording once.
///
/// # Errors
/// [`RecordingError`] if it can't be read.
pub fn statistics(recording: &Recording) -> Result<RecordingStatistics, RecordingError> {
    let mut listener = Listener::of(recording);
    let mut sums = [Topic::States, Topic::Samples].map(|topic| Sums::new(recording.channels().of(topic)));
    let mut found = RecordingStatistics::default();
    for record in recording.records()? {
        match record? {
            // The end of a run has a state and no load.
            Record::State(state) if state.is_end => {}
            Record::State(state) => sums[0].add(&state.values()),
            Record::Sample(readings) => sums[1].add(&readings.values()),
            Record::Frame(frame) => listener.hear(&frame, &mut found),
            Record::Event(event) => *found.events.entry(event.name).or_insert(0) += 1,
            Record::Tick(_) => {}
        }
    }
    found.lost_frames = listener.lost();
    found.channels = sums.iter().flat_map(Sums::channels).collect();
    Ok(found)
}

/// Receivers that judge the frames of a recording.
enum Listener {
    /// A receiver for each end of Resonarm's protocol. Each end has counters of its own, and hears only the other's
    /// frames.
    Network([Receiver; 2]),
    /// A decoder of the user protocol.
    Wire(Box<Decoder>),
}

impl Listener {
    fn of(recording: &Recording) -> Listener {
        let scenario = Scenario::from_configuration(recording.configuration()).ok();
        if let Some(decoder) = scenario.as_ref().and_then(|scenario| Decoder::of_scenario(scenario).ok().flatten()) {
            return Listener::Wire(Box::new(decoder));
        }
        // A log that was imported without a scenario has no network of its own, and most likely the usual one.
        let network = scenario.and_then(|scenario| scenario.network().ok()).unwrap_or_default();
        Listener::Network([(); 2].map(|()| Receiver::new(network)))
    }

    fn hear(&mut self, record: &FrameRecord, found: &mut RecordingStatistics) {
        let mut refused = |reason: String| *found.refused_frames.entry(reason).or_insert(0) += 1;
        match self {
            Listener::Network(receivers) => {
                // The counters of both directions start independently, so each has a receiver of its own.
                let receiver = &mut receivers[usize::from(record.direction == Direction::Sent)];
                match receiver.accept(&record.frame) {
                    Ok(Some(message)) => *found.messages.entry(message.kind().name().to_owned()).or_insert(0) += 1,
                    Ok(None) => found.foreign_frames += 1,
                    Err(error) => refused(reason(&error)),
                }
            }
            Listener::Wire(decoder) => match decoder.decode(&record.frame) {
                Decoded::Message(DecodedMessage { message, outcome: Outcome::Refused(fault), .. }) => {
                    refused(format!("{message}: {}", fault.kind()));
                }
                Decoded::Message(DecodedMessage { message, .. }) | Decoded::Request { message, .. } => {
                    *found.messages.entry(message).or_insert(0) += 1;
                }
                Decoded::Foreign => found.foreign_frames += 1,
            },
        }
    }

    fn lost(&self) -> u64 {
        match self {
            Listener::Network(receivers) => receivers.iter().map(Receiver::lost).sum(),
            Listener::Wire(decoder) => decoder.lost(),
        }
    }
}

/// Returns the message and the check that its frame failed, without numbers.
fn reason(error: &DecodeError) -> String {
    let what = match error {
        DecodeError::Crc { .. } => "checksum",
        DecodeError::Counter { .. } => "counter",
        _ => "form or content",
    };
    format!("{}: {what}", error.kind().name())
}

/// The sums over the records of a topic.
struct Sums<'c> {
    channels: &'c [Channel],
    count: u64,
    sums: Vec<[f64; 4]>,
}

impl Sums<'_> {
    fn new(channels: &[Channel]) -> Sums<'_> {
        Sums { channels, count: 0, sums: vec![[f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0]; channels.len()] }
    }

    fn add(&mut self, values: &[f64]) {
        self.count += 1;
        for ([least, largest, sum, squares], value) in self.sums.iter_mut().zip(values) {
            *least = least.min(*value);
            *largest = largest.max(*value);
            *sum += value;
            *squares += value * value;
        }
    }

    fn channels(&self) -> Vec<ChannelStatistics> {
        let count = self.count as f64;
        let names = self.channels.iter().map(|channel| channel.name);
        let of = |(name, [least, largest, sum, squares]): (ChannelName, &[f64; 4])| ChannelStatistics {
            name,
            least: *least,
            largest: *largest,
            mean: sum / count,
            rms: libm::sqrt(squares / count),
        };
        if self.count == 0 { Vec::new() } else { names.zip(&self.sums).map(of).collect() }
    }
}
