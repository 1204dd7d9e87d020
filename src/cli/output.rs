//! What goes to standard output, standard error and files.

use std::io::{self, Write};
use std::path::PathBuf;

use serde::Serialize;

use super::failure::Failure;

/// Writes text to standard output.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}

/// Writes one JSON document to standard output.
pub(super) fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    let mut text = serde_json::to_string(value)?;
    text.push('\n');
    print(&text)
}

/// Writes a text file, over what is there, and returns its path.
pub(super) fn write(path: PathBuf, text: &str) -> Result<PathBuf, Failure> {
    match std::fs::write(&path, text) {
        Ok(()) => Ok(path),
        Err(source) => Err(Failure::Write { path, source }),
    }
}

/// Writes a file of one JSON document likewise.
pub(super) fn write_json(path: PathBuf, value: &impl Serialize) -> Result<PathBuf, Failure> {
    write(path, &(serde_json::to_string(value)? + "\n"))
}

/// Tells on standard error why a command failed.
pub(super) fn complain(failure: &Failure) {
    // If not even this can be written there is nobody to tell.
    let _unwritten = writeln!(io::stderr(), "resonarm: {failure}");
}
