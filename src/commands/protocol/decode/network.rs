//! Frames of Resonarm's own protocol.

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::{Explains, Tally};
use crate::output::map;
use resonarm::protocol::{DecodeError, Frame, Message, Network, Receiver};
use resonarm_numeric::number::short;

/// The number of frames of each verdict.
#[derive(Default, Serialize)]
struct Counts {
    frames: u64,
    taken: u64,
    refused: u64,
    /// Frames of other protocols or networks.
    foreign: u64,
    /// Frames lost according to the counters.
    lost: u64,
}

/// The verdict of a receiver on a frame; none on a frame of another protocol.
type Verdicted = Result<Option<Message>, DecodeError>;

/// A receiver that listens from the first frame on.
pub(super) struct NetworkFrames {
    receiver: Receiver,
    counts: Counts,
}

impl NetworkFrames {
    pub fn new(network: Network) -> NetworkFrames {
        NetworkFrames { receiver: Receiver::new(network), counts: Counts::default() }
    }

    fn accept(&mut self, frame: &Frame) -> Verdicted {
        let verdict = self.receiver.accept(frame);
        self.counts.frames += 1;
        match verdict {
            Ok(Some(_)) => self.counts.taken += 1,
            Err(_) => self.counts.refused += 1,
            Ok(None) => self.counts.foreign += 1,
        }
        self.counts.lost = self.receiver.lost();
        verdict
    }
}

impl Explains for NetworkFrames {
    fn row(&mut self, frame: &Frame) -> Map<String, Value> {
        let (outcome, more) = match self.accept(frame) {
            Ok(Some(message)) => {
                let mut signals = Map::new();
                message.signals(|name, value| drop(signals.insert(name.to_owned(), json!(value))));
                let kind = message.kind();
                ("taken", json!({ "message": kind.name(), "sender": kind.sender().to_string(), "signals": signals }))
            }
            Err(error) => ("refused", json!({ "message": error.kind().name(), "reason": error.to_string() })),
            Ok(None) => ("foreign", json!({})),
        };
        let mut row = Map::from_iter([("verdict".to_owned(), json!(outcome))]);
        row.extend(map(more));
        row
    }

    fn text(&mut self, frame: &Frame) -> String {
        match self.accept(frame) {
            Ok(Some(message)) => {
                let mut text = message.kind().to_string();
                message.signals(|name, value| {
                    text += &format!(" {name}={}", short(&value));
                });
                if let Message::Emergency(emergency) = message {
                    text += &format!(" ({emergency})");
                }
                text
            }
            Err(error) => error.to_string(),
            Ok(None) => String::from("not of this network"),
        }
    }

    fn tally(&self) -> Tally {
        let Counts { frames, taken, refused, foreign, lost } = self.counts;
        let text = format!(
            "{frames} frames: {taken} taken, {refused} rejected, {foreign} of other protocols; {lost} lost before them"
        );
        Tally { frames, is_clean: refused == 0, document: json!(self.counts), text }
    }
}
