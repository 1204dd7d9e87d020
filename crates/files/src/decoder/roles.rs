//! The roles of the messages and signals of a mapping.

use std::collections::HashMap;

use super::check::Fault;
use super::meaning::Meaning;
use super::name_of;
use resonarm_bench::node::mapped::mapping::{
    Action, CommandSignal, Counts, EventSignal, Form, Incoming, LoadInput, MappedSignal, Outgoing, Protection,
    ProtectionCheck, Source, Value,
};
use resonarm_bench::structure::{Channel, LOAD_NAMES, Quantity};
use resonarm_protocol::Frame;
use resonarm_scenario::dbc::Message;
use resonarm_scenario::wire::{Quantities, REASONS, STATES};
use resonarm_wire::layout::Layout;

/// Relative rounding of a value by the scale of its signal.
const ROUNDING: f64 = 1e-9;

/// Role of a signal in the plant's mapping.
#[derive(Clone, Debug)]
enum Role {
    Counter,
    Checksum,
    Load(CommandSignal),
    Event(EventSignal, Option<f64>),
    Quantity { channel: Channel, scale: f64, offset: f64 },
    Clipped(Channel),
    Report(Source),
}

/// Roles of the signals of a message, and its protection.
#[derive(Clone, Debug)]
pub(super) struct MessageRoles {
    protection: ProtectionCheck,
    /// The roles by the names of the signals.
    roles: HashMap<String, Vec<Role>>,
    /// The requests that every frame makes.
    pub requests: Vec<Action>,
    /// Whether the message answers samples in lockstep, or requests readings.
    pub is_sync: bool,
    /// Whether the message is sent on request.
    pub is_on_request: bool,
    /// The signals without which a frame is rejected.
    needed: Vec<(String, MappedSignal)>,
}

impl MessageRoles {
    /// Returns the roles of a message that the plant receives.
    pub fn incoming(message: &Message, of: &Incoming) -> MessageRoles {
        let mut roles = MessageRoles::protected(message, of.form(), &of.protection);
        roles.is_sync = of.is_sync;
        for command in &of.commands {
            roles.add(message, &command.signal, Role::Load(command.clone()));
        }
        for event in &of.events {
            match &event.signal {
                Some(signal) => roles.add(message, signal, Role::Event(event.clone(), None)),
                None => roles.requests.extend(event.actions.iter().map(|(_, action)| *action)),
            }
        }
        roles
    }

    /// Returns the roles of a message that the plant sends.
    pub fn outgoing(message: &Message, of: &Outgoing, quantities: &Quantities) -> MessageRoles {
        let mut roles = MessageRoles::protected(message, of.form(), &of.protection);
        roles.is_on_request = of.is_on_request;
        for reading in &of.signals {
            let role = match &reading.source {
                Source::Value { value, scale, offset } => match (quantities.channel(*value), value) {
                    (Some(channel), Value::Clipped(_)) => Role::Clipped(channel),
                    (Some(channel), _) => Role::Quantity { channel, scale: *scale, offset: *offset },
                    (None, _) => continue,
                },
                source => Role::Report(source.clone()),
            };
            roles.add(message, &reading.signal, role);
        }
        roles
    }

    fn protected(message: &Message, form: Form, protection: &Protection) -> MessageRoles {
        let mut roles = MessageRoles {
            protection: ProtectionCheck::new(form, protection),
            roles: HashMap::new(),
            requests: Vec::new(),
            is_sync: false,
            is_on_request: false,
            needed: Vec::new(),
        };
        let mut at = |layout: &Layout, role: Role| {
            // The mapping states counter and checksum by their place in the payload. A DBC may have no signal there.
            let found = message.signals().find(|signal| signal.wire().layout().is_same_place(layout));
            if let Some(signal) = found {
                roles.roles.entry(signal.name().to_string()).or_default().push(role);
            }
        };
        if let Some(counter) = &protection.counter {
            at(counter.layout(), Role::Counter);
        }
        if let Some(checksum) = &protection.checksum {
            at(checksum.place(), Role::Checksum);
        }
        roles
    }

    fn add(&mut self, message: &Message, signal: &MappedSignal, role: Role) {
        let Some(name) = name_of(message, signal) else { return };
        self.needed.push((name.clone(), signal.clone()));
        self.roles.entry(name).or_default().push(role);
    }

