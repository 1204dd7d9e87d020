//! What a mapped exciter hears: the messages with the plant's readings.

use alloc::vec::Vec;

use crate::node::FrameCheck;
use crate::node::mapped::mapping::{Mapping, Outgoing, ProtectionCheck, Said, Source, Trigger, Value};
use crate::rig::Measurement;
use resonarm_protocol::{EmergencyCode, Frame, Id, NodeState};
use resonarm_wire::counter::Step;

/// By what the samples of a message are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Numbering {
    /// The index in it, modulo this.
    Sample(u64),
    /// Its counter.
    Counter,
    /// Its frames.
    Frames,
}

/// A message of the plant, with what was heard of it.
#[derive(Clone, Debug)]
pub(super) struct Listener {
    message: Outgoing,
    check: ProtectionCheck,
    numbering: Numbering,
    /// Samples from one frame to the next.
    every: u64,
    /// The index of the sample heard last, modulo that of [`Numbering::Sample`].
    last: Option<u64>,
    /// Whether each of its frames is a part of a sample that is answered.
    pub is_of_sample: bool,
    /// Whether its part of the next sample has come.
    pub has_come: bool,
    /// The readings in the frame heard last that were beyond a range, a bit each.
    pub clipped: u8,
}

/// What a frame says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Heard {
    /// The samples since the frame before; 0: the same sample again.
    pub ahead: u64,
    /// The state of its drive, if it says it.
    pub state: Option<NodeState>,
    /// The reason of a fault, if there is one.
    pub fault: Option<Reason>,
}

/// The reason of the plant's fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reason {
    /// A known one.
    Code(EmergencyCode),
    /// Another.
    Other,
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

    pub fn id(&self) -> Id {
        self.message.id
    }

    /// The drive of whose state it may say something.
    pub fn drive(&self) -> usize {
        self.message.drive
    }

    /// Whether it says the state of its drive, so that operational differs from the others.
    pub fn says_state(&self) -> bool {
        self.message.signals.iter().any(|signal| match &signal.source {
            Source::State([boot_up, idle, armed, fault]) => ![boot_up, idle, fault].contains(&armed),
            _ => false,
        })
    }

    /// Whether it has a reading of the plant, by its place.
    pub fn says(&self, place: usize) -> bool {
        let is_it = |source: &Source| matches!(source, Source::Value { value: Value::Reading(of), .. } if *of == place);
        self.message.signals.iter().any(|signal| is_it(&signal.source))
    }

    /// How well its samples are counted: better is larger.
    pub fn counts(&self) -> u8 {
        match self.numbering {
            Numbering::Sample(_) => 2,
            Numbering::Counter => 1,
            Numbering::Frames => 0,
        }
    }

    /// Forgets what it heard: another plant, or the same after a fault, counts anew.
    pub fn forget(&mut self) {
        self.check = ProtectionCheck::new(self.message.form(), &self.message.protection);
        (self.last, self.has_come, self.clipped) = (None, false, 0);
    }

    /// Takes in a frame: checks it, and writes the readings in it to their places.
    ///
    /// # Errors
    /// The check that failed: the frame must not be used.
    pub fn hear(&mut self, frame: &Frame, readings: &mut [f64; Measurement::CHANNELS]) -> Result<Heard, FrameCheck> {
        let step = self.check.step(frame)?;
        let payload = frame.data();
        self.message.signals.iter().try_for_each(|signal| signal.signal.read(payload).map(drop))?;
        self.clipped = 0;
        let (mut heard, mut index) = (Heard { ahead: 0, state: None, fault: None }, None);
        for signal in &self.message.signals {
            let Some(got) = signal.signal.read(payload)? else { continue };
            let tolerance = 0.5 * signal.signal.signal.resolution().unwrap_or(0.0);
            let is = |number: &f64| (got - number).abs() <= tolerance;
            match &signal.source {
                Source::Value { .. } if self.is_of_sample => {
                    self.clipped |= write(signal.reading(payload)?, readings);
                }
                Source::Value { .. } => {}
                Source::State(numbers) => heard.state = state(numbers, is),
                Source::Reason { none, codes, .. } if !is(none) => {
                    let code = codes.iter().find(|(_, number)| is(number)).map(|(code, _)| Reason::Code(*code));
                    heard.fault = Some(code.unwrap_or(Reason::Other));
                }
                Source::Reason { .. } => {}
                Source::Sample { .. } => index = Some(got as u64),
            }
        }
        heard.state = if heard.fault.is_some() { Some(NodeState::Fault) } else { heard.state };
        heard.ahead = self.ahead(step, index);
        Ok(heard)
    }

    /// How many samples a frame is ahead of the one before: 0 is a repetition.
    fn ahead(&mut self, step: Option<Step>, index: Option<u64>) -> u64 {
        match (self.numbering, index, step) {
            (Numbering::Sample(modulus), Some(index), _) => {
                let last = self.last.replace(index);
                last.map_or(self.every, |last| (index % modulus + modulus - last % modulus) % modulus)
            }
            (_, _, Some(Step::Lost { frames })) => frames.saturating_add(1).saturating_mul(self.every),
            _ => self.every,
        }
    }
}

/// Writes what is said of a reading; returns the bit of its place if it was beyond a range.
fn write(said: Option<Said>, readings: &mut [f64; Measurement::CHANNELS]) -> u8 {
    let (place, is_clipped) = match said {
        Some(Said::Value { place, value, is_at_end }) => {
            readings.get_mut(place).into_iter().for_each(|reading| *reading = value);
            (place, is_at_end)
        }
        Some(Said::Clipped { place, is_clipped }) => (place, is_clipped),
        None => return 0,
    };
    u8::from(is_clipped).checked_shl(place as u32).unwrap_or(0)
}

/// The state of these numbers; of two with one number the worse.
fn state([boot_up, idle, armed, fault]: &[f64; 4], is: impl Fn(&f64) -> bool) -> Option<NodeState> {
    let states = [
        (armed, NodeState::Operational),
        (idle, NodeState::PreOperational),
        (fault, NodeState::Fault),
        (boot_up, NodeState::BootUp),
    ];
    states.into_iter().find(|(number, _)| is(number)).map(|(_, state)| state)
}

/// The messages of the plant, and every how many samples its samples are answered: those of the messages with
/// readings of head, B and C that come most often, or with states and loads if none has such readings. `None` if none
/// comes by itself.
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

/// Whether messages of samples come only when they are asked for by the message that synchronises.
pub(super) fn come_on_sync(mapping: &Mapping, listeners: &[Listener]) -> bool {
    let of_sample = mapping.outgoing.iter().zip(listeners).filter(|(_, listener)| listener.is_of_sample);
    of_sample.into_iter().any(|(message, _)| message.trigger == Trigger::Sync)
}
