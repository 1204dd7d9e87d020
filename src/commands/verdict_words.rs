//! What the text and the report of a verdict share.

use clap::ValueEnum;
use serde::Serialize;

use resonarm::judge::{Document, Found};
use resonarm::specification::verdict::LevelVerdict;
use resonarm_numeric::number::{rounded, short};

/// Exit code of a verdict that the record does not decide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Undecided {
    Pass,
    Fail,
}

pub(super) fn percent(share: f64) -> String {
    format!("{} %", rounded(&(100.0 * share), 1))
}

pub(super) fn db(value: f64) -> String {
    format!("{}{} dB", if value > 0.0 { "+" } else { "" }, rounded(&value, 2))
}

/// Returns what was measured of the level of a record, in words.
pub(super) fn level_measured(level: &LevelVerdict) -> String {
    let asked = level.asked_s.map_or_else(String::new, |asked_s| format!(" of {} s asked for", short(&asked_s)));
    let full_s = rounded(&level.full_s, 1);
    let highest = db(level.highest_db);
    let from_s = rounded(&level.highest_s, 1);
    format!("{full_s} s at full level{asked}; highest rms over 2 s {highest}, from {from_s} s on")
}

/// Says why no test begins in a record; `None` if one does.
pub(super) fn not_begun(document: &Document<'_>) -> Option<String> {
    match document.found {
        _ if document.begins_s.is_some() => None,
        Found::NotBegun(found) => Some(found.reason.clone()),
        Found::Random(_) => Some(String::from("no stretch is at full level")),
        Found::Sine(_) | Found::Shock(_) | Found::Srs(_) => Some(String::from("no shot is at full level")),
    }
}

/// Says where the test begins, or why nowhere.
pub(super) fn begins_text(document: &Document<'_>) -> String {
    match (document.begins_s.zip(document.begins_by), document.found) {
        (Some((at_s, by)), found) => {
            let left_out = match found {
                Found::Sine(found) if found.left_out > 0 => {
                    format!("; sweeps before it that were broken off or at low level: {}", found.left_out)
                }
                _ => String::new(),
            };
            format!("begin of the test: {} s, {}{left_out}", rounded(&at_s, 3), by.name())
        }
        (None, _) => format!("begin of the test: not found; {}", not_begun(document).unwrap_or_default()),
    }
}
