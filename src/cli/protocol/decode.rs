//! `resonarm protocol decode`: what frames say.

use core::fmt::Write;
use std::io::{self, BufRead};

use clap::Args;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::NetworkFlags;
use super::log_line::LogLine;
use crate::cli::failure::{Failure, Verdict};
use crate::cli::output;
use crate::number::short;
use crate::protocol::{DecodeError, Message, Receiver};

/// Says what frames mean, and whether a receiver takes them: form, E2E protection, content. Counters are judged from
/// frame to frame, as a receiver does that has listened from the first one on.
#[derive(Debug, Args)]
pub(super) struct Decode {
    /// Frames as cansend takes them, such as 201#8A00F40183FF3412; without any, lines of frames or of `candump -L` from
    /// standard input.
    #[arg(value_name = "FRAME")]
    frames: Vec<String>,
    #[command(flatten)]
    network: NetworkFlags,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// How many frames of each verdict.
#[derive(Default, Serialize)]
struct Counts {
    frames: u64,
    taken: u64,
    refused: u64,
    /// Of other protocols or networks.
    foreign: u64,
    /// As the counters tell.
    lost: u64,
}

/// What became of a frame.
enum Verdicted {
    Taken(Message),
    Refused(DecodeError),
    Foreign,
}

impl Decode {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let mut receiver = Receiver::new(self.network.network()?);
        let (mut counts, mut rows) = (Counts::default(), Vec::new());
        let mut decode = |line: &LogLine| -> Result<(), Failure> {
            let verdict = match receiver.accept(&line.frame) {
                Ok(Some(message)) => Verdicted::Taken(message),
                Ok(None) => Verdicted::Foreign,
                Err(error) => Verdicted::Refused(error),
            };
            counts.add(&verdict);
            if self.json {
                rows.push(row(line, &verdict))
            } else {
                output::print(&text(line, &verdict))?
            }
            Ok(())
        };
        if self.frames.is_empty() {
            for (number, line) in io::stdin().lock().lines().enumerate() {
                let line = line.map_err(|error| Failure::Usage(format!("standard input can't be read: {error}")))?;
                if !line.trim().is_empty() {
                    decode(&parse(&line).map_err(|error| Failure::Usage(format!("line {}: {error}", number + 1)))?)?;
                }
            }
        } else {
            self.frames.iter().try_for_each(|frame| decode(&parse(frame).map_err(Failure::Usage)?))?;
        }
        counts.lost = receiver.lost();
        let verdict = Verdict::of(counts.refused == 0);
        if self.json {
            output::print_json(&json!({ "frames": rows, "counts": counts }))?;
        } else if counts.frames > 1 {
            output::print(&counts.text())?;
        }
        Ok(verdict)
    }
}

fn parse(line: &str) -> Result<LogLine, String> {
    LogLine::parse(line).map_err(|error| format!("{line:?}: {error}"))
}

impl Counts {
    fn add(&mut self, verdict: &Verdicted) {
        self.frames += 1;
        match verdict {
            Verdicted::Taken(_) => self.taken += 1,
            Verdicted::Refused(_) => self.refused += 1,
            Verdicted::Foreign => self.foreign += 1,
        }
    }

    fn text(&self) -> String {
        let Counts { frames, taken, refused, foreign, lost } = self;
        format!(
            "{frames} frames: {taken} taken, {refused} refused, {foreign} of other protocols; {lost} lost before them\n"
        )
    }
}

fn row(line: &LogLine, verdict: &Verdicted) -> Value {
    let mut row = json!({ "frame": line.frame.to_string(), "time_s": line.time_s, "interface": line.interface });
    let (outcome, more) = match verdict {
        Verdicted::Taken(message) => {
            let mut signals = Map::new();
            message.signals(|name, value| drop(signals.insert(name.to_owned(), json!(value))));
            let kind = message.kind();
            ("taken", json!({ "message": kind.name(), "sender": kind.sender().to_string(), "signals": signals }))
        }
        Verdicted::Refused(error) => {
            ("refused", json!({ "message": error.kind().name(), "reason": error.to_string() }))
        }
        Verdicted::Foreign => ("foreign", json!({})),
    };
    row["verdict"] = json!(outcome);
    if let (Some(row), Value::Object(more)) = (row.as_object_mut(), more) {
        row.extend(more);
    }
    row
}

fn text(line: &LogLine, verdict: &Verdicted) -> String {
    let mut text = String::new();
    if let (Some(time_s), Some(interface)) = (line.time_s, &line.interface) {
        let _infallible = write!(text, "({time_s:.6}) {interface} ");
    }
    let _infallible = write!(text, "{}  ", line.frame);
    match verdict {
        Verdicted::Taken(message) => {
            let _infallible = write!(text, "{}", message.kind());
            message.signals(|name, value| {
                let _infallible = write!(text, " {name}={}", short(&value));
            });
            if let Message::Emergency(emergency) = message {
                let _infallible = write!(text, " ({emergency})");
            }
        }
        Verdicted::Refused(error) => {
            let _infallible = write!(text, "{error}");
        }
        Verdicted::Foreign => text.push_str("not of this network"),
    }
    text.push('\n');
    text
}
