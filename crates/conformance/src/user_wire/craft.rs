//! Frames of the tester's end as they are damaged on their way to the bus, and frames that no node of ours sends.

use std::collections::BTreeMap;

use super::protocol::UserWire;
use resonarm_bench::node::WireSpec;
use resonarm_bench::node::mapped::mapping::{Action, Incoming};
use resonarm_protocol::{Frame, Id};
use resonarm_wire::layout::Number;

/// Bytes of a target's frame that end before the target.
const BEFORE_TARGET: usize = 3;

/// Damage of a frame with loads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Damage {
    /// A bit of its checksum.
    Checksum,
    /// The counter is that of the frame before.
    Repeated,
    /// The counter is one further than the most frames that may be lost.
    Jump,
    /// The frame ends before a signal.
    Short,
    /// A load is not a number.
    NotFinite,
}

impl Damage {
    /// Whether a message can have it.
    fn fits(self, message: &Incoming) -> bool {
        let protection = &message.protection;
        match self {
            Damage::Checksum => protection.checksum.is_some(),
            Damage::Repeated => protection.counter.is_some(),
            // A whole turn is no jump, and one less a repetition.
            Damage::Jump => protection.counter.as_ref().is_some_and(|of| protection.most_lost + 2 < of.values()),
            Damage::Short => true,
            Damage::NotFinite => message.commands.iter().any(|command| is_float(&command.signal.signal)),
        }
    }

    /// Whether every message with loads can have it.
    pub fn is_possible(self, on: &UserWire) -> bool {
        match on.spec {
            WireSpec::Mapped(_) => on.commands().all(|message| self.fits(message)),
            WireSpec::Cia402(_) => self == Damage::Short,
        }
    }
}

fn is_float(signal: &resonarm_wire::signal::Signal) -> bool {
    signal.layout().number() == Number::Float
}

/// The frames that the tester has sent last.
#[derive(Clone, Debug, Default)]
pub(super) struct Sent {
    last: BTreeMap<Id, Frame>,
}

impl Sent {
    /// A frame that is sent as it is.
    pub fn pass(&mut self, frame: &Frame) -> Frame {
        self.last.insert(frame.id(), *frame);
        *frame
    }

    /// The counter of the frame of a message that was sent last.
    fn counter(&self, message: &Incoming) -> Option<u64> {
        message.protection.counter.as_ref()?.read(self.last.get(&message.id)?.data())
    }

    /// A frame as it is sent damaged, if it has a load.
    pub fn damage(&mut self, on: &UserWire, frame: &Frame, damage: Damage) -> Frame {
        let damaged = match &on.spec {
            WireSpec::Mapped(_) => on
                .commands()
                .find(|message| message.id == frame.id())
                .and_then(|message| self.damaged(message, frame, damage)),
            WireSpec::Cia402(_) => {
                let data = frame.data().get(..BEFORE_TARGET).filter(|_| on.is_command(frame));
                data.and_then(|data| Frame::new(frame.id(), frame.format(), data).ok())
            }
        };
        let damaged = damaged.unwrap_or(*frame);
        // These counters count from the frame sent last, so that each one jumps, or repeats, anew.
        if matches!(damage, Damage::Repeated | Damage::Jump) {
            self.last.insert(frame.id(), damaged);
        }
        damaged
    }

    fn damaged(&self, message: &Incoming, frame: &Frame, damage: Damage) -> Option<Frame> {
        let mut payload = frame.data().to_vec();
        match damage {
            Damage::Short => return shortened(message, frame),
            Damage::Checksum => {
                let place = message.protection.checksum.as_ref()?.place();
                let checksum = place.extract_u64(&payload)?;
                // A bit of the checksum itself, so that the content stays valid, and acts if the checksum is not
                // looked at.
                place.insert_u64(checksum ^ 1, &mut payload).ok()?;
                return Frame::new(frame.id(), frame.format(), &payload).ok();
            }
            Damage::Repeated | Damage::Jump => {
                let counter = message.protection.counter.as_ref()?;
                // Without a frame before it there is nothing to repeat or to jump from; then 0 is as good as any.
                let last = self.counter(message).unwrap_or(0);
                // The step of one, the frames that may be lost, and one more.
                let ahead = if damage == Damage::Jump { message.protection.most_lost + 2 } else { 0 };
                counter.write((last + ahead) % counter.values(), &mut payload).ok()?;
            }
            Damage::NotFinite => {
                for command in message.commands.iter().filter(|command| is_float(&command.signal.signal)) {
                    command.signal.signal.layout().insert_f64(f64::NAN, &mut payload).ok()?;
                }
            }
        }
        protected(message, payload, frame)
    }

    /// A frame that asks the plant to stop: the one of its message that was sent last, with the value that stops.
    /// `None` if no message of the mapping does.
    pub fn stop(&mut self, on: &UserWire) -> Option<Frame> {
        let (message, event) = on.mapping()?.incoming.iter().find_map(|message| {
            let stops = |event: &&_| stop_value(event).is_some();
            message.events.iter().find(stops).map(|event| (message, event))
        })?;
        let last = self.last.get(&message.id);
        let mut payload = last.map_or_else(|| vec![0; message.length], |last| last.data().to_vec());
        if let (Some(signal), Some(value)) = (&event.signal, stop_value(event)) {
            signal.signal.encode(value, &mut payload).ok()?;
        }
        if let (Some(counter), Some(last)) = (&message.protection.counter, self.counter(message)) {
            counter.write(counter.after(last), &mut payload).ok()?;
        }
        // Only its identifier and format are used, by `protected`.
        let empty = Frame::new(message.id, message.format, &payload).ok()?;
        protected(message, payload, &empty)
    }
}

/// The value of an event that stops the plant.
fn stop_value(event: &resonarm_bench::node::mapped::mapping::EventSignal) -> Option<f64> {
    event.actions.iter().find(|(_, action)| *action == Action::Stop).map(|(value, _)| *value)
}

/// The frame with this payload and the checksum that belongs to it.
fn protected(message: &Incoming, mut payload: Vec<u8>, frame: &Frame) -> Option<Frame> {
    if let Some(checksum) = &message.protection.checksum {
        checksum.write(message.id, &mut payload).ok()?;
    }
    Frame::new(frame.id(), frame.format(), &payload).ok()
}

/// The longest beginning of a frame that ends before a signal which the mapping uses.
fn shortened(message: &Incoming, frame: &Frame) -> Option<Frame> {
    let data = frame.data();
    let is_short = |bytes: &usize| message.check(&data[..*bytes]).is_err();
    // CAN FD has no frames of many lengths, so the next shorter one that exists is looked for.
    let mut lengths = (0..data.len()).rev().filter(is_short);
    lengths.find_map(|bytes| Frame::new(frame.id(), frame.format(), &data[..bytes]).ok())
}
