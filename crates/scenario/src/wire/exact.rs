//! Numbers that a signal must have exactly: what is another number on the wire never matches, or says something else.

use std::collections::BTreeMap;

use super::error::{Place, WireError};
use crate::dbc::{Message, Signal};
use resonarm_bench::node::mapped::mapping::Source;
use resonarm_wire::PAYLOAD_MAX_BYTES;

/// The largest distance from a value of the signal that is rounding, in its steps; of a floating-point signal as a
/// share of its value.
const ROUNDING: f64 = 1e-6;

/// A signal of a message, with its line in the DBC.
pub(super) struct Exact<'a> {
    place: Place,
    message: &'a Message,
    signal: &'a Signal,
}

impl<'a> Exact<'a> {
    /// The signal of this name in a message that a key of the scenario names.
    ///
    /// # Errors
    /// [`WireError::Dbc`] if the message has no such signal.
    pub fn new(key: &'static str, message: &'a Message, name: &str) -> Result<Exact<'a>, WireError> {
        Ok(Exact { place: Place::signal(key, message.name(), name), message, signal: message.signal(name)? })
    }

    /// The signal.
    pub const fn signal(&self) -> &'a Signal {
        self.signal
    }

    /// A value as the signal has it once it was sent.
    ///
    /// # Errors
    /// [`WireError::Value`] if it would be another one.
    pub fn value(&self, name: &str, got: f64) -> Result<f64, WireError> {
        let wire = self.signal.wire();
        let [least, most] = wire.range();
        let step = wire.resolution();
        let nearest = self.sent(got.clamp(least, most));
        let rounding = ROUNDING * step.unwrap_or(got.abs() + wire.offset().abs());
        if let Some(nearest) = nearest
            && (nearest - got).abs() <= rounding
        {
            return Ok(nearest);
        }
        Err(WireError::Value {
            place: self.place.clone(),
            line: self.message.line_of(self.signal.name()),
            name: name.to_string(),
            got,
            range: [least, most],
            step,
            nearest,
        })
    }

    /// What comes of a value that is sent.
    fn sent(&self, value: f64) -> Option<f64> {
        let mut payload = [0; PAYLOAD_MAX_BYTES];
        let payload = payload.get_mut(..self.message.length())?;
        self.signal.wire().encode(value, payload).ok()?;
        self.signal.wire().decode(payload)
    }

    /// The numbers of a source that the signal says, as the signal has them; `given` are those that the scenario has.
    ///
    /// # Errors
    /// [`WireError::Value`] names the first one that would be another.
    pub fn source(&self, source: Source, given: &BTreeMap<String, f64>) -> Result<Source, WireError> {
        match source {
            Source::State(mut numbers) => {
                for (number, name) in numbers.iter_mut().zip(super::signals::STATES) {
                    // A plant is never heard while it boots: its number matters only if it is given.
                    if name != super::signals::STATES[0] || given.contains_key(name) {
                        *number = self.value(&format!("state.{name}"), *number)?;
                    }
                }
                Ok(Source::State(numbers))
            }
            Source::Reason { none, other, mut codes } => {
                for (code, number) in &mut codes {
                    let known = super::signals::REASONS.iter().find(|(_, of)| of == code);
                    *number = self.value(&format!("reason.{}", known.map_or("other", |(name, _)| name)), *number)?;
                }
                let (none, other) = (self.value("reason.none", none)?, self.value("reason.other", other)?);
                Ok(Source::Reason { none, other, codes })
            }
            source => Ok(source),
        }
    }
}
