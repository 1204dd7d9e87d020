//! Compiles the section `[wire]`: resolves the names in the DBC into the mapping that the plant's node
//! executes.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::conversion::signal_factor;
use super::error::{Place, WireError};
use super::exact::Exact;
use super::signals::quantity::Quantities;
use super::signals::{Used, counter};
use super::{
    ArmSpec, CommandSpec, EventSpec, InputSpec, LockstepSpec, OnSpec, ReadingSpec, RequestSpec, SourceSpec, WireSection,
};
use crate::Scenario;
use crate::dbc::{Database, Message, NO_NODE, Signal};
use crate::nearest::nearest;
use resonarm_bench::node::mapped::mapping::{
    Action, Arming, CommandSignal, Counts, EventSignal, Incoming, LoadInput, Lockstep, MappedSignal, Mapping, Outgoing,
    Protection, ReadingSignal, Source, Trigger, Value,
};
use resonarm_bench::rig::Exciter;
use resonarm_bench::structure::{LOADS, Quantity};
use resonarm_protocol::Id;

/// Compiles the mapping of a scenario's user protocol.
pub(super) fn mapping(scenario: &Scenario, section: &WireSection) -> Result<Mapping, WireError> {
    let database = section.database()?;
    let quantities = Quantities::of_scenario(scenario)?;
    let mut compiler = Compiler { scenario, section, database: &database, quantities, incoming: BTreeMap::new() };
    compiler.check_node()?;
    if section.commands.is_empty() {
        return Err(WireError::NoCommands);
    }
    // Commands come before events and SYNC, since these may add to a message that a command has already
    // entered, and readings come last, since a message can't be received and sent.
    section.commands.iter().try_for_each(|spec| compiler.command(spec))?;
    section.events.iter().try_for_each(|spec| compiler.event(spec))?;
    compiler.sync()?;
    let outgoing: Vec<Outgoing> =
        section.readings.iter().map(|spec| compiler.reading(spec)).collect::<Result<_, _>>()?;
    for (place, message) in section.readings.iter().enumerate() {
        if section.readings[..place].iter().any(|other| other.message == message.message) {
            let place = Place::message("wire.readings", &message.message);
            return Err(WireError::Message { place, problem: "it is listed twice in `readings`" });
        }
    }
    let incoming: Vec<Incoming> = compiler.incoming.into_values().collect();
    let arming = arming(section, &incoming)?;
    let lockstep = match section.lockstep {
        Some(LockstepSpec::Sync) => Lockstep::Sync,
        Some(LockstepSpec::Command) | None => Lockstep::Command,
    };
    Ok(Mapping { incoming, outgoing, arming, lockstep })
}

fn arming(section: &WireSection, incoming: &[Incoming]) -> Result<Arming, WireError> {
    let arms = |event: &EventSignal| event.actions.iter().any(|(_, action)| *action == Action::Arm);
    match section.arm {
        Some(ArmSpec::Operator) => Ok(Arming::Operator),
        Some(ArmSpec::ZeroCommand) => Ok(Arming::ZeroCommand),
        None if incoming.iter().any(|message| message.events.iter().any(arms)) => Ok(Arming::Message),
        None => Err(WireError::NoArming),
    }
}

struct Compiler<'a> {
    scenario: &'a Scenario,
    section: &'a WireSection,
    database: &'a Database,
    /// Readings that a signal can carry.
    quantities: Quantities,
    /// Compiled messages by identifier, standard identifiers first.
    incoming: BTreeMap<Id, Incoming>,
}