    /// Checks a frame; returns how many were lost before it.
    ///
    /// # Errors
    /// [`Fault`] if its receiver must not use it.
    pub fn check(&mut self, frame: &Frame) -> Result<u64, Fault> {
        let lost = self.protection.lost(frame)?;
        let payload = frame.data();
        for (name, signal) in &self.needed {
            signal.read(payload).map_err(|unreadable| Fault::of_signal(name, payload.len(), unreadable))?;
        }
        Ok(lost)
    }

    /// Returns the meaning of a signal with this value; with `is_taken` it counts as the last one.
    pub fn meanings(&mut self, signal: &str, value: f64, is_taken: bool) -> Vec<Meaning> {
        let Some(roles) = self.roles.get_mut(signal) else { return Vec::new() };
        roles.iter_mut().flat_map(|role| role.meanings(value, is_taken)).collect()
    }
}

impl Role {
    fn meanings(&mut self, value: f64, is_taken: bool) -> Vec<Meaning> {
        match self {
            Role::Counter => vec![Meaning::Counter],
            Role::Checksum => vec![Meaning::Checksum],
            Role::Load(of) => {
                let (name, quantity) = load(of.input);
                vec![Meaning::Load { name, value: of.scale * value + of.offset, unit: quantity.unit() }]
            }
            Role::Event(event, before) => {
                let is_new = event.counts == Counts::InEveryFrame || *before != Some(value);
                if is_taken {
                    *before = Some(value);
                }
                let asked = event.actions.iter().filter(|(asking, _)| *asking == value);
                let request = asked.map(|(_, action)| Meaning::Request { action: action_name(*action), is_new });
                let required = (!event.required.is_empty())
                    .then(|| Meaning::Required { is_fulfilled: event.required.contains(&value) });
                request.chain(required).collect()
            }
            Role::Quantity { channel, scale, offset } => {
                let name = channel.name;
                let unit = channel.quantity.unit();
                // The inverse of what the plant does: it sends scale · quantity + offset.
                vec![Meaning::Quantity { name, value: (value - *offset) / *scale, unit }]
            }
            Role::Clipped(channel) => vec![Meaning::Clipped { name: channel.name, is_clipped: value != 0.0 }],
            Role::Report(source) => report(source, value).into_iter().collect(),
        }
    }
}

/// Says whether a value equals this number, up to the rounding of its scale.
fn is_same(number: f64, value: f64) -> bool {
    (number - value).abs() <= ROUNDING * (1.0 + number.abs())
}

fn report(source: &Source, value: f64) -> Option<Meaning> {
    match source {
        Source::State(numbers) => {
            let name = STATES.iter().zip(numbers).find(|(_, number)| is_same(**number, value)).map(|(name, _)| *name);
            Some(Meaning::State { name })
        }
        Source::Reason { none, other, codes } => {
            let named = |code| REASONS.iter().find(|(_, known)| *known == code).map(|(name, _)| *name);
            let name = match value {
                value if is_same(*none, value) => Some("none"),
                value => match codes.iter().find(|(_, number)| is_same(*number, value)) {
                    Some((code, _)) => named(*code),
                    None if is_same(*other, value) => Some("other"),
                    None => None,
                },
            };
            Some(Meaning::Reason { name })
        }
        Source::Sample { .. } => Some(Meaning::Sample),
        Source::Value { .. } => None,
    }
}

/// Returns the key of a load in a scenario, and its quantity.
fn load(input: LoadInput) -> (&'static str, Quantity) {
    match input {
        LoadInput::Torque(joint) => (LOAD_NAMES.get(joint).copied().unwrap_or("torque"), Quantity::Torque),
        LoadInput::ForceX => ("force_x_n", Quantity::Force),
        LoadInput::ForceY => ("force_y_n", Quantity::Force),
        LoadInput::ForceZ => ("force_z_n", Quantity::Force),
        LoadInput::Along(_) => ("force_n", Quantity::Force),
    }
}

/// Returns the key of a request in a scenario.
pub const fn action_name(action: Action) -> &'static str {
    match action {
        Action::Arm => "arm",
        Action::Disarm => "disarm",
        Action::Reset => "reset",
        Action::Stop => "stop",
    }
}
