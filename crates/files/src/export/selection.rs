//! The selection of a recording that is exported.

use core::ops::RangeInclusive;

use super::ExportFormat;
use super::error::ExportError;
use super::recording_part::RecordingPart;
use crate::recording::Recording;

/// The selected part of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Selection {
    /// The kinds of records, in order and each at most once.
    pub parts: Vec<RecordingPart>,
    /// Range of samples whose records are wanted.
    pub samples: RangeInclusive<u64>,
    /// Magnification of the moving arm's vibrations, if it is drawn; only [`ExportFormat::Foxglove`] can hold it.
    pub magnification: Option<f64>,
}

impl Selection {
    /// Selects the records of `parts`, or if it is empty all that the format can hold and the recording has, of the
    /// samples from one simulated time to another, both included, s from sample 0 on; no moving arm.
    ///
    /// # Errors
    /// [`ExportError::Interval`] if there is no sample between them, [`ExportError::Nothing`] if the recording has no
    /// records that the format can hold.
    pub fn of(
        recording: &Recording,
        format: ExportFormat,
        parts: &[RecordingPart],
        from_s: Option<f64>,
        to_s: Option<f64>,
    ) -> Result<Selection, ExportError> {
        let samples = samples(recording, from_s, to_s)?;
        let summary = recording.summary();
        let there =
            |part: &&RecordingPart| summary.topics.get(part.topic().name()).is_some_and(|topic| topic.records > 0);
        let mut parts: Vec<RecordingPart> = match parts {
            [] => format.parts().iter().filter(there).copied().collect(),
            parts => parts.to_vec(),
        };
        parts.sort_unstable();
        parts.dedup();
        if parts.is_empty() {
            return Err(ExportError::Nothing { format });
        }
        Ok(Selection { parts, samples, magnification: None })
    }
}

/// Returns the samples from one simulated time to another, both included; all for a recording without a record. A
/// deviation of a millionth of a sample counts as rounding of a time in decimals.
///
/// # Errors
/// [`ExportError::Interval`] if there is no sample between them.
pub fn samples(
    recording: &Recording,
    from_s: Option<f64>,
    to_s: Option<f64>,
) -> Result<RangeInclusive<u64>, ExportError> {
    const TOLERANCE: f64 = 1e-6;
    let dt_s = recording.origin().dt_s;
    // Of a recording without a record there is nothing, whatever is asked for.
    let Some((first, last)) = recording.summary().samples else { return Ok(0..=u64::MAX) };
    // Rounded inwards, so that both ends are within the requested range.
    let from = from_s.map_or(first, |from_s| libm::ceil(from_s / dt_s - TOLERANCE) as u64);
    let to = to_s.map_or(last, |to_s| libm::floor(to_s / dt_s + TOLERANCE) as u64);
    let is_negative = [from_s, to_s].iter().flatten().any(|time_s| *time_s < 0.0);
    if is_negative || from > to || from > last || to < first {
        // As it is written in decimals: to the nanosecond.
        let [first_s, last_s] = [first, last].map(|sample| libm::round(sample as f64 * dt_s * 1e9) / 1e9);
        let from_s = from_s.unwrap_or(first_s);
        let to_s = to_s.unwrap_or(last_s);
        return Err(ExportError::Interval { from_s, to_s, first_s, last_s });
    }
    Ok(from..=to)
}
