//! What is wrong with the mapping of a user's protocol.

use std::fmt;
use std::ops::Deref;
use std::path::PathBuf;

use thiserror::Error;

use crate::dbc::DbcError;
use resonarm_bench::structure::ChannelName;
use resonarm_numeric::number::{rounded, short};
use resonarm_wire::checksum::{ChecksumError, PresetError, UnknownPreset};
use resonarm_wire::counter::CounterError;

/// A key of `[wire]`, with the message and the signal that it names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place(Box<Names>);

/// What a [`Place`] names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names {
    /// The key, such as `wire.commands`.
    pub key: &'static str,
    /// The message.
    pub message: String,
    /// The signal, if it is about one.
    pub signal: Option<String>,
}

impl Deref for Place {
    type Target = Names;

    fn deref(&self) -> &Names {
        &self.0
    }
}

impl Place {
    /// A message.
    pub(super) fn message(key: &'static str, message: &str) -> Place {
        Place(Box::new(Names { key, message: message.to_string(), signal: None }))
    }

    /// A signal of a message.
    pub(super) fn signal(key: &'static str, message: &str, signal: &str) -> Place {
        Place(Box::new(Names { key, message: message.to_string(), signal: Some(signal.to_string()) }))
    }

    /// A signal of the same message.
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

/// Why a protocol can't be mapped so.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WireError {
    /// The structure that the sensors of `[rig.sensors]` read is impossible, so that it is not known which readings
    /// signals can carry.
    #[error("[wire]: which readings of [rig.sensors] signals can carry follows from the structure: {reason}")]
    Structure {
        /// Why.
        reason: String,
    },
    /// The DBC can't be read.
    #[error("can't read the DBC {}: {source}; `wire.dbc` counts from the scenario's folder", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The DBC has not been read.
    #[error("the DBC that `wire.dbc` names has not been read: a scenario of text alone has no folder to read it from")]
    NotRead,
    /// The DBC, or what is asked of it.
    #[error(transparent)]
    Dbc(#[from] DbcError),
    /// There is no such node.
    #[error("wire.node: the DBC has no node {got:?}{}", nearest(.suggestion))]
    NoNode {
        /// The name.
        got: String,
        /// The nearest name that there is.
        suggestion: Option<String>,
    },
    /// The name that stands for no node.
    #[error(
        "wire.node is {got:?}, by which a DBC says that it names no node: leave `node` out, and any message can be a \
         command or a reading"
    )]
    NoNodeName {
        /// The name.
        got: String,
    },
    /// A message that the wrong node sends.
    #[error("{place}: it is sent by {senders}, and {expected}")]
    Sender {
        /// Where.
        place: Place,
        /// The senders in the DBC.
        senders: String,
        /// Who has to send it.
        expected: String,
    },
    /// A message without anything mapped, or mapped twice.
    #[error("{place}: {problem}")]
    Message {
        /// Where.
        place: Place,
        /// What is wrong.
        problem: &'static str,
    },
    /// A signal that is used twice.
    #[error("{place}: it is mapped twice, as {one} and as {other}")]
    Twice {
        /// Where.
        place: Place,
        /// The first use.
        one: String,
        /// The second.
        other: String,
    },
    /// A load that two signals command.
    #[error("{place}: it commands {input}, as signal {other} does already: leave one out")]
    InputTwice {
        /// Where.
        place: Place,
        /// The load.
        input: ChannelName,
        /// The other signal.
        other: String,
    },
    /// A load that the exciter of the scenario never takes.
    #[error("{place}: {input} {problem}")]
    Input {
        /// Where.
        place: Place,
        /// The load.
        input: ChannelName,
        /// What is wrong.
        problem: &'static str,
    },
    /// A unit that does not go into the quantity's.
    #[error("{place}: its unit {got:?} is none of {known}, which become {expected}: give `scale`, {}", scale_of(.place, .expected))]
    Unit {
        /// Where.
        place: Place,
        /// The unit of the signal.
        got: String,
        /// The unit of the quantity.
        expected: &'static str,
        /// The units that are converted.
        known: &'static str,
    },
    /// A number that can't be.
    #[error("{place}: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Number {
        /// Where.
        place: Place,
        /// The key.
        name: &'static str,
        /// What was given.
        got: f64,
        /// What would do.
        expected: &'static str,
    },
    /// A number that the signal can't have.
    #[error(
        "{place}, line {line} of the DBC: `{name}` is {got}, and {}",
        ranged(.range, .step, .nearest), got = short(.got)
    )]
    Value {
        /// Where.
        place: Place,
        /// The line of the signal in the DBC.
        line: usize,
        /// The key.
        name: String,
        /// What was given.
        got: f64,
        /// The least and the largest value of the signal.
        range: [f64; 2],
        /// The distance of its values; `None` of a floating-point signal.
        step: Option<f64>,
        /// The value of the signal next to it; `None` if it is no number.
        nearest: Option<f64>,
    },
    /// There is no such quantity.
    #[error("{place}: there is no quantity {got:?}{}; there are {known}", nearest(.suggestion))]
    Quantity {
        /// Where.
        place: Place,
        /// The name.
        got: String,
        /// The nearest name.
        suggestion: Option<String>,
        /// All of them.
        known: String,
    },
    /// There is no such state or fault.
    #[error("{place}: there is no {what} {got:?}{}; there are {known}", nearest(.suggestion))]
    Name {
        /// Where.
        place: Place,
        /// A state or a fault.
        what: &'static str,
        /// The name.
        got: String,
        /// The nearest name.
        suggestion: Option<String>,
        /// All of them.
        known: String,
    },
    /// A signal with a range too small for its quantity.
    #[error(
        "{place}: its range is {least} to {most} {unit}, and {what} goes from {from} to {to}: widen the signal, or lower {limit}",
        least = short(.least), most = short(.most), from = rounded(.from, 6), to = rounded(.to, 6)
    )]
    Range {
        /// Where.
        place: Place,
        /// The least that it can represent, in its unit.
        least: f64,
        /// The largest.
        most: f64,
        /// Its unit.
        unit: String,
        /// What it has to say.
        what: String,
        /// The least of that, in the same unit.
        from: f64,
        /// The largest.
        to: f64,
        /// The key that limits it.
        limit: String,
    },
    /// Not one of the keys that say what a signal says.
    #[error(
        "{place}: it has {got} of the keys `quantity`, `clipped`, `state`, `reason`, `constant` and `sample`: give one"
    )]
    Sources {
        /// Where.
        place: Place,
        /// How many it has.
        got: usize,
    },
    /// A counter that can't be.
    #[error("{place}: {source}")]
    Counter {
        /// Where.
        place: Place,
        /// Why.
        source: CounterError,
    },
    /// A checksum that can't be.
    #[error("{place}: {source}")]
    Checksum {
        /// Where.
        place: Place,
        /// Why.
        source: PresetError,
    },
    /// An algorithm that can't be.
    #[error("{place}: {source}")]
    Algorithm {
        /// Where.
        place: Place,
        /// Why.
        source: ChecksumError,
    },
    /// The name of no checksum.
    #[error("{place}: {source}")]
    Preset {
        /// Where.
        place: Place,
        /// Why.
        source: UnknownPreset,
    },
    /// A time that is no whole number of samples.
    #[error(
        "{place}: its cycle time in the DBC, {period_s} s, is {samples} samples at {rate_hz} Hz: give `every`, or a rate of which it is a \
         whole number", period_s = short(.period_s), samples = short(.samples), rate_hz = short(.rate_hz)
    )]
    Cycle {
        /// Where.
        place: Place,
        /// The cycle time, s.
        period_s: f64,
        /// The same in samples.
        samples: f64,
        /// Samples a second, Hz.
        rate_hz: f64,
    },
    /// A timeout that every second frame would exceed.
    #[error(
        "{place}: `timeout_s` is {timeout_s}, and the DBC sends it every {period_s} s: give at least two of its cycles",
        timeout_s = short(.timeout_s), period_s = short(.period_s)
    )]
    Timeout {
        /// Where.
        place: Place,
        /// The timeout, s.
        timeout_s: f64,
        /// The cycle time, s.
        period_s: f64,
    },
    /// Drives without a preset, a preset without drives, or keys of a DBC beside them.
    #[error("[wire]: {problem}")]
    Drives {
        /// What is wrong.
        problem: &'static str,
    },
    /// A number of a drive that can't be.
    #[error("wire.drives, number {}: `{name}` is {got}: it must be {expected}", .place + 1, got = short(.got))]
    Drive {
        /// Its place, from 0.
        place: usize,
        /// The key.
        name: &'static str,
        /// What was given.
        got: f64,
        /// What would do.
        expected: &'static str,
    },
    /// Nothing arms the plant.
    #[error(
        "[wire] has nothing that arms the plant: give an event with `arm`, or `arm = \"operator\"` (in the live view), or \
         `arm = \"zero-command\"` (by first commands near zero)"
    )]
    NoArming,
    /// Nothing commands a load.
    #[error("[wire] has no commands: a plant without a load has nothing to do; give [[wire.commands]]")]
    NoCommands,
    /// `sync` is needed, or of no use.
    #[error("wire.sync: {problem}")]
    Sync {
        /// What is wrong.
        problem: &'static str,
    },
    /// Lockstep needs a wire that answers.
    #[error(
        "[wire] says nothing of lockstep: give `lockstep = \"command\"` or `lockstep = \"sync\"`, or run in real time"
    )]
    NoLockstep,
    /// Nothing says which protocol it is.
    #[error("[wire] names no protocol: give `dbc`, the file with the messages, or `preset`")]
    NeitherDbcNorPreset,
    /// Only SYNC answers samples.
    #[error("wire.lockstep: with `preset = \"{preset}\"` a SYNC answers a sample: give `lockstep = \"sync\"`")]
    LockstepBySync {
        /// The preset.
        preset: &'static str,
    },
    /// A drive without something that its preset needs.
    #[error("wire.drives, number {}: it has no `{name}`, which `preset = \"{preset}\"` needs", .place + 1)]
    DriveWithout {
        /// Its place, from 0.
        place: usize,
        /// The key.
        name: &'static str,
        /// The preset.
        preset: &'static str,
    },
    /// A drive with something that its preset does not know.
    #[error("wire.drives, number {}: `{name}` is not a key of `preset = \"{preset}\"`: leave it out", .place + 1)]
    DriveWith {
        /// Its place, from 0.
        place: usize,
        /// The key.
        name: &'static str,
        /// The preset.
        preset: &'static str,
    },
    /// A timeout of drives that can't be.
    #[error("wire.timeout_s is {got}: it must be a positive number of seconds, at most 3600", got = short(.got))]
    TimeoutOfDrives {
        /// What was given, s.
        got: f64,
    },
    /// The bus can't carry the messages.
    #[error(
        "the messages of [wire] are up to {percent:.1} % of what network.bit_rate_hz carries, and a bus for control is loaded to 80 % at \
         most: send readings less often, or raise the bit rate"
    )]
    Overload {
        /// The load, %.
        percent: f64,
    },
    /// The bus can't carry the frames of CANopen drives.
    #[error(
        "the frames of the drives, with a SYNC and a target for each drive once a sample, are up to {percent:.1} % of what \
         network.bit_rate_hz carries, and a bus for control is loaded to 80 % at most: lower simulation.rate_hz, or raise the bit rate"
    )]
    OverloadByDrives {
        /// The load, %.
        percent: f64,
    },
}

fn nearest(suggestion: &Option<String>) -> String {
    suggestion.as_ref().map_or(String::new(), |name| format!("; is it {name:?}?"))
}

fn ranged(range: &[f64; 2], step: &Option<f64>, nearest: &Option<f64>) -> String {
    let steps = step.map_or_else(String::new, |step| format!(" in steps of {}", short(&step)));
    // Scale times count leaves a last digit that nobody wrote.
    let tidy = |value: f64| short(&format!("{value:.9}").parse().unwrap_or(value)).to_string();
    let next = nearest.map_or_else(String::new, |nearest| format!(", next to it {}", tidy(nearest)));
    let [least, most] = range.map(tidy);
    format!("the signal has {least} to {most}{steps}{next}: give one of its values, or widen the signal")
}

fn scale_of(place: &Place, unit: &str) -> String {
    let is_reading = place.key == "wire.readings";
    if is_reading { format!("its value for 1 {unit}") } else { format!("the {unit} of its value 1") }
}
