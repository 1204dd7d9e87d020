//! Frames of a mapped exciter: requests to the plant, and loads.
//!
//! A message whose signals are multiplexed apart has several pages, that is, payloads with different values of
//! the switches. Signals that are not mapped are zero.

use core::ops::Add;

use alloc::vec;
use alloc::vec::Vec;

use crate::node::exciter_lack::ExciterLack;
use crate::node::mapped::mapping::{Action, Arming, CommandSignal, Counts, EventSignal, Incoming, Mapping, Protection};
use crate::rig::Load;
use resonarm_protocol::{Frame, FrameFormat, Id};
use resonarm_wire::PAYLOAD_MAX_BYTES;
use resonarm_wire::layout::Layout;
use resonarm_wire::multiplex::Presence;
use resonarm_wire::signal::Signal;

/// Largest number of raw values of a signal that are searched for one that requests nothing.
const REST_VALUES: u32 = 256;

/// Request to the plant, in the order of a signal's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ask {
    /// Requests nothing, between other requests.
    Rest,
    /// Clears a fault of the plant.
    Reset,
    /// Arms and keeps armed: every command of a load makes this request.
    Arm,
    /// Disarms the plant or one drive.
    Disarm,
}

impl Ask {
    const ALL: [Ask; 4] = [Ask::Rest, Ask::Reset, Ask::Arm, Ask::Disarm];

    const fn action(self) -> Option<Action> {
        match self {
            Ask::Rest => None,
            Ask::Reset => Some(Action::Reset),
            Ask::Arm => Some(Action::Arm),
            Ask::Disarm => Some(Action::Disarm),
        }
    }
}

/// Signal of an event, with its value for each [`Ask`].
#[derive(Clone, Debug)]
struct Asking {
    signal: Signal,
    values: [f64; 4],
}

/// One payload layout of a message.
#[derive(Clone, Debug)]
pub(super) struct Page {
    /// Index of its message in the mapping.
    pub message: usize,
    /// Identifier of that message.
    pub id: Id,
    format: FrameFormat,
    /// Payload with the switches set, zero elsewhere.
    template: Vec<u8>,
    /// Switches that have a value in the template.
    switches: Vec<Layout>,
    protection: Protection,
    commands: Vec<CommandSignal>,
    events: Vec<Asking>,
    /// Requests for which it must be sent.
    asks: [bool; 4],
    /// Whether it only sets conditions of commands, and precedes what arms.
    pub is_condition: bool,
    /// Whether it is the message that synchronises.
    pub is_sync: bool,
}

impl Page {
    fn new(place: usize, message: &Incoming) -> Page {
        Page {
            message: place,
            id: message.id,
            format: message.format,
            template: vec![0; message.length],
            switches: Vec::new(),
            protection: message.protection.clone(),
            commands: Vec::new(),
            events: Vec::new(),
            asks: [false; 4],
            is_condition: false,
            is_sync: false,
        }
    }

    /// Returns whether it commands a load.
    pub fn is_command(&self) -> bool {
        !self.commands.is_empty()
    }

    /// Returns whether it must be sent to make this request.
    pub fn asks(&self, ask: Ask) -> bool {
        self.asks[ask as usize]
    }

    /// Sets the switches so that the payload contains a signal. Returns `false`, without a change, if one of
    /// them already has another value.
    fn select(&mut self, presence: &Presence) -> bool {
        let mut template = self.template.clone();
        let mut switches = self.switches.clone();
        for condition in presence.conditions() {
            let is_set = switches.iter().any(|switch| switch.is_same_place(condition.switch()));
            if is_set && condition.holds(&template) != Some(true) {
                return false;
            }
            if !is_set {
                let first = condition.values().first().map_or(0, |range| *range.start());
                if condition.switch().insert_u64(first, &mut template).is_err() {
                    return false;
                }
                switches.push(*condition.switch());
            }
        }
        self.template = template;
        self.switches = switches;
        true
    }

    /// Adds an event whose signal is in the page.
    fn add(&mut self, id: Id, event: &EventSignal) -> Result<(), ExciterLack> {
        let has = |action| event.actions.iter().any(|(_, asked)| *asked == action);
        for ask in Ask::ALL {
            self.asks[ask as usize] |= ask.action().is_some_and(has);
        }
        // A signal that counts on change must leave its value before it can request again, so the page has a
        // rest to send.
        let is_change = event.counts == Counts::OnChange && event.signal.is_some();
        self.asks[Ask::Rest as usize] |= is_change && (has(Action::Arm) || has(Action::Reset));
        self.asks[Ask::Arm as usize] |= !event.required.is_empty();
        if let Some(signal) = &event.signal {
            let values = values(event, &signal.signal).ok_or(ExciterLack::Rest { id })?;
            // Encoding is the only exact test of whether the signal can represent a value.
            let mut scratch = self.template.clone();
            let mut is_held = |value: &f64| signal.signal.encode(*value, &mut scratch).is_ok();
            if let Some(value) = values.into_iter().find(|value| !is_held(value)) {
                return Err(ExciterLack::Value { id, value });
            }
            self.events.push(Asking { signal: signal.signal, values });
        }
        Ok(())
    }

