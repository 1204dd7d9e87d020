//! Why a call of FMI fails.

use std::path::PathBuf;

use thiserror::Error;

use resonarm_bench::plant::PlantError;
use resonarm_files::recording::RecordingError;
use resonarm_numeric::number::short;
use resonarm_scenario::ScenarioError;
use resonarm_session::run::RunError;

use crate::instance::State;

/// Why a call of FMI fails; the importer reads it in its log.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Fault {
    /// The resources lack a file, or it can't be read.
    #[error("{}: {reason}: the FMU must be unpacked whole, and `resourcePath` name its folder `resources`", path.display())]
    Resource {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The importer names no folder of resources.
    #[error("`resourcePath` is missing: the FMU needs its folder `resources`, which has its scenario")]
    NoResources,
    /// The resources are of another version than the library.
    #[error("the resources are of version {got}, the library of {library}: export the FMU anew by `resonarm fmu`")]
    Version {
        /// Of the resources.
        got: String,
        /// Of the library.
        library: &'static str,
    },
    /// The token is not that of the resources.
    #[error(
        "the instantiation token is {got}, that of the resources is {expected}: modelDescription.xml and resources are of \
         different FMUs, or were edited"
    )]
    Token {
        /// What the importer gave.
        got: String,
        /// Of the resources.
        expected: String,
    },
    /// A kind of instance that the FMU does not offer.
    #[error("{call}: the FMU is one for co-simulation alone: call fmi3InstantiateCoSimulation")]
    NotCoSimulation {
        /// The call.
        call: &'static str,
    },
    /// The scenario is impossible.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The run can't be made.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The simulation failed.
    #[error("the simulation failed at {0}")]
    Plant(#[from] PlantError),
    /// A recording can't be written.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A text is not UTF-8.
    #[error("{call}: {what} is not UTF-8")]
    NotUtf8 {
        /// The call.
        call: &'static str,
        /// The argument.
        what: &'static str,
    },
    /// A pointer is null.
    #[error("{call}: {what} is NULL")]
    Null {
        /// The call.
        call: &'static str,
        /// The argument.
        what: &'static str,
    },
    /// The call is not one of this state.
    #[error("{call} is not allowed in {state}: it is in {legal}")]
    WrongState {
        /// The call.
        call: &'static str,
        /// The state of the instance.
        state: State,
        /// The states in which it is.
        legal: &'static str,
    },
    /// The function is not one of this FMU.
    #[error("{call}: this FMU does not have what it is for: {why}")]
    NotOffered {
        /// The call.
        call: &'static str,
        /// What the model description says of it.
        why: &'static str,
    },
    /// No variable has the value reference.
    #[error("{call}: no variable has the value reference {got}: they are from 0 to {most}")]
    UnknownReference {
        /// The call.
        call: &'static str,
        /// The value reference.
        got: u32,
        /// The largest one.
        most: u32,
    },
    /// A variable of another type.
    #[error("{call}: `{name}` is of the type {is}")]
    WrongType {
        /// The call.
        call: &'static str,
        /// The variable.
        name: String,
        /// Its type.
        is: &'static str,
    },
    /// A variable that can't be set now.
    #[error("{call}: `{name}` can't be set in {state}: {why}")]
    NotSettable {
        /// The call.
        call: &'static str,
        /// The variable.
        name: String,
        /// The state of the instance.
        state: State,
        /// When it can.
        why: &'static str,
    },
    /// Another number of values than of value references.
    #[error("{call}: {values} values for {references} value references")]
    Lengths {
        /// The call.
        call: &'static str,
        /// Value references given.
        references: usize,
        /// Values given.
        values: usize,
    },
    /// A value that a variable can't have.
    #[error("`{name}` is {got}: it must be {expected}", got = short(.got))]
    Value {
        /// The variable.
        name: String,
        /// The value.
        got: f64,
        /// The valid values.
        expected: &'static str,
    },
    /// A load beyond the exciter's limits or direction.
    #[error(
        "the load is {force_n:?} N, {torque_nm:?} N·m: the exciter can't produce it (rig.exciter of the scenario: {limit_n} N, \
         {limit_nm} N·m)", limit_n = short(.limit_n), limit_nm = short(.limit_nm)
    )]
    Load {
        /// Force along x and y, N.
        force_n: [f64; 2],
        /// Torque at the joints, N·m.
        torque_nm: [f64; 2],
        /// Largest force, N.
        limit_n: f64,
        /// Largest torque, N·m.
        limit_nm: f64,
    },
    /// The start time is none.
    #[error("fmi3EnterInitializationMode: the start time is {got_s} s: it must be finite")]
    StartTime {
        /// What was given, s.
        got_s: f64,
    },
    /// The step does not begin where the last one ended.
    #[error("fmi3DoStep: the step begins at {got_s} s: the FMU is at {at_s} s")]
    StepStart {
        /// Where it begins, s.
        got_s: f64,
        /// Where the FMU is, s.
        at_s: f64,
    },
    /// The length of a step is impossible.
    #[error("fmi3DoStep: the step is of {got_s} s: it must be finite and not negative")]
    StepSize {
        /// Its length, s.
        got_s: f64,
    },
    /// Time does not advance by the step.
    #[error("fmi3DoStep: the step of {got_s} s is too small: at {at_s} s time does not advance by it")]
    StepTooSmall {
        /// Its length, s.
        got_s: f64,
        /// Where it begins, s.
        at_s: f64,
    },
    /// The recording already has what the state would take back.
    #[error(
        "fmi3SetFMUState: the file of the recording already has what came behind this state, up to sample {sample}: keep a state \
         from fmi3GetFMUState for as long as it may be returned to, or leave `parameter.recording` empty"
    )]
    Recorded {
        /// The last sample in the file.
        sample: u64,
    },
    /// A saved state that is not of this FMU.
    #[error("{call}: the bytes are not a state of this FMU: {reason}")]
    Saved {
        /// The call.
        call: &'static str,
        /// What differs.
        reason: &'static str,
    },
    /// A buffer of another length than the state has.
    #[error("{call}: {got} bytes: the state has {expected}")]
    SavedLength {
        /// The call.
        call: &'static str,
        /// The length given.
        got: usize,
        /// The length of the state.
        expected: usize,
    },
    /// The importer does not use event mode, without which no frame moves.
    #[error(
        "fmi3InstantiateCoSimulation: eventModeUsed is false: frames move in event mode alone; import the FMU with events"
    )]
    NeedsEventMode,
    /// Bytes that end within an operation.
    #[error(
        "`{name}`: the operation at byte {at} is of {expected} bytes, and {got} are there: the bytes were cut, or are not operations \
         of FMI-LS-BUS"
    )]
    Operation {
        /// The terminal.
        name: String,
        /// Where it begins.
        at: usize,
        /// The bytes that are left from there on.
        got: usize,
        /// Its length.
        expected: usize,
    },
    /// Frames that nobody fetches.
    #[error("`{name}`: {bytes} bytes wait to be sent: the importer lets the clock `{name}.Tx_Clock` not tick")]
    Untaken {
        /// The terminal.
        name: String,
        /// The bytes that wait.
        bytes: usize,
    },
    /// A bus without a bit rate.
    #[error("the scenario names no network.bit_rate_hz: a bus on which frames take their time needs it")]
    NoBitRate,
    /// A node that works at another bit rate.
    #[error("node{node} works at {got_hz} bit/s, the bus at {expected_hz} (network.{key}): give both FMUs the same")]
    BitRate {
        /// The number of its terminal, from 1.
        node: usize,
        /// The key of the bus's scenario.
        key: &'static str,
        /// Of the node, Hz.
        got_hz: u32,
        /// Of the bus, Hz.
        expected_hz: u32,
    },
    /// Something panicked, which is a defect of the library.
    #[error("{call}: internal error in the library: {reason}; please report it")]
    Panic {
        /// The call.
        call: &'static str,
        /// What it said.
        reason: String,
    },
}
