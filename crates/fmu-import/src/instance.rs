//! An FMU that runs in a process of its own.

use std::io::{BufReader, Error, ErrorKind, PipeReader, PipeWriter, Write};

use crate::description::Version;
use crate::error::ImportError;
use crate::message::{Answer, Request, StepCall, Stepped};
use crate::process::{FarEnds, Guard};
use crate::source::Source;
use resonarm_bench::structure::{ForeignFault, StructureError};

/// The part of a step by which the time that an FMU has reached may differ: it adds up its own steps.
const TOLERANCE_STEPS: f64 = 1e-3;

/// An FMU that runs. Its process and its folder go when this is dropped.
#[derive(Debug)]
pub(crate) struct Instance {
    version: Version,
    requests: PipeWriter,
    answers: BufReader<PipeReader>,
    /// The last message of the FMU.
    last: Option<String>,
    /// The number of values that are set.
    inputs: usize,
    /// Whether it was asked to end, or has ended by itself.
    is_over: bool,
    request: Vec<u8>,
    body: Vec<u8>,
    /// Declared after the pipes, so that it is dropped after them: an FMU that waits at one of them ends then.
    _guard: Guard,
}

/// The name of a status: those of both standards have the same numbers.
fn status_name(status: Option<i32>) -> &'static str {
    match status {
        None => "NULL",
        Some(0) => "OK",
        Some(1) => "Warning",
        Some(2) => "Discard",
        Some(3) => "Error",
        Some(4) => "Fatal",
        Some(5) => "Pending",
        Some(_) => "a status that FMI does not have",
    }
}

fn is_good(status: i32) -> bool {
    matches!(status, 0 | 1)
}

/// Says how a process has ended, by its status of waitpid(2).
fn ended(status: i32) -> ForeignFault {
    if libc::WIFSIGNALED(status) {
        ForeignFault::Killed { signal: libc::WTERMSIG(status) }
    } else {
        ForeignFault::Exited { code: libc::WEXITSTATUS(status) }
    }
}

impl Instance {
    /// Loads the FMU, begins a simulation at 0, and reads its variables into `read`.
    pub fn start(source: &Source, read: &mut [f64]) -> Result<Instance, ImportError> {
        let unstarted = |error: Error| ImportError::Process { reason: error.to_string() };
        let version = source.description.version;
        let (requests_far, requests) = std::io::pipe().map_err(unstarted)?;
        let (answers, answers_far) = std::io::pipe().map_err(unstarted)?;
        let (lifeline_far, lifeline) = std::io::pipe().map_err(unstarted)?;
        let far = FarEnds { requests: requests_far, answers: answers_far, lifeline: lifeline_far };
        let unwritten = |error: Error| ImportError::Unpack { reason: error.to_string() };
        let folder = tempfile::Builder::new().prefix("resonarm-fmu-").tempdir().map_err(unwritten)?;
        let mut guard = Guard::start(source, folder.path(), far, lifeline).map_err(unstarted)?;
        // The guard removes it.
        let folder = folder.keep();
        source.archive.unpack(version.platform(), &folder)?;
        guard.load().map_err(unstarted)?;
        let mut instance = Instance {
            version,
            requests,
            answers: BufReader::new(answers),
            last: None,
            inputs: source.mapping.set.count,
            is_over: false,
            request: Vec::new(),
            body: Vec::new(),
            _guard: guard,
        };
        instance.started(read)?;
        Ok(instance)
    }

    /// Waits until the simulation has begun.
    fn started(&mut self, read: &mut [f64]) -> Result<(), ImportError> {
        let answer = self.receive(read);
        if !matches!(answer, Ok(Answer::Started)) {
            self.is_over = true;
        }
        let log = self.last_message();
        match answer {
            Ok(Answer::Started) => match read.iter().find(|value| !value.is_finite()) {
                Some(got) => {
                    let fault = ForeignFault::NotFinite { got: *got };
                    let call = self.function(StepCall::Get);
                    Err(ImportError::Start {
                        reason: StructureError::Foreign { call, t_s: 0.0, fault }.to_string(),
                        log,
                    })
                }
                None => Ok(()),
            },
            Ok(Answer::NotLoaded { reason }) => Err(ImportError::Load { reason }),
            Ok(Answer::NoFunction { name }) => Err(ImportError::Function { name }),
            Ok(Answer::Refused { function, status }) => {
                Err(ImportError::Call { call: function, status: status_name(status), log })
            }
            Ok(_) => Err(ImportError::Ended { during: "loading", fault: ForeignFault::Lost, log }),
            Err(fault) => Err(ImportError::Ended { during: "loading", fault, log }),
        }
    }

