//! Faults in a BLF log.

use resonarm_protocol::FrameError;
use thiserror::Error;

/// A fault in a BLF log.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum BlfFault {
    /// The file has another signature.
    #[error("the file is not a BLF log: it begins with {:?}, expected LOGG", got.escape_ascii().to_string())]
    Signature {
        /// First bytes of the file, instead of the signature `LOGG`.
        got: Vec<u8>,
    },
    /// The head of the file has an invalid date.
    #[error(
        "the head of the file has the invalid date {got:?} (year, month, weekday, day, hour, minute, second, millisecond)"
    )]
    Date {
        /// Year, month, weekday, day, hour, minute, second, millisecond.
        got: [u16; 8],
    },
    /// The file is shorter than its head states.
    #[error("the log is cut short: it has {got} bytes, expected {expected} as its head states")]
    Short {
        /// Bytes that the head states.
        expected: u64,
        /// Size of the file, bytes.
        got: u64,
    },
    /// The file ends inside its head or inside an object.
    #[error("the log is cut short: expected {expected} more bytes, got {got}")]
    Truncated {
        /// Bytes that are needed from this place on.
        expected: usize,
        /// Bytes that are left in the file.
        got: usize,
    },
    /// The last container ends inside an object, and no container follows.
    #[error("the log ends inside an object, of which the last container has {got} bytes")]
    Unfinished {
        /// Bytes of the object found.
        got: usize,
    },
    /// There is no object where one is expected.
    #[error("expected an object, which begins with LOBJ")]
    NoObject,
    /// An object states an impossible length.
    #[error("an object states a length of {got} bytes, expected {least} to {most}")]
    Length {
        /// Length that the object states, bytes.
        got: u32,
        /// Smallest length that an object can have, bytes.
        least: usize,
        /// Largest accepted length, bytes.
        most: usize,
    },
    /// An object that is too short for its kind.
    #[error("an object of kind {kind} has {got} bytes, expected at least {expected}")]
    Object {
        /// Number of the object's kind in BLF.
        kind: u32,
        /// Length of the object, bytes.
        got: usize,
        /// Smallest length of an object of this kind, bytes.
        expected: usize,
    },
    /// A field has a number that this version does not know.
    #[error("{what} {got}, expected {expected}")]
    Number {
        /// Where the field is, and its name.
        what: &'static str,
        /// Number in the field.
        got: u32,
        /// Description of the known numbers.
        expected: &'static str,
    },
    /// A container that can't be inflated.
    #[error("a container can't be inflated: {cause}")]
    Inflate {
        /// Error that the decompressor reports.
        cause: String,
    },
    /// A container holds more or less than it states.
    #[error("a container holds {got} bytes, expected {expected} as its head states")]
    Container {
        /// Number of bytes that it states.
        expected: usize,
        /// Number of bytes that it holds; counted only up to one more than it states.
        got: usize,
    },
    /// The head of a frame is too short for its time.
    #[error("the head of a frame states a length of {got} bytes, expected at least {least}")]
    Head {
        /// Length that the head states, bytes.
        got: u16,
        /// Smallest length with which the head contains the time, bytes.
        least: usize,
    },
    /// The time of a frame does not fit 64 bits.
    #[error("a frame is {got} time units after the start of the log, so its time in ns does not fit 64 bits")]
    Time {
        /// Time from the start of the log, in the object's unit.
        got: u64,
    },
    /// An identifier that is too large to be standard and is not marked as extended.
    #[error("identifier {got:#X} does not fit 11 bits, and is not marked as extended")]
    Id {
        /// Identifier as the object states it.
        got: u32,
    },
    /// The object describes a frame that CAN does not allow.
    #[error(transparent)]
    Frame(#[from] FrameError),
}
