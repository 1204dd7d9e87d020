//! An FMU in its own process: its library, its instance, and the requests that it serves.

use std::ffi::CString;
use std::io::{PipeReader, Read};
use std::path::Path;
use std::sync::Arc;

use crate::abi::{Fmi, Fmi2, Fmi3, Library, StartError, begin, is_good};
use crate::description::Version;
use crate::message::{Answer, Answers, Request, StepCall, Stepped};
use crate::process::end_within;
use crate::source::Source;

/// How long an FMU may take to free its instance and to be unloaded, s.
const END_S: u32 = 10;

/// Loads the FMU from `folder` and begins a simulation at 0.
fn start(source: &Source, folder: &Path, answers: &Arc<Answers>) -> Result<Box<dyn Fmi>, StartError> {
    // The token is from a file, and the path of the folder from the environment.
    let text = |text: &str| CString::new(text).map_err(|_| StartError::unloadable(format!("`{text}` has a NUL")));
    let token = text(&source.description.token)?;
    let resources = text(&format!("{}/", folder.join("resources").display()))?;
    let (library, answers) = (Library::load(&folder.join(source.description.library()))?, Arc::clone(answers));
    let mut fmu: Box<dyn Fmi> = match source.description.version {
        Version::Fmi2 => Box::new(Fmi2::new(library, &token, &resources, answers)?),
        Version::Fmi3 => Box::new(Fmi3::new(library, &token, &resources, answers)?),
    };
    begin(&mut *fmu, &source.mapping)?;
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
        Err(error) => return answers.send(&Answer::NotStarted(error), &[]),
    };
    if let Err(error) = fmu.get(&mapping.read.references, &mut read).checked() {
        return answers.send(&Answer::NotStarted(error), &[]);
    }
    answers.send(&Answer::Started, &read)?;
    let mut request = vec![0; Request::length(set.len())];
    loop {
        requests.read_exact(&mut request)?;
        match Request::read(&request, &mut set) {
            Some(Request::Step { from_s, step_s, sets }) => {
                let stepped = step(&mut *fmu, source, sets.then_some(&*set), (from_s, step_s), &mut read);
                let has_read = stepped.call == StepCall::Get && is_good(stepped.status);
                answers.send(&Answer::Stepped(stepped), if has_read { &read } else { &[] })?;
            }
            Some(Request::End) => {
                // An FMU that hangs as it is freed is ended by the alarm. The guard then reports the signal in place of
                // the answer.
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
            return Stepped { call: StepCall::Set, status: called.status, terminates: false, reached_s: None };
        }
    }
    let stepped = fmu.step(from_s, step_s);
    if !is_good(stepped.status) || stepped.terminates {
        return stepped;
    }
    let called = fmu.get(&mapping.read.references, read);
    Stepped { call: StepCall::Get, status: called.status, ..stepped }
}
