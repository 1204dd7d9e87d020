//! The stream for Foxglove, Lichtblick and PlotJuggler: the Foxglove WebSocket protocol, with the messages and
//! schemas of recordings.
//!
//! The server describes itself (`serverInfo`) and its channels (`advertise`); a client subscribes to
//! channels, and each message comes as a binary frame: opcode 1, the client's number of the subscription (32 bits), the
//! time (64 bits, ns), both little-endian, and the payload. The subprotocol has an old name, `foxglove.websocket.v1`,
//! and a new one, `foxglove.sdk.v1`, for the same messages.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::ws::{Message, Utf8Bytes};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;
use serde_json::{Value, json};

use super::model::Model;
use super::moving::Moving;
use resonarm_bench::structure::{Kind, LoadSet};
use resonarm_files::drawing::Drawing;
use resonarm_files::export::scene;
use resonarm_files::recording::channels::Channels;
use resonarm_files::recording::{
    Batch, Batcher, Event, FrameBatcher, Layout, NumberBatch, Numbers, Plot, Plots, Record, SampleRecord, StateRecord,
    Topic, proto,
};
use resonarm_session::run::{self, CommandRecord};

/// Both names of the subprotocol.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// The channels with messages as in recordings. A channel's number is its place among those published: after these that
/// of the moving structure.
const RECORDED: [Channel; 8] = [
    Channel::Recorded(Topic::State),
    Channel::Recorded(Topic::Command),
    Channel::Recorded(Topic::Sensors),
    Channel::Recorded(Topic::States),
    Channel::Recorded(Topic::Samples),
    Channel::Recorded(Topic::Ticks),
    Channel::Recorded(Topic::Events),
    Channel::Recorded(Topic::Frames),
];
/// Opcode of a message.
const MESSAGE_DATA: u8 = 1;
/// Level of a status message for an error.
const ERROR: u8 = 2;
/// Most rows in a batch; each update sends the rows so far.
const BATCH_ROWS: u32 = 500;
/// A plotting topic has a message every so many samples.
const PLOT_EVERY: u64 = 10;

/// A channel that the stream can publish.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Messages as in recordings.
    Recorded(Topic),
    /// The moving structure, as in copies for viewers.
    Scene,
}

impl Channel {
    /// Entry of the channel, with number `id`, in the message `advertise`.
    fn advertised(self, id: usize, table: &Channels) -> Value {
        match self {
            Channel::Recorded(of) => json!({
                "id": id,
                "topic": of.name(),
                "encoding": "protobuf",
                "schemaName": of.schema_name(),
                "schema": STANDARD.encode(of.descriptor(table)),
                "schemaEncoding": "protobuf",
            }),
            Channel::Scene => json!({
                "id": id,
                "topic": scene::TOPIC,
                "encoding": "json",
                "schemaName": scene::SCHEMA,
                "schema": scene::schema().to_string(),
                "schemaEncoding": "jsonschema",
            }),
        }
    }
}

/// A message for all subscribers of its channel.
#[derive(Clone, Debug)]
pub struct Published {
    channel: u32,
    time_ns: u64,
    bytes: Bytes,
}

/// Makes Foxglove messages of notices and records.
pub struct Stream {
    dt_s: f64,
    /// Time of sample 0, ns of the UNIX epoch.
    start_unix_ns: u64,
    table: Channels,
    states: Batcher<NumberBatch<StateRecord>>,
    readings: Batcher<NumberBatch<SampleRecord>>,
    ticks: Batcher<proto::TickBatch>,
    frames: FrameBatcher,
    plots: Plots,
    /// `None` where the coordinates are unknown, or the places of the points.
    moving: Option<Moving>,
    /// Channels that are published.
    pub channels: Vec<Channel>,
    published: Vec<Published>,
}

impl Stream {
    /// Makes the server for samples `dt_s` apart, the first at `start_unix_ns`, frames on the bus `interface`, and a
    /// structure that is drawn if its coordinates are known; states and readings consist of the channels of `table`.
    pub fn new(dt_s: f64, start_unix_ns: u64, interface: &str, drawing: Option<Drawing>, table: Channels) -> Stream {
        let moving = drawing.map(Moving::new);
        let scene = moving.as_ref().map(|_moving| Channel::Scene);
        Stream {
            dt_s,
            start_unix_ns,
            states: numbers(&table, dt_s),
            readings: numbers(&table, dt_s),
            ticks: Batcher::new(proto::TickBatch::default(), BATCH_ROWS, dt_s),
            frames: FrameBatcher::new(BATCH_ROWS, interface),
            moving,
            channels: RECORDED.into_iter().chain(scene).collect(),
            plots: Plots::new(PLOT_EVERY, &table),
            table,
            published: Vec::new(),
        }
    }

