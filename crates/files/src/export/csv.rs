//! Writes tables of comma-separated values (RFC 4180, lines ended by a line feed): a file for each part, a row for each
//! record.
//!
//! Numbers have the fewest digits that identify them, so that reading gives the recorded value. Missing information is
//! an empty cell.

use core::fmt::{self, Display};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use resonarm_protocol::{FrameFormat, Id};

use super::ExportedFile;
use super::channels::lead;
use super::error::ExportError;
use super::recording_part::RecordingPart;
use super::selection::Selection;
use crate::recording::channels::Channels;
use crate::recording::{Direction, Event, Existing, FrameRecord, Origin, Record, Recording, TickRecord};
use crate::staged::Staged;
use resonarm_numeric::number::short;
use resonarm_realtime::OverrunCause;

/// Returns the names of the columns.
fn columns(channels: &Channels, part: RecordingPart) -> Vec<String> {
    let own: &[&str] = match part {
        RecordingPart::States => &["is_end"],
        RecordingPart::Samples => &["clipped"],
        RecordingPart::Frames => {
            &["bus_unix_ns", "direction", "identifier", "extended", "remote", "fd", "brs", "esi", "length", "data"]
        }
        RecordingPart::Ticks => &["wakeup_ns", "exec_ns", "overruns", "cause"],
        RecordingPart::Events => &["name", "value"],
    };
    let of_channels = channels.of(part.topic()).iter().map(|channel| channel.name.as_str());
    ["sample", "time_s"].into_iter().chain(of_channels).chain(own.iter().copied()).map(String::from).collect()
}

/// A table that is being written.
struct Table {
    part: RecordingPart,
    out: BufWriter<File>,
    staged: Staged,
    file: ExportedFile,
}

/// Writes all parts in one pass.
pub(super) fn write(
    recording: &Recording,
    selection: &Selection,
    files: impl Iterator<Item = (PathBuf, Vec<RecordingPart>)>,
) -> Result<Vec<ExportedFile>, ExportError> {
    let mut tables = Vec::new();
    for (path, parts) in files {
        tables.extend(parts.first().map(|part| Table::create(path, recording.channels(), *part)).transpose()?);
    }
    for record in recording.records()? {
        let record = record?;
        let table = tables.iter_mut().find(|table| table.part.topic() == record.topic());
        if let Some(table) = table.filter(|_| selection.samples.contains(&record.sample())) {
            table.row(recording.origin(), &record)?;
        }
    }
    // All tables are written out before the first takes its name: if the disk is full, none does.
    tables.iter_mut().try_for_each(Table::flush)?;
    tables.into_iter().map(Table::publish).collect()
}

impl Table {
    fn create(path: PathBuf, channels: &Channels, part: RecordingPart) -> Result<Table, ExportError> {
        let columns = columns(channels, part);
        let failed = |source| ExportError::Write { path: path.clone(), source };
        let (staged, file) = Staged::create(&path, Existing::Overwrite).map_err(failed)?;
        let mut out = BufWriter::new(file);
        writeln!(out, "{}", columns.join(",")).map_err(failed)?;
        Ok(Table { part, out, staged, file: ExportedFile { path, rows: 0, columns } })
    }

    fn row(&mut self, origin: &Origin, record: &Record<String>) -> Result<(), ExportError> {
        self.file.rows += 1;
        let row = Row { origin, record };
        writeln!(self.out, "{row}").map_err(|source| ExportError::Write { path: self.file.path.clone(), source })
    }

    fn flush(&mut self) -> Result<(), ExportError> {
        self.out.flush().map_err(|source| ExportError::Write { path: self.file.path.clone(), source })
    }

    fn publish(mut self) -> Result<ExportedFile, ExportError> {
        match self.staged.publish() {
            Ok(()) => Ok(self.file),
            Err(source) => Err(ExportError::Write { path: self.file.path, source }),
        }
    }
}

/// A row of a table.
struct Row<'a> {
    origin: &'a Origin,
    record: &'a Record<String>,
}

impl Display for Row<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let record = self.record;
        let sample = self.record.sample();
        let time_s = (sample as f64 - lead(record.topic(), self.origin)) * self.origin.dt_s;
        match record {
            Record::State(record) => {
                write!(f, "{sample},{}", short(&time_s))?;
                numbers(f, &record.values())?;
                write!(f, ",{}", u8::from(record.is_end))
            }
            Record::Sample(record) => {
                write!(f, "{sample},{}", short(&time_s))?;
                numbers(f, &record.values())?;
                write!(f, ",{}", record.clipped_bits())
            }
            Record::Frame(record) => frame(f, record),
            Record::Tick(TickRecord { wakeup_ns, exec_ns, overruns, cause, .. }) => {
                let cause = cause.map_or("", OverrunCause::name);
                write!(f, "{sample},{},{wakeup_ns},{exec_ns},{overruns},{cause}", short(&time_s))
            }
            Record::Event(Event { time_ns, name, value, .. }) => {
                write!(f, "{sample},{},{},{value}", Seconds(*time_ns), Text(name))
            }
        }
    }
}

fn numbers(f: &mut fmt::Formatter<'_>, values: &[f64]) -> fmt::Result {
    values.iter().try_for_each(|value| write!(f, ",{}", short(value)))
}

fn frame(f: &mut fmt::Formatter<'_>, record: &FrameRecord) -> fmt::Result {
    let FrameRecord { sample, direction, time_ns, bus_timestamp_ns, frame } = record;
    let direction = match direction {
        Direction::Received => "received",
        Direction::Sent => "sent",
    };
    let is_extended = u8::from(matches!(frame.id(), Id::Extended(_)));
    let [remote, fd, brs, esi] = match frame.format() {
        FrameFormat::Classic => [false; 4],
        FrameFormat::Remote => [true, false, false, false],
        FrameFormat::Fd { bit_rate_switch, error_state_indicator } => {
            [false, true, bit_rate_switch, error_state_indicator]
        }
    }
    .map(u8::from);
    let time_s = Seconds(*time_ns);
    let bus_unix_ns = bus_timestamp_ns.map_or(String::new(), |ns| ns.to_string());
    write!(f, "{sample},{time_s},{bus_unix_ns},{direction},{},{is_extended},", frame.id().raw())?;
    write!(f, "{remote},{fd},{brs},{esi},{},", frame.len())?;
    frame.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
}

/// Displays nanoseconds as seconds, to the last digit.
struct Seconds(u64);

impl Display for Seconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:09}", self.0 / 1_000_000_000, self.0 % 1_000_000_000)
    }
}

/// A text, in quotation marks where it needs them.
struct Text<'a>(&'a str);

impl Display for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.contains([',', '"', '\n', '\r']) {
            write!(f, "\"{}\"", self.0.replace('"', "\"\""))
        } else {
            f.write_str(self.0)
        }
    }
}