    /// The next answer that is not a message of the FMU.
    fn receive(&mut self, read: &mut [f64]) -> Result<Answer, ForeignFault> {
        loop {
            match Answer::read(&mut self.answers, &mut self.body, read) {
                Ok(Answer::Says { status, text }) => self.note(status, text),
                Ok(Answer::Ended { status }) => return Err(ended(status)),
                Ok(answer) => return Ok(answer),
                Err(_) => return Err(ForeignFault::Lost),
            }
        }
    }

    /// Notes a message, of a status as the standards number them, 1 a warning and from 2 on errors.
    fn note(&mut self, status: i32, text: String) {
        match status {
            i32::MIN..=0 => tracing::debug!("the FMU says: {text}"),
            1 => tracing::warn!("the FMU says: {text}"),
            _ => tracing::error!("the FMU says: {text}"),
        }
        self.last = Some(text);
    }

    const fn function(&self, call: StepCall) -> &'static str {
        match (self.version, call) {
            (Version::Fmi2, StepCall::Set) => "fmi2SetReal",
            (Version::Fmi2, StepCall::Step) => "fmi2DoStep",
            (Version::Fmi2, StepCall::Get) => "fmi2GetReal",
            (Version::Fmi3, StepCall::Set) => "fmi3SetFloat64",
            (Version::Fmi3, StepCall::Step) => "fmi3DoStep",
            (Version::Fmi3, StepCall::Get) => "fmi3GetFloat64",
        }
    }

    /// A communication step, which has to come to its end; then the variables are read, all finite. `set` are the values
    /// of the inputs if they have changed.
    pub fn step(
        &mut self,
        from_s: f64,
        step_s: f64,
        (sets, set): (bool, &[f64]),
        read: &mut [f64],
    ) -> Result<(), StructureError> {
        let failed = |call, fault| StructureError::Foreign { call, t_s: from_s, fault };
        let answer = self.ask(Request::Step { from_s, step_s, sets }, set, read);
        let Stepped { call, status, terminates, reached_s } = match answer {
            Ok(Answer::Stepped(stepped)) => stepped,
            other => {
                self.is_over = true;
                return Err(failed(self.function(StepCall::Step), other.err().unwrap_or(ForeignFault::Lost)));
            }
        };
        // Written so that NaN is elsewhere, too.
        let is_there = |reached_s: f64| (reached_s - (from_s + step_s)).abs() <= TOLERANCE_STEPS * step_s;
        let missed_s = reached_s.filter(|reached_s| !is_there(*reached_s));
        let function = self.function(call);
        match (call, missed_s) {
            // Tested first: an FMU that asks for the end may also discard the step, or stop before its end.
            _ if terminates => Err(failed(function, ForeignFault::Terminates)),
            (StepCall::Set | StepCall::Step, _) => {
                Err(failed(function, ForeignFault::Status(status_name(Some(status)))))
            }
            (StepCall::Get, Some(reached_s)) => {
                Err(failed(self.function(StepCall::Step), ForeignFault::Reached { reached_s }))
            }
            (StepCall::Get, None) => {
                let failed = |fault| StructureError::Foreign { call: function, t_s: from_s + step_s, fault };
                if !is_good(status) {
                    return Err(failed(ForeignFault::Status(status_name(Some(status)))));
                }
                match read.iter().find(|value| !value.is_finite()) {
                    Some(got) => Err(failed(ForeignFault::NotFinite { got: *got })),
                    None => Ok(()),
                }
            }
        }
    }

    /// Sends a request and waits for its answer.
    fn ask(&mut self, request: Request, set: &[f64], read: &mut [f64]) -> Result<Answer, ForeignFault> {
        request.write(set, &mut self.request);
        // If nobody reads it, the FMU has ended, and the next answer tells how.
        if let Err(error) = self.requests.write_all(&self.request)
            && error.kind() != ErrorKind::BrokenPipe
        {
            return Err(ForeignFault::Lost);
        }
        self.receive(read)
    }

    /// Frees the FMU and unloads its library.
    pub fn end(mut self) -> Result<(), ImportError> {
        self.finish().map_err(|fault| ImportError::Ended { during: "unloading", fault, log: self.last_message() })
    }

    fn finish(&mut self) -> Result<(), ForeignFault> {
        if core::mem::replace(&mut self.is_over, true) {
            return Ok(());
        }
        // Requests have one length, so the last one carries values, too.
        let unused = vec![0.0; self.inputs];
        match self.ask(Request::End, &unused, &mut [])? {
            Answer::Freed => Ok(()),
            _ => Err(ForeignFault::Lost),
        }
    }

    /// The last message of the FMU, once.
    pub fn last_message(&mut self) -> Option<String> {
        self.last.take()
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if let Err(fault) = self.finish() {
            tracing::warn!("unloading the FMU, {fault}; the samples before it are not affected");
        }
    }
}
