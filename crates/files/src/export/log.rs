//! Writes frames as a log of another tool.

use std::io::BufWriter;
use std::path::PathBuf;

use super::ExportedFile;
use super::error::ExportError;
use super::selection::Selection;
use crate::can_log::{LogFormat, LoggedFrame};
use crate::recording::{Existing, FrameRecord, Origin, Recording, RecordingError};
use crate::staged::Staged;

/// Longest name of a network interface, bytes (IFNAMSIZ of Linux, without the terminator).
const LONGEST_NAME: usize = 15;
/// Name of the interface in a recording of a run without a bus.
const NO_BUS: &str = "none";
/// Name in the log for a bus without such an interface.
const NO_NAME: &str = "can0";

/// Writes the frames of the wanted samples.
pub(super) fn write(
    recording: &Recording,
    format: LogFormat,
    selection: &Selection,
    path: PathBuf,
) -> Result<ExportedFile, ExportError> {
    let origin = recording.origin();
    // Read twice, not collected: a recording may be larger than the memory.
    let logged = || {
        let wanted = |record: &FrameRecord| selection.samples.contains(&record.sample);
        let frames = recording.frames()?.filter(move |record| record.as_ref().map_or(true, wanted));
        Ok::<_, RecordingError>(frames.map(|record| record.map(|record| logged_frame(origin, &record))))
    };
    // Frames need not be in order: the times of a log count from the earliest.
    let mut start_ns: Option<u64> = None;
    for frame in logged()? {
        let time_ns = frame?.time_ns;
        start_ns = Some(start_ns.map_or(time_ns, |earliest| earliest.min(time_ns)));
    }
    let failed = |source| ExportError::Write { path: path.clone(), source };
    let (mut staged, file) = Staged::create(&path, Existing::Overwrite).map_err(failed)?;
    let mut writer = format.writer(BufWriter::new(file), interface(&origin.interface), start_ns.unwrap_or(0));
    let mut rows = 0;
    for frame in logged()? {
        writer.write(&frame?).map_err(failed)?;
        rows += 1;
    }
    writer.finish().map_err(failed)?;
    drop(writer);
    staged.publish().map_err(failed)?;
    Ok(ExportedFile { path, rows, columns: Vec::new() })
}

fn logged_frame(origin: &Origin, record: &FrameRecord) -> LoggedFrame {
    let time_ns = origin.log_start_ns().saturating_add(origin.frame_time_ns(record));
    LoggedFrame { time_ns, interface: None, direction: Some(record.direction), frame: record.frame }
}

/// Returns the name of the bus, if an interface can have this name.
fn interface(name: &str) -> &str {
    let is_name = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_' | b'.');
    let fits = name != NO_BUS && (1..=LONGEST_NAME).contains(&name.len()) && name.bytes().all(is_name);
    if fits { name } else { NO_NAME }
}

#[cfg(test)]
mod tests {
    use super::interface;

    #[test]
    fn a_bus_without_an_interface_is_can0() {
        let names = ["vcan0", "none", "", "udp:239.74.163.2:43113", "0123456789abcdef", "can-1_a.b"];
        assert_eq!(names.map(interface), ["vcan0", "can0", "can0", "can0", "can0", "can-1_a.b"]);
    }
}
