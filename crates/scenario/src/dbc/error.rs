//! Errors of a DBC file and of requests for its messages and signals.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use resonarm_protocol::FrameFormat;
use resonarm_wire::layout::LayoutError;
use resonarm_wire::multiplex::MultiplexError;
use resonarm_wire::signal::SignalError;
use thiserror::Error;

/// Reason why a DBC file, or a message or signal of it, can't be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DbcError {
    /// The file can't be read.
    #[error("can't read the DBC {}: {source}", path.display())]
    Read {
        /// Path of the DBC file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The text does not follow the grammar of a DBC.
    #[error("{origin}, line {line}, column {column}: expected {expected}, got {}", shown(.got))]
    Syntax {
        /// Path or name of the text.
        origin: Arc<str>,
        /// The line, from 1 on.
        line: usize,
        /// The character in the line, from 1 on.
        column: usize,
        /// Token that the grammar allows at this place.
        expected: &'static str,
        /// The text that is there; empty at the end of a line or of the file.
        got: String,
    },
    /// There is no such message.
    #[error("{origin} has no message {name:?}{}", did_you_mean(.suggestion))]
    NoMessage {
        /// Path or name of the text.
        origin: Arc<str>,
        /// Requested name of the message.
        name: String,
        /// Existing name that is closest to the requested one.
        suggestion: Option<String>,
    },
    /// There is no such signal in the message.
    #[error("{origin}, line {line}: message {message} has no signal {name:?}{}", did_you_mean(.suggestion))]
    NoSignal {
        /// Path or name of the text.
        origin: Arc<str>,
        /// The line of the message, from 1 on.
        line: usize,
        /// Name of the message.
        message: String,
        /// Requested name of the signal.
        name: String,
        /// Existing name that is closest to the requested one.
        suggestion: Option<String>,
    },
    /// The message exists, but it breaks a rule and can't be used.
    #[error("{origin}, line {line}: message {message}: {problem}")]
    Message {
        /// Path or name of the text.
        origin: Arc<str>,
        /// The line of the message, from 1 on.
        line: usize,
        /// Name of the message.
        message: String,
        /// Rule that the message breaks.
        problem: Problem,
    },
    /// The signal exists, but it breaks a rule and can't be used.
    #[error("{origin}, line {line}: signal {signal} of {message}: {problem}")]
    Signal {
        /// Path or name of the text.
        origin: Arc<str>,
        /// The line of the signal, from 1 on.
        line: usize,
        /// Name of the message.
        message: String,
        /// Name of the signal.
        signal: String,
        /// Rule that the signal breaks.
        problem: Problem,
    },
}

/// Rule that a message or signal breaks. It is an error only for those who ask for just this message or signal
/// by name.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Problem {
    /// The identifier has more bits than CAN allows.
    #[error("identifier {got} does not fit {}", id_rule(*.got))]
    Id {
        /// The number in the file, with bit 31 of 29-bit identifiers.
        got: u64,
    },
    /// Another message has the identifier.
    #[error("its identifier is also that of {other} in line {line}")]
    IdTwice {
        /// Name of the other message with the same identifier.
        other: String,
        /// Line of the other message, from 1 on.
        line: usize,
    },
    /// Another message or signal has the name.
    #[error("its name is also used in line {line}")]
    NameTwice {
        /// The line of the other, from 1 on.
        line: usize,
    },
    /// The payload length does not exist in this frame format.
    #[error("its length is {got} bytes: {}", length_rule(.format))]
    Length {
        /// Payload length stated in the file, bytes.
        got: u64,
        /// Frame format that does not have this length.
        format: FrameFormat,
    },
    /// The frame format is none of the known ones.
    #[error(
        "its VFrameFormat is {got}: it must be StandardCAN (0), ExtendedCAN (1), J1939PG (3), StandardCAN_FD (14) or ExtendedCAN_FD (15)"
    )]
    Format {
        /// Value of the attribute `VFrameFormat` as written in the file.
        got: String,
    },
    /// The bits of the signal do not fit into the payload.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// Factor, offset or width do not yield exact values.
    #[error(transparent)]
    Value(#[from] SignalError),
    /// The signal shares bits with another signal in the same payload.
    #[error("bit {bit} also belongs to {other}, in line {line}")]
    Overlap {
        /// Name of the other signal.
        other: String,
        /// The line of it, from 1 on.
        line: usize,
        /// The first bit that both have.
        bit: u16,
    },
    /// `SIG_VALTYPE_` states a floating-point type of another width than the signal's.
    #[error("SIG_VALTYPE_ states {expected} bits, but it has {got}")]
    ValueTypeBits {
        /// The bits of the signal.
        got: u64,
        /// The bits of the type.
        expected: u64,
    },
    /// A statement about a signal that the message does not have.
    #[error("{statement} refers to it, but the message has no such signal")]
    NoSuchSignal {
        /// The keyword of the statement.
        statement: &'static str,
    },
    /// A statement about a signal of a message that isn't there.
    #[error("{statement} refers to it, but no message has the identifier {id}")]
    NoSuchMessage {
        /// The keyword of the statement.
        statement: &'static str,
        /// The number in the file, with bit 31 of 29-bit identifiers.
        id: u64,
    },
    /// A multiplexed signal without a switch.
    #[error("it is multiplexed, but the message has no switch, a signal marked M")]
    NoSwitch,
    /// A multiplexed signal with several possible switches.
    #[error("it is multiplexed, but the message has several switches: SG_MUL_VAL_ must say which one selects it")]
    SeveralSwitches,
    /// A switch that isn't there.
    #[error("its switch {switch:?} is not a signal of the message")]
    UnknownSwitch {
        /// The name of the switch.
        switch: String,
    },
    /// A switch that can't be used.
    #[error("its switch {switch} can't be used: {problem}")]
    Switch {
        /// Name of the switch signal.
        switch: String,
        /// Rule that the switch breaks.
        problem: Box<Problem>,
    },
    /// A switch that is selected by itself.
    #[error("its switches select each other in a circle")]
    SwitchCircle,
    /// Impossible values of the switch.
    #[error(transparent)]
    Multiplex(#[from] MultiplexError),
}

fn did_you_mean(suggestion: &Option<String>) -> String {
    suggestion.as_ref().map_or(String::new(), |name| format!("\nDid you mean {name:?}?"))
}

fn shown(got: &str) -> String {
    if got.is_empty() { "the end of the line or file".to_string() } else { format!("{got:?}") }
}

fn id_rule(got: u64) -> String {
    match u32::try_from(got) {
        Ok(got) if got >> 31 == 0 && got <= 0x1FFF_FFFF => {
            format!("11 bits: with 29 bits it is written as {}, with bit 31", got | 1 << 31)
        }
        _ => "29 bits, which are written with bit 31".to_string(),
    }
}

fn length_rule(format: &FrameFormat) -> &'static str {
    match format {
        FrameFormat::Fd { .. } => "CAN FD has 0 to 8, 12, 16, 20, 24, 32, 48 or 64",
        _ => {
            "a classical frame has 0 to 8; if it is CAN FD, its attribute VFrameFormat has to be StandardCAN_FD or ExtendedCAN_FD"
        }
    }
}
