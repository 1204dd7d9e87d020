//! The command line from the user's side: documents, messages and exit codes of the program.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking, its helpers too")]

mod audit;
mod backbone;
mod bad_input;
mod branches;
mod canopen;
mod compare;
mod conformance;
mod cut;
mod diff;
mod documents;
mod escapes;
mod experiment;
mod export;
mod figures;
mod first_minute;
mod given_states;
mod identify;
mod import;
mod integrators;
mod latency;
mod numbers;
mod paper;
mod plot;
mod progress;
mod protocol;
mod readings;
mod recordings;
mod signals;
mod specifications;
mod structure_words;
mod structures;
mod survey;
mod time_domain;
mod wire;

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

/// The result of a command.
pub struct CommandResult {
    /// Its exit code.
    pub code: i32,
    /// Its standard output.
    pub stdout: String,
    /// Its standard error.
    pub stderr: String,
}

/// Runs the program in `folder`, without lines of progress, which would appear on a machine that stalls. No command
/// here takes more than some seconds.
pub fn resonarm(folder: &Path, arguments: &[&str]) -> CommandResult {
    let mut command = Command::new(env!("CARGO_BIN_EXE_resonarm"));
    command.args(arguments).current_dir(folder).env("RESONARM_LOG", "resonarm::progress=off").stdin(Stdio::null());
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    CommandResult { code: output.status.code().unwrap(), stdout: text(output.stdout), stderr: text(output.stderr) }
}

/// Runs a command that must end with `code` and print one JSON document, and nothing else.
pub fn document(folder: &Path, code: i32, arguments: &[&str]) -> Value {
    let outcome = resonarm(folder, arguments);
    assert_eq!(outcome.code, code, "{arguments:?}: {}{}", outcome.stdout, outcome.stderr);
    serde_json::from_str(&outcome.stdout).unwrap_or_else(|error| panic!("{arguments:?}: {error} in {}", outcome.stdout))
}

/// Runs a command that must fail with `code` and print nothing on standard output; returns its standard error.
pub fn complaint(folder: &Path, code: i32, arguments: &[&str]) -> String {
    let outcome = resonarm(folder, arguments);
    assert_eq!(outcome.code, code, "{arguments:?}: {}{}", outcome.stdout, outcome.stderr);
    assert_eq!(outcome.stdout, "", "{arguments:?}");
    outcome.stderr
}

/// The names in a JSON object, in alphabetical order.
pub fn names(object: &Value) -> Vec<&str> {
    object.as_object().unwrap().keys().map(String::as_str).collect()
}