    /// Publishes what a notice of the loop contains. Responses and set-points have no channel.
    pub fn notice(&mut self, notice: &run::Notice) {
        match notice {
            run::Notice::Record(record) => self.record(record),
            run::Notice::Command(CommandRecord { sample, load }) => {
                if sample.is_multiple_of(PLOT_EVERY) {
                    let taken = self.table.of(Topic::States).iter().filter(|channel| channel.kind == Kind::Load);
                    let mut loads = LoadSet::of_channels(taken).unwrap_or(LoadSet::NATIVE).parts(load);
                    let channels = self.table.of(Topic::States).iter();
                    let value = |kind| if kind == Kind::Load { loads.next() } else { None };
                    let row: Vec<f64> =
                        channels.map(|channel| channel.kind).map(value).map(Option::unwrap_or_default).collect();
                    self.publish_plot(&Plot::new(Topic::Command, &self.table, *sample, &row, 0));
                }
            }
            run::Notice::Response(_) | run::Notice::SetPoint(_) | run::Notice::Test(_) => {}
        }
    }

    /// Publishes a record of the run.
    pub fn record<Name: AsRef<str>>(&mut self, record: &Record<Name>) {
        match record {
            Record::State(state) => {
                // All batches are published together, so that no topic lags behind the others.
                if self.states.must_take_before(state) {
                    self.take_batches();
                }
                self.states.append(state);
                self.moving.iter_mut().for_each(|moving| moving.state(state));
                self.plots.state(state);
                self.publish_plots();
            }
            Record::Sample(readings) => {
                if self.readings.must_take_before(readings) {
                    self.take_batches();
                }
                self.readings.append(readings);
                self.plots.reading(readings);
                self.publish_plots();
            }
            Record::Tick(tick) => {
                if self.ticks.must_take_before(tick) {
                    self.take_batches();
                }
                self.ticks.append(tick);
            }
            Record::Event(Event { sample, time_ns, name, value }) => {
                let name = name.as_ref().to_owned();
                let step = *sample;
                self.publish(Topic::Events, step, &proto::Event { step, time_ns: *time_ns, name, value: *value });
            }
            Record::Frame(frame) => {
                if self.frames.must_take_before(frame) {
                    self.take_batches();
                }
                self.frames.append(frame);
            }
        }
    }

    /// The messages made since the last call.
    pub fn take(&mut self) -> Vec<Published> {
        self.take_batches();
        let start_and_dt = (self.start_unix_ns, self.dt_s);
        if let Some((sample, scene)) =
            self.moving.as_mut().and_then(|moving| moving.take(|sample| time_ns(start_and_dt, sample)))
        {
            // The scene's channel follows those of recordings.
            self.push(RECORDED.len(), sample, scene.to_string().into_bytes());
        }
        core::mem::take(&mut self.published)
    }

    fn take_batches(&mut self) {
        if let Some(batch) = self.states.take().cloned() {
            self.publish(Topic::States, batch.first_sample(), &batch);
        }
        if let Some(batch) = self.readings.take().cloned() {
            self.publish(Topic::Samples, batch.first_sample(), &batch);
        }
        if let Some(batch) = self.ticks.take().cloned() {
            self.publish(Topic::Ticks, batch.first_sample(), &batch);
        }
        if let Some((first, batch)) = self.frames.take().map(|(first, batch)| (first, batch.clone())) {
            self.publish(Topic::Frames, first, &batch);
        }
    }

    fn publish_plots(&mut self) {
        for plot in self.plots.ready() {
            self.publish_plot(&plot);
        }
    }

    fn publish_plot(&mut self, plot: &Plot) {
        self.publish(plot.topic, plot.sample, plot);
    }

    fn publish(&mut self, topic: Topic, sample: u64, message: &impl prost::Message) {
        let Some(channel) = RECORDED.iter().position(|of| *of == Channel::Recorded(topic)) else { return };
        self.push(channel, sample, message.encode_to_vec());
    }

    fn push(&mut self, channel: usize, sample: u64, bytes: Vec<u8>) {
        let time_ns = time_ns((self.start_unix_ns, self.dt_s), sample);
        self.published.push(Published { channel: channel as u32, time_ns, bytes: Bytes::from(bytes) });
    }
}

/// Gathers states or readings.
fn numbers<R: Numbers>(table: &Channels, dt_s: f64) -> Batcher<NumberBatch<R>> {
    Batcher::new(NumberBatch::new(Arc::new(Layout::new(table, R::TOPIC))), BATCH_ROWS, dt_s)
}

