//! What is wrong with a DBC, or with what is asked of it.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use resonarm_protocol::FrameFormat;
use resonarm_wire::layout::LayoutError;
use resonarm_wire::multiplex::MultiplexError;
use resonarm_wire::signal::SignalError;
use thiserror::Error;

/// Why a DBC, a message or a signal of it can't be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DbcError {
    /// The file can't be read.
    #[error("can't read the DBC {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The text is no DBC.
    #[error("{origin}, line {line}, column {column}: expected {expected}, got {}", shown(.got))]
    Syntax {
        /// Where the text is from.
        origin: Arc<str>,
        /// The line, from 1 on.
        line: usize,
        /// The character in the line, from 1 on.
        column: usize,
        /// What belongs there.
        expected: &'static str,
        /// The text that is there; empty at the end of a line or of the file.
        got: String,
    },
    /// There is no such message.
    #[error("{origin} has no message {name:?}{}", did_you_mean(.suggestion))]
    NoMessage {
        /// Where the text is from.
        origin: Arc<str>,
        /// The name.
        name: String,
        /// The nearest name that there is.
        suggestion: Option<String>,
    },
    /// There is no such signal in the message.
    #[error("{origin}, line {line}: message {message} has no signal {name:?}{}", did_you_mean(.suggestion))]
    NoSignal {
        /// Where the text is from.
        origin: Arc<str>,
        /// The line of the message, from 1 on.
        line: usize,
        /// The message.
        message: String,
        /// The name.
        name: String,
        /// The nearest name that there is.
        suggestion: Option<String>,
    },
    /// The message is there, and can't be used.
    #[error("{origin}, line {line}: message {message}: {problem}")]
    Message {
        /// Where the text is from.
        origin: Arc<str>,
        /// The line of the message, from 1 on.
        line: usize,
        /// The message.
        message: String,
        /// What is wrong.
        problem: Problem,
    },
    /// The signal is there, and can't be used.
    #[error("{origin}, line {line}: signal {signal} of {message}: {problem}")]
    Signal {
        /// Where the text is from.
        origin: Arc<str>,
        /// The line of the signal, from 1 on.
        line: usize,
        /// The message.
        message: String,
        /// The signal.
        signal: String,
        /// What is wrong.
        problem: Problem,
    },
}

/// What breaks the rules of DBC in a message or signal: an error if it is asked for by its name.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Problem {
    /// An identifier that is too large.
    #[error("identifier {got} does not fit {}", id_rule(*.got))]
    Id {
        /// The number in the file, with bit 31 of 29-bit identifiers.
        got: u64,
    },
    /// Another message has the identifier.
    #[error("its identifier is also that of {other} in line {line}")]
    IdTwice {
        /// The other message.
        other: String,
        /// Its line, from 1 on.
        line: usize,
    },
    /// Another message or signal has the name.
    #[error("its name is also that of line {line}")]
    NameTwice {
        /// The line of the other, from 1 on.
        line: usize,
    },
    /// A length that its format doesn't have.
    #[error("its length is {got} bytes: {}", length_rule(.format))]
    Length {
        /// The length, bytes.
        got: u64,
        /// The format.
        format: FrameFormat,
    },
    /// A format that isn't known.
    #[error(
        "its VFrameFormat is {got}: StandardCAN (0), ExtendedCAN (1), J1939PG (3), StandardCAN_FD (14) and ExtendedCAN_FD (15) are known"
    )]
    Format {
        /// The attribute's value.
        got: String,
    },
    /// Bits that can't lie so.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// A factor, an offset or a size that gives no value.
    #[error(transparent)]
    Value(#[from] SignalError),
    /// Its bits are also those of another signal.
    #[error("bit {bit} is also of {other}, in line {line}")]
    Overlap {
        /// The other signal.
        other: String,
        /// The line of it, from 1 on.
        line: usize,
        /// The first bit that both have.
        bit: u16,
    },
    /// A floating-point type of another size than the signal's.
    #[error("SIG_VALTYPE_ says that it has {expected} bits, and it has {got}")]
    ValueTypeBits {
        /// The bits of the signal.
        got: u64,
        /// The bits of the type.
        expected: u64,
    },
    /// A statement about a signal that the message does not have.
    #[error("{statement} is about it, and the message has no such signal")]
    NoSuchSignal {
        /// The keyword of the statement.
        statement: &'static str,
    },
    /// A statement about a signal of a message that isn't there.
    #[error("{statement} is about it, and no message has the identifier {id}")]
    NoSuchMessage {
        /// The keyword of the statement.
        statement: &'static str,
        /// The number in the file, with bit 31 of 29-bit identifiers.
        id: u64,
    },
    /// A multiplexed signal without a switch.
    #[error("it is multiplexed, and the message has no switch, a signal marked M")]
    NoSwitch,
    /// A multiplexed signal with several possible switches.
    #[error("it is multiplexed, and the message has several switches: SG_MUL_VAL_ has to say which is its")]
    SeveralSwitches,
    /// A switch that isn't there.
    #[error("its switch {switch:?} is no signal of the message")]
    UnknownSwitch {
        /// The name of the switch.
        switch: String,
    },
    /// A switch that can't be used.
    #[error("its switch {switch} can't be used: {problem}")]
    Switch {
        /// The switch.
        switch: String,
        /// What is wrong with it.
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
