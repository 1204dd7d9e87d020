//! Errors of a scenario.

use std::path::PathBuf;

use thiserror::Error;

use crate::specification::SpecificationFileError;
use crate::structure::StructureSectionError;
use crate::toml_error::TomlError;
use crate::wire::error::WireError;
use resonarm_bench::control::ControlError;
use resonarm_bench::excitation::{ExcitationError, LoadFileError};
use resonarm_bench::plant::PlantSpecError;
use resonarm_bench::rig::InstrumentName;
use resonarm_bus::fault::FaultError;
use resonarm_numeric::number::short;
use resonarm_protocol::NetworkError;
use resonarm_protocol::bits::BitRates;

/// Reason why a scenario can't be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// The file can't be read.
    #[error("can't read the scenario {}: {source}", path.display())]
    Read {
        /// Path of the scenario file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The load file can't be read.
    #[error("can't read the load file {}: {source}; `excitation.profile.path` is relative to the scenario's folder", path.display())]
    ReadLoad {
        /// Path of the load file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The load file can be read, but its contents are not a load.
    #[error("load file {}: {source}", path.display())]
    LoadFile {
        /// Path of the load file.
        path: PathBuf,
        /// Fault of the contents.
        source: LoadFileError,
    },
    /// The text is not a scenario.
    #[error(transparent)]
    Parse(#[from] TomlError),
    /// The scenario can't be written as TOML.
    #[error("the scenario can't be written as TOML: {reason}")]
    Write {
        /// Message of the TOML writer.
        reason: String,
    },
    /// The structure's name can't be shown in one line.
    #[error("structure.name is {got:?}: it must be 1 to {most} characters, none of them a control character")]
    Name {
        /// Name that was given.
        got: String,
        /// Largest number of characters of a name.
        most: usize,
    },
    /// The excitation can't be played.
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// The controller of the section `[control]` can't be built.
    #[error(transparent)]
    Control(#[from] ControlError),
    /// The specification of the control can't be used.
    #[error("control: {0}")]
    Specification(#[from] SpecificationFileError),
    /// The scenario has both an excitation and a control.
    #[error("the scenario has both [excitation] and [control], but an exciter has one controller; leave one out")]
    TwoControllers,
    /// The sample rate, the steps per sample or the rig make no valid plant.
    #[error("simulation: {0}")]
    Plant(#[from] PlantSpecError),
    /// A fault of the section `[network]` is not valid.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// The user protocol of the section `[wire]` can't be mapped.
    #[error(transparent)]
    Wire(Box<WireError>),
    /// A load acts on a degree of freedom that the structure does not have.
    #[error(
        "the load has `{name}` = {got}, but the structure accepts only {accepted}; choose one of these, or place the exciter \
         elsewhere by `rig.exciter.at`", got = short(.got)
    )]
    IdleLoad {
        /// Key of the load.
        name: &'static str,
        /// Amplitude of that load, N or N·m.
        got: f64,
        /// Keys of the loads that the structure accepts.
        accepted: String,
    },
    /// The section `[structure]` describes no valid structure, or the rig does not fit it.
    #[error(transparent)]
    Structure(#[from] StructureSectionError),
    /// The base identifier or the node ids are not valid.
    #[error("network: {0}")]
    Network(#[from] NetworkError),
    /// The protocol can't state the sample rate.
    #[error("simulation.rate_hz is {got_hz}: it must be an integer from 1 to 65535 Hz", got_hz = short(.got_hz))]
    Rate {
        /// Sample rate that was given, Hz.
        got_hz: f64,
    },
    /// The bus can't carry the samples.
    #[error(
        "simulation.rate_hz is {rate_hz}: frames and heartbeats take up to {bits_per_second} bit/s, {percent:.1} % of {} \
         lower the rate to {most_hz}{}", carried(*.rates), raised(*.enough)
    )]
    Overload {
        /// Sample rate that the scenario states, Hz.
        rate_hz: u16,
        /// Bits sent in a second, with the largest possible number of stuff bits.
        bits_per_second: u64,
        /// The bit rates of the bus.
        rates: BitRates,
        /// Share of the bus that the load takes, %.
        percent: f64,
        /// The largest sample rate that fits, Hz.
        most_hz: f64,
        /// The bit rate that alone would have to be larger, if one within its range does, and the least that does, Hz.
        enough: Option<(&'static str, f64)>,
    },
    /// The sample rate is too low for real time.
    #[error(
        "simulation.rate_hz is {got_hz}: a run in real time needs at least {} Hz; lockstep and free runs take any rate",
        resonarm_protocol::timing::REAL_TIME_RATE_MIN_HZ
    )]
    RealTimeRate {
        /// Sample rate that was given, Hz.
        got_hz: u16,
    },
    /// The load exceeds what the exciter can produce or the protocol can state.
    #[error("{name} is {got}, beyond {limit_name}, {limit} {unit}: {fix}", got = short(.got), limit = short(.limit))]
    BeyondLimit {
        /// Key of the load.
        name: String,
        /// Value that was given, in the unit of the key.
        got: f64,
        /// Key or property that sets the limit.
        limit_name: &'static str,
        /// The limit, in the same unit.
        limit: f64,
        /// The unit of both values.
        unit: &'static str,
        /// Remedy that the message suggests, in words.
        fix: &'static str,
    },
    /// The load does not point along the shaker.
    #[error(
        "{section}.amplitude does not point along the shaker, at {direction_deg}° to the x axis: give `exciter_x` and `exciter_y` in \
         that direction alone, turn the shaker (`rig.shaker.direction_deg`), or leave `[rig.shaker]` out for an ideal exciter, which \
         takes torques, too", direction_deg = short(.direction_deg)
    )]
    AcrossShaker {
        /// Section of the load, `excitation` or `control`.
        section: String,
        /// Direction of the shaker, degrees.
        direction_deg: f64,
    },
    /// A number is outside its valid range.
    #[error("{name} is {got}: it must be {expected}", got = short(.got))]
    Value {
        /// Key of the number.
        name: String,
        /// Value that was given.
        got: f64,
        /// Valid values, in words.
        expected: &'static str,
    },
    /// A limit is on a sensor that the scenario does not have.
    #[error("limits.sensors.{sensor}: there is no such sensor: [rig.sensors] has {known}")]
    NoSuchSensor {
        /// Name that was given.
        sensor: InstrumentName,
        /// Names of the sensors.
        known: String,
    },
    /// The run has more samples than can be counted.
    #[error(
        "simulation.duration_s is {}, which is {} samples: at most {most} can be simulated; leave it out for a run without end",
        short(.duration_s), short(.samples)
    )]
    TooLong {
        /// Duration that was given, s.
        duration_s: f64,
        /// Number of samples in that duration.
        samples: f64,
        /// Largest number of samples.
        most: u64,
    },
    /// The scenario has nothing for an exciter to play.
    #[error(
        "the scenario has neither [excitation] nor [control]: add one, as scenarios/bench.toml and scenarios/demo.toml show"
    )]
    NoExcitation,
    /// The recording's configuration has no scenario.
    #[error("the recording has no scenario in its configuration: it was not made by a run of the plant")]
    NotInRecording,
}

impl ScenarioError {
    /// The number of a key is outside its valid range.
    pub(crate) fn value(name: impl Into<String>, got: impl Into<f64>, expected: &'static str) -> ScenarioError {
        ScenarioError::Value { name: name.into(), got: got.into(), expected }
    }

    /// A load that a structure does not accept, by its key, with the keys of those that it accepts.
    pub fn idle_load(name: &'static str, got: f64, accepted: impl Iterator<Item = String>) -> ScenarioError {
        let accepted: Vec<String> = accepted.collect();
        ScenarioError::IdleLoad { name, got, accepted: accepted.join(", ") }
    }
}

fn carried(BitRates { nominal_hz, data_hz }: BitRates) -> String {
    if nominal_hz == data_hz {
        format!("network.bit_rate_hz, {nominal_hz};")
    } else {
        format!("network.bit_rate_hz, {nominal_hz}, and data_bit_rate_hz, {data_hz};")
    }
}

fn raised(enough: Option<(&str, f64)>) -> String {
    enough.map_or(String::new(), |(name, least_hz)| format!(", or raise {name} to {least_hz}"))
}

impl From<WireError> for ScenarioError {
    fn from(error: WireError) -> ScenarioError {
        ScenarioError::Wire(Box::new(error))
    }
}
