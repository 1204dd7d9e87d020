//! Writes states and samples as sound files: a file for each part, 32-bit floating-point numbers in SI units.

use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use hound::{Error, SampleFormat, WavSpec, WavWriter};

use super::ExportedFile;
use super::channels::{span, visit};
use super::error::ExportError;
use super::recording_part::RecordingPart;
use super::selection::Selection;
use crate::recording::{Existing, Recording};
use crate::staged::Staged;

/// Bytes of a value.
const VALUE: u64 = 4;
/// Bytes that the heads of the file's chunks take at most.
const HEADS: u64 = 256;

/// Writes the file of a part.
pub(super) fn write(
    recording: &Recording,
    selection: &Selection,
    path: PathBuf,
    part: RecordingPart,
) -> Result<ExportedFile, ExportError> {
    let sample_rate = whole_rate_hz(recording.origin().dt_s)?;
    let channels = recording.channels().of(part.topic());
    let (_, rows) = span(recording, part, &selection.samples)?;
    // Checked before the file is written: the length in its head has 32 bits and would wrap around.
    if rows * channels.len() as u64 * VALUE + HEADS > u64::from(u32::MAX) {
        return Err(ExportError::Long { rows, channels: channels.len() });
    }
    let bits_per_sample = 32;
    let sample_format = SampleFormat::Float;
    let spec = WavSpec { channels: channels.len() as u16, sample_rate, bits_per_sample, sample_format };
    let failed = |error| failed(&path, error);
    let (mut staged, file) = Staged::create(&path, Existing::Overwrite).map_err(|error| failed(error.into()))?;
    let mut writer = WavWriter::new(BufWriter::new(file), spec).map_err(failed)?;
    visit(recording, part, &selection.samples, |values| {
        let mut each = values.iter();
        each.try_for_each(|value| writer.write_sample(*value as f32)).map_err(failed)
    })?;
    writer.finalize().and_then(|()| Ok(staged.publish()?)).map_err(failed)?;
    let columns = channels.iter().map(|channel| channel.name.to_string()).collect();
    Ok(ExportedFile { path, rows, columns })
}

/// Returns the samples a second, which a sound file has as a whole number.
fn whole_rate_hz(dt_s: f64) -> Result<u32, ExportError> {
    let rate_hz = 1.0 / dt_s;
    let whole = libm::round(rate_hz);
    // 1/dt is off by a rounding error of some 1e-16 where dt is the rounded inverse of a whole rate.
    if (rate_hz - whole).abs() < 1e-9 * whole && (1.0..=f64::from(u32::MAX)).contains(&whole) {
        Ok(whole as u32)
    } else {
        Err(ExportError::Rate { rate_hz })
    }
}

fn failed(path: &Path, error: Error) -> ExportError {
    let source = match error {
        Error::IoError(source) => source,
        other => io::Error::other(other.to_string()),
    };
    ExportError::Write { path: path.to_path_buf(), source }
}
