//! Messages back into records.

use std::sync::Arc;

use prost::Message;

use super::batch::Batch;
use super::contents::RawMessage;
use super::frames;
use super::layout::NumberBatch;
use super::schema::MessageType;
use super::schema::proto::{self, TickBatch};
use super::{Event, Record};

/// Hands the records in a message to `visit`, in order. The messages for plotting repeat others and give none.
///
/// Returns the time from sample to sample that the message states, s, if it states one. Errors: what is wrong with the
/// message.
pub(super) fn decode(raw: RawMessage<'_>, visit: &mut impl FnMut(Record<String>)) -> Result<Option<f64>, String> {
    let bytes = raw.bytes;
    match (raw.message_type, raw.layout) {
        (MessageType::StepBatch, Some(layout)) => {
            return rows(NumberBatch::new(Arc::clone(layout)), bytes, |row| visit(Record::State(row)));
        }
        (MessageType::SampleBatch, Some(layout)) => {
            return rows(NumberBatch::new(Arc::clone(layout)), bytes, |row| visit(Record::Sample(row)));
        }
        (MessageType::TickBatch, _) => return rows(TickBatch::default(), bytes, |row| visit(Record::Tick(row))),
        (MessageType::FrameBatch, _) => frames::batch(&message(bytes)?, |frame| visit(Record::Frame(frame)))?,
        (MessageType::Event, _) => {
            let proto::Event { step, time_ns, name, value } = message(bytes)?;
            visit(Record::Event(Event { sample: step, time_ns, name, value }));
        }
        _ => {}
    }
    Ok(None)
}

fn message<M: Message + Default>(bytes: &[u8]) -> Result<M, String> {
    M::decode(bytes).map_err(|error| error.to_string())
}

fn rows<B: Batch>(mut batch: B, bytes: &[u8], visit: impl FnMut(B::Row)) -> Result<Option<f64>, String> {
    batch.merge(bytes).map_err(|error| error.to_string())?;
    batch.rows(visit)?;
    Ok(batch.dt_s())
}
