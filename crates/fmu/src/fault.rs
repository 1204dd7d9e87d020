//! Errors of FMI calls.

use std::path::PathBuf;

use thiserror::Error;

use resonarm_bench::plant::PlantError;
use resonarm_bench::rig::Load;
use resonarm_files::recording::RecordingError;
use resonarm_numeric::number::short;
use resonarm_scenario::ScenarioError;
use resonarm_session::run::RunError;

use crate::state::State;

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
        "the resources are of version {got}, but the library is of version {expected}: export the FMU again with `resonarm fmu`"
    )]
    Version {
        /// Version of the resources.
        got: String,
        /// Version of the library.
        expected: &'static str,
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
    /// The call is one that this FMU does not support, or has an invalid argument.
    #[error(transparent)]
    Call(#[from] WrongCall),
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
        "the load is {load}: the exciter can't produce it; its limits are {limit_n} N and {limit_nm} N·m (rig.exciter of \
         the scenario)",
        limit_n = short(.limit_n), limit_nm = short(.limit_nm)
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
    /// Bytes that end within an operation.
    #[error(
        "`{name}`: the operation at byte {at} has {got} bytes, expected {expected}: the bytes were cut off, or are not \
         operations of FMI-LS-BUS"
    )]
    Operation {
        /// Name of the terminal that received the bytes.
        name: String,
        /// Byte at which the operation begins.
        at: usize,
        /// The bytes that are left from there on.
        got: usize,
        /// Length that the operation states, bytes.
        expected: usize,
    },
    /// Frames that nobody fetches.
    #[error("`{name}`: {bytes} bytes wait to be sent: the importer never activates the clock `{name}.Tx_Clock`")]
    Untaken {
        /// Name of the terminal with the waiting frames.
        name: String,
        /// The bytes that wait.
        bytes: usize,
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

/// Reason why an FMI call is refused.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum WrongCall {
    /// A kind of instance that the FMU does not offer.
    #[error("the FMU supports co-simulation only: call fmi3InstantiateCoSimulation")]
    NotCoSimulation,
    /// The importer does not use event mode, without which no frame moves.
    #[error("eventModeUsed is false: the FMU exchanges frames only in event mode; set eventModeUsed to true")]
    NeedsEventMode,
    /// A text is not UTF-8.
    #[error("{what} is not UTF-8")]
    NotUtf8 {
        /// Name of the argument that is not UTF-8.
        what: &'static str,
    },
    /// A pointer is NULL.
    #[error("{what} is NULL")]
    Null {
        /// Name of the argument that is NULL.
        what: &'static str,
    },
    /// The function is not one of this FMU.
    #[error("this FMU does not support the function: {why}")]
    NotOffered {
        /// Capability that the model description states.
        why: &'static str,
    },
    /// No variable has the value reference.
    #[error("no variable has the value reference {got}: it must be from 0 to {most}")]
    UnknownReference {
        /// Value reference that no variable has.
        got: u32,
        /// Largest value reference of the FMU.
        most: usize,
    },
    /// A variable of another type.
    #[error("`{name}` is of the type {is}: use the function for that type")]
    WrongType {
        /// Name of the variable.
        name: String,
        /// Type of the variable in the model description.
        is: &'static str,
    },
    /// A variable that can't be set now.
    #[error("`{name}` can't be set in {state}: {why}")]
    NotSettable {
        /// Name of the variable.
        name: String,
        /// The state of the instance.
        state: State,
        /// States in which the variable can be set.
        why: &'static str,
    },
    /// Another number of values than of value references.
    #[error("got {values} values for {references} value references: expected one value for each")]
    Lengths {
        /// Number of value references given.
        references: usize,
        /// Number of values given.
        values: usize,
    },
    /// The start time is not finite.
    #[error("the start time is {got_s} s: it must be finite")]
    StartTime {
        /// Start time that was given, s.
        got_s: f64,
    },
    /// The step does not begin where the last one ended.
    #[error("the step begins at {got_s} s: it must begin at {at_s} s, the time of the FMU")]
    StepStart {
        /// Time at which the step begins, s.
        got_s: f64,
        /// Time of the FMU, s.
        at_s: f64,
    },
    /// The length of a step is impossible.
    #[error("the length of the step is {got_s} s: it must be finite and not negative")]
    StepSize {
        /// Requested length of the step, s.
        got_s: f64,
    },
    /// Time does not advance by the step.
    #[error("the step of {got_s} s is too small: it does not advance the time {at_s} s; make a longer step")]
    StepTooSmall {
        /// Requested length of the step, s.
        got_s: f64,
        /// Time at which the step begins, s.
        at_s: f64,
    },
    /// A buffer of another length than the state has.
    #[error("got {got} bytes: the state has {expected}")]
    SavedLength {
        /// Length of the buffer given, bytes.
        got: usize,
        /// Length of the state, bytes.
        expected: usize,
    },
}

impl Fault {
    /// The message in the importer's log: an error of a call itself begins with the name of the function.
    pub(crate) fn in_call(&self, call: &str) -> String {
        match self {
            Fault::WrongState { .. } => format!("{call} is {self}"),
            Fault::Call(_) | Fault::Saved(_) | Fault::Recorded { .. } | Fault::Panic(_) => format!("{call}: {self}"),
            _ => self.to_string(),
        }
    }
}
