//! Frames of a user protocol.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::{Explains, Tally};
use crate::output::map;
use resonarm::decoder::{Decoded, DecodedMessage, DecodedSignal, Decoder, Outcome};
use resonarm::protocol::Frame;
use resonarm_numeric::number::short;

/// The number of frames of each verdict.
#[derive(Default, Serialize)]
struct Counts {
    frames: u64,
    /// Frames of mapped messages.
    taken: u64,
    refused: u64,
    /// Frames of messages that the mapping does not use; without a mapping, of all messages.
    decoded: u64,
    /// The decoded frames that are shorter than their message.
    short: u64,
    /// Requests for a message, such as remote frames.
    requests: u64,
    /// Frames of no message.
    foreign: u64,
    /// Frames lost according to the counters.
    lost: u64,
}

/// A decoder that listens from the first frame on.
pub(super) struct WireFrames {
    decoder: Decoder,
    counts: Counts,
}

impl WireFrames {
    pub fn new(decoder: Decoder) -> WireFrames {
        WireFrames { decoder, counts: Counts::default() }
    }

    /// Decodes a frame, counts it, and returns its content and the verdict on it.
    fn decode(&mut self, frame: &Frame) -> (Decoded, &'static str) {
        let decoded = self.decoder.decode(frame);
        let counts = &mut self.counts;
        let (count, verdict) = match &decoded {
            Decoded::Foreign => (&mut counts.foreign, "foreign"),
            Decoded::Request { .. } => (&mut counts.requests, "request"),
            Decoded::Message(message) => match message.outcome {
                Outcome::Taken { .. } => (&mut counts.taken, "taken"),
                Outcome::Refused(_) => (&mut counts.refused, "refused"),
                Outcome::Unmapped if message.beyond().next().is_some() => (&mut counts.short, "short"),
                Outcome::Unmapped => (&mut counts.decoded, "decoded"),
            },
        };
        *count += 1;
        counts.frames += 1;
        counts.lost = self.decoder.lost();
        (decoded, verdict)
    }
}

impl Explains for WireFrames {
    fn row(&mut self, frame: &Frame) -> Map<String, Value> {
        let (decoded, verdict) = self.decode(frame);
        let mut row = Map::from_iter([("verdict".to_owned(), json!(verdict))]);
        match &decoded {
            Decoded::Foreign => {}
            Decoded::Request { message, is_answered } => {
                row.insert("message".to_owned(), json!(message));
                row.insert("is_answered".to_owned(), json!(is_answered));
            }
            Decoded::Message(message) => row.extend(message_row(message)),
        }
        row
    }

    fn text(&mut self, frame: &Frame) -> String {
        match self.decode(frame).0 {
            Decoded::Foreign if self.decoder.is_canopen() => String::from("of none of the drives"),
            Decoded::Foreign => String::from("of no message in the DBC"),
            Decoded::Request { message, is_answered: true } => format!("{message} requested"),
            Decoded::Request { message, is_answered: false } => {
                format!("{message} requested by a remote frame, which the plant does not answer")
            }
            Decoded::Message(message) => message_text(&message),
        }
    }

    fn tally(&self) -> Tally {
        let Counts { frames, taken, refused, decoded, short, requests, foreign, lost } = self.counts;
        let text = if self.decoder.is_canopen() {
            format!(
                "{frames} frames: {taken} taken, {refused} rejected, {requests} requests, {foreign} of none of the drives"
            )
        } else if self.decoder.is_mapped() {
            format!(
                "{frames} frames: {taken} taken, {refused} rejected, {decoded} of messages that are not mapped, {short} too \
                 short, {requests} requests, {foreign} of no message; {lost} lost before them"
            )
        } else {
            format!(
                "{frames} frames: {decoded} decoded, {short} too short, {requests} requests, {foreign} of no message"
            )
        };
        Tally { frames, is_clean: refused == 0 && short == 0, document: json!(self.counts), text }
    }
}

fn message_row(message: &DecodedMessage) -> Map<String, Value> {
    let of = |value: &dyn Fn(&DecodedSignal) -> Option<Value>| -> Value {
        let found = message.signals.iter().filter_map(|signal| Some((signal.name.clone(), value(signal)?)));
        Value::Object(found.collect())
    };
    let beyond: Vec<&str> = message.beyond().map(|signal| signal.name.as_str()).collect();
    // A double holds integers exactly up to 2⁵³. Larger ones are written from their integer value, where JSON has a
    // number for it.
    let exact = |signal: &DecodedSignal| signal.large.and_then(|large| integer(large.value?));
    let mut row = json!({
        "message": message.message,
        "senders": message.senders,
        "bytes": message.bytes,
        "expected_bytes": message.expected_bytes,
        "signals": of(&|signal| exact(signal).or_else(|| signal.value.map(|value| json!(value)))),
        "raw": of(&|signal| signal.large.and_then(|large| integer(large.raw))),
        "units": of(&|signal| (!signal.unit.is_empty()).then(|| json!(signal.unit))),
        "texts": of(&|signal| signal.text.as_ref().map(|text| json!(text))),
        "means": of(&|signal| (!signal.means.is_empty()).then(|| json!(signal.means))),
        "message_means": message.means,
        "beyond": beyond,
    });
    match &message.outcome {
        Outcome::Taken { lost } => row["lost"] = json!(lost),
        Outcome::Refused(fault) => row["reason"] = json!(fault.to_string()),
        Outcome::Unmapped => {}
    }
    map(row)
}

/// Returns a number of JSON, if the integer has at most 64 bits.
fn integer(number: i128) -> Option<Value> {
    u64::try_from(number).map(Value::from).or_else(|_| i64::try_from(number).map(Value::from)).ok()
}

fn message_text(message: &DecodedMessage) -> String {
    let mut text = message.message.clone();
    if let Outcome::Refused(fault) = &message.outcome {
        text += &format!(" rejected: {fault}");
        text += if message.signals.iter().any(|signal| signal.value.is_some()) { ";" } else { "" };
    }
    for means in &message.means {
        text += &format!(" ({means})");
    }
    for signal in &message.signals {
        if let Some(value) = signal.value {
            text += &format!(" {}", signal_text(signal, value));
        }
    }
    if message.bytes != message.expected_bytes {
        text += &format!("; {} of {} bytes", message.bytes, message.expected_bytes);
    }
    let beyond: Vec<&str> = message.beyond().map(|signal| signal.name.as_str()).collect();
    if !beyond.is_empty() {
        text += &format!(", beyond them {}", beyond.join(", "));
    }
    if let Outcome::Taken { lost: lost @ 1.. } = message.outcome {
        text += &format!("; {lost} lost before it");
    }
    text
}

fn signal_text(signal: &DecodedSignal, value: f64) -> String {
    // The last digits of a product of count and factor mean nothing.
    let shown = format!("{value:.14e}").parse().unwrap_or(value);
    let exact = signal.large.and_then(|large| large.value);
    let mut text = match exact {
        Some(exact) => format!("{}={exact}", signal.name),
        None => format!("{}={}", signal.name, short(&shown)),
    };
    if !signal.unit.is_empty() {
        text += &format!(" {}", signal.unit);
    }
    if let (Some(large), None) = (signal.large, exact) {
        text += &format!(" (raw {})", large.raw);
    }
    if let Some(of_table) = &signal.text {
        text += &format!(" {of_table:?}");
    }
    let means: Vec<String> = signal.means.iter().map(ToString::to_string).collect();
    if !means.is_empty() {
        text += &format!(" ({})", means.join(", "));
    }
    text
}
