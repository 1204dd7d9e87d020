//! Errors of planning and running surveys.

use std::io;
use std::path::PathBuf;

use serde_json::Value;
use thiserror::Error;

use crate::run::RunError;
use resonarm_files::recording::RecordingError;
use resonarm_numeric::number::short;
use resonarm_scenario::{ScenarioError, StructureKind};

/// Error of a survey.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SurveyError {
    /// The scenario can't be used.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A run of the plan can't start.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A recording can't be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The structure's equations are not known.
    #[error(
        "the structure is of the kind {kind}: a survey is planned by the modes of a structure whose equations the scenario states; \
         record its runs yourself, and list them with --from"
    )]
    NoEquations {
        /// Kind of the structure.
        kind: StructureKind,
    },
    /// A place is not on the structure.
    #[error("{flag} {got}: the structure has no such point or degree of freedom; there are {known}")]
    Place {
        /// The flag that names it.
        flag: &'static str,
        /// Name that was given.
        got: String,
        /// Names of the degrees of freedom.
        known: String,
    },
    /// The name of a degree of freedom is too long for the rig.
    #[error("the name `{got}` has more than 31 bytes: give its point a shorter name")]
    LongPlace {
        /// Name of the degree of freedom.
        got: String,
    },
    /// A group has more accelerometers than a rig.
    #[error(
        "--sensors: group {group} has {got} degrees of freedom besides that of the exciter: a run takes at most {most}; split it \
         into several --sensors"
    )]
    TooManySensors {
        /// Number of the group, from 1.
        group: usize,
        /// Number of accelerometers besides the one at the exciter.
        got: usize,
        /// The largest number of them that is possible.
        most: usize,
    },
    /// A number is outside its valid range.
    #[error("{flag} is {got}: it must be {expected}", got = short(.got))]
    Value {
        /// Name of the flag, as it is written.
        flag: &'static str,
        /// Value that was given.
        got: f64,
        /// Valid values, in words.
        expected: String,
    },
    /// A level is given twice.
    #[error("--levels has {level} twice: give each level once", level = short(.level))]
    SameLevel {
        /// The level that was stated.
        level: f64,
    },
    /// Neither the scenario nor the request states a force.
    #[error("the scenario has no force at the exciter: give its peak by --force-n")]
    NoForce,
    /// No mode fits the sample rate.
    #[error(
        "the lowest mode is at {lowest_hz:.3} Hz, too high for the sample rate of {rate_hz} Hz: raise simulation.rate_hz to {needed_hz:.0} or more",
        rate_hz = short(.rate_hz)
    )]
    NoMode {
        /// Frequency of the lowest mode that vibrates, Hz.
        lowest_hz: f64,
        /// Sample rate of the scenario, Hz.
        rate_hz: f64,
        /// Least sample rate for this mode, Hz.
        needed_hz: f64,
    },
    /// No mode of the structure vibrates.
    #[error("no mode of the structure vibrates: there is nothing to survey")]
    Rigid,
    /// The duration can't be derived from the damping.
    #[error("mode {mode} has no damping, from which the duration would follow: give --duration-s")]
    Undamped {
        /// Number of the mode, from 1.
        mode: usize,
    },
    /// The folder holds another survey.
    #[error(
        "{} holds another survey: there {key} is {had}, here {has}; repeat the command that began it to continue it, choose \
         another folder, or allow overwriting it (--overwrite)", path.display()
    )]
    Differs {
        /// The index in the folder.
        path: PathBuf,
        /// The first key that differs, as `plan.seed`.
        key: String,
        /// Its value in the folder.
        had: Value,
        /// Its value in this survey.
        has: Value,
    },
    /// A file is there that is not of this survey.
    #[error("{} already exists: choose another folder, or allow overwriting it (--overwrite)", path.display())]
    Exists {
        /// File that would be overwritten.
        path: PathBuf,
    },
    /// Another process works in the folder.
    #[error("{} is in use by another process: wait until it has ended, or choose another folder", path.display())]
    InUse {
        /// Folder of the survey.
        path: PathBuf,
    },
    /// The index can't be read.
    #[error("can't read {}: {source}", path.display())]
    Read {
        /// Path of the index.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file is no index of a survey.
    #[error("{} is not the index of a survey: {reason}", path.display())]
    NotAnIndex {
        /// Path of the file.
        path: PathBuf,
        /// Reason why the run failed, in words.
        reason: String,
    },
    /// A file or the folder can't be written.
    #[error("can't write {}: {source}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}
