//! Explains the frames of a user protocol: by a DBC alone, or also by the mapping in a scenario's `[wire]`, which may
//! also be that of CANopen drives.
//!
//! A decoder listens as the plant and its controller do: it checks length, checksum and counter of every mapped
//! message, and keeps the last value of every signal with requests. It can't see other reasons for which the plant
//! rejects a frame, such as a load beyond a limit.
//!
//! The PDOs of CANopen drives have the mapping of the scenario, until the frames change it: a decoder follows the
//! objects that the master writes and the drives confirm.

mod check;
mod drives;
mod explained;
mod meaning;
mod roles;
mod words;

use std::collections::HashMap;

pub use check::Fault;
pub use explained::{Decoded, DecodedMessage, DecodedSignal, LargeInteger, Outcome};
pub use meaning::{Meaning, ObjectName};
pub use roles::action_name;

use drives::Drives;
use resonarm_bench::node::WireSpec;
use resonarm_bench::node::mapped::mapping::Mapping;
use resonarm_protocol::{Frame, FrameFormat, Id};
use resonarm_scenario::dbc::{Database, Found, Message};
use resonarm_scenario::wire::Quantities;
use resonarm_scenario::{Scenario, ScenarioError};
use roles::MessageRoles;

/// Explains the frames of a bus one after another.
#[derive(Clone, Debug)]
pub struct Decoder {
    protocol: Protocol,
    lost: u64,
}

#[derive(Clone, Debug)]
enum Protocol {
    Dbc {
        database: Box<Database>,
        /// Roles of the signals of each mapped message, by its identifier.
        mapped: HashMap<Id, MessageRoles>,
    },
    CanOpen(Drives),
}

impl Decoder {
    /// Makes a decoder from a DBC alone: signals have values, and no meaning to the plant.
    pub fn new(database: Database) -> Decoder {
        Decoder { protocol: Protocol::Dbc { database: Box::new(database), mapped: HashMap::new() }, lost: 0 }
    }

    /// Makes the decoder of a scenario's user protocol; `None` if the scenario has no `[wire]`.
    ///
    /// # Errors
    /// [`ScenarioError::Wire`] with the invalid part of `[wire]`.
    pub fn of_scenario(scenario: &Scenario) -> Result<Option<Decoder>, ScenarioError> {
        let protocol = match (scenario.wire_spec()?, scenario.wire_database()?) {
            (Some(WireSpec::Cia402(spec)), _) => Protocol::CanOpen(Drives::new(&spec)),
            (Some(WireSpec::Mapped(mapping)), Some(database)) => {
                let mapped = mapped(&database, &mapping, &Quantities::of_scenario(scenario)?);
                Protocol::Dbc { database: Box::new(database), mapped }
            }
            (Some(WireSpec::Mapped(_)), None) | (None, _) => return Ok(None),
        };
        Ok(Some(Decoder { protocol, lost: 0 }))
    }

    /// Says whether the frames are those of CANopen drives, and not of a DBC.
    pub const fn is_canopen(&self) -> bool {
        matches!(self.protocol, Protocol::CanOpen(_))
    }

    /// Says whether it knows what messages mean to the plant.
    pub fn is_mapped(&self) -> bool {
        match &self.protocol {
            Protocol::Dbc { mapped, .. } => !mapped.is_empty(),
            Protocol::CanOpen(_) => true,
        }
    }

    /// Returns the source of the DBC; `None` for CANopen drives.
    pub fn origin(&self) -> Option<&str> {
        match &self.protocol {
            Protocol::Dbc { database, .. } => Some(database.origin()),
            Protocol::CanOpen(_) => None,
        }
    }

    /// Returns the faults of the DBC in the order of the file. The parts that they concern are not decoded.
    pub fn problems(&self) -> Vec<Found> {
        match &self.protocol {
            Protocol::Dbc { database, .. } => database.problems(),
            Protocol::CanOpen(_) => Vec::new(),
        }
    }

    /// Returns the number of frames lost so far, according to the counters of mapped messages.
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// Explains the next frame on the bus.
    pub fn decode(&mut self, frame: &Frame) -> Decoded {
        let (database, mapped) = match &mut self.protocol {
            Protocol::Dbc { database, mapped } => (database, mapped),
            Protocol::CanOpen(drives) => return drives.decode(frame),
        };
        let Some(message) = database.message_by_id(frame.id()) else { return Decoded::Foreign };
        let mut roles = mapped.get_mut(&frame.id());
        let is_answered = roles.as_ref().is_some_and(|roles| roles.is_on_request);
        if frame.format() == FrameFormat::Remote || (is_answered && frame.data().is_empty()) {
            return Decoded::Request { message: message.name().to_string(), is_answered };
        }
        let outcome = match &mut roles {
            Some(roles) => match roles.check(frame) {
                Ok(lost) => Outcome::Taken { lost },
                Err(fault) => Outcome::Refused(fault),
            },
            None => Outcome::Unmapped,
        };
        if let Outcome::Taken { lost } = outcome {
            self.lost += lost;
        }
        // A rejected frame is explained as well, but its values don't become the last ones: the plant has not used
        // them either.
        let is_taken = !matches!(outcome, Outcome::Refused(_));
        let decoded = explained::message(message, frame, roles, is_taken);
        Decoded::Message(DecodedMessage { outcome, ..decoded })
    }
}

fn mapped(database: &Database, mapping: &Mapping, quantities: &Quantities) -> HashMap<Id, MessageRoles> {
    let message = |id: Id| database.message_by_id(id);
    let incoming = mapping.incoming.iter().filter_map(|of| Some((of.id, MessageRoles::incoming(message(of.id)?, of))));
    let outgoing =
        mapping.outgoing.iter().filter_map(|of| Some((of.id, MessageRoles::outgoing(message(of.id)?, of, quantities))));
    incoming.chain(outgoing).collect()
}

/// Returns the name of the signal of `message` with these bits, scale and presence.
fn name_of(message: &Message, of: &resonarm_bench::node::mapped::mapping::MappedSignal) -> Option<String> {
    let mut signals = message.signals();
    signals
        .find(|signal| *signal.wire() == of.signal && *signal.presence() == of.presence)
        .map(|s| s.name().to_string())
}

#[cfg(test)]
mod tests;
