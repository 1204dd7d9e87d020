//! Errors in mapping a user protocol.

use std::fmt;
use std::ops::Deref;
use std::path::PathBuf;

use thiserror::Error;

use crate::dbc::DbcError;
use resonarm_bench::structure::ChannelName;
use resonarm_numeric::number::{rounded, short};
use resonarm_wire::checksum::{ChecksumError, PresetError, UnknownPreset};
use resonarm_wire::counter::CounterError;

/// Place of an error: a key of `[wire]`, with the message and the signal that it names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place(Box<Names>);

/// Names that make up a [`Place`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names {
    /// Key of the section, such as `wire.commands`.
    pub key: &'static str,
    /// Name of the message.
    pub message: String,
    /// Name of the signal, if the error is about one.
    pub signal: Option<String>,
}

impl Deref for Place {
    type Target = Names;

    fn deref(&self) -> &Names {
        &self.0
    }
}

impl Place {
    /// Returns the place of a message, by its key and its name.
    pub(super) fn message(key: &'static str, message: &str) -> Place {
        Place(Box::new(Names { key, message: message.to_string(), signal: None }))
    }

    /// Names a signal of a message.
    pub(super) fn signal(key: &'static str, message: &str, signal: &str) -> Place {
        Place(Box::new(Names { key, message: message.to_string(), signal: Some(signal.to_string()) }))
    }

    /// Names a signal of the same message.
    pub(super) fn of(&self, signal: &str) -> Place {
        Place::signal(self.key, &self.message, signal)
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: message {}", self.key, self.message)?;
        self.signal.as_ref().map_or(Ok(()), |signal| write!(f, ", signal {signal}"))
    }
}