impl Compiler<'_> {
    fn check_node(&self) -> Result<(), WireError> {
        let Some(node) = &self.section.node else { return Ok(()) };
        if self.database.nodes().contains(node) {
            return Ok(());
        }
        if node == NO_NODE {
            return Err(WireError::NoNodeName { got: node.clone() });
        }
        let suggestion = nearest(node, self.database.nodes().iter().map(String::as_str));
        Err(WireError::NoNode { got: node.clone(), suggestion })
    }

    /// Looks up a message that others send, or, with `is_own`, that the plant's node sends.
    fn message(&self, key: &'static str, name: &str, is_own: bool) -> Result<&Message, WireError> {
        let message = self.database.message(name)?;
        let Some(node) = &self.section.node else { return Ok(message) };
        let senders = message.senders();
        if senders.contains(node) == is_own || senders.is_empty() {
            return Ok(message);
        }
        let expected = if is_own {
            format!("readings must be sent by {node} (`wire.node`)")
        } else {
            format!("commands must not be sent by {node} (`wire.node`)")
        };
        Err(WireError::Sender { place: Place::message(key, name), senders: senders.join(", "), expected })
    }

    fn command(&mut self, spec: &CommandSpec) -> Result<(), WireError> {
        const KEY: &str = "wire.commands";
        let place = Place::message(KEY, &spec.message);
        let message = self.message(KEY, &spec.message, false)?;
        let timeout_s = spec.timeout_s.unwrap_or(self.scenario.network.command_timeout_s);
        if !(timeout_s > 0.0 && timeout_s <= 3600.0) {
            let expected = "a positive number of seconds, at most 3600";
            return Err(WireError::Number { place, name: "timeout_s", got: timeout_s, expected });
        }
        if let Some(period_s) = message.cycle_time_ms().map(|cycle_ms| 1e-3 * cycle_ms)
            // With a timeout below two cycles, one lost frame would exceed it.
            && timeout_s < 2.0 * period_s
        {
            return Err(WireError::Timeout { place, timeout_s, period_s });
        }
        let mut used = Used::default();
        let commands = self.inputs(spec, message, &mut used)?;
        if commands.is_empty() {
            return Err(WireError::Message {
                place,
                problem: "it has no load: give `force_x_n`, `force_y_n`, `force_z_n`, `force_n`, or a torque, as `torque1_nm`",
            });
        }
        let protection = protection(&place, message, (&spec.counter, &spec.checksum), &mut used)?;
        let incoming = Incoming {
            protection,
            commands,
            timeout_ns: libm::round(timeout_s * 1e9) as u64,
            ..bare(message, spec.drive)
        };
        if self.incoming.insert(message.id(), incoming).is_some() {
            return Err(WireError::Message { place, problem: "it is listed twice in `commands`" });
        }
        Ok(())
    }

    fn inputs(&self, spec: &CommandSpec, message: &Message, used: &mut Used) -> Result<Vec<CommandSignal>, WireError> {
        let along = match &self.scenario.rig.drive() {
            Exciter::Shaker(shaker) => Some(shaker.direction().into()),
            Exciter::Ideal(_) => None,
        };
        let is_shaker = along.is_some();
        let candidates = [
            ("force_x_n", &spec.force_x_n, LoadInput::ForceX),
            ("force_y_n", &spec.force_y_n, LoadInput::ForceY),
            ("force_z_n", &spec.force_z_n, LoadInput::ForceZ),
            ("force_n", &spec.force_n, LoadInput::Along(along.unwrap_or([0.0; 2]))),
            ("torque1_nm", &spec.torque1_nm, LoadInput::Torque(0)),
            ("torque2_nm", &spec.torque2_nm, LoadInput::Torque(1)),
            ("torque3_nm", &spec.torque3_nm, LoadInput::Torque(2)),
            ("torque4_nm", &spec.torque4_nm, LoadInput::Torque(3)),
            ("torque5_nm", &spec.torque5_nm, LoadInput::Torque(4)),
            ("torque6_nm", &spec.torque6_nm, LoadInput::Torque(5)),
            ("torque7_nm", &spec.torque7_nm, LoadInput::Torque(6)),
            ("torque8_nm", &spec.torque8_nm, LoadInput::Torque(7)),
        ];
        let mut commands = Vec::new();
        for (name, input, kind) in candidates {
            let Some(input) = input else { continue };
            let place = Place::signal("wire.commands", &spec.message, &input.signal);
            let problem = match (kind, is_shaker) {
                (LoadInput::Along(_), false) => Some("is along the shaker, but the scenario has no [rig.shaker]"),
                (LoadInput::Torque(_), true) => Some("is a torque, but a shaker exerts only forces"),
                (LoadInput::ForceX | LoadInput::ForceY | LoadInput::ForceZ, true) => {
                    Some("is along an axis, but a shaker pushes along its own axis: map the signal to `force_n`")
                }
                (kind, _) if !self.takes(kind) => Some("acts on no part of the structure"),
                _ => None,
            };
            if let Some(problem) = problem {
                return Err(WireError::Input { place, input: name.into(), problem });
            }
            self.check_input_once(&place, name, kind)?;
            used.take(&place, name)?;
            let signal = message.signal(&input.signal)?;
            let quantity = if name.starts_with("force") { Quantity::Force } else { Quantity::Torque };
            let (scale, offset) = input_scale(&place, input, signal, quantity)?;
            commands.push(CommandSignal { signal: mapped(signal), scale, offset, input: kind });
        }
        Ok(commands)
    }

    /// Says whether the plant accepts a load.
    fn takes(&self, input: LoadInput) -> bool {
        let place = match input {
            LoadInput::Torque(joint) => joint,
            LoadInput::ForceZ => LOADS.len() - 1,
            LoadInput::ForceX | LoadInput::ForceY | LoadInput::Along(_) => return true,
        };
        self.quantities.loads().has(place)
    }

    fn check_input_once(&self, place: &Place, name: &'static str, kind: LoadInput) -> Result<(), WireError> {
        let others = self.incoming.values().filter(|message| message.commands.iter().any(|c| c.input == kind));
        let other = others.map(|message| message.id).next();
        let Some(id) = other else { return Ok(()) };
        let other = self.database.message_by_id(id).map_or(String::new(), |message| message.name().to_string());
        Err(WireError::InputTwice { place: place.clone(), input: name.into(), other })
    }

    fn event(&mut self, spec: &EventSpec) -> Result<(), WireError> {
        const KEY: &str = "wire.events";
        let place = Place::message(KEY, &spec.message);
        let message = self.message(KEY, &spec.message, false)?;
        let lists = [
            ("arm", &spec.arm, Action::Arm),
            ("disarm", &spec.disarm, Action::Disarm),
            ("reset", &spec.reset, Action::Reset),
            ("stop", &spec.stop, Action::Stop),
        ];
        // A value that the signal can't represent exactly would never match, and the request never come.
        let exact = spec.signal.as_ref().map(|name| Exact::new(KEY, message, name)).transpose()?;
        // Values are compared with decoded ones, so that they must be what decoding gives, to the last bit.
        let exactly = |name, value| exact.as_ref().map_or(Ok(value), |exact| exact.value(name, value));
        let mut actions: Vec<(f64, Action)> = Vec::new();
        for (name, values, action) in lists {
            for value in values {
                let value = exactly(name, *value)?;
                if actions.iter().any(|(other, _)| *other == value) {
                    let problem = "one of its values has two meanings";
                    return Err(WireError::Message { place, problem });
                }
                actions.push((value, action));
            }
        }
        let required = spec.require.iter().map(|value| exactly("require", *value)).collect::<Result<Vec<_>, _>>()?;
        let signal = match (&exact, spec.on_frame) {
            (Some(exact), None) if !(actions.is_empty() && required.is_empty()) => Some(mapped(exact.signal())),
            (None, Some(request)) if actions.is_empty() && required.is_empty() => {
                actions.push((0.0, action(request)));
                None
            }
            _ => {
                let problem = "give `signal` with `arm`, `disarm`, `reset`, `stop` or `require`, or `on_frame` alone";
                return Err(WireError::Message { place, problem });
            }
        };
        let protection = protection(&place, message, (&spec.counter, &spec.checksum), &mut Used::default())?;
        let counts = if spec.every_frame { Counts::InEveryFrame } else { Counts::OnChange };
        let name = Arc::from(spec.signal.as_deref().unwrap_or_default());
        let event = EventSignal { name, signal, counts, actions, required };
        let empty = bare(message, spec.drive);
        // A message with a load may carry requests as well. The event then joins the entry of the command.
        let incoming = self.incoming.entry(empty.id).or_insert(empty);
        if protection.counter.is_some() || protection.checksum.is_some() {
            if incoming.protection.counter.is_some() || incoming.protection.checksum.is_some() {
                return Err(WireError::Message { place, problem: "its counter and checksum are given twice" });
            }
            incoming.protection = protection;
        }
        if incoming.drive != spec.drive {
            return Err(WireError::Message { place, problem: "it is given for two drives" });
        }
        incoming.events.push(event);
        Ok(())
    }

    fn sync(&mut self) -> Result<(), WireError> {
        let is_needed = self.section.lockstep == Some(LockstepSpec::Sync)
            || self.section.readings.iter().any(|spec| spec.on == Some(OnSpec::Sync));
        match (&self.section.sync, is_needed) {
            (Some(name), true) => {
                let empty = bare(self.message("wire.sync", name, false)?, 0);
                // SYNC may be one of the messages that carry loads.
                self.incoming.entry(empty.id).or_insert(empty).is_sync = true;
                Ok(())
            }
            (None, true) => Err(WireError::Section { key: "wire.sync", problem: "name the message that synchronises" }),
            (Some(_), false) => Err(WireError::Section {
                key: "wire.sync",
                problem: "nothing waits for it: give `lockstep = \"sync\"`, or readings with `on = \"sync\"`, or leave it out",
            }),
            (None, false) => Ok(()),
        }
    }

    fn reading(&self, spec: &ReadingSpec) -> Result<Outgoing, WireError> {
        const KEY: &str = "wire.readings";
        let place = Place::message(KEY, &spec.message);
        let message = self.message(KEY, &spec.message, true)?;
        if self.incoming.contains_key(&message.id()) {
            return Err(WireError::Message { place, problem: "the plant receives it, so it can't also send it" });
        }
        let mut used = Used::default();
        let mut payload = vec![0; message.length()];
        let mut signals = Vec::new();
        for (name, source) in &spec.signals {
            let place = Place::signal(KEY, &spec.message, name);
            used.take(&place, "a reading")?;
            let exact = Exact::new(KEY, message, name)?;
            // A constant is part of the payload from the start. Only the other signals are written for every
            // frame.
            match source.constant {
                Some(value) if source_count(source) == 1 => {
                    let value = exact.value("constant", value)?;
                    exact.signal().wire().encode(value, &mut payload).map_err(|_range| WireError::Number {
                        place,
                        name: "constant",
                        got: value,
                        expected: "a number within the signal's range",
                    })?;
                }
                _ => signals.push(self.source(&place, source, &exact)?),
            }
        }
        let protection = protection(&place, message, (&spec.counter, &spec.checksum), &mut used)?;
        Ok(Outgoing {
            id: message.id(),
            format: message.format(),
            payload,
            protection,
            drive: spec.drive,
            trigger: self.trigger(&place, spec, message)?,
            is_on_request: spec.on_request || spec.on == Some(OnSpec::Remote),
            signals,
        })
    }

    fn trigger(&self, place: &Place, spec: &ReadingSpec, message: &Message) -> Result<Trigger, WireError> {
        let number = |name, got, expected| Err(WireError::Number { place: place.clone(), name, got, expected });
        match (spec.every, spec.period_s, spec.on) {
            (Some(0), None, None) => number("every", 0.0, "at least 1"),
            (Some(every), None, None) => Ok(Trigger::Every(every)),
            (None, Some(got), None) if !(1e-4..=3600.0).contains(&got) => {
                number("period_s", got, "from 0.0001 to 3600 s")
            }
            (None, Some(period_s), None) => Ok(Trigger::Period(libm::round(period_s * 1e9) as u64)),
            (None, None, Some(OnSpec::Remote)) => Ok(Trigger::Request),
            (None, None, Some(OnSpec::Sync)) => Ok(Trigger::Sync),
            (None, None, None) => self.cycle(place, message),
            _ => Err(WireError::Message { place: place.clone(), problem: "give one of `every`, `period_s` and `on`" }),
        }
    }

    /// Converts the DBC's cycle time of a message into samples.
    fn cycle(&self, place: &Place, message: &Message) -> Result<Trigger, WireError> {
        let Some(cycle_ms) = message.cycle_time_ms().filter(|cycle_ms| *cycle_ms > 0.0) else {
            let problem = "the DBC has no cycle time for it: give `every`, `period_s` or `on`";
            return Err(WireError::Message { place: place.clone(), problem });
        };
        let period_s = 1e-3 * cycle_ms;
        let rate_hz = self.scenario.simulation.rate_hz;
        let samples = period_s * rate_hz;
        let whole = libm::round(samples);
        // A cycle of 2.5 samples would drift against the samples. The tolerance allows for rounding of cycle
        // times in ms.
        if whole < 1.0 || (samples - whole).abs() > 1e-6 * whole {
            return Err(WireError::Cycle { place: place.clone(), period_s, samples, rate_hz });
        }
        Ok(Trigger::Every(whole as u64))
    }

    fn source(&self, place: &Place, spec: &SourceSpec, exact: &Exact<'_>) -> Result<ReadingSignal, WireError> {
        let signal = exact.signal();
        let got = source_count(spec);
        if got != 1 {
            return Err(WireError::Sources { place: place.clone(), got });
        }
        let source = match (&spec.quantity, &spec.clipped, &spec.state, &spec.reason) {
            (Some(name), ..) => self.quantities.source(self.scenario, place, name, spec, signal)?,
            (_, Some(name), ..) => {
                let value = Value::Clipped(self.quantities.reading(place, name)?);
                exact.value("clipped", 0.0).and_then(|_| exact.value("clipped", 1.0))?;
                Source::Value { value, scale: 1.0, offset: 0.0 }
            }
            (.., Some(states), _) => exact.source(super::signals::states(place, states)?, states)?,
            (.., Some(reasons)) => exact.source(super::signals::reasons(place, reasons)?, reasons)?,
            _ => Source::Sample { modulus: signal.wire().range()[1] + 1.0 },
        };
        Ok(ReadingSignal { signal: mapped(signal), source })
    }
}

