//! An FMU in its own process: its library, its instance, and the requests that it serves.

use std::ffi::CString;
use std::io::{PipeReader, Read};
use std::path::Path;
use std::sync::Arc;

use crate::abi::{Fmi, Fmi2, Fmi3, InstanceSpec, Library, StartError, StepOutcome, begin};
use crate::alarm::end_within;
use crate::description::Version;
use crate::message::{Answer, Answers, Request, StepCall, Stepped};
use crate::source::Source;

/// How long an FMU may take to free its instance and to be unloaded, s.
const END_S: u32 = 10;

/// Loads the FMU from `folder` and begins a simulation at 0.
fn start(source: &Source, folder: &Path, answers: &Arc<Answers>) -> Result<Box<dyn Fmi>, StartError> {
    let text = |text: &str| CString::new(text).map_err(|_| StartError::Load(format!("`{text}` has a NUL")));
    let token = text(&source.description.token)?;
    let resources = text(&format!("{}/", folder.join("resources").display()))?;
    let mapping = &source.mapping;
    let at_rest = mapping.set_at_rest();
    let inputs = (&*mapping.set.references, &*at_rest);
    let spec = InstanceSpec { token: &token, resources: &resources, parameters: &mapping.parameters, inputs };
    let library = Library::load(&folder.join(source.description.library()))?;
    let mut fmu: Box<dyn Fmi> = match source.description.version {
        Version::Fmi2 => Box::new(Fmi2::new(library, &spec, Arc::clone(answers))?),
        Version::Fmi3 => Box::new(Fmi3::new(library, &spec, Arc::clone(answers))?),
    };
    begin(&mut *fmu, &spec)?;
    Ok(fmu)
}

/// Runs the FMU until it is asked to end, or nobody asks any more.
///
/// # Errors
/// That of a pipe.
pub(crate) fn serve(
    source: &Source,
    folder: &Path,
    mut requests: PipeReader,
    answers: &Arc<Answers>,
) -> std::io::Result<()> {
    let mapping = &source.mapping;
    let mut set = vec![0.0; mapping.set.count];
    let mut read = vec![0.0; mapping.read.count];
    let mut fmu = match start(source, folder, answers) {
        Ok(fmu) => fmu,
        Err(error) => return answers.send(&refusal(error), &[]),
    };
    let first = fmu.get(&mapping.read.references, &mut read);
    if !first.is_good() {
        return answers.send(&refusal(StartError::of(first)), &[]);
    }
    answers.send(&Answer::Started, &read)?;
    let mut request = vec![0; Request::length(set.len())];
    loop {
        requests.read_exact(&mut request)?;
        match Request::read(&request, &mut set) {
            Some(Request::Step { from_s, step_s, sets }) => {
                let stepped = step(&mut *fmu, source, sets.then_some(&*set), (from_s, step_s), &mut read);
                let is_good = stepped.call == StepCall::Get && matches!(stepped.status, 0 | 1);
                answers.send(&Answer::Stepped(stepped), if is_good { &read } else { &[] })?;
            }
            Some(Request::End) => {
                end_within(END_S);
                drop(fmu);
                return answers.send(&Answer::Freed, &[]);
            }
            None => return Err(std::io::ErrorKind::InvalidData.into()),
        }
    }
}

/// A communication step of `(from_s, step_s)`, as far as it succeeds.
fn step(
    fmu: &mut dyn Fmi,
    source: &Source,
    set: Option<&[f64]>,
    (from_s, step_s): (f64, f64),
    read: &mut [f64],
) -> Stepped {
    let mapping = &source.mapping;
    if let Some(set) = set {
        let called = fmu.set(&mapping.set.references, set);
        if !called.is_good() {
            return stepped(StepCall::Set, called.status, None);
        }
    }
    let outcome = fmu.step(from_s, step_s);
    if !outcome.called.is_good() || outcome.terminates {
        return stepped(StepCall::Step, outcome.called.status, Some(outcome));
    }
    let called = fmu.get(&mapping.read.references, read);
    stepped(StepCall::Get, called.status, Some(outcome))
}

/// The end of a step that got as far as `call`.
fn stepped(call: StepCall, status: i32, outcome: Option<StepOutcome>) -> Stepped {
    let terminates = outcome.is_some_and(|outcome| outcome.terminates);
    Stepped { call, status, terminates, reached_s: outcome.and_then(|outcome| outcome.reached_s) }
}

/// The answer that tells of an error before the simulation.
fn refusal(error: StartError) -> Answer {
    match error {
        StartError::Load(reason) => Answer::NotLoaded { reason },
        StartError::Function(name) => Answer::NoFunction { name: name.to_owned() },
        StartError::Status { function, status } => Answer::Refused { function: function.to_owned(), status },
    }
}