/// Reason why a user protocol can't be mapped.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WireError {
    /// The structure is not valid, so that the readings of the sensors in `[rig.sensors]` are not known.
    #[error("[wire]: the readings of [rig.sensors] depend on the structure, which is invalid: {reason}")]
    Structure {
        /// Reason why the structure is rejected.
        reason: String,
    },
    /// The DBC can't be read.
    #[error("can't read the DBC {}: {source}; `wire.dbc` is relative to the scenario's folder", path.display())]
    Read {
        /// Path of the DBC file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The DBC has not been read.
    #[error(
        "the DBC that `wire.dbc` names has not been read; read the scenario from a file, since a text has no folder"
    )]
    NotRead,
    /// The DBC, or a message or signal of it, can't be used.
    #[error(transparent)]
    Dbc(#[from] DbcError),
    /// The DBC has no node of this name.
    #[error("wire.node: the DBC has no node {got:?}{}", nearest(.suggestion))]
    NoNode {
        /// Name that was given.
        got: String,
        /// Existing name closest to it.
        suggestion: Option<String>,
    },
    /// The name is the DBC's name for no node.
    #[error(
        "wire.node is {got:?}, the name of a DBC for no node; leave `node` out, so that any message can be a command or a \
         reading"
    )]
    NoNodeName {
        /// Name that was given.
        got: String,
    },
    /// The message is sent by a node that must not send it.
    #[error("{place}: it is sent by {senders}, but {expected}")]
    Sender {
        /// Message that the error is about.
        place: Place,
        /// Senders of the message according to the DBC.
        senders: String,
        /// Required sender, in words.
        expected: String,
    },
    /// The keys of a message contradict each other or are incomplete.
    #[error("{place}: {problem}")]
    Message {
        /// Message that the error is about.
        place: Place,
        /// Contradiction and remedy, in words.
        problem: &'static str,
    },
    /// A signal is used for two purposes.
    #[error("{place}: it is mapped twice, as {one} and as {other}")]
    Twice {
        /// Signal that the error is about.
        place: Place,
        /// First use of the signal.
        one: String,
        /// Second use of the signal.
        other: String,
    },
    /// Two signals command the same load.
    #[error("{place}: it commands {input}, as message {other} does already: leave one out")]
    InputTwice {
        /// Signal that the error is about.
        place: Place,
        /// Load that is commanded twice.
        input: ChannelName,
        /// Message that commands it already.
        other: String,
    },
    /// The exciter of the scenario does not take this load.
    #[error("{place}: {input} {problem}")]
    Input {
        /// Signal that the error is about.
        place: Place,
        /// Load that is not taken.
        input: ChannelName,
        /// Reason and remedy, in words.
        problem: &'static str,
    },
    /// The unit of a signal can't be converted to that of the quantity.
    #[error("{place}: its unit {got:?} can't be converted to {expected} (known are {known}): give `scale`, {}", scale_of(.place, .expected))]
    Unit {
        /// Signal that the error is about.
        place: Place,
        /// The unit of the signal.
        got: String,
        /// The unit of the quantity.
        expected: &'static str,
        /// The units that are converted.
        known: &'static str,
    },
    /// A number is outside its valid range.
    #[error("{place}: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Number {
        /// Message or signal that the error is about.
        place: Place,
        /// Key of the number.
        name: &'static str,
        /// Value that was given.
        got: f64,
        /// Valid values, in words.
        expected: &'static str,
    },
    /// The signal can't represent the number exactly.
    #[error(
        "{place}, line {line} of the DBC: `{name}` is {got}, but {}",
        ranged(.range, .step, .nearest), got = short(.got)
    )]
    Value {
        /// Signal that the error is about.
        place: Place,
        /// The line of the signal in the DBC.
        line: usize,
        /// Key of the number.
        name: String,
        /// Value that was given.
        got: f64,
        /// Least and largest value of the signal.
        range: [f64; 2],
        /// Resolution of the signal; `None` if it is floating-point.
        step: Option<f64>,
        /// Value of the signal closest to the number; `None` if it is not a number.
        nearest: Option<f64>,
    },
    /// The program has no quantity, state or fault of this name.
    #[error("{place}: there is no {what} {got:?}{}; there are {known}", nearest(.suggestion))]
    Name {
        /// Signal that the error is about.
        place: Place,
        /// Kind of name: `quantity`, `state` or `fault`.
        what: &'static str,
        /// Name that was given.
        got: String,
        /// Existing name closest to it.
        suggestion: Option<String>,
        /// All known names, separated by commas.
        known: String,
    },
    /// The range of a signal is too small for its quantity.
    #[error(
        "{place}: its range is {least} to {most} {unit}, but {what} goes from {from} to {to}: widen the signal, or lower {limit}",
        least = short(.least), most = short(.most), from = rounded(.from, 6), to = rounded(.to, 6)
    )]
    Range {
        /// Signal that the error is about.
        place: Place,
        /// Least value that the signal can represent, in its unit.
        least: f64,
        /// Largest value that the signal can represent.
        most: f64,
        /// Unit of the signal.
        unit: String,
        /// Quantity that the signal has to carry.
        what: String,
        /// Least value of that quantity, in the signal's unit.
        from: f64,
        /// Largest value of that quantity, in the signal's unit.
        to: f64,
        /// Key that limits the quantity.
        limit: String,
    },
    /// A signal has none, or several, of the keys that say what it carries.
    #[error(
        "{place}: it has {got} of the keys `quantity`, `clipped`, `state`, `reason`, `constant` and `sample`: give exactly one"
    )]
    Sources {
        /// Signal that the error is about.
        place: Place,
        /// Number of such keys that were given.
        got: usize,
    },
    /// The counter or the checksum is not possible, or the program has no checksum preset of this name.
    #[error("{place}: {source}")]
    Protection {
        /// Signal that the error is about.
        place: Place,
        /// Reason for the rejection.
        source: ProtectionError,
    },
    /// The cycle time is not an integer number of samples.
    #[error(
        "{place}: its cycle time in the DBC, {period_s} s, is {samples} samples at {rate_hz} Hz: give `every`, or choose a rate at which \
         it is a whole number of samples", period_s = short(.period_s), samples = short(.samples), rate_hz = short(.rate_hz)
    )]
    Cycle {
        /// Message that the error is about.
        place: Place,
        /// Cycle time in the DBC, s.
        period_s: f64,
        /// Cycle time in samples.
        samples: f64,
        /// Sample rate of the scenario, Hz.
        rate_hz: f64,
    },
    /// The timeout is so short that one lost frame would exceed it.
    #[error(
        "{place}: `timeout_s` is {timeout_s}, but the DBC sends the message every {period_s} s: it must be at least two cycles",
        timeout_s = short(.timeout_s), period_s = short(.period_s)
    )]
    Timeout {
        /// Message that the error is about.
        place: Place,
        /// Timeout that was given, s.
        timeout_s: f64,
        /// Cycle time in the DBC, s.
        period_s: f64,
    },
    /// Keys of the section contradict each other, such as drives without a preset, or `sync` that nothing uses.
    #[error("{key}: {problem}")]
    Section {
        /// The section, or its key.
        key: &'static str,
        /// Contradiction and remedy, in words.
        problem: &'static str,
    },
    /// A number of a drive is outside its valid range.
    #[error("wire.drives, number {}: `{name}` is {got}: it must be {expected}", .place + 1, got = short(.got))]
    Drive {
        /// Index of the drive, from 0.
        place: usize,
        /// Key of the number.
        name: &'static str,
        /// Value that was given.
        got: f64,
        /// Valid values, in words.
        expected: &'static str,
    },
    /// The mapping has nothing that arms the plant.
    #[error(
        "[wire] has nothing that arms the plant: give an event with `arm`, or `arm = \"operator\"` (in the live view), or \
         `arm = \"zero-command\"` (by first commands near zero)"
    )]
    NoArming,
    /// The mapping has no commands.
    #[error("[wire] has no commands, so no load can act on the plant: add [[wire.commands]]")]
    NoCommands,
    /// The run is in lockstep, and the mapping does not say what answers a sample.
    #[error(
        "[wire] does not define lockstep: give `lockstep = \"command\"` or `lockstep = \"sync\"`, or run in real time"
    )]
    NoLockstep,
    /// The section names neither a DBC nor a preset.
    #[error("[wire] names no protocol: give `dbc`, the file with the messages, or `preset`")]
    NeitherDbcNorPreset,
    /// With this preset only SYNC can answer a sample in lockstep.
    #[error("wire.lockstep: with `preset = \"{preset}\"` a SYNC answers a sample: give `lockstep = \"sync\"`")]
    LockstepBySync {
        /// Name of the preset.
        preset: &'static str,
    },
    /// A drive lacks a key that its preset needs.
    #[error("wire.drives, number {}: it has no `{name}`, which `preset = \"{preset}\"` needs", .place + 1)]
    DriveWithout {
        /// Index of the drive, from 0.
        place: usize,
        /// Key that is missing.
        name: &'static str,
        /// Name of the preset.
        preset: &'static str,
    },
    /// A drive has a key that its preset does not know.
    #[error("wire.drives, number {}: `{name}` is not a key of `preset = \"{preset}\"`: leave it out", .place + 1)]
    DriveWith {
        /// Index of the drive, from 0.
        place: usize,
        /// Key that does not apply.
        name: &'static str,
        /// Name of the preset.
        preset: &'static str,
    },
    /// The timeout of the drives is outside its valid range.
    #[error("wire.timeout_s is {got}: it must be a positive number of seconds, at most 3600", got = short(.got))]
    TimeoutOfDrives {
        /// Timeout that was given, s.
        got: f64,
    },
    /// The bus can't carry the frames.
    #[error(
        "{frames} take up to {percent:.1} % of network.bit_rate_hz, more than the limit of 80 % for a bus with control; {fix}, or \
         raise the bit rate"
    )]
    Overload {
        /// Frames that are too many, in words.
        frames: &'static str,
        /// Share of the bus that the frames take, %.
        percent: f64,
        /// Remedy besides a higher bit rate, in words.
        fix: &'static str,
    },
}

