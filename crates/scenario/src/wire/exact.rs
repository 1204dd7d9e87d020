//! Numbers that a signal must represent exactly. A number that the bus changes would never match, or mean
//! something else.

use std::collections::BTreeMap;

use super::error::{Place, WireError};
use crate::dbc::{Message, Signal};
use resonarm_bench::node::mapped::mapping::Source;
use resonarm_wire::PAYLOAD_MAX_BYTES;

/// Largest distance from a value of the signal that counts as rounding, relative to its resolution, or to the
/// value of a floating-point signal.
const ROUNDING: f64 = 1e-6;

/// A signal of a message, for checks against its DBC entry.
pub(super) struct Exact<'a> {
    place: Place,
    message: &'a Message,
    signal: &'a Signal,
}

impl<'a> Exact<'a> {
    /// Looks up the signal of this name, in a message that a key of the scenario names.
    ///
    /// # Errors
    /// [`WireError::Dbc`] if the message has no such signal.
    pub fn new(key: &'static str, message: &'a Message, name: &str) -> Result<Exact<'a>, WireError> {
        Ok(Exact { place: Place::signal(key, message.name(), name), message, signal: message.signal(name)? })
    }

    /// Returns the signal in the DBC.
    pub const fn signal(&self) -> &'a Signal {
        self.signal
    }

    /// Returns the value as the signal has it after encoding and decoding.
    ///
    /// # Errors
    /// [`WireError::Value`] if it would be another one.
    pub fn value(&self, name: &str, got: f64) -> Result<f64, WireError> {
        let wire = self.signal.wire();
        let [least, most] = wire.range();
        let step = wire.resolution();
        // Clamped first, so that a value beyond the range gets the end of it as the nearest in its message. A NaN
        // stays one, and is encoded by no signal.
        let nearest = self.sent(got.clamp(least, most));
        // The offset counts as well, since the sum of scaled number and offset has rounding errors of its size.
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

    /// Encodes a value and decodes it again.
    fn sent(&self, value: f64) -> Option<f64> {
        let mut payload = [0; PAYLOAD_MAX_BYTES];
        let payload = payload.get_mut(..self.message.length())?;
        self.signal.wire().encode(value, payload).ok()?;
        self.signal.wire().decode(payload)
    }

    /// Returns the source with the numbers as the signal has them; `given` are those that the scenario states.
    ///
    /// # Errors
    /// [`WireError::Value`] names the first one that would be another.
    pub fn source(&self, source: Source, given: &BTreeMap<String, f64>) -> Result<Source, WireError> {
        match source {
            Source::State(mut numbers) => {
                for (number, name) in numbers.iter_mut().zip(super::signals::STATES) {
                    // A plant is never heard while it boots. Its number for that state matters only if it is
                    // given.
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
                let none = self.value("reason.none", none)?;
                let other = self.value("reason.other", other)?;
                Ok(Source::Reason { none, other, codes })
            }
            source => Ok(source),
        }
    }
}
