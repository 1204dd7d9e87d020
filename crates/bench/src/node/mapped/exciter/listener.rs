//! The plant's messages as a mapped exciter receives them.

use alloc::vec::Vec;

use crate::node::mapped::mapping::{Mapping, Outgoing, ProtectionCheck, Said, Source, Trigger, Value};
use crate::rig::{MOST_CHANNELS, Measurement};
use resonarm_protocol::node::FrameCheck;
use resonarm_protocol::{EmergencyCode, Frame, NodeState};
use resonarm_wire::counter::Step;

/// Number by which the samples of a message are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Numbering {
    /// The sample index in the message, modulo this number.
    Sample(u64),
    /// The alive counter of the message.
    Counter,
    /// The number of its frames, if it has neither.
    Frames,
}

/// A message of the plant, with what has been received of it.
#[derive(Clone, Debug)]
pub(super) struct Listener {
    /// The message, with its identifier and the drive whose state it may report.
    pub message: Outgoing,
    check: ProtectionCheck,
    numbering: Numbering,
    /// Number of samples from one frame to the next.
    every: u64,
    /// Index of the last received sample, modulo that of [`Numbering::Sample`].
    last: Option<u64>,
    /// Whether each of its frames is a part of an answered sample.
    pub is_of_sample: bool,
    /// Whether its part of the next sample has come.
    pub has_come: bool,
    /// Readings of the last frame that were clipped, one bit each.
    pub clipped: u32,
}

/// Content of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Heard {
    /// Number of samples since the frame before; 0 for the same sample again.
    pub ahead: u64,
    /// State of its drive, if the message carries it.
    pub state: Option<NodeState>,
    /// Code of its fault, if it has one whose number the mapping states.
    pub fault: Option<EmergencyCode>,
}

impl Listener {
    fn new(message: &Outgoing, every: u64) -> Listener {
        let modulus = message.signals.iter().find_map(|signal| match signal.source {
            Source::Sample { modulus } if modulus >= 2.0 => Some(modulus as u64),
            _ => None,
        });
        let counter = message.protection.counter.as_ref().map(|_| Numbering::Counter);
        Listener {
            numbering: modulus.map(Numbering::Sample).or(counter).unwrap_or(Numbering::Frames),
            check: ProtectionCheck::new(message.form(), &message.protection),
            message: message.clone(),
            every,
            last: None,
            is_of_sample: false,
            has_come: false,
            clipped: 0,
        }
    }

    /// Returns whether it reports the state of its drive such that operational differs from the others.
    pub fn says_state(&self) -> bool {
        self.message.signals.iter().any(|signal| match &signal.source {
            Source::State([boot_up, idle, armed, fault]) => ![boot_up, idle, fault].contains(&armed),
            _ => false,
        })
    }

    /// Returns whether it carries a reading of the plant, by the reading's index.
    pub fn says(&self, place: usize) -> bool {
        let is_it = |source: &Source| matches!(source, Source::Value { value: Value::Reading(of), .. } if *of == place);
        self.message.signals.iter().any(|signal| is_it(&signal.source))
    }

    /// Returns how well it counts samples: a larger number is better.
    pub fn counts(&self) -> u8 {
        match self.numbering {
            Numbering::Sample(_) => 2,
            Numbering::Counter => 1,
            Numbering::Frames => 0,
        }
    }

    /// Forgets everything received: another plant, or the same one after a fault, counts anew.
    pub fn forget(&mut self) {
        self.check = ProtectionCheck::new(self.message.form(), &self.message.protection);
        self.last = None;
        self.has_come = false;
        self.clipped = 0;
    }

    /// Checks a frame and writes the readings in it to their places.
    ///
    /// # Errors
    /// The check that failed: the frame must not be used.
    pub fn hear(&mut self, frame: &Frame, readings: &mut [f64; MOST_CHANNELS]) -> Result<Heard, FrameCheck> {
        let step = self.check.step(frame)?;
        let payload = frame.data();
        // All signals are read before any of them takes effect, so that a frame is used as a whole or not at
        // all.
        self.message.signals.iter().try_for_each(|signal| signal.signal.read(payload).map(drop))?;
        self.clipped = 0;
        let mut heard = Heard { ahead: 0, state: None, fault: None };
        let mut index = None;
        let mut has_fault = false;
        for signal in &self.message.signals {
            let Some(got) = signal.signal.read(payload)? else { continue };
            // A number that went through the bus is off by rounding, by half a count at most.
            let tolerance = 0.5 * signal.signal.signal.resolution().unwrap_or(0.0);
            let is = |number: &f64| (got - number).abs() <= tolerance;
            match &signal.source {
                Source::Value { .. } if self.is_of_sample => {
                    self.clipped |= write(signal.reading(payload)?, readings);
                }
                Source::Value { .. } => {}
                Source::State(numbers) => heard.state = state(numbers, is),
                Source::Reason { none, codes, .. } if !is(none) => {
                    has_fault = true;
                    heard.fault = codes.iter().find(|(_, number)| is(number)).map(|(code, _)| *code);
                }
                Source::Reason { .. } => {}
                Source::Sample { .. } => index = Some(got as u64),
            }
        }
        // A message may report a fault without a number for the state fault.
        heard.state = if has_fault { Some(NodeState::Fault) } else { heard.state };
        heard.ahead = self.ahead(step, index);
        Ok(heard)
    }