impl WireError {
    /// Rejects the counter or the checksum of a message.
    pub(super) fn protection(place: &Place, error: impl Into<ProtectionError>) -> WireError {
        WireError::Protection { place: place.clone(), source: error.into() }
    }
}

/// Error of a message's counter or checksum.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(transparent)]
pub enum ProtectionError {
    /// The counter is not possible.
    Counter(#[from] CounterError),
    /// The checksum of a preset is not possible.
    Preset(#[from] PresetError),
    /// The checksum of an algorithm is not possible.
    Algorithm(#[from] ChecksumError),
    /// There is no preset of this name.
    UnknownPreset(#[from] UnknownPreset),
}

fn nearest(suggestion: &Option<String>) -> String {
    suggestion.as_ref().map_or(String::new(), |name| format!("; is it {name:?}?"))
}

fn ranged(range: &[f64; 2], step: &Option<f64>, nearest: &Option<f64>) -> String {
    let steps = step.map_or_else(String::new, |step| format!(" in steps of {}", short(&step)));
    // Scale times count leaves digits beyond those of the DBC, such as 0.30000000000000004, which nine decimals
    // remove.
    let tidy = |value: f64| short(&format!("{value:.9}").parse().unwrap_or(value)).to_string();
    let next = nearest.map_or_else(String::new, |nearest| format!("; the nearest is {}", tidy(nearest)));
    let [least, most] = range.map(tidy);
    format!("the signal has values from {least} to {most}{steps}{next}: give one of its values, or widen the signal")
}

fn scale_of(place: &Place, unit: &str) -> String {
    let is_reading = place.key == "wire.readings";
    if is_reading { format!("its value for 1 {unit}") } else { format!("the load in {unit} for its value 1") }
}
