//! What goes to standard output, standard error and files.
//!
//! Standard output holds one thing: the JSON document with `--json`; else the data, if there is no other place for
//! them; else, with `--plot` or `--out`, a summary and the names of the files that hold the data.

use std::borrow::Cow;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::failure::Failure;
use resonarm_figures::plot::{Figure, beside};

/// Writes text to standard output, with the control characters in it escaped.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    out.write_all(printable(text).as_bytes())?;
    Ok(out.flush()?)
}

/// Writes one JSON document to standard output.
pub(super) fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    // Those that JSON leaves as they are stand inside of strings alone, where it has an escape for each.
    let text = escape(&serde_json::to_string(value)?, is_control, |letter| format!("\\u{:04x}", u32::from(letter)))
        .into_owned();
    print(&(text + "\n"))
}

/// The text with its control characters, line feeds and tabs apart, as escapes such as `\u{1b}`: names in files of
/// others must not move a terminal's cursor, rename its window or write backwards. All that is written to a terminal
/// goes through it.
pub(super) fn printable(text: &str) -> Cow<'_, str> {
    escape(text, is_control, |letter| letter.escape_default().to_string())
}

/// The same of what stands in a line: line feeds and tabs, too.
pub(super) fn in_line(text: &str) -> Cow<'_, str> {
    let is_wanted = |letter| is_control(letter) || matches!(letter, '\n' | '\t');
    escape(text, is_wanted, |letter| letter.escape_default().to_string())
}

/// Control characters (Unicode's category Cc) but line feed and tab, and those that reverse the direction of writing
/// (UAX #9, section 2).
fn is_control(letter: char) -> bool {
    letter.is_control() && !matches!(letter, '\n' | '\t')
        || matches!(letter, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn escape(text: &str, is_wanted: impl Fn(char) -> bool, escaped: impl Fn(char) -> String) -> Cow<'_, str> {
    if !text.contains(&is_wanted) {
        return Cow::Borrowed(text);
    }
    let letter = |letter| if is_wanted(letter) { escaped(letter) } else { String::from(letter) };
    text.chars().map(letter).collect()
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

/// What a figure and its data are written to: the figure, its caption, the data.
pub(super) const PLOTTED: &[&str] = &[".svg", ".png", ".txt", ".csv", ".json"];

/// Writes a figure, its caption and its data to `stem` with [`PLOTTED`] appended, and returns the paths.
pub(super) fn plot(
    stem: &Path,
    figure: &Figure,
    csv: &str,
    document: &impl Serialize,
) -> Result<Vec<PathBuf>, Failure> {
    let mut files = figure.write(stem)?.to_vec();
    files.push(write(beside(stem, ".csv"), csv)?);
    files.push(write_json(beside(stem, ".json"), document)?);
    Ok(files)
}

/// Says on standard output which files were written.
pub(super) fn print_written(files: &[PathBuf]) -> Result<(), Failure> {
    let names: Vec<_> = files.iter().map(|path| path.display().to_string()).collect();
    print(&format!("written to {}\n", names.join(", ")))
}

/// Writes a line to standard error, with the control characters in it escaped.
pub(super) fn note(line: &str) {
    // If this can't be written there is nobody to tell.
    let _unwritten = writeln!(io::stderr(), "{}", printable(line));
}

/// Tells on standard error why a command failed.
pub(super) fn complain(failure: &Failure) {
    note(&format!("resonarm: {failure}"));
}

/// Whether files that are there may be written over. A command that writes files asks before it computes anything.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct OverwriteFlag {
    /// Write over files that are there.
    #[arg(long)]
    pub overwrite: bool,
}

impl OverwriteFlag {
    /// Refuses to go on if one of these files is there, unless it may be written over.
    pub fn check(self, files: impl IntoIterator<Item = PathBuf>) -> Result<(), Failure> {
        let there = files.into_iter().find(|path| !self.overwrite && path.symlink_metadata().is_ok());
        there.map_or(Ok(()), |path| Err(Failure::Exists { path }))
    }

    /// The same for the files STEM + ending.
    pub fn check_stem(self, stem: Option<&Path>, endings: &[&str]) -> Result<(), Failure> {
        self.check(stem.into_iter().flat_map(|stem| endings.iter().map(|ending| beside(stem, ending))))
    }
}

/// Whether the folder is there in which STEM's files are to be: commands that compute for minutes ask before.
pub(super) fn check_folder(stem: &Path) -> Result<(), Failure> {
    let folder = stem.parent().filter(|folder| !folder.as_os_str().is_empty());
    match folder.map(std::fs::read_dir) {
        Some(Err(source)) => Err(Failure::Write { path: stem.to_path_buf(), source }),
        _ => Ok(()),
    }
}
