//! Encodes and decodes all signals of a message at once.

use resonarm_protocol::{Frame, FrameError};
use resonarm_wire::signal::EncodeError;
use thiserror::Error;

use super::error::DbcError;
use super::{Message, Signal};

/// Reason why values can't be encoded as a message.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CodecError {
    /// A signal is not in the message, or can't be used.
    #[error(transparent)]
    Dbc(#[from] DbcError),
    /// The value lies outside what the signal can represent.
    #[error("signal {signal} of {message}: {source}")]
    Value {
        /// Name of the message.
        message: String,
        /// Name of the signal.
        signal: String,
        /// Reason that the signal gives for rejecting the value.
        source: EncodeError,
    },
    /// A signal that is present with these values of the switches has no value.
    #[error("message {message}: its signal {signal} needs a value")]
    Missing {
        /// Name of the message.
        message: String,
        /// Name of the signal that needs a value.
        signal: String,
    },
    /// A value is given for a signal that is absent with these values of the switches.
    #[error("message {message} has no signal {signal} with these values of its switches: leave its value out")]
    NotSelected {
        /// Name of the message.
        message: String,
        /// Name of the signal that has a value and is absent.
        signal: String,
    },
    /// One signal has two values.
    #[error("signal {signal} of {message} has two values: give one")]
    Twice {
        /// Name of the message.
        message: String,
        /// Name of the signal that is given twice.
        signal: String,
    },
    /// The payload can't be sent in a frame of this message.
    #[error("message {message}: {source}")]
    Frame {
        /// Name of the message.
        message: String,
        /// Reason that the frame gives.
        source: FrameError,
    },
}

/// Decodes all signals of a message that can be read, and encodes those that can be written.
#[derive(Clone, Copy, Debug)]
pub struct Codec<'a> {
    message: &'a Message,
}

impl<'a> Codec<'a> {
    pub(super) const fn new(message: &'a Message) -> Codec<'a> {
        Codec { message }
    }

    /// Returns the signals that are in a payload with their values, in the order of the file: a payload may be shorter
    /// than the message, or have other bits in spare places. A floating-point signal may be NaN or infinite.
    pub fn decode<'b>(&self, payload: &'b [u8]) -> impl Iterator<Item = (&'a str, f64)> + use<'a, 'b> {
        self.message.signals().filter_map(move |signal| Some((signal.name(), signal.decode(payload)?)))
    }

    /// Returns the frame with these values, all other bits zero.
    ///
    /// # Errors
    /// [`CodecError`] if a value is beyond its signal, one is missing, too many or twice, or a signal has a problem.
    pub fn encode(&self, values: &[(&str, f64)]) -> Result<Frame, CodecError> {
        let mut buffer = [0; resonarm_wire::PAYLOAD_MAX_BYTES];
        let payload = &mut buffer[..self.message.length];
        // Values are written before they are checked for completeness, since which signals are present follows
        // from the switches in the payload.
        self.encode_into(values, payload)?;
        let message = self.message.name();
        let payload = &*payload;
        let given = self.resolve(values)?;
        for signal in self.message.writable_signals() {
            let is_in = signal.presence().is_in(payload) == Some(true);
            let has_value = given.iter().any(|(of, _)| std::ptr::eq(*of, signal));
            if is_in == has_value {
                continue;
            }
            let message = message.to_string();
            let signal = signal.name().to_string();
            return Err(if is_in {
                CodecError::Missing { message, signal }
            } else {
                CodecError::NotSelected { message, signal }
            });
        }
        Frame::new(self.message.id, self.message.format, payload)
            .map_err(|source| CodecError::Frame { message: message.to_string(), source })
    }

    /// Writes these values into a payload, even where its switches do not select the signal, and leaves all
    /// other bits unchanged.
    ///
    /// # Errors
    /// [`CodecError`] if a value is beyond its signal or comes twice, or a signal has a problem; the payload may then
    /// have some of the values.
    pub fn encode_into(&self, values: &[(&str, f64)], payload: &mut [u8]) -> Result<(), CodecError> {
        for (signal, value) in self.resolve(values)? {
            signal.wire().encode(value, payload).map_err(|source| CodecError::Value {
                message: self.message.name().to_string(),
                signal: signal.name().to_string(),
                source,
            })?;
        }
        Ok(())
    }

    /// Looks up the signals by name and rejects a name that is given twice.
    fn resolve(&self, values: &[(&str, f64)]) -> Result<Vec<(&'a Signal, f64)>, CodecError> {
        let mut found: Vec<(&Signal, f64)> = Vec::new();
        for (name, value) in values {
            let signal = self.message.signal(name)?;
            // Compared by place, since a signal may be given by its long name and by its symbol.
            if found.iter().any(|(other, _)| std::ptr::eq(*other, signal)) {
                let message = self.message.name().to_string();
                let signal = signal.name().to_string();
                return Err(CodecError::Twice { message, signal });
            }
            found.push((signal, *value));
        }
        Ok(found)
    }
}
