//! `resonarm protocol decode`: explains frames.

mod network;
mod wire;

use std::io::{self, BufRead};
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Map, Value, json};

use super::NetworkFlags;
use crate::failure::{Failure, Verdict};
use crate::help::heading;
use crate::output::{self, JsonFlag};
use crate::recordings;
use network::NetworkFrames;
use resonarm::can_log::{CanLogError, CandumpContent, CandumpLine, parse_line};
use resonarm::dbc::{Database, Found};
use resonarm::decoder::Decoder;
use resonarm::protocol::Frame;
use resonarm::recording::Recording;
use resonarm::scenario::{Scenario, ScenarioError};
use wire::WireFrames;

/// Explains frames, and says whether a receiver accepts them: form, E2E protection, content.
///
/// Counters are checked from frame to frame, as by a receiver that listens from the first one on.
///
/// Without the flags below the frames are those of Resonarm's protocol. With a scenario that has [wire], or a recording
/// of one, they are those of its DBC: signals have their unit, the text of their value table, and in brackets what they
/// mean to the plant; lengths, checksums and counters of mapped messages are checked. Whether the plant accepts a load
/// depends on its limits and its state as well. Those of CANopen drives are explained by their objects: network
/// management, PDOs by the mapping that the frames set, SDOs with the reason of an abort, control- and statusword in
/// words. With --dbc signals have values, and nothing but the length is checked. What is wrong with a DBC is a warning,
/// in the JSON as well; an integer of more than 53 bits has its raw number beside its rounded value. The exit code is 1
/// if a frame is rejected or too short.
#[derive(Debug, Args)]
pub(super) struct Decode {
    /// Frames as cansend takes them, as 201#8A00F40183FF3412; without any, lines from standard input.
    ///
    /// The lines are frames, or those of `candump`, with or without -L: `candump -L can0 | resonarm protocol decode`,
    /// or of a file: `resonarm protocol decode < can0.log`. Error frames say what the CAN controller reports. Other
    /// lines are reported, counted and left out; then the exit code is 1.
    #[arg(value_name = "FRAME")]
    frames: Vec<String>,
    /// TOML file with the scenario of the frames: its network, or its own protocol, [wire].
    #[arg(long, help_heading = heading::NETWORK, value_name = "FILE", conflicts_with_all = NETWORK)]
    scenario: Option<PathBuf>,
    /// DBC file of the frames.
    #[arg(long, help_heading = heading::NETWORK, value_name = "FILE", conflicts_with_all = NETWORK, conflicts_with = "scenario")]
    dbc: Option<PathBuf>,
    /// Explain the frames in this recording, an MCAP file.
    ///
    /// They are explained by the protocol of its scenario, or by that of --scenario or --dbc; without any, as in that of an
    /// imported log, by Resonarm's. Times count from its beginning.
    #[arg(long, help_heading = heading::RECORDS, value_name = "FILE", conflicts_with_all = NETWORK, conflicts_with = "frames")]
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
    /// Explains the next frame for --json, without the frame itself.
    fn row(&mut self, frame: &Frame) -> Map<String, Value>;
    /// Explains the next frame as text, without the frame itself.
    fn text(&mut self, frame: &Frame) -> String;
    /// Counts the frames so far.
    fn tally(&self) -> Tally;
}

/// The number of frames of each verdict.
struct Tally {
    /// All frames.
    frames: u64,
    /// Whether no frame was rejected or too short.
    is_clean: bool,
    document: Value,
    text: String,
}

struct Decoding {
    explains: Box<dyn Explains>,
    /// Warnings about the DBC, for --json.
    warnings: Vec<Value>,
    /// The number of lines that hold no frame.
    unreadable_lines: u64,
    /// The number of reports of the CAN controller.
    error_frames: u64,
    /// With --json, the frames, and the lines that hold none.
    rows: Option<[Vec<Value>; 2]>,
}

