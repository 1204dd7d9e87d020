//! Writes states and samples in the Universal File Format: dataset 58, function at nodal degree of freedom, in ASCII,
//! behind dataset 164, units (SDRC 1988; the University of Cincinnati keeps the layouts at ceas3.uc.edu/sdrluff).
//!
//! Numbers are in fixed columns of lines of 80. A dataset holds one channel, so the recording is read once for each:
//! this needs no memory, and no temporary file. Values have 13 digits.

use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

use super::ExportedFile;
use super::channels::{lead, span, visit};
use super::error::ExportError;
use super::recording_part::RecordingPart;
use super::selection::Selection;
use crate::recording::{Existing, Recording};
use crate::staged::Staged;
use crate::universal::{DELIMITER, NONE, axis, e13, e20, line80, units};
use resonarm_bench::structure::{Axis, Channel, Quantity};

/// Values in a line.
const IN_LINE: u64 = 4;
/// Specific data type of dataset 58: time.
const TIME: u32 = 17;

/// Description of a channel in the file: specific data type, label, unit, exponents of length, force and temperature.
const fn ordinate(quantity: Quantity) -> (u32, &'static str, &'static str, [i32; 3]) {
    match quantity {
        Quantity::Angle => (8, "Angle", "rad", [0, 0, 0]),
        Quantity::AngularVelocity => (11, "Angular velocity", "rad/s", [0, 0, 0]),
        Quantity::Torque => (13, "Torque", "N*m", [1, 1, 0]),
        Quantity::Force => (13, "Force", "N", [0, 1, 0]),
        Quantity::Acceleration => (12, "Acceleration", "m/s^2", [1, 0, 0]),
        Quantity::Current => (1, "Current", "A", [0, 0, 0]),
        Quantity::ModalDisplacement => (1, "Modal displacement", "m*sqrt(kg)", [0, 0, 0]),
        Quantity::ModalVelocity => (1, "Modal velocity", "m*sqrt(kg)/s", [0, 0, 0]),
        Quantity::Displacement => (8, "Displacement", "m", [1, 0, 0]),
        Quantity::Velocity => (11, "Velocity", "m/s", [1, 0, 0]),
        Quantity::Length => (8, "Deflection", "m", [1, 0, 0]),
        Quantity::Branch => (1, "Branch", "1", [0, 0, 0]),
    }
}

/// Direction at a node.
const fn direction(axis: Axis) -> u32 {
    match axis {
        Axis::X => 1,
        Axis::Y => 2,
        Axis::Z => 3,
        Axis::AboutZ => 6,
        Axis::Scalar => 0,
    }
}

/// Writes all channels to one file.
pub(super) fn write(
    recording: &Recording,
    selection: &Selection,
    path: PathBuf,
    parts: Vec<RecordingPart>,
) -> Result<ExportedFile, ExportError> {
    let failed = |source| ExportError::Write { path: path.clone(), source };
    let (mut staged, file) = Staged::create(&path, Existing::Overwrite).map_err(failed)?;
    let mut out = BufWriter::new(file);
    units(&mut out).map_err(failed)?;
    let mut rows = 0;
    let mut columns = Vec::new();
    for part in parts {
        let (first, count) = span(recording, part, &selection.samples)?;
        for (index, channel) in recording.channels().of(part.topic()).iter().enumerate() {
            let dt_s = recording.origin().dt_s;
            let start_s = (first as f64 - lead(part.topic(), recording.origin())) * dt_s;
            head(&mut out, recording, channel, &Abscissa { count, start_s, dt_s }).map_err(failed)?;
            let mut written = 0;
            visit(recording, part, &selection.samples, |values| {
                written += 1;
                // The last line of a dataset may have fewer values, and must end before the delimiter.
                let end = if written % IN_LINE == 0 || written == count { "\n" } else { "" };
                write!(out, "{}{end}", e20(values[index])).map_err(failed)
            })?;
            writeln!(out, "{DELIMITER}").map_err(failed)?;
            columns.push(channel.name.to_string());
        }
        rows = rows.max(count);
    }
    out.flush().and_then(|()| staged.publish()).map_err(failed)?;
    Ok(ExportedFile { path, rows, columns })
}

/// Position of a channel's values in time.
struct Abscissa {
    count: u64,
    start_s: f64,
    dt_s: f64,
}

/// Writes the first eleven lines of dataset 58.
fn head(out: &mut impl Write, recording: &Recording, channel: &Channel, abscissa: &Abscissa) -> io::Result<()> {
    let (kind, label, unit, [length, force, temperature]) = ordinate(channel.quantity);
    let file = recording.path().file_name().map_or(String::from("NONE"), |name| line80(&name.to_string_lossy()));
    writeln!(out, "{DELIMITER}\n{:6}{:74}", 58, "")?;
    // What it is, where it comes from, and three lines without use.
    writeln!(out, "{:80}\n{file:80}\n{:80}\n{:80}\n{:80}", channel.name, "NONE", "NONE", "NONE")?;
    // A response in time at a node, which has no reference.
    let node = channel.point.node();
    let direction = direction(channel.axis);
    writeln!(out, "{:5}{:10}{:5}{:10} {:10}{node:10}{direction:4} {:10}{:10}{:4}", 1, 0, 0, 0, "NONE", "NONE", 0, 0)?;
    // Real numbers of double precision at even distances.
    let start = e13(abscissa.start_s);
    let step = e13(abscissa.dt_s);
    writeln!(out, "{:10}{:10}{:10}{start}{step}{}", 4, abscissa.count, 1, e13(0.0))?;
    axis(out, TIME, [0; 3], "Time", "s")?;
    axis(out, kind, [length, force, temperature], label, unit)?;
    axis(out, NONE, [0; 3], "NONE", "NONE")?;
    axis(out, NONE, [0; 3], "NONE", "NONE")
}
