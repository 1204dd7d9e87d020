//! The numbers of states and samples, channel by channel.

use core::ops::RangeInclusive;

use super::error::ExportError;
use super::recording_part::RecordingPart;
use crate::recording::{Origin, Recording, Topic};

/// Returns how long before its sample a channel was read, in samples: the delay of the instruments' converters.
pub(super) fn lead(topic: Topic, origin: &Origin) -> f64 {
    match topic {
        Topic::Samples => origin.reading_delay_samples,
        _ => 0.0,
    }
}

/// Passes the values of every wanted sample of a part to `visit`, in order and without a gap.
///
/// # Errors
/// [`ExportError::Recording`] if samples are missing.
pub(super) fn visit(
    recording: &Recording,
    part: RecordingPart,
    wanted: &RangeInclusive<u64>,
    mut visit: impl FnMut(&[f64]) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    for row in recording.rows(part.topic())? {
        let row = row?;
        if row.sample > *wanted.end() {
            break;
        }
        if wanted.contains(&row.sample) {
            visit(&row.values)?;
        }
    }
    Ok(())
}

/// Returns the first sample of a part among the wanted ones, and their number.
///
/// # Errors
/// As [`visit`]; [`ExportError::Recording`] as well if the part has no samples there.
pub(super) fn span(
    recording: &Recording,
    part: RecordingPart,
    wanted: &RangeInclusive<u64>,
) -> Result<(u64, u64), ExportError> {
    let first = recording.rows(part.topic())?.next().transpose()?.map(|row| row.sample);
    let records = recording.summary().topics.get(part.topic().name()).map_or(0, |topic| topic.records);
    let Some(first) = first else { return Ok((*wanted.start(), 0)) };
    // They are without a gap, and the last may have the largest of all numbers.
    let from = (*wanted.start()).max(first);
    let last = (*wanted.end()).min(first + (records - 1));
    Ok((from, last.checked_sub(from).map_or(0, |behind| behind + 1)))
}
