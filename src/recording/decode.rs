//! Messages back into records.

use prost::Message;
use resonarm_protocol::{Frame, FrameFormat, Id};

use super::batch::Batch;
use super::contents::RawMessage;
use super::schema::Topic;
use super::schema::proto::{self, SampleBatch, StepBatch, TickBatch, can_frame};
use super::{Direction, Event, FrameRecord, Record};

/// Hands the records in a message to `visit`, in order. The messages for plotting repeat others and give none.
///
/// Returns the time from sample to sample that the message states, s, if it states one. Errors: what is wrong with the
/// message.
pub(super) fn decode(raw: RawMessage<'_>, visit: &mut impl FnMut(Record<String>)) -> Result<Option<f64>, String> {
    let bytes = raw.bytes;
    match raw.topic {
        Topic::States => return rows::<StepBatch>(bytes, |row| visit(Record::State(row))),
        Topic::Samples => return rows::<SampleBatch>(bytes, |row| visit(Record::Sample(row))),
        Topic::Ticks => return rows::<TickBatch>(bytes, |row| visit(Record::Tick(row))),
        Topic::Frames => visit(Record::Frame(frame(message::<proto::CanFrame>(bytes)?)?)),
        Topic::Events => {
            let proto::Event { step, time_ns, name, value } = message(bytes)?;
            visit(Record::Event(Event { sample: step, time_ns, name, value }));
        }
        Topic::State | Topic::Command | Topic::Sensors => {}
    }
    Ok(None)
}

fn message<M: Message + Default>(bytes: &[u8]) -> Result<M, String> {
    M::decode(bytes).map_err(|error| error.to_string())
}

fn rows<B: Batch>(bytes: &[u8], visit: impl FnMut(B::Row)) -> Result<Option<f64>, String> {
    let batch = message::<B>(bytes)?;
    batch.rows()?.into_iter().for_each(visit);
    Ok(batch.dt_s())
}

fn frame(message: proto::CanFrame) -> Result<FrameRecord, String> {
    let direction = match can_frame::Direction::try_from(message.direction) {
        Ok(can_frame::Direction::Received) => Direction::Received,
        Ok(can_frame::Direction::Sent) => Direction::Sent,
        _ => return Err(format!("a frame of direction {}", message.direction)),
    };
    let id = match (message.extended, u16::try_from(message.id)) {
        (true, _) => Id::Extended(message.id),
        (false, Ok(id)) => Id::Standard(id),
        (false, Err(_)) => return Err(format!("a standard frame with identifier {:#x}", message.id)),
    };
    let format = match (message.fd, message.remote) {
        (true, _) => FrameFormat::Fd { bit_rate_switch: message.brs, error_state_indicator: message.esi },
        (false, true) => FrameFormat::Remote,
        (false, false) => FrameFormat::Classic,
    };
    let asked_for = [0; 8];
    let data = match format {
        FrameFormat::Remote => asked_for.get(..message.length as usize).ok_or("a remote frame of over 8 bytes")?,
        _ => &message.data,
    };
    let frame = Frame::new(id, format, data).map_err(|error| error.to_string())?;
    Ok(FrameRecord {
        sample: message.step,
        direction,
        time_ns: message.time_ns,
        bus_timestamp_ns: message.bus_timestamp_ns,
        frame,
    })
}
