//! Errors of a rig's specification.

use thiserror::Error;

use super::name::{InstrumentName, Section};
use resonarm_numeric::number::short;

/// Errors of a rig's specification.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum RigError {
    /// A value of the specification is outside its valid range.
    #[error("{section}: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Spec {
        /// Section of the scenario.
        section: Section,
        /// Key of the value.
        name: &'static str,
        /// Value that was given.
        got: f64,
        /// Valid values, in words.
        expected: &'static str,
    },
    /// Two keys state the same thing.
    #[error("{section}: `{}` and `{}` state the same: leave one out", names[0], names[1])]
    Both {
        /// Section of the scenario.
        section: Section,
        /// Keys that exclude each other.
        names: [&'static str; 2],
    },
    /// The structure provides no motion for a sensor.
    #[error(
        "{section}: the structure serves head, b and c alone, as its equations are not Resonarm's: leave the sensor out, or take a \
         structure of the scenario"
    )]
    NotSensed {
        /// Section of the scenario.
        section: Section,
    },
    /// A fault names an instrument that the rig does not have.
    #[error(
        "rig.faults, number {number}: `instrument` is \"{got}\": expected \"head\", or the name of a sensor in [rig.sensors]"
    )]
    FaultInstrument {
        /// Number of the fault, from 1.
        number: usize,
        /// Name that was given.
        got: InstrumentName,
    },
    /// A number of a fault is outside its valid range.
    #[error("rig.faults, number {number}: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Fault {
        /// Number of the fault, from 1.
        number: usize,
        /// Key of the value.
        name: &'static str,
        /// Value that was given.
        got: f64,
        /// Valid values, in words.
        expected: &'static str,
    },
    /// A fault lacks its amount.
    #[error("rig.faults, number {number}: `{key}` is missing: add it, or change `kind`")]
    FaultKeyMissing {
        /// Number of the fault, from 1.
        number: usize,
        /// Key that is missing.
        key: &'static str,
    },
    /// A fault has a key that means nothing for it.
    #[error(
        "rig.faults, number {number}: `{key}` does not apply to this kind of fault of this instrument: leave it out"
    )]
    FaultKeyIdle {
        /// Number of the fault, from 1.
        number: usize,
        /// Key that does not apply.
        key: &'static str,
    },
    /// The rig has too many faults.
    #[error("rig.faults are {got}: at most {most} are taken")]
    TooManyFaults {
        /// Number of faults that was given.
        got: usize,
        /// Largest number of faults.
        most: usize,
    },
}
