//! All signals of a message at once.

use resonarm_protocol::{Frame, FrameError};
use resonarm_wire::signal::EncodeError;
use thiserror::Error;

use super::{DbcError, Message, Signal};

/// Why a message can't be made of these values.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CodecError {
    /// A signal is not in the message, or can't be used.
    #[error(transparent)]
    Dbc(#[from] DbcError),
    /// A value that the signal can't be.
    #[error("signal {signal} of {message}: {source}")]
    Value {
        /// The message.
        message: String,
        /// The signal.
        signal: String,
        /// Why.
        source: EncodeError,
    },
    /// A signal that the message has with these switches has no value.
    #[error("message {message} has a signal {signal}, which has no value")]
    Missing {
        /// The message.
        message: String,
        /// The signal.
        signal: String,
    },
    /// A value for a signal that the message does not have with these switches.
    #[error("message {message} has no signal {signal} with these switches, and it has a value")]
    NotSelected {
        /// The message.
        message: String,
        /// The signal.
        signal: String,
    },
    /// Two values for one signal.
    #[error("signal {signal} of {message} has two values")]
    Twice {
        /// The message.
        message: String,
        /// The signal.
        signal: String,
    },
    /// The frame is impossible.
    #[error("message {message}: {source}")]
    Frame {
        /// The message.
        message: String,
        /// Why.
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

    /// The signals that are in a payload with their values, in the order of the file: a payload may be shorter than the
    /// message, or have other bits in spare places. A floating-point signal may be NaN or infinite.
    pub fn decode<'b>(&self, payload: &'b [u8]) -> impl Iterator<Item = (&'a str, f64)> + use<'a, 'b> {
        self.message.signals().filter_map(move |signal| Some((signal.name(), signal.decode(payload)?)))
    }

    /// The frame with these values, all other bits zero.
    ///
    /// # Errors
    /// [`CodecError`] if a value is beyond its signal, one is missing, too many or twice, or a signal has a problem.
    pub fn encode(&self, values: &[(&str, f64)]) -> Result<Frame, CodecError> {
        let mut buffer = [0; resonarm_wire::PAYLOAD_MAX_BYTES];
        let payload = &mut buffer[..self.message.length];
        self.encode_into(values, payload)?;
        let (message, payload) = (self.message.name(), &*payload);
        let given = self.resolve(values)?;
        for signal in self.message.writable_signals() {
            let is_in = signal.presence().is_in(payload) == Some(true);
            let has_value = given.iter().any(|(of, _)| std::ptr::eq(*of, signal));
            if is_in == has_value {
                continue;
            }
            let (message, signal) = (message.to_string(), signal.name().to_string());
            return Err(if is_in {
                CodecError::Missing { message, signal }
            } else {
                CodecError::NotSelected { message, signal }
            });
        }
        Frame::new(self.message.id, self.message.format, payload)
            .map_err(|source| CodecError::Frame { message: message.to_string(), source })
    }

    /// Writes these values into a payload, whatever its switches are, and leaves all other bits as they are.
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

    /// The signals of these names, each at most once.
    fn resolve(&self, values: &[(&str, f64)]) -> Result<Vec<(&'a Signal, f64)>, CodecError> {
        let mut found: Vec<(&Signal, f64)> = Vec::new();
        for (name, value) in values {
            let signal = self.message.signal(name)?;
            if found.iter().any(|(other, _)| std::ptr::eq(*other, signal)) {
                let (message, signal) = (self.message.name().to_string(), signal.name().to_string());
                return Err(CodecError::Twice { message, signal });
            }
            found.push((signal, *value));
        }
        Ok(found)
    }
}
