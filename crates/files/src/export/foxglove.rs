//! Writes a copy for viewers: an MCAP file with a JSON message for every state and sample, which Foxglove, Lichtblick
//! and PlotJuggler plot as they are; events as `foxglove.Log`; scenario and DBC as attachments; the moving arm, or
//! another structure, as `foxglove.SceneUpdate`, if requested.
//!
//! The copy has no frames and does not replace the recording.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{Attachment, McapError, WriteOptions, Writer};
use serde_json::{Map, Value, json};

use super::ExportedFile;
use super::channels::lead;
use super::error::ExportError;
use super::recording_part::RecordingPart;
use super::scene::{self, Scene, time, time_schema};
use super::selection::Selection;
use crate::recording::channels::Channels;
use crate::recording::{Event, Existing, Origin, Record, RecordedFault, Recording};
use crate::staged::Staged;
use resonarm_protocol::dbc::Dbc;
use resonarm_scenario::Scenario;

/// Levels of `foxglove.Log` (foxglove.dev, "LogLevel").
const INFO: u8 = 2;
const WARNING: u8 = 3;
const ERROR: u8 = 4;

/// A topic of the copy.
struct Topic {
    id: u16,
    messages: u32,
}

impl Topic {
    fn write(&mut self, writer: &mut Writer<BufWriter<File>>, time_ns: u64, message: &Value) -> Result<(), McapError> {
        self.messages = self.messages.wrapping_add(1);
        let header =
            MessageHeader { channel_id: self.id, sequence: self.messages, log_time: time_ns, publish_time: time_ns };
        writer.write_to_known_channel(&header, message.to_string().as_bytes())
    }
}

/// Writes all parts to one file, in one pass.
pub(super) fn write(
    recording: &Recording,
    selection: &Selection,
    path: PathBuf,
    parts: &[RecordingPart],
) -> Result<ExportedFile, ExportError> {
    let scene = selection.magnification.map(|factor| Scene::new(recording, factor)).transpose()?;
    let failed = |error: McapError| write_error(&path, error);
    let (mut staged, file) = Staged::create(&path, Existing::Overwrite).map_err(|error| failed(error.into()))?;
    let library = concat!("resonarm ", env!("CARGO_PKG_VERSION"));
    let options =
        // By default the library starts a compression thread for each core, which a copy does not need.
        WriteOptions::new().library(library).compression(Some(mcap::Compression::Zstd)).compression_threads(0);
    let mut writer = options.create(BufWriter::new(file)).map_err(failed)?;
    let declared = parts.iter().map(|part| Ok((*part, declare(&mut writer, recording.channels(), *part)?)));
    let mut topics = declared.collect::<Result<Vec<_>, _>>().map_err(failed)?;
    let mut moving = match &scene {
        Some(scene) => {
            Some((scene, add_topic(&mut writer, scene::TOPIC, scene::SCHEMA, &scene::schema()).map_err(failed)?))
        }
        None => None,
    };
    let mut rows = 0;
    for record in recording.records()? {
        let record = record?;
        if !selection.samples.contains(&record.sample()) {
            continue;
        }
        if let (Some((scene, topic)), Record::State(state)) = (&mut moving, &record) {
            let time_ns = sample_ns(recording.origin(), state.sample, 0.0);
            topic.write(&mut writer, time_ns, &scene.message(state, time_ns)).map_err(failed)?;
        }
        // Frames and ticks have no form that viewers plot, and are left out.
        let Some((part, time_ns, message)) = message(recording, &record) else { continue };
        let Some((_, topic)) = topics.iter_mut().find(|(of, _)| *of == part) else { continue };
        topic.write(&mut writer, time_ns, &message).map_err(failed)?;
        rows += 1;
    }
    attach(recording, &mut writer).map_err(failed)?;
    writer.finish().and_then(|_summary| Ok(staged.publish()?)).map_err(failed)?;
    let channels = parts.iter().flat_map(|part| recording.channels().of(part.topic()));
    let columns = channels.map(|channel| channel.name.to_string()).collect();
    Ok(ExportedFile { path, rows, columns })
}

fn write_error(path: &Path, error: McapError) -> ExportError {
    let source = match error {
        McapError::Io(source) => source,
        other => io::Error::other(other.to_string()),
    };
    ExportError::Write { path: path.to_path_buf(), source }
}

