//! Errors that end a command, and their exit codes.

use core::fmt::Display;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use thiserror::Error;

use resonarm::analysis::AnalysisError;
use resonarm::analysis::time_domain::TimeDomainError;
use resonarm::bus::BusError;
use resonarm::export::ExportError;
use resonarm::identification::IdentificationError;
use resonarm::identify::IdentifyError;
use resonarm::import::ImportError;
use resonarm::integrate::IntegrateError;
use resonarm::plant::PlantSpecError;
use resonarm::realtime::RateError;
use resonarm::recording::RecordingError;
use resonarm::replay::ReplayError;
use resonarm::responses::ResponsesError;
use resonarm::run::RunError;
use resonarm::scenario::specification::SpecificationFileError;
use resonarm::scenario::structure::StructureFileError;
use resonarm::scenario::{ScenarioError, StructureSectionError};
use resonarm::structure::StepError;
use resonarm::study::{JournalError, StudyError};
use resonarm::survey::SurveyError;
use resonarm_figures::paper::PaperError;
use resonarm_figures::plot::PlotError;
use resonarm_numeric::number::short;

/// The verdict of a command that completed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    Positive,
    Negative,
}

impl Verdict {
    pub const fn of(positive: bool) -> Verdict {
        if positive { Verdict::Positive } else { Verdict::Negative }
    }

    /// Returns the verdict on both: positive if both are.
    pub fn and(self, other: Verdict) -> Verdict {
        if self == Verdict::Positive { other } else { Verdict::Negative }
    }
}