/// Time of a sample, ns of the UNIX epoch.
fn time_ns((start_unix_ns, dt_s): (u64, f64), sample: u64) -> u64 {
    // Rounded, as in recordings: cut off, every few samples would be 1 ns early.
    start_unix_ns.saturating_add(libm::round(sample as f64 * dt_s * 1e9) as u64)
}

/// The first messages to a client.
pub fn introduction(model: &Model, channels: &[Channel], session: &str) -> [Message; 2] {
    let about = &model.about;
    let table = &model.under_test.table;
    // Without capabilities a client may neither publish nor call anything. The session tells a client that connects
    // again whether this is still the same run.
    let info = json!({
        "op": "serverInfo",
        "name": format!("resonarm {} ({}, {})", about.version, about.role, about.place),
        "capabilities": [],
        "supportedEncodings": ["protobuf"],
        "metadata": { "structure": about.structure, "rate_hz": about.rate_hz.to_string() },
        "sessionId": session,
    });
    let channels: Vec<Value> = channels.iter().enumerate().map(|(id, channel)| channel.advertised(id, table)).collect();
    [text(&info), text(&json!({ "op": "advertise", "channels": channels }))]
}

fn text(value: &Value) -> Message {
    Message::Text(Utf8Bytes::from(value.to_string()))
}

/// Message of a client. Messages not for this server are refused by a status message.
#[derive(Debug, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum Said {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: u32,
}

/// Most subscriptions of a client: each channel a few times over.
const SUBSCRIPTIONS: usize = 64;

/// A client's subscriptions: its own numbers, and the channels.
#[derive(Debug)]
pub struct Subscriptions {
    /// Number of channels that are advertised.
    channels: usize,
    subscribed: BTreeMap<u32, u32>,
}

impl Subscriptions {
    /// Makes a list without subscriptions to so many channels.
    pub fn new(channels: usize) -> Subscriptions {
        Subscriptions { channels, subscribed: BTreeMap::new() }
    }

    /// Takes a client's message; returns an error message if it is wrong.
    pub fn receive(&mut self, text: &str) -> Option<Message> {
        match serde_json::from_str(text) {
            Ok(Said::Subscribe { subscriptions }) => {
                let refused: Vec<String> = subscriptions.iter().filter_map(|one| self.subscribe(*one).err()).collect();
                (!refused.is_empty()).then(|| status(&refused.join("; ")))
            }
            Ok(Said::Unsubscribe { subscription_ids }) => {
                self.subscribed.retain(|id, _| !subscription_ids.contains(id));
                None
            }
            Err(error) => Some(status(&format!("resonarm accepts only subscribe and unsubscribe: {error}"))),
        }
    }

    fn subscribe(&mut self, Subscription { id, channel_id }: Subscription) -> Result<(), String> {
        if channel_id as usize >= self.channels {
            return Err(format!("there is no channel {channel_id}"));
        }
        // A number that is used again replaces its subscription, and needs no more room.
        if self.subscribed.len() >= SUBSCRIPTIONS && !self.subscribed.contains_key(&id) {
            return Err(format!("more than {SUBSCRIPTIONS} subscriptions"));
        }
        self.subscribed.insert(id, channel_id);
        Ok(())
    }

    /// The frames of a message for this client: one for each subscription to its channel.
    pub fn frames(&self, message: &Published) -> impl Iterator<Item = Message> {
        let subscribed = self.subscribed.iter().filter(|(_, channel)| **channel == message.channel);
        subscribed.map(|(id, _)| {
            let head = [&[MESSAGE_DATA][..], &id.to_le_bytes(), &message.time_ns.to_le_bytes()];
            Message::Binary(Bytes::from([&head.concat()[..], &message.bytes].concat()))
        })
    }
}

/// An error message to a client.
pub fn status(text_: &str) -> Message {
    text(&json!({ "op": "status", "level": ERROR, "message": text_ }))
}

#[cfg(test)]
mod tests {
    use prost::Message as _;

    use super::*;
    use resonarm_bench::rig::Load;
    use resonarm_bench::structure::States;
    use resonarm_files::recording::{Direction, FrameRecord, TickRecord};
    use resonarm_scenario::Scenario;

    fn frame(sample: u64, direction: Direction, id: u16) -> Record {
        let frame = resonarm_protocol::Frame::classic(resonarm_protocol::Id::Standard(id), &[1, 2]).unwrap();
        Record::Frame(FrameRecord { sample, direction, time_ns: 7 * sample, bus_timestamp_ns: None, frame })
    }

