//! Converts messages back to records.

use std::sync::Arc;

use prost::Message;

use super::batch::Batch;
use super::contents::RawMessage;
use super::frames;
use super::number_batch::{NumberBatch, Numbers};
use super::record::{Event, FrameRecord, Record, TickRecord};
use super::schema::Topic;
use super::schema::proto::{self, TickBatch};

/// Passes the records in a message to `visit`, in order. The messages for plotting repeat others and have none. The
/// error describes an invalid message.
pub(super) fn decode(raw: RawMessage<'_>, mut visit: impl FnMut(Record<String>)) -> Result<(), String> {
    match raw.topic {
        Topic::States => numbers(raw, |row| visit(Record::State(row))),
        Topic::Samples => numbers(raw, |row| visit(Record::Sample(row))),
        Topic::Ticks => ticks(raw, |row| visit(Record::Tick(row))),
        Topic::Frames => frames(raw, |frame| visit(Record::Frame(frame))),
        Topic::Events => events(raw, |event| visit(Record::Event(event))),
        Topic::State | Topic::Command | Topic::Sensors => Ok(()),
    }
}

/// Passes the states or readings in a message to `visit`.
pub(super) fn numbers<R: Numbers>(raw: RawMessage<'_>, visit: impl FnMut(R)) -> Result<(), String> {
    match number_batch(raw)? {
        Some(batch) => batch.rows(visit),
        None => Ok(()),
    }
}

/// Passes the ticks in a message to `visit`.
pub(super) fn ticks(raw: RawMessage<'_>, visit: impl FnMut(TickRecord)) -> Result<(), String> {
    message::<TickBatch>(raw.bytes)?.rows(visit)
}

/// Passes the frames in a message to `visit`.
pub(super) fn frames(raw: RawMessage<'_>, visit: impl FnMut(FrameRecord)) -> Result<(), String> {
    frames::batch(&message(raw.bytes)?, visit)
}

/// Passes the event in a message to `visit`.
pub(super) fn events(raw: RawMessage<'_>, mut visit: impl FnMut(Event<String>)) -> Result<(), String> {
    let proto::Event { step, time_ns, name, value } = message(raw.bytes)?;
    visit(Event { sample: step, time_ns, name, value });
    Ok(())
}

/// Returns a message as a batch of states or readings, if its topic has channels.
pub(super) fn number_batch<R: Numbers>(raw: RawMessage<'_>) -> Result<Option<NumberBatch<R>>, String> {
    let Some(layout) = raw.layout else { return Ok(None) };
    let mut batch = NumberBatch::new(Arc::clone(layout));
    batch.merge(raw.bytes).map_err(|error| error.to_string())?;
    Ok(Some(batch))
}

fn message<M: Message + Default>(bytes: &[u8]) -> Result<M, String> {
    M::decode(bytes).map_err(|error| error.to_string())
}
