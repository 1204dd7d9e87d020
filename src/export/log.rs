//! Frames as a log of another tool.

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;

use super::{ExportError, ExportedFile, Part, Selection};
use crate::can_log::{LogFormat, LoggedFrame};
use crate::recording::Recording;

/// Longest name of a network interface, bytes (IFNAMSIZ of Linux, without the terminator).
const LONGEST_NAME: usize = 15;
/// Stands for a bus that has no interface of that kind.
const NO_NAME: &str = "can0";

/// Writes the frames of the wanted samples.
pub(super) fn write(
    recording: &Recording,
    format: LogFormat,
    selection: &Selection,
    files: Vec<(PathBuf, Vec<Part>)>,
) -> Result<Vec<ExportedFile>, ExportError> {
    let mut exported = Vec::new();
    for (path, _) in files {
        let failed = |source| ExportError::Write { path: path.clone(), source };
        let out = BufWriter::new(File::create(&path).map_err(failed)?);
        let origin = recording.origin();
        let mut writer = format.writer(out, interface(&origin.interface));
        let mut rows = 0;
        for record in recording.frames()? {
            let record = record?;
            if !selection.samples.contains(&record.sample) {
                continue;
            }
            let time_ns = origin.log_start_ns().saturating_add(origin.frame_time_ns(&record));
            let (direction, frame) = (Some(record.direction), record.frame);
            writer.write(&LoggedFrame { time_ns, interface: None, direction, frame }).map_err(failed)?;
            rows += 1;
        }
        writer.finish().map_err(failed)?;
        exported.push(ExportedFile { path, rows, columns: Vec::new() });
    }
    Ok(exported)
}

/// The name of the bus, if it is one that an interface can have.
fn interface(name: &str) -> &str {
    let is_name = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_' | b'.');
    if (1..=LONGEST_NAME).contains(&name.len()) && name.bytes().all(is_name) { name } else { NO_NAME }
}
