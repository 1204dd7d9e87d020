//! Messages back into records.

use prost::Message;

use super::batch::Batch;
use super::contents::RawMessage;
use super::frames;
use super::schema::MessageType;
use super::schema::proto::{self, SampleBatch, StepBatch, TickBatch};
use super::{Event, Record};

/// Hands the records in a message to `visit`, in order. The messages for plotting repeat others and give none.
///
/// Returns the time from sample to sample that the message states, s, if it states one. Errors: what is wrong with the
/// message.
pub(super) fn decode(raw: RawMessage<'_>, visit: &mut impl FnMut(Record<String>)) -> Result<Option<f64>, String> {
    let bytes = raw.bytes;
    match raw.message_type {
        MessageType::StepBatch => return rows::<StepBatch>(bytes, |row| visit(Record::State(row))),
        MessageType::SampleBatch => return rows::<SampleBatch>(bytes, |row| visit(Record::Sample(row))),
        MessageType::TickBatch => return rows::<TickBatch>(bytes, |row| visit(Record::Tick(row))),
        MessageType::FrameBatch => frames::batch(&message(bytes)?, |frame| visit(Record::Frame(frame)))?,
        MessageType::Event => {
            let proto::Event { step, time_ns, name, value } = message(bytes)?;
            visit(Record::Event(Event { sample: step, time_ns, name, value }));
        }
        MessageType::State | MessageType::Command | MessageType::Sensors => {}
    }
    Ok(None)
}

fn message<M: Message + Default>(bytes: &[u8]) -> Result<M, String> {
    M::decode(bytes).map_err(|error| error.to_string())
}

fn rows<B: Batch>(bytes: &[u8], visit: impl FnMut(B::Row)) -> Result<Option<f64>, String> {
    let batch = message::<B>(bytes)?;
    batch.rows(visit)?;
    Ok(batch.dt_s())
}
