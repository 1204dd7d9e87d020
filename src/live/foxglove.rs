//! The stream as Foxglove, Lichtblick and PlotJuggler take it: the Foxglove WebSocket protocol, with the messages and
//! schemas of recordings.
//!
//! The server says what it is (`serverInfo`) and which channels there are (`advertise`); a client subscribes to
//! channels, and each message comes as a binary frame: opcode 1, the client's number of the subscription (32 bits), the
//! time (64 bits, ns), both little-endian, and the payload. The subprotocol has an old name, `foxglove.websocket.v1`,
//! and a new one, `foxglove.sdk.v1`, for the same messages.

use std::collections::BTreeMap;

use axum::body::Bytes;
use axum::extract::ws::{Message, Utf8Bytes};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;
use serde_json::{Value, json};

use super::about::About;
use crate::recording::{Batch, Batcher, Event, MessageType, Plot, Plots, Record, proto};
use crate::run::{self, CommandRecord};

/// Both names of the subprotocol.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// What is published; the number of a channel is its place here.
const CHANNELS: [MessageType; 7] = [
    MessageType::State,
    MessageType::Command,
    MessageType::Sensors,
    MessageType::StepBatch,
    MessageType::SampleBatch,
    MessageType::TickBatch,
    MessageType::Event,
];
/// Opcode of a message.
const MESSAGE_DATA: u8 = 1;
/// Level of a status message that tells an error.
const ERROR: u8 = 2;
/// Rows of a batch at most; what is there goes out with each update.
const BATCH_ROWS: u32 = 500;
/// Every how many samples a plotting topic has a message.
const PLOT_EVERY: u64 = 10;

/// A message for everyone who subscribed to its channel.
#[derive(Clone, Debug)]
pub struct Published {
    channel: u32,
    time_ns: u64,
    bytes: Bytes,
}

/// Makes messages of what is told.
pub struct Stream {
    dt_s: f64,
    /// Time of sample 0, ns of the UNIX epoch.
    start_unix_ns: u64,
    states: Batcher<proto::StepBatch>,
    readings: Batcher<proto::SampleBatch>,
    ticks: Batcher<proto::TickBatch>,
    plots: Plots,
    published: Vec<Published>,
}

impl Stream {
    /// Of samples `dt_s` apart, the first of which is taken for `start_unix_ns`.
    pub fn new(dt_s: f64, start_unix_ns: u64) -> Stream {
        Stream {
            dt_s,
            start_unix_ns,
            states: Batcher::new(BATCH_ROWS, dt_s),
            readings: Batcher::new(BATCH_ROWS, dt_s),
            ticks: Batcher::new(BATCH_ROWS, dt_s),
            plots: Plots::new(PLOT_EVERY),
            published: Vec::new(),
        }
    }

    /// Takes what a loop told.
    pub fn told(&mut self, told: &run::Told) {
        match told {
            run::Told::Record(record) => self.record(record),
            run::Told::Command(CommandRecord { sample, load }) => {
                let (t, f) = (load.torque_nm, load.force_n);
                let (torque1_nm, torque2_nm, force_x_n, force_y_n) = (t.x, t.y, f.x, f.y);
                if sample.is_multiple_of(PLOT_EVERY) {
                    let command = proto::Command { step: *sample, torque1_nm, torque2_nm, force_x_n, force_y_n };
                    self.publish(MessageType::Command, *sample, &command);
                }
            }
            run::Told::Response(_) => {}
        }
    }

    /// Takes a record.
    pub fn record<Name: AsRef<str>>(&mut self, record: &Record<Name>) {
        match record {
            Record::State(state) => {
                if self.states.must_take_before(state) {
                    self.take_batches();
                }
                self.states.append(state);
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
                let (name, step) = (name.as_ref().to_owned(), *sample);
                self.publish(MessageType::Event, step, &proto::Event { step, time_ns: *time_ns, name, value: *value });
            }
            Record::Frame(_) => {}
        }
    }

    /// What is to be sent since the last call.
    pub fn take(&mut self) -> Vec<Published> {
        self.take_batches();
        core::mem::take(&mut self.published)
    }

    fn take_batches(&mut self) {
        if let Some(batch) = self.states.take().cloned() {
            self.publish(MessageType::StepBatch, batch.first_sample(), &batch);
        }
        if let Some(batch) = self.readings.take().cloned() {
            self.publish(MessageType::SampleBatch, batch.first_sample(), &batch);
        }
        if let Some(batch) = self.ticks.take().cloned() {
            self.publish(MessageType::TickBatch, batch.first_sample(), &batch);
        }
    }

    fn publish_plots(&mut self) {
        for plot in self.plots.ready() {
            let sample = plot.sample();
            match plot {
                Plot::State(state) => self.publish(MessageType::State, sample, &state),
                Plot::Command(command) => self.publish(MessageType::Command, sample, &command),
                Plot::Sensors(sensors) => self.publish(MessageType::Sensors, sample, &sensors),
            }
        }
    }