/// Counts the keys that say what a signal carries.
fn source_count(spec: &SourceSpec) -> usize {
    let named = [spec.quantity.is_some(), spec.clipped.is_some(), spec.state.is_some(), spec.reason.is_some()];
    named.into_iter().chain([spec.constant.is_some(), spec.sample]).filter(|given| *given).count()
}

fn action(request: RequestSpec) -> Action {
    match request {
        RequestSpec::Arm => Action::Arm,
        RequestSpec::Disarm => Action::Disarm,
        RequestSpec::Reset => Action::Reset,
        RequestSpec::Stop => Action::Stop,
    }
}

/// Returns an incoming message without load, counter or checksum.
fn bare(message: &Message, drive: usize) -> Incoming {
    Incoming {
        name: Arc::from(message.name()),
        id: message.id(),
        format: message.format(),
        length: message.length(),
        protection: Protection::default(),
        drive,
        commands: Vec::new(),
        timeout_ns: 0,
        events: Vec::new(),
        is_sync: false,
    }
}

fn mapped(signal: &Signal) -> MappedSignal {
    MappedSignal { signal: *signal.wire(), presence: signal.presence().clone() }
}

fn protection(
    place: &Place,
    message: &Message,
    (counter_spec, checksum_spec): (&Option<super::CounterSpec>, &Option<super::ChecksumSpec>),
    used: &mut Used,
) -> Result<Protection, WireError> {
    let preset = checksum_spec.as_ref().map(|spec| spec.known(place)).transpose()?.flatten();
    let counter = counter_spec.as_ref().map(|spec| counter(place, spec, message, preset, used)).transpose()?;
    let layout = counter.as_ref().map(|counter| *counter.layout());
    let checksum = checksum_spec.as_ref().map(|spec| spec.checksum(place, message, layout, used)).transpose()?;
    // Three, as a receiver of Resonarm's own protocol accepts.
    let most_lost = counter_spec.as_ref().and_then(|spec| spec.most_lost).unwrap_or(3);
    Ok(Protection { counter, most_lost, checksum })
}

/// Returns the load for one unit of a signal and at the value 0, N or N·m.
fn input_scale(place: &Place, input: &InputSpec, signal: &Signal, quantity: Quantity) -> Result<(f64, f64), WireError> {
    let finite = |name, value: Option<f64>, default: f64, expected| match value.unwrap_or(default) {
        got if got.is_finite() && (got != 0.0 || default == 0.0) => Ok(got),
        got => Err(WireError::Number { place: place.clone(), name, got, expected }),
    };
    let gear = finite("gear_ratio", input.gear_ratio, 1.0, "a number other than 0")?;
    let offset = finite("offset", input.offset, 0.0, "a finite number")?;
    let constant = finite("constant_per_a", input.constant_per_a, 1.0, "a number other than 0")?;
    // With a motor or shaker constant the signal is a current, and its unit is converted as one.
    let of_signal = if input.constant_per_a.is_some() { Quantity::Current } else { quantity };
    let scale = match input.scale {
        Some(_) => finite("scale", input.scale, 1.0, "a number other than 0")?,
        None => signal_factor(place, of_signal, signal)?,
    };
    Ok((scale * constant * gear, offset))
}