impl Decode {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let recording = self.recording.as_deref().map(recordings::open).transpose()?;
        let (explains, problems) = self.explains(recording.as_ref())?;
        let mut decoding = Decoding {
            explains,
            warnings: problems.iter().map(warning).collect(),
            unreadable_lines: 0,
            error_frames: 0,
            rows: self.json.json.then(Default::default),
        };
        if let Some(recording) = &recording {
            decoding.recorded(recording)?;
        } else if self.frames.is_empty() {
            decoding.lines(io::stdin().lock())?;
        } else {
            for frame in &self.frames {
                decoding.line(&parse(frame).map_err(|reason| not_a_frame(frame, reason))?)?;
            }
        }
        let whole = recording.as_ref().map_or(Verdict::Positive, recordings::verdict);
        Ok(decoding.finish()?.and(whole))
    }

    /// Makes the decoder of the frames, by the DBC, the scenario, the recording's scenario or the network, in this
    /// order; and the faults of the DBC.
    fn explains(&self, recording: Option<&Recording>) -> Result<(Box<dyn Explains>, Vec<Found>), Failure> {
        if let Some(path) = &self.dbc {
            let database = Database::read(path).map_err(|error| Failure::usage(error.to_string()))?;
            return Ok(wire(Decoder::new(database)));
        }
        let scenario = match (recording, &self.scenario) {
            (_, Some(path)) => Scenario::read(path)?,
            (Some(recording), None) => match Scenario::from_configuration(recording.configuration()) {
                // The scenario of an imported log states no protocol, like the log itself.
                Err(ScenarioError::NotInRecording) => return self.of_network(),
                scenario => scenario?,
            },
            (None, None) => return self.of_network(),
        };
        Ok(match Decoder::of_scenario(&scenario)? {
            Some(decoder) => wire(decoder),
            None => (Box::new(NetworkFrames::new(scenario.network()?)), Vec::new()),
        })
    }

    /// Makes the decoder of Resonarm's own protocol, for the network of the flags.
    fn of_network(&self) -> Result<(Box<dyn Explains>, Vec<Found>), Failure> {
        Ok((Box::new(NetworkFrames::new(self.network.network()?)), Vec::new()))
    }
}

/// Makes the decoder of a DBC or of drives, and lists the faults of the DBC, which are also reported on standard error.
fn wire(decoder: Decoder) -> (Box<dyn Explains>, Vec<Found>) {
    let problems = decoder.problems();
    for Found { line, message, signal, problem } in &problems {
        let message = Some(message).filter(|name| !name.is_empty()).map(|name| format!("message {name}"));
        let signal = signal.as_ref().map(|name| format!("signal {name}"));
        let of = message.into_iter().chain(signal).collect::<Vec<_>>().join(", ");
        let origin = decoder.origin().unwrap_or_default();
        tracing::warn!("{origin}, line {line}: {of}: {problem}");
    }
    (Box::new(WireFrames::new(decoder)), problems)
}

fn warning(found: &Found) -> Value {
    let Found { line, message, signal, problem } = found;
    json!({ "line": line, "message": message, "signal": signal, "problem": problem.to_string() })
}

impl Decoding {
    /// Decodes every line of a log. Other lines are reported and left out.
    fn lines(&mut self, log: impl BufRead) -> Result<(), Failure> {
        // Bytes, not `lines()`, which ends at the first line that is not UTF-8: a damaged log is read to its end.
        for (line, number) in log.split(b'\n').zip(1..) {
            let line = line.map_err(|error| Failure::usage(format!("standard input can't be read: {error}")))?;
            let line = String::from_utf8_lossy(&line);
            if line.trim().is_empty() {
                continue;
            }
            match parse(&line) {
                Ok(line) => self.line(&line)?,
                Err(reason) => self.unreadable(number, &reason)?,
            }
        }
        Ok(())
    }

    /// Decodes the frames of a recording.
    fn recorded(&mut self, recording: &Recording) -> Result<(), Failure> {
        for record in recording.frames()? {
            let record = record?;
            let time_s = Some(record.time_ns as f64 * 1e-9);
            self.frame(time_s, Some(&recording.origin().interface), &record.frame)?;
        }
        Ok(())
    }

    fn line(&mut self, line: &CandumpLine) -> Result<(), Failure> {
        let time_s = line.time_ns.and_then(seconds);
        let interface = line.interface.as_deref();
        let error = match &line.content {
            CandumpContent::Frame(frame) => return self.frame(time_s, interface, frame),
            CandumpContent::ErrorFrame(error) => error,
        };
        self.error_frames += 1;
        if let Some([frames, _]) = &mut self.rows {
            frames.push(json!({
                "verdict": "error_frame",
                "frame": null,
                "reason": error.to_string(),
                "time_s": time_s,
                "interface": interface,
            }));
            return Ok(());
        }
        output::print(&format!("{}error frame ({error})\n", at(time_s, interface)))
    }