/// The error that ended a command.
#[derive(Debug, Error)]
pub(crate) enum Failure {
    #[error("{0}")]
    Usage(String),
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    #[error(transparent)]
    Specification(#[from] SpecificationFileError),
    #[error(transparent)]
    Plant(#[from] PlantSpecError),
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    #[error(transparent)]
    Step(#[from] StepError),
    #[error(transparent)]
    Rate(#[from] RateError),
    #[error(transparent)]
    Bus(#[from] BusError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error(transparent)]
    Replay(#[from] ReplayError),
    #[error(transparent)]
    Export(#[from] ExportError),
    #[error(transparent)]
    Fmu(#[from] resonarm_fmu::export::ExportError),
    #[error(transparent)]
    Import(#[from] ImportError),
    #[error(transparent)]
    Responses(#[from] ResponsesError),
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    #[error(transparent)]
    Identification(#[from] IdentificationError),
    #[error(transparent)]
    Run(#[from] RunError),
    #[cfg(feature = "live")]
    #[error(transparent)]
    Live(#[from] resonarm_live::LiveError),
    #[error(transparent)]
    Plot(#[from] PlotError),
    #[error(transparent)]
    Analysis(#[from] AnalysisError),
    #[error("along {along}: {source}{}{}", continuation_hint(source), kept_so_far(kept))]
    BranchEndedEarly { along: String, source: AnalysisError, kept: usize },
    #[error(transparent)]
    Paper(#[from] PaperError),
    #[error(transparent)]
    TimeDomain(#[from] TimeDomainError),
    #[error(transparent)]
    Study(#[from] StudyError),
    #[error(transparent)]
    Survey(#[from] SurveyError),
    #[error("can't write {}: {source}", path.display())]
    Write { path: PathBuf, source: io::Error },
    #[error("{} already exists: choose another place, or allow overwriting it (--overwrite)", path.display())]
    Exists { path: PathBuf },
    #[error("{} can't be written over itself, since this command reads it: name another file for the result", path.display())]
    SameFile { path: PathBuf },
    #[error("can't write to standard output: {0}")]
    Output(io::Error),
    #[error("the result can't be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
    #[error("can't start the {what}: {source}")]
    Start { what: &'static str, source: io::Error },
    #[error("the {0} ended in a panic; the message above says where")]
    Panic(&'static str),
    #[error("standard output was closed")]
    BrokenPipe,
}

/// The exit codes other than success.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Exit {
    Negative = 1,
    Usage = 2,
    Environment = 3,
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Failure {
        if error.kind() == io::ErrorKind::BrokenPipe { Failure::BrokenPipe } else { Failure::Output(error) }
    }
}

impl Failure {
    /// Makes the failure of a wrong request, or of wrong input.
    pub fn usage(problem: impl Into<String>) -> Failure {
        Failure::Usage(problem.into())
    }

    /// Makes the failure of writing a file or a folder from the system's reason.
    pub fn write(path: &Path) -> impl Fn(io::Error) -> Failure {
        move |source| Failure::Write { path: path.to_path_buf(), source }
    }

    /// Makes the failure of a flag with a value that it can't have.
    pub fn value(flag: &str, got: f64, why: impl Display) -> Failure {
        Failure::usage(format!("{flag} is {}: {why}", short(&got)))
    }

    /// Says whether memory, threads or file descriptors have run out.
    fn is_exhaustion(&self) -> bool {
        let mut cause: Option<&(dyn core::error::Error + 'static)> = Some(self);
        while let Some(error) = cause {
            // Errors that are cloned keep their `io::Error` in an `Arc`, which is a type of its own to
            // `downcast_ref`.
            let kept = error.downcast_ref::<Arc<io::Error>>().map(|error| &**error);
            if error.downcast_ref::<io::Error>().or(kept).is_some_and(is_exhausted) {
                return true;
            }
            // This error keeps only the kind of its cause.
            if let Some(StructureSectionError::Read { kind: io::ErrorKind::OutOfMemory, .. }) = error.downcast_ref() {
                return true;
            }
            cause = error.source();
        }
        false
    }

    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.exit() as u8)
    }

    fn exit(&self) -> Exit {
        match self {
            // Exhaustion says nothing about the request, whatever failed because of it.
            _ if self.is_exhaustion() => Exit::Environment,
            Failure::Bus(error) => bus(error),
            Failure::Recording(error) => recording(error),
            Failure::Replay(ReplayError::Bus(error)) => bus(error),
            Failure::Replay(ReplayError::Recording(error))
            | Failure::Export(ExportError::Recording(error))
            | Failure::Import(ImportError::Recording(error))
            | Failure::Identification(IdentificationError::Recording(error)) => recording(error),
            Failure::Replay(ReplayError::Simulation(_)) => Exit::Negative,
            Failure::Replay(ReplayError::NoController { .. }) => Exit::Environment,
            Failure::Run(error) => run(error),
            Failure::Scenario(error) => scenario(error),
            Failure::Fmu(resonarm_fmu::export::ExportError::NoLibrary { .. }) => Exit::Environment,
            Failure::Analysis(source) | Failure::BranchEndedEarly { source, .. } => analysis(source),
            Failure::Integrate(error) => integrate(error),
            Failure::Step(error) => step(error),
            Failure::TimeDomain(TimeDomainError::Step { source, .. })
            | Failure::Study(StudyError::TimeDomain(TimeDomainError::Step { source, .. })) => step(source),
            Failure::Paper(PaperError::Settings(_) | PaperError::Measured(_)) => Exit::Usage,
            Failure::Paper(_) => Exit::Negative,
            Failure::Study(StudyError::Journal(JournalError::Write { .. } | JournalError::InUse { .. })) => {
                Exit::Environment
            }
            Failure::Survey(error) => survey(error),
            Failure::Write { source, .. }
            | Failure::Export(ExportError::Write { source, .. })
            | Failure::Plot(PlotError::Write { source, .. })
            | Failure::Fmu(resonarm_fmu::export::ExportError::Write { source, .. }) => written(source),
            #[cfg(feature = "live")]
            Failure::Live(error) => live(error),
            Failure::Output(_) | Failure::Start { .. } | Failure::Panic(_) | Failure::Json(_) => Exit::Environment,
            _ => Exit::Usage,
        }
    }
}

/// Says whether a system call failed since memory, threads or file descriptors have run out.
fn is_exhausted(error: &io::Error) -> bool {
    // EAGAIN is what a new thread gets at the limit of processes (pthread_create(3), RLIMIT_NPROC).
    let numbers = [libc::ENOMEM, libc::EMFILE, libc::ENFILE, libc::EAGAIN];
    error.kind() == io::ErrorKind::OutOfMemory || error.raw_os_error().is_some_and(|number| numbers.contains(&number))
}

/// Returns the exit code for a file that can't be written: a folder that does not exist is a wrong request.
fn written(error: &io::Error) -> Exit {
    match error.kind() {
        io::ErrorKind::NotFound
        | io::ErrorKind::NotADirectory
        | io::ErrorKind::IsADirectory
        | io::ErrorKind::AlreadyExists
        | io::ErrorKind::InvalidInput
        | io::ErrorKind::InvalidFilename
        // A file of another kind has the name.
        | io::ErrorKind::Other => Exit::Usage,
        _ => Exit::Environment,
    }
}

fn bus(error: &BusError) -> Exit {
    match error {
        BusError::Address { .. } | BusError::MemoryIsNotShared => Exit::Usage,
        _ => Exit::Environment,
    }
}

#[cfg(feature = "live")]
fn live(error: &resonarm_live::LiveError) -> Exit {
    use resonarm_live::LiveError;
    match error {
        LiveError::Address { .. } | LiveError::Origin { .. } => Exit::Usage,
        LiveError::Listen { .. } | LiveError::Random(_) | LiveError::Thread(_) => Exit::Environment,
    }
}

fn analysis(error: &AnalysisError) -> Exit {
    match error {
        AnalysisError::Interval { .. }
        | AnalysisError::StateSize { .. }
        | AnalysisError::LoadOrder { .. }
        | AnalysisError::LoadHarmonics
        | AnalysisError::NoMode { .. }
        | AnalysisError::NoResonance { .. }
        | AnalysisError::NotLinear { .. }
        | AnalysisError::Dissipates { .. } => Exit::Usage,
        // The others are found on the way along a branch: they say something of the structure, not of the request.
        _ => Exit::Negative,
    }
}

/// Returns the exit code for an error of integration: a response that can't be integrated further is a verdict on the
/// excitation, not a wrong request.
fn integrate(error: &IntegrateError) -> Exit {
    match error {
        IntegrateError::NoConvergence { .. } | IntegrateError::Unbalanced { .. } | IntegrateError::NotFinite { .. } => {
            Exit::Negative
        }
        _ => Exit::Usage,
    }
}

fn step(error: &StepError) -> Exit {
    match error {
        StepError::Integrate(source) => integrate(source),
        StepError::TooStiff { .. } => Exit::Negative,
        _ => Exit::Usage,
    }
}

fn survey(error: &SurveyError) -> Exit {
    match error {
        SurveyError::Scenario(error) => scenario(error),
        SurveyError::Run(error) => run(error),
        SurveyError::Recording(error) => recording(error),
        SurveyError::Write { source, .. } => written(source),
        SurveyError::InUse { .. } => Exit::Environment,
        _ => Exit::Usage,
    }
}

fn recording(error: &RecordingError) -> Exit {
    match error {
        RecordingError::Create { source, .. } => written(source),
        RecordingError::Write { .. } | RecordingError::WriterDied { .. } | RecordingError::Gone { .. } => {
            Exit::Environment
        }
        RecordingError::NothingRecovered { .. }
        | RecordingError::NothingLeft { .. }
        | RecordingError::NothingToCopy { .. } => Exit::Negative,
        _ => Exit::Usage,
    }
}

fn run(error: &RunError) -> Exit {
    match error {
        RunError::Bus(error) => bus(error),
        RunError::Recording(error) => recording(error),
        RunError::NotRecorded(_) => Exit::Negative,
        RunError::Scenario(error) => scenario(error),
        RunError::NoRealTimeThread { .. }
        | RunError::NoThread { .. }
        | RunError::NoPlant { .. }
        | RunError::PlantNotArmed { .. }
        | RunError::Histogram(_) => Exit::Environment,
        RunError::Plant(_) | RunError::Encode(_) | RunError::Periodic(_) | RunError::Stalled { .. } => Exit::Negative,
        _ => Exit::Usage,
    }
}

/// Returns the exit code for an error of a scenario: an FMU of others may need a process or a folder that the system
/// doesn't give.
fn scenario(error: &ScenarioError) -> Exit {
    match error {
        ScenarioError::Structure(StructureSectionError::File { fault, .. }) => match &**fault {
            StructureFileError::Fmu(fault) if fault.is_of_the_system() => Exit::Environment,
            _ => Exit::Usage,
        },
        _ => Exit::Usage,
    }
}

/// Returns the flags that help a continuation that ended early, in brackets after the message.
fn continuation_hint(error: &AnalysisError) -> &'static str {
    match error {
        AnalysisError::TooManyHarmonics { .. } => " (--most-harmonics)",
        AnalysisError::TooManyPoints { .. } => " (--most-points, --largest-step)",
        AnalysisError::Stuck { .. } | AnalysisError::NotLocated { .. } => " (--largest-step, --most-harmonics)",
        _ => "",
    }
}

/// Returns the end of the message of a continuation that ended early: how much of it is kept.
fn kept_so_far(responses: &usize) -> String {
    match responses {
        0 => String::new(),
        1 => String::from("; the response before that is in the results"),
        _ => format!("; the {responses} responses before that are in the results"),
    }
}