    fn publish(&mut self, message_type: MessageType, sample: u64, message: &impl prost::Message) {
        let Some(channel) = CHANNELS.iter().position(|of| *of == message_type) else { return };
        let time_ns = self.start_unix_ns.saturating_add((sample as f64 * self.dt_s * 1e9) as u64);
        let bytes = Bytes::from(message.encode_to_vec());
        self.published.push(Published { channel: channel as u32, time_ns, bytes });
    }
}

/// What a client is told first.
pub fn introduction(about: &About, session: &str) -> [Message; 2] {
    let info = json!({
        "op": "serverInfo",
        "name": format!("resonarm {} ({}, {})", about.version, about.role, about.place),
        "capabilities": [],
        "supportedEncodings": ["protobuf"],
        "metadata": { "arm": about.arm, "rate_hz": about.rate_hz.to_string() },
        "sessionId": session,
    });
    let channels: Vec<Value> = CHANNELS
        .iter()
        .enumerate()
        .map(|(id, of)| {
            json!({
                "id": id,
                "topic": of.topic().name(),
                "encoding": "protobuf",
                "schemaName": of.name(),
                "schema": STANDARD.encode(of.descriptor()),
                "schemaEncoding": "protobuf",
            })
        })
        .collect();
    [text(&info), text(&json!({ "op": "advertise", "channels": channels }))]
}

fn text(value: &Value) -> Message {
    Message::Text(Utf8Bytes::from(value.to_string()))
}

/// What a client says. What is not for this server is refused by a status message.
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

/// Subscriptions of a client at most: each channel a few times over.
const SUBSCRIPTIONS: usize = 64;

/// What a client has subscribed to: its own numbers, and the channels.
#[derive(Debug, Default)]
pub struct Subscriptions(BTreeMap<u32, u32>);

impl Subscriptions {
    /// Takes what the client said; what it is answered, if it is wrong.
    pub fn said(&mut self, text: &str) -> Option<Message> {
        match serde_json::from_str(text) {
            Ok(Said::Subscribe { subscriptions }) => {
                let refused: Vec<String> = subscriptions.iter().filter_map(|one| self.subscribe(*one).err()).collect();
                (!refused.is_empty()).then(|| status(&refused.join("; ")))
            }
            Ok(Said::Unsubscribe { subscription_ids }) => {
                self.0.retain(|id, _| !subscription_ids.contains(id));
                None
            }
            Err(error) => Some(status(&format!("resonarm takes subscribe and unsubscribe: {error}"))),
        }
    }

    fn subscribe(&mut self, Subscription { id, channel_id }: Subscription) -> Result<(), String> {
        if channel_id as usize >= CHANNELS.len() {
            return Err(format!("there is no channel {channel_id}"));
        }
        if self.0.len() >= SUBSCRIPTIONS && !self.0.contains_key(&id) {
            return Err(format!("more than {SUBSCRIPTIONS} subscriptions"));
        }
        self.0.insert(id, channel_id);
        Ok(())
    }

    /// The frames of a message for this client: one for each subscription to its channel.
    pub fn frames(&self, message: &Published) -> impl Iterator<Item = Message> {
        let subscribed = self.0.iter().filter(|(_, channel)| **channel == message.channel);
        subscribed.map(|(id, _)| {
            let head = [&[MESSAGE_DATA][..], &id.to_le_bytes(), &message.time_ns.to_le_bytes()];
            Message::Binary(Bytes::from([&head.concat()[..], &message.bytes].concat()))
        })
    }
}

/// Says what is wrong with something that a client said.
pub fn status(text_: &str) -> Message {
    text(&json!({ "op": "status", "level": ERROR, "message": text_ }))
}

#[cfg(test)]
mod tests {
    use prost::Message as _;

    use super::*;
    use crate::recording::TickRecord;

    #[test]
    fn who_has_subscribed_gets_frames_and_nonsense_is_answered() {
        let mut subscriptions = Subscriptions::default();
        let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":7,"channelId":5},{"id":8,"channelId":99}]}"#;
        let Some(Message::Text(refused)) = subscriptions.said(subscribe) else { panic!("nothing refused") };
        assert_eq!(refused.as_str(), r#"{"level":2,"message":"there is no channel 99","op":"status"}"#);
        let mut stream = Stream::new(1e-3, 1_000);
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
        assert!(subscriptions.said(r#"{"op":"unsubscribe","subscriptionIds":[7]}"#).is_none());
        assert_eq!(published.iter().flat_map(|message| subscriptions.frames(message)).count(), 0);
        for nonsense in ["", "[]", r#"{"op":"advertise","channels":[]}"#, "{\"op\":\"subscribe\"}"] {
            assert!(subscriptions.said(nonsense).is_some(), "{nonsense}");
        }
    }
}