    fn frame(&mut self, time_s: Option<f64>, interface: Option<&str>, frame: &Frame) -> Result<(), Failure> {
        if let Some([frames, _]) = &mut self.rows {
            // The JSON document is printed as a whole at the end. Text is printed frame by frame, so that a live
            // `candump` can be piped in.
            let mut row = self.explains.row(frame);
            row.insert("frame".to_owned(), json!(frame.to_string()));
            row.insert("time_s".to_owned(), json!(time_s));
            row.insert("interface".to_owned(), json!(interface));
            frames.push(Value::Object(row));
            return Ok(());
        }
        output::print(&format!("{}{frame}  {}\n", at(time_s, interface), self.explains.text(frame)))
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
        let Decoding { explains, warnings, unreadable_lines, error_frames, rows } = self;
        let Tally { frames, is_clean, document: mut counts, mut text } = explains.tally();
        if let Some([decoded, lines]) = rows {
            counts["unreadable_lines"] = json!(unreadable_lines);
            counts["error_frames"] = json!(error_frames);
            let document = json!({ "frames": decoded, "unreadable": lines, "warnings": warnings, "counts": counts });
            output::print_json(&document)?;
        } else if frames > 1 || unreadable_lines + error_frames > 0 {
            for (count, what) in [(error_frames, "error frames"), (unreadable_lines, "lines without a frame")] {
                if count > 0 {
                    text += &format!("; {count} {what}");
                }
            }
            output::print(&format!("{text}\n"))?;
        }
        // Error frames do not count against the verdict: they report the state of the bus, and no receiver rejects
        // them.
        Ok(Verdict::of(is_clean && unreadable_lines == 0))
    }
}

/// Writes time and interface before a frame.
fn at(time_s: Option<f64>, interface: Option<&str>) -> String {
    let time = time_s.map_or(String::new(), |time_s| format!("({time_s:.6}) "));
    let interface = interface.map_or(String::new(), |interface| format!("{interface} "));
    time + &interface
}

/// Returns a time in seconds, if it is a number of them.
fn seconds(time_ns: u64) -> Option<f64> {
    // Seconds and remainder separately: a present-day count of nanoseconds has more digits than this type.
    format!("{}.{:09}", time_ns / 1_000_000_000, time_ns % 1_000_000_000).parse().ok()
}

fn parse(line: &str) -> Result<CandumpLine, String> {
    parse_line(line).map_err(|error| {
        let error = match error {
            CanLogError::CandumpLine => {
                String::from("it is neither a frame, as 201#1122, nor a line of `candump` or `candump -L`")
            }
            error => error.to_string(),
        };
        match line.char_indices().nth(SHOWN_CHARS) {
            Some((end, _)) => format!("{:?}…: {error}", &line[..end]),
            None => format!("{line:?}: {error}"),
        }
    })
}

/// Explains that an argument is no frame: it may be the name of a file with frames.
fn not_a_frame(argument: &str, reason: String) -> Failure {
    Failure::usage(match Path::new(argument).is_file() {
        true => format!("{reason}. It is a file: `resonarm protocol decode < {argument}` reads it"),
        false => reason,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm::can_log::ErrorFrame;

    #[test]
    fn reads_frames_and_lines_of_logs() {
        let read = |line| {
            let CandumpLine { time_ns, interface, content, .. } = parse(line).unwrap();
            (time_ns.and_then(seconds), interface, content)
        };
        let frame = CandumpContent::Frame("201#1122".parse().unwrap());
        assert_eq!(read(" 201#1122 "), (None, None, frame));
        let bus = Some(String::from("vcan0"));
        for line in [
            "(1436509052.249713) vcan0 201#1122",
            "(1436509052.249713) vcan0 201#1122 R",
            " (1436509052.249713)  vcan0  201   [2]  11 22",
        ] {
            assert_eq!(read(line), (Some(1436509052.249713), bus.clone(), frame), "{line}");
        }
        assert_eq!(read("  vcan0  201   [2]  11 22"), (None, bus, frame));
        let error = CandumpContent::ErrorFrame(ErrorFrame { classes: 0x4 });
        assert_eq!(read("(0.5) can0 20000004#0004000000000000"), (Some(0.5), Some(String::from("can0")), error));
    }

    #[test]
    fn says_what_is_wrong() {
        let said = |line| parse(line).unwrap_err();
        insta::assert_snapshot!(said("  vcan0  201   [2]  11"), @r#""  vcan0  201   [2]  11": it is neither a frame, as 201#1122, nor a line of `candump` or `candump -L`"#);
        insta::assert_snapshot!(said("(now) vcan0 201#1122"), @r#""(now) vcan0 201#1122": "(now)" is not a time in brackets such as (12.345678)"#);
        insta::assert_snapshot!(said("201#112"), @r#""201#112": the data must be pairs of hexadecimal digits"#);
    }
}