    /// Sample 1025 of a bench at 1 kHz was at 1024999999 ns: the product of floating-point numbers is below 1.025 s.
    #[test]
    fn times_of_samples_are_whole_milliseconds() {
        let wrong = (0..100_000_u64).find(|sample| time_ns((5, 1e-3), *sample) != 5 + sample * 1_000_000);
        assert_eq!(wrong, None);
    }

    #[test]
    fn frames_are_sent_as_recorded() {
        let mut stream = Stream::new(1e-3, 0, "vcan0", None, Channels::default());
        assert_eq!(stream.channels, RECORDED);
        stream.record(&frame(3, Direction::Received, 0x203));
        stream.record(&frame(4, Direction::Sent, 0x205));
        // An exciter counts from each arming.
        stream.record(&frame(0, Direction::Sent, 0x205));
        let published = stream.take();
        let batches: Vec<_> = published.iter().map(|one| proto::FrameBatch::decode(&*one.bytes).unwrap()).collect();
        assert_eq!(
            published.iter().map(|one| (one.channel, one.time_ns)).collect::<Vec<_>>(),
            [(7, 3_000_000), (7, 0)]
        );
        assert_eq!((batches[0].id.as_slice(), batches[0].direction.as_slice()), (&[0x203, 0x205][..], &[1, 2][..]));
        assert_eq!((batches[0].interface.as_str(), &batches[0].time_difference_ns[..]), ("vcan0", &[21, 7][..]));
        assert!(stream.take().is_empty());
    }

    #[test]
    fn the_structure_is_sent_once_an_update_as_in_copies_for_viewers() {
        let drawing = Drawing::of(&Scenario::default()).unwrap();
        let mut stream = Stream::new(1e-3, 1_000, "none", drawing, Channels::default());
        assert_eq!(stream.channels[RECORDED.len()..], [Channel::Scene]);
        for sample in 5..8 {
            let state = StateRecord {
                sample,
                states: States::new(&[1e-3, 0.0, 0.0, 0.0], &[]).unwrap(),
                load: Load::default(),
                taken: LoadSet::NATIVE,
                is_end: false,
            };
            stream.record(&Record::<&str>::State(state));
        }
        let published = stream.take();
        let arms: Vec<_> = published.iter().filter(|one| one.channel == 8).collect();
        let [arm] = arms.as_slice() else { panic!("{arms:?}") };
        assert_eq!(arm.time_ns, 7_001_000);
        let update: Value = serde_json::from_slice(&arm.bytes).unwrap();
        assert_eq!(update["entities"][0]["timestamp"], json!({ "sec": 0, "nsec": 7_001_000 }));
        assert!(stream.take().is_empty());
    }

    #[test]
    fn subscribers_get_frames_and_nonsense_is_answered() {
        let mut stream = Stream::new(1e-3, 1_000, "vcan0", None, Channels::default());
        let mut subscriptions = Subscriptions::new(stream.channels.len());
        let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":7,"channelId":5},{"id":8,"channelId":99}]}"#;
        let Some(Message::Text(refused)) = subscriptions.receive(subscribe) else { panic!("nothing refused") };
        assert_eq!(refused.as_str(), r#"{"level":2,"message":"there is no channel 99","op":"status"}"#);
        stream.record(&Record::<&str>::Tick(TickRecord {
            sample: 2,
            wakeup_ns: 1,
            exec_ns: 2,
            overruns: 0,
            cause: None,
        }));
        stream.record(&Record::Event(Event { sample: 3, time_ns: 0, name: "state.fault", value: 0 }));
        let published = stream.take();
        assert_eq!(published.len(), 2);
        let frames: Vec<Message> = published.iter().flat_map(|message| subscriptions.frames(message)).collect();
        let [Message::Binary(bytes)] = &frames[..] else { panic!("{frames:?}") };
        assert_eq!(&bytes[..5], [1, 7, 0, 0, 0]);
        assert_eq!(u64::from_le_bytes(bytes[5..13].try_into().unwrap()), 2_001_000);
        let batch = proto::TickBatch::decode(&bytes[13..]).unwrap();
        assert_eq!((batch.first_step, batch.exec_ns), (2, vec![2]));
        assert!(subscriptions.receive(r#"{"op":"unsubscribe","subscriptionIds":[7]}"#).is_none());
        assert_eq!(published.iter().flat_map(|message| subscriptions.frames(message)).count(), 0);
        for nonsense in ["", "[]", r#"{"op":"advertise","channels":[]}"#, "{\"op\":\"subscribe\"}"] {
            assert!(subscriptions.receive(nonsense).is_some(), "{nonsense}");
        }
    }
}
