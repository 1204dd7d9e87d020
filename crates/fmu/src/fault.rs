//! Errors of FMI calls.

use std::path::PathBuf;

use thiserror::Error;

use resonarm_bench::plant::PlantError;
use resonarm_bench::rig::Load;
use resonarm_files::recording::RecordingError;
use resonarm_numeric::number::short;
use resonarm_scenario::ScenarioError;
use resonarm_session::run::RunError;

use crate::content::VERSION;
use crate::instance::State;

/// Error of an FMI call; the importer reads it in its log.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Fault {
    /// The resources lack a file, or it can't be read.
    #[error("{}: {reason}: expected the whole FMU unpacked, and its folder `resources` as `resourcePath`", path.display())]
    Resource {
        /// Path of the resource.
        path: PathBuf,
        /// Reason why the resources are invalid.
        reason: String,
    },
    /// The importer names no folder of resources.
    #[error("`resourcePath` is missing: the FMU needs its folder `resources`, which has its scenario")]
    NoResources,
    /// The resources are of another version than the library.
    #[error(
        "the resources are of version {got}, but the library is of version {VERSION}: export the FMU again with `resonarm fmu`"
    )]
    Version {
        /// Version of the resources.
        got: String,
    },
    /// The token is not that of the resources.
    #[error(
        "the instantiation token is {got}, but that of the resources is {expected}: modelDescription.xml and \
         resources are of different FMUs, or were edited; export the FMU again"
    )]
    Token {
        /// Token that the importer gave.
        got: String,
        /// Instantiation token stored in the resources.
        expected: String,
    },
    /// The scenario is impossible.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The run can't be made.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The simulation of the plant failed.
    #[error("the simulation failed at {0}")]
    Plant(#[from] PlantError),
    /// A recording can't be written.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The call is one that this FMU does not support, or has an invalid argument. The importer sees no more of it than
    /// the status `fmi3Error` and this text.
    #[error("{0}")]
    Call(String),
    /// The call is not one of this state.
    #[error("not allowed in {state}: it is allowed in {legal}")]
    WrongState {
        /// The state of the instance.
        state: State,
        /// States in which the call is allowed.
        legal: &'static str,
    },
    /// A value that a variable can't have.
    #[error("`{name}` is {got}: it must be a finite number", got = short(.got))]
    Value {
        /// Name of the variable.
        name: String,
        /// Value that the importer set.
        got: f64,
    },
    /// A load beyond the exciter's limits or direction.
    #[error(
        "the load is {:?} N, {:?} N·m: the exciter can't produce it; its limits are {limit_n} N and {limit_nm} N·m \
         (rig.exciter of the scenario)", .load.forces_n(), .load.torques_nm(), limit_n = short(.limit_n), limit_nm = short(.limit_nm)
    )]
    Load {
        /// The load that was set, which the exciter can't produce.
        load: Load,
        /// Largest force of the exciter, N.
        limit_n: f64,
        /// Largest torque of the exciter, N·m.
        limit_nm: f64,
    },
    /// The recording already has what the state would take back.
    #[error(
        "the recording already contains samples after this state, up to sample {sample}: keep a \
         state from fmi3GetFMUState for as long as you may return to it, or leave `parameter.recording` empty"
    )]
    Recorded {
        /// The last sample in the file.
        sample: u64,
    },
    /// A saved state that is not of this FMU, with what differs.
    #[error("the bytes are not a state of this FMU: {0}")]
    Saved(&'static str),
    /// A terminal received bytes that end within an operation, or has frames that nobody fetches.
    #[error("`{name}`: {reason}")]
    Terminal {
        /// Name of the terminal.
        name: String,
        /// What is wrong with its bytes.
        reason: String,
    },
    /// A bus without a bit rate.
    #[error("the scenario gives no network.bit_rate_hz: a bus on which frames take time needs it")]
    NoBitRate,
    /// A node that works at another bit rate.
    #[error(
        "node{node} works at {got_hz} bit/s, but the bus at {expected_hz} (network.{key}): give both FMUs the same bit rate"
    )]
    BitRate {
        /// The number of its terminal, from 1.
        node: usize,
        /// The key of the bus's scenario.
        key: &'static str,
        /// Bit rate of the node, bit/s.
        got_hz: u32,
        /// Bit rate of the bus, bit/s.
        expected_hz: u32,
    },
    /// Something panicked, with this message, which is a defect of the library.
    #[error("internal error in the library: {0}; please report it")]
    Panic(String),
}

impl Fault {
    /// The error of a function that the description says is not to be called.
    pub(crate) fn not_offered(why: &str) -> Fault {
        Fault::Call(format!("this FMU does not support the function: {why}"))
    }

    /// The message in the importer's log: an error of a call itself begins with the name of the function.
    pub(crate) fn in_call(&self, call: &str) -> String {
        match self {
            Fault::WrongState { .. } => format!("{call} is {self}"),
            Fault::Call(_) | Fault::Saved(_) | Fault::Recorded { .. } | Fault::Panic(_) => format!("{call}: {self}"),
            _ => self.to_string(),
        }
    }
}
