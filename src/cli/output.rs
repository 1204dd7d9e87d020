//! What goes to standard output and standard error.

use std::io::{self, Write};

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

/// Tells on standard error why a command failed.
pub(super) fn complain(failure: &Failure) {
    // If not even this can be written there is nobody to tell.
    let _unwritten = writeln!(io::stderr(), "resonarm: {failure}");
}
