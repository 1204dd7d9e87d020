//! What is wrong with a TOML text.

use alloc::format;
use alloc::string::{String, ToString};

use thiserror::Error;

use crate::nearest::nearest;

/// Why a TOML text is not what it should be.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{origin}: {message}{}", suggestion.as_ref().map_or(String::new(), |s| format!("\nDid you mean `{s}`?")))]
pub struct TomlError {
    /// Where the text is from.
    pub origin: String,
    /// What the TOML reader says, with the place.
    pub message: String,
    /// The known key or variant that is nearest to an unknown one.
    pub suggestion: Option<String>,
}

impl TomlError {
    /// What the TOML reader says of a text from `origin`.
    pub fn new(origin: &str, error: &toml::de::Error) -> TomlError {
        let whole = error.to_string();
        let message = if whole.lines().all(|line| line.len() <= LONGEST_LINE) && whole.len() <= LONGEST {
            whole.trim_end().to_string()
        } else {
            // Without the line of the text: a file may be a single one.
            let place = whole.lines().next().filter(|line| line.starts_with("TOML parse error at "));
            let place = place.map_or(String::new(), |place| format!("{place}\n"));
            place + &shortened(error.message())
        };
        TomlError { origin: origin.to_string(), suggestion: suggestion(error.message()), message }
    }
}

/// The longest line of a message, and the longest message, bytes.
const LONGEST_LINE: usize = 300;
const LONGEST: usize = 2000;

/// The beginning of a text that is too long.
fn shortened(text: &str) -> String {
    match text.char_indices().nth(LONGEST_LINE) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_string(),
    }
}

/// Reads serde's ``unknown field `x`, expected one of `a`, `b` `` and finds the name nearest to x.
fn suggestion(message: &str) -> Option<String> {
    let (unknown, expected) = message.split_once(", expected ")?;
    let got = unknown.strip_prefix("unknown field ").or(unknown.strip_prefix("unknown variant "))?.trim_matches('`');
    if got.len() > LONGEST_LINE {
        return None;
    }
    let known = expected.split('`').skip(1).step_by(2);
    nearest(got, known)
}
