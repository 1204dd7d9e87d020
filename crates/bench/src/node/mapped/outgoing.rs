//! Messages that a mapped plant sends.

use super::mapping::{Outgoing, Source, Trigger, Values, place};
use resonarm_protocol::{Emergency, Frame, NodeState};
use resonarm_wire::PAYLOAD_MAX_BYTES;
use resonarm_wire::signal::{EncodeError, Signal};

/// State and fault of a drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Status {
    pub state: NodeState,
    pub fault: Option<Emergency>,
}

/// A message with the state of its next frame.
#[derive(Clone, Debug)]
pub(super) struct Sender {
    pub message: Outgoing,
    counter: u64,
    /// Whether a frame of it waits.
    pub waits: bool,
    due_ns: u64,
    /// Number of values of the last frame that its signals could not represent.
    limited: u64,
}

impl Sender {
    pub fn new(message: Outgoing) -> Sender {
        Sender { message, counter: 0, waits: false, due_ns: 0, limited: 0 }
    }

    /// Queues a frame for sending. Returns `false` if one waited already, which is then sent with newer values.
    pub fn queue(&mut self) -> bool {
        !core::mem::replace(&mut self.waits, true)
    }

    /// Returns the time at which it is due by the clock, ns.
    pub fn due_ns(&self) -> Option<u64> {
        matches!(self.message.trigger, Trigger::Period(_)).then_some(self.due_ns)
    }

    /// Returns whether it is due by the clock. It is due again one period after the last time, or after now if
    /// that has passed.
    pub fn take_due(&mut self, now_ns: u64) -> bool {
        let Trigger::Period(period_ns) = self.message.trigger else { return false };
        if now_ns < self.due_ns {
            return false;
        }
        let next_ns = self.due_ns.saturating_add(period_ns);
        self.due_ns = if next_ns > now_ns { next_ns } else { now_ns.saturating_add(period_ns) };
        true
    }

    /// Returns the frame with these values; `None` if there can't be one.
    pub fn frame(&mut self, values: &Values, status: &Status) -> Option<Frame> {
        let mut bytes = [0; PAYLOAD_MAX_BYTES];
        let payload = bytes.get_mut(..self.message.payload.len())?;
        payload.copy_from_slice(&self.message.payload);
        self.limited = 0;
        for reading in &self.message.signals {
            // A multiplexed signal is written only where its switch, a constant of the payload, selects it.
            if reading.signal.presence.is_in(payload) != Some(false) {
                let value = value_of(&reading.source, values, status);
                self.limited += u64::from(write(&reading.signal.signal, value, payload));
            }
        }
        let protection = &self.message.protection;
        if let Some(counter) = &protection.counter {
            // The counter advances only when the bus has taken the frame: a frame that is built again keeps its
            // number.
            counter.write(self.counter, payload).ok()?;
        }
        if let Some(checksum) = &protection.checksum {
            checksum.write(self.message.id, payload).ok()?;
        }
        Frame::new(self.message.id, self.message.format, payload).ok()
    }

    /// Notes that the last frame has been sent. Returns how many values its signals could not represent.
    pub fn sent(&mut self) -> u64 {
        self.waits = false;
        if let Some(counter) = &self.message.protection.counter {
            self.counter = counter.after(self.counter);
        }
        self.limited
    }
}

/// Writes the closest value that the bits can represent. Returns whether it was limited by more than rounding.
fn write(signal: &Signal, value: f64, payload: &mut [u8]) -> bool {
    match signal.encode(value, payload) {
        Ok(()) => false,
        Err(EncodeError::OutOfRange { value, least, most }) => {
            // A value beyond the signal is sent at its limit, as a real sensor would saturate, and counted.
            let _written = signal.encode(value.clamp(least, most), payload);
            true
        }
        Err(_) => true,
    }
}

fn value_of(source: &Source, values: &Values, status: &Status) -> f64 {
    match source {
        Source::Value { value, scale, offset } => scale * values.get(*value) + offset,
        Source::State(numbers) => numbers[place(status.state)],
        Source::Reason { none, other, codes } => match status.fault {
            None => *none,
            Some(fault) => codes.iter().find(|(code, _)| *code == fault.code).map_or(*other, |(_, number)| *number),
        },
        Source::Sample { modulus } => libm::fmod(values.sample as f64, *modulus),
    }
}