    /// Returns the frame that makes this request, with a load; `None` if its signals can't represent the load.
    pub fn frame(&self, ask: Ask, load: &Load, counter: u64) -> Option<Frame> {
        let mut bytes = [0; PAYLOAD_MAX_BYTES];
        let payload = bytes.get_mut(..self.template.len())?;
        payload.copy_from_slice(&self.template);
        for event in &self.events {
            event.signal.encode(event.values[ask as usize], payload).ok()?;
        }
        for command in &self.commands {
            command.signal.signal.encode(command.value(load), payload).ok()?;
        }
        // The checksum covers the counter, so it is written last.
        if let Some(of) = &self.protection.counter {
            of.write(counter, payload).ok()?;
        }
        if let Some(checksum) = &self.protection.checksum {
            checksum.write(self.id, payload).ok()?;
        }
        Frame::new(self.id, self.format, payload).ok()
    }

    /// Returns the counter that follows `counter`.
    pub fn after(&self, counter: u64) -> u64 {
        self.protection.counter.as_ref().map_or(0, |of| of.after(counter))
    }

    /// Returns the part of `load` that the page commands.
    fn share(&self, load: &Load) -> Load {
        let parts = self.commands.iter().map(|command| command.input.load(command.input.part(load)));
        parts.fold(Load::default(), Add::add)
    }
}

/// Returns the values of an event's signal by [`Ask`]; `None` if every value of the signal requests something
/// that must not be.
///
/// At rest the signal has the value that disarms, and while the plant is armed the one that arms; without such
/// a value it requests nothing. A condition keeps its value.
fn values(event: &EventSignal, signal: &Signal) -> Option<[f64; 4]> {
    let of = |action| event.actions.iter().find(|(_, asked)| *asked == action).map(|(value, _)| *value);
    let [least, most] = signal.range();
    let asks = |value: &f64| event.actions.iter().any(|(asking, _)| asking == value);
    // Raw values are tried from 0 up, as most protocols use a small number for "no request".
    let mut raw = (0..REST_VALUES).map(|raw| f64::from(raw) * signal.scale() + signal.offset());
    let neutral = raw.find(|value| (least..=most).contains(value) && !asks(value));
    let condition = event.required.first().copied();
    let rest = condition.or(of(Action::Disarm)).or(neutral).or(of(Action::Reset)).or(of(Action::Arm))?;
    let armed = of(Action::Arm).or(condition).or(neutral).unwrap_or(rest);
    Some([rest, of(Action::Reset).unwrap_or(rest), armed, of(Action::Disarm).unwrap_or(rest)])
}

/// Returns the pages of a mapping: those that only set conditions first, and those that synchronise last.
///
/// # Errors
/// [`ExciterLack`] says why no controller can speak to the plant so.
pub(super) fn pages(mapping: &Mapping) -> Result<Vec<Page>, ExciterLack> {
    let mut pages = Vec::new();
    for (place, message) in mapping.incoming.iter().enumerate() {
        let mut own = of_message(place, message)?;
        if mapping.arming == Arming::ZeroCommand {
            own.iter_mut().filter(|page| page.is_command()).for_each(|page| page.asks[Ask::Arm as usize] = true);
        }
        pages.append(&mut own);
    }
    // Conditions must hold before what they condition, and SYNC takes everything received before it.
    pages.sort_by_key(|page| (page.is_sync, !page.is_condition, page.message));
    Ok(pages)
}

fn of_message(place: usize, message: &Incoming) -> Result<Vec<Page>, ExciterLack> {
    let mut pages = Vec::new();
    if !message.commands.is_empty() || message.is_sync || message.events.is_empty() {
        let mut page = Page::new(place, message);
        if !message.commands.iter().all(|command| page.select(&command.signal.presence)) {
            return Err(ExciterLack::Multiplexed { id: message.id });
        }
        page.commands = message.commands.clone();
        page.is_sync = message.is_sync && message.commands.is_empty();
        pages.push(page);
    }
    for event in &message.events {
        let presence = event.signal.as_ref().map_or(Presence::ALWAYS, |signal| signal.presence.clone());
        let place = match pages.iter_mut().position(|page| page.select(&presence)) {
            Some(place) => place,
            None => {
                let mut page = Page::new(place, message);
                if !page.select(&presence) {
                    return Err(ExciterLack::Multiplexed { id: message.id });
                }
                pages.push(page);
                pages.len() - 1
            }
        };
        pages[place].add(message.id, event)?;
    }
    for page in &mut pages {
        let arms = message.events.iter().any(|event| event.actions.iter().any(|(_, action)| *action == Action::Arm));
        page.is_condition = !arms && !page.is_command() && page.asks(Ask::Arm);
    }
    Ok(pages)
}

/// Returns whether the pages can command the load: every part of it has a signal, within its range.
pub(super) fn can_command(pages: &[Page], load: &Load) -> bool {
    let commanded = pages.iter().fold(Load::default(), |sum, page| sum + page.share(load));
    let off_n = (commanded - *load).force_n.amax();
    let off_nm = (commanded - *load).torque_nm.amax();
    // The tolerance covers the rounding of a shaker's direction.
    let is_whole = off_n <= 1e-9 * (1.0 + load.force_n.amax()) && off_nm <= 1e-9 * (1.0 + load.torque_nm.amax());
    is_whole && pages.iter().all(|page| page.frame(Ask::Arm, load, 0).is_some())
}
