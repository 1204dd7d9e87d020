//! The table of channels, and what is derived from it.

use std::path::Path;

use resonarm::export::{ExportFormat, RecordingPart, Selection, export};
use resonarm::recording::channels::Channels;
use resonarm::recording::{Options, Record, Recording, RecordingError, Topic};
use resonarm::scenario::Scenario;
use resonarm::statistics::statistics;
use resonarm::structure::Kind;
use resonarm::structure::States;

use crate::{TestResult, options, record, run};

#[test]
fn the_documentation_has_the_table() {
    let channels = Channels::arm(true);
    let rows = [Topic::States, Topic::Samples].into_iter().flat_map(|topic| channels.of(topic)).map(|channel| {
        let bit = match channel.kind {
            Kind::Reading { clip_bit } => format!(" {clip_bit} "),
            _ => String::from(" "),
        };
        let axis =
            if channel.axis.name().is_empty() { String::from(" ") } else { format!(" {} ", channel.axis.name()) };
        let (name, kind, unit) = (channel.name, channel.kind.name(), channel.quantity.unit());
        format!("| `{name}` | {kind} | {unit} | {} |{axis}|{bit}|\n", channel.point.name())
    });
    let head = "| channel | is | unit | at | axis | bit of `clipped` |\n| --- | --- | --- | --- | --- | --- |\n";
    let table = core::iter::once(String::from(head)).chain(rows).collect::<String>();
    let document = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/recording.md"));
    assert!(document.contains(&format!("\n{table}\n")), "docs/recording.md lacks this table:\n{table}");
}

#[test]
fn only_a_plant_with_a_coil_has_its_current() {
    let names =
        |has_coil| Channels::arm(has_coil).of(Topic::States).iter().map(|channel| channel.name.to_string()).collect();
    let (without, with): (Vec<_>, Vec<_>) = (names(false), names(true));
    assert_eq!(with.split_last(), Some((&String::from("coil_current_a"), without.as_slice())));
}

/// What a run records is what the structure says of itself.
#[test]
fn the_channels_of_the_arm_s_structure_are_the_table() {
    for (name, has_coil) in [("demo", false), ("shaker", true)] {
        let scenario = Scenario::read(Path::new(&format!("scenarios/{name}.toml"))).unwrap();
        let plant = scenario.plant().unwrap();
        assert_eq!(Channels::of_structure(plant.structure()), Channels::arm(has_coil));
    }
}

#[test]
fn the_current_of_a_coil_is_exported_and_in_the_statistics() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    let mut records = run(3)?;
    for record in &mut records {
        if let Record::State(state) = record {
            state.states = States::new(state.states.moving(), &[0.5 + state.sample as f64]).unwrap();
        }
    }
    let options = Options { channels: Channels::arm(true), ..options() };
    record(&path, options, &records)?;
    let recording = Recording::open(&path)?;
    let found = statistics(&recording)?;
    let current = found.channels.iter().find(|channel| channel.name == "coil_current_a").ok_or("no current")?;
    assert_eq!((current.least, current.largest), (0.5, 2.5));
    let stem = directory.path().join("run");
    let selection = Selection { parts: vec![RecordingPart::States], samples: 0..=u64::MAX, magnification: None };
    for format in [ExportFormat::Csv, ExportFormat::Wav, ExportFormat::Uff58, ExportFormat::Foxglove] {
        let files = export(&recording, format, &selection, &stem)?;
        assert!(files[0].columns.iter().any(|column| column == "coil_current_a"), "{format}");
    }
    let csv = std::fs::read_to_string(directory.path().join("run-states.csv"))?;
    assert!(csv.lines().next().is_some_and(|names| names.ends_with(",force_y_n,coil_current_a,is_end")), "{csv}");
    assert!(csv.lines().nth(2).is_some_and(|row| row.ends_with(",1.5,0")), "{csv}");
    Ok(())
}

#[test]
fn a_record_of_other_channels_than_its_recording_is_refused() -> TestResult {
    let directory = tempfile::tempdir()?;
    let options = Options { channels: Channels::arm(true), ..options() };
    let refused = record(&directory.path().join("run.mcap"), options, &run(1)?).err().ok_or("it was written")?;
    let cause = refused.downcast_ref::<RecordingError>().ok_or("another error")?;
    // Four states and four parts of the load are there; the coil of the table has its current as well.
    assert!(matches!(cause, RecordingError::Row { topic: "/plant/steps", expected: 9, got: 8, .. }), "{cause}");
    Ok(())
}

/// Replaces a name in a recording's schemas by one of the same length; returns the error of opening it.
fn renamed(path: &Path, from: &str, to: &str) -> TestResult<String> {
    let bytes = std::fs::read(path)?;
    let options = mcap::WriteOptions::new().library("resonarm test").compression(None);
    let mut writer = options.create(std::io::Cursor::new(Vec::new()))?;
    let about = [("format", "5"), ("dt_s", "0.001"), ("time", "simulated"), ("plot_every_samples", "10")];
    let metadata = about.iter().map(|(key, value)| (key.to_string(), value.to_string())).collect();
    writer.write_metadata(&mcap::records::Metadata { name: String::from("resonarm.recording"), metadata })?;
    for message in mcap::MessageStream::new(&bytes)? {
        let mut message = message?;
        let channel = message.channel.as_ref().clone();
        let schema = channel.schema.as_ref().ok_or("a topic without a schema")?.as_ref().clone();
        let mut data = schema.data.to_vec();
        if let Some(place) = data.windows(from.len()).position(|name| name == from.as_bytes()) {
            data[place..place + to.len()].copy_from_slice(to.as_bytes());
        }
        let schema = Some(std::sync::Arc::new(mcap::Schema { data: data.into(), ..schema }));
        message.channel = std::sync::Arc::new(mcap::Channel { schema, ..channel });
        writer.write(&message)?;
    }
    writer.finish()?;
    let path = path.with_file_name("renamed.mcap");
    std::fs::write(&path, writer.into_inner().into_inner())?;
    let refused = Recording::open(&path).err().ok_or("it was read")?.to_string();
    Ok(refused.replace(&path.display().to_string(), "renamed.mcap"))
}

#[test]
fn the_channels_of_a_recording_are_checked() -> TestResult {
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("run.mcap");
    record(&path, options(), &run(3)?)?;
    insta::assert_snapshot!(renamed(&path, "torque2_nm", "torque9_nm")?, @"recording `renamed.mcap` has channel `torque9_nm`, which this version does not know, in topic `/plant/steps`; read it with the version of resonarm that wrote it");
    insta::assert_snapshot!(renamed(&path, "torque2_nm", "torque1_nm")?, @"recording `renamed.mcap` has channel `torque1_nm` twice, or two channels in its field, in topic `/plant/steps`; read it with the version of resonarm that wrote it");
    Ok(())
}
