//! Frames of a user's own protocol explained: by a DBC alone, or also by what a scenario's `[wire]` makes of them.
//!
//! A decoder listens as the plant and its controller do: it checks length, checksum and counter of every mapped
//! message, and keeps the last value of every signal with requests. What the plant refuses for another reason, such as
//! a load beyond a limit, is not in a frame.

mod check;
mod explained;
mod roles;

use std::collections::HashMap;

pub use check::Fault;
pub use explained::{Decoded, DecodedMessage, DecodedSignal, Meaning, Outcome};

use crate::dbc::{Database, Message};
use crate::scenario::{Scenario, ScenarioError};
use resonarm_bench::node::WireSpec;
use resonarm_bench::node::mapped::mapping::Mapping;
use resonarm_protocol::{Frame, FrameFormat, Id};
use roles::MessageRoles;

/// Explains the frames of a bus one after another.
#[derive(Clone, Debug)]
pub struct Decoder {
    database: Database,
    /// What each mapped message is, by its identifier.
    mapped: HashMap<Id, MessageRoles>,
    lost: u64,
}

impl Decoder {
    /// A decoder by a DBC alone: signals have values, and no meaning to the plant.
    pub fn new(database: Database) -> Decoder {
        Decoder { database, mapped: HashMap::new(), lost: 0 }
    }

    /// The decoder of a scenario's own protocol; `None` if the scenario has no `[wire]`.
    ///
    /// # Errors
    /// [`ScenarioError::Wire`] says what in `[wire]` can't be.
    pub fn of_scenario(scenario: &Scenario) -> Result<Option<Decoder>, ScenarioError> {
        let (Some(database), Some(WireSpec::Mapped(mapping))) = (scenario.wire_database()?, scenario.wire_spec()?)
        else {
            return Ok(None);
        };
        let mapped = mapped(&database, &mapping);
        Ok(Some(Decoder { database, mapped, lost: 0 }))
    }

    /// The DBC.
    pub const fn database(&self) -> &Database {
        &self.database
    }

    /// Whether it knows what messages mean to the plant.
    pub fn is_mapped(&self) -> bool {
        !self.mapped.is_empty()
    }

    /// Frames lost so far, according to the counters of mapped messages.
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// Explains the next frame on the bus.
    pub fn decode(&mut self, frame: &Frame) -> Decoded {
        let Some(message) = self.database.message_by_id(frame.id()) else { return Decoded::Foreign };
        let mut roles = self.mapped.get_mut(&frame.id());
        let is_answered = roles.as_ref().is_some_and(|roles| roles.is_on_request());
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
        let is_taken = !matches!(outcome, Outcome::Refused(_));
        let decoded = explained::message(message, frame, roles, is_taken);
        Decoded::Message(DecodedMessage { outcome, ..decoded })
    }
}

fn mapped(database: &Database, mapping: &Mapping) -> HashMap<Id, MessageRoles> {
    let message = |id: Id| database.message_by_id(id);
    let incoming = mapping.incoming.iter().filter_map(|of| Some((of.id, MessageRoles::incoming(message(of.id)?, of))));
    let outgoing = mapping.outgoing.iter().filter_map(|of| Some((of.id, MessageRoles::outgoing(message(of.id)?, of))));
    incoming.chain(outgoing).collect()
}

/// The name of the signal of `message` with these bits, scale and presence.
fn name_of(message: &Message, of: &resonarm_bench::node::mapped::mapping::MappedSignal) -> Option<String> {
    let mut signals = message.signals();
    signals
        .find(|signal| *signal.wire() == of.signal && *signal.presence() == of.presence)
        .map(|s| s.name().to_string())
}

#[cfg(test)]
mod tests;
