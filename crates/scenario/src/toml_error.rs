//! Errors of TOML texts, with suggestions for unknown keys.

use thiserror::Error;

use crate::nearest::nearest;

/// Reason why a TOML text can't be used.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{origin}: {message}{}", suggestion.as_ref().map_or(String::new(), |s| format!("\nDid you mean `{s}`?")))]
pub struct TomlError {
    /// Path or name of the text.
    pub origin: String,
    /// Message of the TOML parser, with the position.
    pub message: String,
    /// Known key or variant closest to the unknown one.
    pub suggestion: Option<String>,
}

impl TomlError {
    /// Converts an error of the TOML parser about a text from `origin`.
    pub fn new(origin: &str, error: &toml::de::Error) -> TomlError {
        let whole = error.to_string();
        let message = if whole.lines().all(|line| line.len() <= LONGEST_LINE) && whole.len() <= LONGEST {
            whole.trim_end().to_string()
        } else {
            // The message quotes the line of the text. It is left out here, since the whole file may be a
            // single line.
            let place = whole.lines().next().filter(|line| line.starts_with("TOML parse error at "));
            let place = place.map_or(String::new(), |place| format!("{place}\n"));
            place + &shortened(error.message())
        };
        TomlError { origin: origin.to_string(), suggestion: suggestion(error.message()), message }
    }
}

/// Longest line that a message may have, bytes; the next constant is the longest message.
const LONGEST_LINE: usize = 300;
const LONGEST: usize = 2000;

/// Shortens a text to its beginning if it is too long.
fn shortened(text: &str) -> String {
    match text.char_indices().nth(LONGEST_LINE) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_string(),
    }
}

/// Finds the name closest to x in serde's message ``unknown field `x`, expected one of `a`, `b` ``.
fn suggestion(message: &str) -> Option<String> {
    let (unknown, expected) = message.split_once(", expected ")?;
    let got = unknown.strip_prefix("unknown field ").or(unknown.strip_prefix("unknown variant "))?.trim_matches('`');
    if got.len() > LONGEST_LINE {
        return None;
    }
    // Names stand between backquotes, so every second piece of the split is a name.
    let known = expected.split('`').skip(1).step_by(2);
    nearest(got, known)
}
