//! `resonarm protocol decode`: explains frames.

use std::io::{self, BufRead};
use std::path::Path;

use clap::Args;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::NetworkFlags;
use super::log_line::LogLine;
use crate::failure::{Failure, Verdict};
use crate::output::{self, JsonFlag};
use resonarm::protocol::{DecodeError, Message, Receiver};
use resonarm_numeric::number::short;

/// Explains frames, and says whether a receiver accepts them: form, E2E protection, content. Counters are checked from
/// frame to frame, as by a receiver that listens from the first one on.
#[derive(Debug, Args)]
pub(super) struct Decode {
    /// Frames as cansend takes them, such as 201#8A00F40183FF3412; without any, lines of frames or of `candump -L` from
    /// standard input: `candump -L can0 | resonarm protocol decode`, or of a file: `resonarm protocol decode <
    /// can0.log`. Other lines are reported, counted and left out; then the exit code is 1.
    #[arg(value_name = "FRAME")]
    frames: Vec<String>,
    #[command(flatten)]
    network: NetworkFlags,
    #[command(flatten)]
    json: JsonFlag,
}

/// Number of characters shown of a line without a frame.
const SHOWN_CHARS: usize = 80;

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
    /// Lines that hold no frame.
    unreadable_lines: u64,
}

/// Whether a receiver takes a frame; none of another protocol.
type Verdicted = Result<Option<Message>, DecodeError>;

struct Decoding {
    receiver: Receiver,
    counts: Counts,
    /// With --json: the frames, and the lines that hold none.
    rows: Option<[Vec<Value>; 2]>,
}

impl Decode {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let mut decoding = Decoding {
            receiver: Receiver::new(self.network.network()?),
            counts: Counts::default(),
            rows: self.json.json.then(Default::default),
        };
        if self.frames.is_empty() {
            decoding.lines(io::stdin().lock())?;
        } else {
            for frame in &self.frames {
                decoding.frame(&parse(frame).map_err(|reason| not_a_frame(frame, reason))?)?;
            }
        }
        decoding.finish()
    }
}

impl Decoding {
    /// Decodes every line of a log. Other lines are reported and left out.
    fn lines(&mut self, log: impl BufRead) -> Result<(), Failure> {
        for (line, number) in log.split(b'\n').zip(1..) {
            let line = line.map_err(|error| Failure::usage(format!("standard input can't be read: {error}")))?;
            let line = String::from_utf8_lossy(&line);
            if line.trim().is_empty() {
                continue;
            }
            match parse(&line) {
                Ok(line) => self.frame(&line)?,
                Err(reason) => self.unreadable(number, &reason)?,
            }
        }
        Ok(())
    }

    fn frame(&mut self, line: &LogLine) -> Result<(), Failure> {
        let verdict = self.receiver.accept(&line.frame);
        self.counts.add(&verdict);
        match &mut self.rows {
            Some([frames, _]) => frames.push(row(line, &verdict)),
            None => output::print(&text(line, &verdict))?,
        }
        Ok(())
    }

    fn unreadable(&mut self, number: u64, reason: &str) -> Result<(), Failure> {
        self.counts.unreadable_lines += 1;
        match &mut self.rows {
            Some([_, lines]) => lines.push(json!({ "line": number, "reason": reason })),
            None => output::print(&format!("line {number}: {reason}\n"))?,
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Verdict, Failure> {
        self.counts.lost = self.receiver.lost();
        let Counts { frames, refused, unreadable_lines, .. } = self.counts;
        if let Some([frames, lines]) = self.rows {
            output::print_json(&json!({ "frames": frames, "unreadable": lines, "counts": self.counts }))?;
        } else if frames > 1 || unreadable_lines > 0 {
            output::print(&self.counts.text())?;
        }
        Ok(Verdict::of(refused == 0 && unreadable_lines == 0))
    }
}

fn parse(line: &str) -> Result<LogLine, String> {
    LogLine::parse(line).map_err(|error| match line.char_indices().nth(SHOWN_CHARS) {
        Some((end, _)) => format!("{:?}…: {error}", &line[..end]),
        None => format!("{line:?}: {error}"),
    })
}

/// An argument that is no frame may be the name of a file with frames.
fn not_a_frame(argument: &str, reason: String) -> Failure {
    Failure::usage(match Path::new(argument).is_file() {
        true => format!("{reason}. It is a file: `resonarm protocol decode < {argument}` reads it"),
        false => reason,
    })
}

impl Counts {
    fn add(&mut self, verdict: &Verdicted) {
        self.frames += 1;
        match verdict {
            Ok(Some(_)) => self.taken += 1,
            Err(_) => self.refused += 1,
            Ok(None) => self.foreign += 1,
        }
    }

    fn text(&self) -> String {
        let Counts { frames, taken, refused, foreign, lost, unreadable_lines } = self;
        let mut text = format!(
            "{frames} frames: {taken} taken, {refused} refused, {foreign} of other protocols; {lost} lost before them"
        );
        if *unreadable_lines > 0 {
            text += &format!("; {unreadable_lines} lines without a frame");
        }
        text.push('\n');
        text
    }
}

fn row(line: &LogLine, verdict: &Verdicted) -> Value {
    let mut row = json!({ "frame": line.frame.to_string(), "time_s": line.time_s, "interface": line.interface });
    let (outcome, more) = match verdict {
        Ok(Some(message)) => {
            let mut signals = Map::new();
            message.signals(|name, value| drop(signals.insert(name.to_owned(), json!(value))));
            let kind = message.kind();
            ("taken", json!({ "message": kind.name(), "sender": kind.sender().to_string(), "signals": signals }))
        }
        Err(error) => ("refused", json!({ "message": error.kind().name(), "reason": error.to_string() })),
        Ok(None) => ("foreign", json!({})),
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
        text += &format!("({time_s:.6}) {interface} ");
    }
    text += &format!("{}  ", line.frame);
    match verdict {
        Ok(Some(message)) => {
            text += &format!("{}", message.kind());
            message.signals(|name, value| {
                text += &format!(" {name}={}", short(&value));
            });
            if let Message::Emergency(emergency) = message {
                text += &format!(" ({emergency})");
            }
        }
        Err(error) => {
            text += &format!("{error}");
        }
        Ok(None) => text.push_str("not of this network"),
    }
    text.push('\n');
    text
}