/// Declares the topic of a part and its schema.
fn declare(writer: &mut Writer<BufWriter<File>>, channels: &Channels, part: RecordingPart) -> Result<Topic, McapError> {
    let (topic, name, schema) = match part {
        RecordingPart::Events => (String::from("/log"), "foxglove.Log", log_schema()),
        part => {
            let numbers = channels.of(part.topic()).iter();
            let mut properties: Map<String, Value> =
                numbers.map(|channel| (channel.name.to_string(), json!({ "type": "number" }))).collect();
            properties.insert(String::from("sample"), json!({ "type": "integer" }));
            let name = if part == RecordingPart::States { "resonarm.StateRow" } else { "resonarm.SampleRow" };
            (format!("/{part}"), name, json!({ "type": "object", "properties": properties }))
        }
    };
    add_topic(writer, &topic, name, &schema)
}

fn add_topic(
    writer: &mut Writer<BufWriter<File>>,
    topic: &str,
    name: &str,
    schema: &Value,
) -> Result<Topic, McapError> {
    let schema = writer.add_schema(name, "jsonschema", schema.to_string().as_bytes())?;
    let id = writer.add_channel(schema, topic, "json", &BTreeMap::new())?;
    Ok(Topic { id, messages: 0 })
}

/// Returns the fields of `foxglove.Log` that its documentation requires.
fn log_schema() -> Value {
    let integer = json!({ "type": "integer" });
    let text = json!({ "type": "string" });
    json!({
        "title": "foxglove.Log",
        "type": "object",
        "properties": {
            "timestamp": time_schema("time"), "level": integer, "message": text, "name": text, "file": text, "line": integer
        },
        "required": ["timestamp", "level", "message", "name", "file", "line"]
    })
}

/// Returns part, time and content of a record's message.
fn message(recording: &Recording, record: &Record<String>) -> Option<(RecordingPart, u64, Value)> {
    let origin = recording.origin();
    let row = |part: RecordingPart| {
        let sample = record.sample();
        let channels = recording.channels().of(part.topic());
        let values = record.values();
        let fields = channels.iter().zip(&*values).map(|(channel, value)| (channel.name.to_string(), json!(value)));
        let mut fields: Map<String, Value> = fields.collect();
        fields.insert(String::from("sample"), json!(sample));
        Some((part, sample_ns(origin, sample, lead(part.topic(), origin)), Value::Object(fields)))
    };
    match record {
        Record::State(_) => row(RecordingPart::States),
        Record::Sample(_) => row(RecordingPart::Samples),
        Record::Event(event) => {
            let time_ns = sample_ns(origin, event.sample, 0.0);
            Some((RecordingPart::Events, time_ns, log(event, time_ns)))
        }
        Record::Frame(_) | Record::Tick(_) => None,
    }
}

/// Returns simulated time, ns; in real time the time of the UNIX epoch. The readings of sample 0 belong to the sample
/// itself.
fn sample_ns(origin: &Origin, sample: u64, lead: f64) -> u64 {
    let samples = (sample as f64 - lead).max(0.0);
    origin.log_start_ns().saturating_add(libm::round(samples * origin.dt_s * 1e9) as u64)
}

fn log(event: &Event<String>, time_ns: u64) -> Value {
    let Event { sample, name, value, .. } = event;
    let (level, message) = match name.as_str() {
        "emergency" => (ERROR, RecordedFault::new(*sample, *value).to_string()),
        "partner.emergency" => (ERROR, format!("the exciter reported: {}", RecordedFault::new(*sample, *value))),
        "state.fault" => (ERROR, format!("{name} at sample {sample}")),
        name if name.starts_with("state.") || name.ends_with(".leaving") => {
            (INFO, format!("{name} at sample {sample}"))
        }
        name => (WARNING, format!("{name} {value} at sample {sample}")),
    };
    json!({ "timestamp": time(time_ns), "level": level, "message": message, "name": name, "file": "", "line": 0 })
}

/// Attaches the scenario, and the DBC of its network or of its user protocol.
fn attach(recording: &Recording, writer: &mut Writer<BufWriter<File>>) -> Result<(), McapError> {
    let scenario = recording.configuration().get("scenario");
    let found = Scenario::from_configuration(recording.configuration()).ok();
    let dbc = found.and_then(|found| match &found.wire {
        Some(wire) => wire.text.clone().map(|text| ("wire.dbc", text)),
        None => found.network().ok().map(|network| ("resonarm.dbc", Dbc(network).to_string())),
    });
    let (dbc_name, dbc) = dbc.unzip();
    let files = [
        ("scenario.toml", "application/toml", scenario.map(str::to_owned)),
        (dbc_name.unwrap_or("resonarm.dbc"), "text/plain", dbc),
    ];
    for (name, media_type, text) in files {
        let Some(text) = text else { continue };
        let name = name.to_owned();
        let media_type = media_type.to_owned();
        let data = Cow::Borrowed(text.as_bytes());
        writer.attach(&Attachment { log_time: 0, create_time: 0, name, media_type, data })?;
    }
    Ok(())
}
