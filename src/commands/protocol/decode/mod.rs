//! `resonarm protocol decode`: explains frames.

mod network;
mod wire;

use std::io::{self, BufRead};
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Map, Value, json};

use super::NetworkFlags;
use super::log_line::LogLine;
use crate::failure::{Failure, Verdict};
use crate::output::{self, JsonFlag};
use crate::recordings;
use network::NetworkFrames;
use resonarm::dbc::Database;
use resonarm::decoder::Decoder;
use resonarm::recording::Recording;
use resonarm::scenario::Scenario;
use wire::WireFrames;

/// Explains frames, and says whether a receiver accepts them: form, E2E protection, content. Counters are checked from
/// frame to frame, as by a receiver that listens from the first one on.
///
/// Without the flags below the frames are those of Resonarm's protocol. With a scenario that has [wire], or a recording
/// of one, they are those of its DBC: signals have their unit, the text of their value table, and in brackets what they
/// mean to the plant; lengths, checksums and counters of mapped messages are checked. Whether the plant accepts a load
/// depends on its limits and its state as well. Those of CANopen drives are explained by their objects: network
/// management, PDOs by the mapping that the frames set, SDOs with the reason of an abort, control- and statusword in
/// words. With --dbc alone signals have values, and nothing but the length is checked. The exit code is 1 if a frame is
/// refused or too short.
#[derive(Debug, Args)]
pub(super) struct Decode {
    /// Frames as cansend takes them, such as 201#8A00F40183FF3412; without any, lines of frames or of `candump -L` from
    /// standard input: `candump -L can0 | resonarm protocol decode`, or of a file: `resonarm protocol decode <
    /// can0.log`. Other lines are reported, counted and left out; then the exit code is 1.
    #[arg(value_name = "FRAME")]
    frames: Vec<String>,
    /// TOML file with the scenario of the frames: its network, or its own protocol, [wire].
    #[arg(long, value_name = "FILE", conflicts_with_all = NETWORK)]
    scenario: Option<PathBuf>,
    /// DBC file of the frames.
    #[arg(long, value_name = "FILE", conflicts_with_all = NETWORK, conflicts_with = "scenario")]
    dbc: Option<PathBuf>,
    /// Explain the frames in a recording, by the protocol of its scenario; times count from its beginning.
    #[arg(long, value_name = "FILE", conflicts_with_all = NETWORK, conflicts_with_all = ["frames", "scenario", "dbc"])]
    recording: Option<PathBuf>,
    #[command(flatten)]
    network: NetworkFlags,
    #[command(flatten)]
    json: JsonFlag,
}

/// The flags that say which network, which a file says otherwise.
const NETWORK: [&str; 4] = ["base", "plant_id", "exciter_id", "profile"];
/// Number of characters shown of a line without a frame.
const SHOWN_CHARS: usize = 80;

/// Explains the frames of one protocol, one after another, and counts them.
trait Explains {
    /// The next frame for --json, without the frame itself.
    fn row(&mut self, line: &LogLine) -> Map<String, Value>;
    /// The next frame as text, likewise.
    fn text(&mut self, line: &LogLine) -> String;
    /// The number of frames so far.
    fn frames(&self) -> u64;
    /// Whether none is refused or too short.
    fn is_clean(&self) -> bool;
    /// The number of frames of each verdict.
    fn counts(&self) -> Value;
    /// The same as text.
    fn counts_text(&self) -> String;
}

struct Decoding {
    explains: Box<dyn Explains>,
    /// Lines that hold no frame.
    unreadable_lines: u64,
    /// With --json: the frames, and the lines that hold none.
    rows: Option<[Vec<Value>; 2]>,
}

impl Decode {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let recording = self.recording.as_deref().map(recordings::open).transpose()?;
        let mut decoding = Decoding {
            explains: self.explains(recording.as_ref())?,
            unreadable_lines: 0,
            rows: self.json.json.then(Default::default),
        };
        if let Some(recording) = &recording {
            decoding.recorded(recording)?;
        } else if self.frames.is_empty() {
            decoding.lines(io::stdin().lock())?;
        } else {
            for frame in &self.frames {
                decoding.frame(&parse(frame).map_err(|reason| not_a_frame(frame, reason))?)?;
            }
        }
        decoding.finish()
    }

    /// What explains the frames: those of the recording's scenario, of the DBC, of the scenario or of the network.
    fn explains(&self, recording: Option<&Recording>) -> Result<Box<dyn Explains>, Failure> {
        if let Some(path) = &self.dbc {
            let database = Database::read(path).map_err(|error| Failure::usage(error.to_string()))?;
            for found in database.problems() {
                let signal = found.signal.map_or(String::new(), |signal| format!(", signal {signal}"));
                let (origin, line, message, problem) = (path.display(), found.line, found.message, found.problem);
                tracing::warn!("{origin}, line {line}: message {message}{signal}: {problem}");
            }
            return Ok(Box::new(WireFrames::new(Decoder::new(database))));
        }
        let scenario = match (recording, &self.scenario) {
            (Some(recording), _) => Scenario::from_configuration(recording.configuration())?,
            (None, Some(path)) => Scenario::read(path)?,
            (None, None) => return Ok(Box::new(NetworkFrames::new(self.network.network()?))),
        };
        Ok(match Decoder::of_scenario(&scenario)? {
            Some(decoder) => Box::new(WireFrames::new(decoder)),
            None => Box::new(NetworkFrames::new(scenario.network()?)),
        })
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

    /// Decodes the frames of a recording.
    fn recorded(&mut self, recording: &Recording) -> Result<(), Failure> {
        let interface = Some(recording.origin().interface.clone());
        for record in recording.frames()? {
            let record = record?;
            let time_s = Some(record.time_ns as f64 * 1e-9);
            self.frame(&LogLine { time_s, interface: interface.clone(), frame: record.frame })?;
        }
        Ok(())
    }

    fn frame(&mut self, line: &LogLine) -> Result<(), Failure> {
        let LogLine { time_s, interface, frame } = line;
        if let Some([frames, _]) = &mut self.rows {
            let mut row = self.explains.row(line);
            row.insert("frame".to_owned(), json!(frame.to_string()));
            row.insert("time_s".to_owned(), json!(time_s));
            row.insert("interface".to_owned(), json!(interface));
            frames.push(Value::Object(row));
            return Ok(());
        }
        let at = match (time_s, interface) {
            (Some(time_s), Some(interface)) => format!("({time_s:.6}) {interface} "),
            _ => String::new(),
        };
        output::print(&format!("{at}{frame}  {}\n", self.explains.text(line)))
    }

    fn unreadable(&mut self, number: u64, reason: &str) -> Result<(), Failure> {
        self.unreadable_lines += 1;
        match &mut self.rows {
            Some([_, lines]) => lines.push(json!({ "line": number, "reason": reason })),
            None => output::print(&format!("line {number}: {reason}\n"))?,
        }
        Ok(())
    }

    fn finish(self) -> Result<Verdict, Failure> {
        let Decoding { explains, unreadable_lines, rows } = self;
        if let Some([frames, lines]) = rows {
            let mut counts = explains.counts();
            counts["unreadable_lines"] = json!(unreadable_lines);
            output::print_json(&json!({ "frames": frames, "unreadable": lines, "counts": counts }))?;
        } else if explains.frames() > 1 || unreadable_lines > 0 {
            let unreadable = match unreadable_lines {
                0 => String::new(),
                lines => format!("; {lines} lines without a frame"),
            };
            output::print(&format!("{}{unreadable}\n", explains.counts_text()))?;
        }
        Ok(Verdict::of(explains.is_clean() && unreadable_lines == 0))
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