    /// Returns the number of samples that a frame is ahead of the one before: 0 is a repetition.
    fn ahead(&mut self, step: Option<Step>, index: Option<u64>) -> u64 {
        match (self.numbering, index, step) {
            (Numbering::Sample(modulus), Some(index), _) => {
                let last = self.last.replace(index);
                // Both indices are reduced first, since a plant may count beyond the modulus that its mapping states.
                last.map_or(self.every, |last| (index % modulus + modulus - last % modulus) % modulus)
            }
            (_, _, Some(Step::Lost { frames })) => frames.saturating_add(1).saturating_mul(self.every),
            _ => self.every,
        }
    }
}

/// Writes a reading that a signal carries. Returns the bit of its index if it was clipped.
fn write(said: Option<Said>, readings: &mut [f64; MOST_CHANNELS]) -> u32 {
    let (place, is_clipped) = match said {
        Some(Said::Value { place, value, is_at_end }) => {
            readings.get_mut(place).into_iter().for_each(|reading| *reading = value);
            (place, is_at_end)
        }
        Some(Said::Clipped { place, is_clipped }) => (place, is_clipped),
        None => return 0,
    };
    u32::from(is_clipped).checked_shl(place as u32).unwrap_or(0)
}

/// Returns the state with this number; if two states share it, the first in the order below.
fn state([boot_up, idle, armed, fault]: &[f64; 4], is: impl Fn(&f64) -> bool) -> Option<NodeState> {
    let states = [
        // Operational comes first. For a drive that reports its state no other state has that number (`says_state`).
        (armed, NodeState::Operational),
        (idle, NodeState::PreOperational),
        (fault, NodeState::Fault),
        (boot_up, NodeState::BootUp),
    ];
    states.into_iter().find(|(number, _)| is(number)).map(|(_, state)| state)
}

/// Returns the messages of the plant, with the number of samples from one answer to the next. The messages with
/// readings of head, B and C that come most often are answered; if none has such readings, those with states
/// and loads. `None` if no message comes by itself.
pub(super) fn listeners(mapping: &Mapping, rate_hz: u16) -> Option<(Vec<Listener>, u64)> {
    let period = |trigger| match trigger {
        Trigger::Every(samples) => Some(samples.max(1)),
        Trigger::Sync => Some(1),
        Trigger::Period(period_ns) => Some((libm::round(period_ns as f64 * 1e-9 * f64::from(rate_hz)) as u64).max(1)),
        Trigger::Request => None,
    };
    let is_reading = |source: &Source| match source {
        Source::Value { value: Value::Reading(place), .. } => *place < Measurement::CHANNELS,
        _ => false,
    };
    let is_value = |source: &Source| matches!(source, Source::Value { .. });
    let least = |wanted: &dyn Fn(&Source) -> bool| {
        let has = |message: &&Outgoing| message.signals.iter().any(|signal| wanted(&signal.source));
        mapping.outgoing.iter().filter(has).filter_map(|message| period(message.trigger)).min()
    };
    let every = least(&is_reading).or_else(|| least(&is_value)).or_else(|| least(&|_| true))?;
    let listeners = mapping.outgoing.iter().map(|message| {
        let own = period(message.trigger);
        let is_of_sample = own == Some(every);
        Listener { is_of_sample, ..Listener::new(message, own.unwrap_or(every)) }
    });
    Some((listeners.collect(), every))
}

/// Returns whether messages of samples come only when the message that synchronises asks for them.
pub(super) fn come_on_sync(mapping: &Mapping, listeners: &[Listener]) -> bool {
    let of_sample = mapping.outgoing.iter().zip(listeners).filter(|(_, listener)| listener.is_of_sample);
    of_sample.into_iter().any(|(message, _)| message.trigger == Trigger::Sync)
}
