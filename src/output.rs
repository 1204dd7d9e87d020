//! Output to standard output, standard error and files.
//!
//! Standard output holds one thing: with `--json` the JSON document; with `--plot` or `--out` a summary and the names
//! of the files that hold the data; otherwise the data.

use std::borrow::Cow;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{Arg, Args};
use serde::Serialize;
use serde_json::{Map, Value};

use crate::failure::{Failure, Verdict};
use crate::help::heading;
use resonarm::scenario::Scenario;
use resonarm::{same_file, write_whole};
use resonarm_figures::plot::{Figure, beside};

/// Writes text to standard output, with its control characters escaped.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    out.write_all(printable(text).as_bytes())?;
    // Flushed here, where a failure is still an error of the command: at the end of the process it would be lost.
    Ok(out.flush()?)
}

/// The flag that makes a command print its document as JSON.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = heading::OUTPUT)]
pub(crate) struct JsonFlag {
    /// Print the results as one JSON document.
    #[arg(long)]
    pub json: bool,
}

impl JsonFlag {
    /// Ends a command with its document: prints it with --json as JSON, otherwise as text, with the names of the files
    /// that were written.
    pub fn show(
        self,
        document: &impl Serialize,
        text: impl FnOnce() -> String,
        written: &[PathBuf],
    ) -> Result<Verdict, Failure> {
        if self.json {
            print_json(document)?;
        } else {
            print(&text())?;
            self.list(written)?;
        }
        Ok(Verdict::Positive)
    }

    /// Prints the names of files that were written, if there are any, unless --json is given.
    pub fn list(self, written: &[PathBuf]) -> Result<(), Failure> {
        if self.json || written.is_empty() { Ok(()) } else { print(&format!("written to {}\n", listed(written))) }
    }
}

/// Returns the names of files, with commas between them.
pub(crate) fn listed(files: &[PathBuf]) -> String {
    files.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// Returns the keys of a JSON object, to add them to another one.
pub(crate) fn map(object: Value) -> Map<String, Value> {
    match object {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

/// Returns the cell of a value in a table; empty if there is none.
pub(crate) fn or_empty(value: Option<impl ToString>) -> String {
    value.map_or(String::new(), |value| value.to_string())
}

/// Writes one JSON document to standard output.
pub(crate) fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    // Control characters that JSON leaves unescaped occur only in strings, where JSON has an escape for each.
    let text = escape(&serde_json::to_string(value)?, is_control, |letter| format!("\\u{:04x}", u32::from(letter)))
        .into_owned();
    print(&(text + "\n"))
}

/// Returns the text with its control characters, except line feeds and tabs, as escapes such as `\u{1b}`: names in
/// foreign files must not move a terminal's cursor, rename its window or write backwards. All output to a terminal goes
/// through this.
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    escape(text, is_control, |letter| letter.escape_default().to_string())
}

/// Returns a text within a line with its control characters as escapes, line feeds and tabs too.
pub(crate) fn in_line(text: &str) -> Cow<'_, str> {
    let is_wanted = |letter| is_control(letter) || matches!(letter, '\n' | '\t');
    escape(text, is_wanted, |letter| letter.escape_default().to_string())
}

/// Says whether a character is a control character (Unicode's category Cc) other than line feed and tab, or one that
/// changes the direction of writing (UAX #9, section 2).
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

/// Writes a text file, replacing an existing one when the new one is whole, and returns its path.
pub(crate) fn write(path: PathBuf, text: &str) -> Result<PathBuf, Failure> {
    write_whole(&path, text.as_bytes()).map_err(Failure::write(&path))?;
    Ok(path)
}

/// Writes one JSON document to a file, replacing an existing file when the new one is whole.
pub(crate) fn write_json(path: PathBuf, value: &impl Serialize) -> Result<PathBuf, Failure> {
    write(path, &(serde_json::to_string(value)? + "\n"))
}

/// The endings of the files of a figure: the figure, its caption, the data.
pub(crate) const PLOTTED: &[&str] = &[".svg", ".png", ".txt", ".csv", ".json"];

/// Whether figures are drawn without title: set once, from the command line.
static WITHOUT_TITLES: AtomicBool = AtomicBool::new(false);

/// Makes [`draw`] leave out titles and subtitles for the rest of the process.
pub(crate) fn leave_titles_out() {
    // The command and its threads have not begun, so that no order with other memory is needed.
    WITHOUT_TITLES.store(true, Ordering::Relaxed);
}

/// Writes a figure as SVG and PNG and its caption to `stem`. Returns the paths.
pub(crate) fn draw(figure: Figure, stem: &Path) -> Result<Vec<PathBuf>, Failure> {
    let is_titled = !WITHOUT_TITLES.load(Ordering::Relaxed);
    Ok(Figure { is_titled, ..figure }.write(stem)?.to_vec())
}

/// Writes, with --plot STEM, the figure, its caption and the data, as a table and as the document, to STEM with
/// [`PLOTTED`] appended. Returns the paths.
pub(crate) fn plot(
    stem: Option<&Path>,
    document: &impl Serialize,
    figure_and_csv: impl FnOnce() -> (Figure, String),
) -> Result<Vec<PathBuf>, Failure> {
    let Some(stem) = stem else { return Ok(Vec::new()) };
    let (figure, csv) = figure_and_csv();
    let mut files = draw(figure, stem)?;
    files.push(write(beside(stem, ".csv"), &csv)?);
    files.push(write_json(beside(stem, ".json"), document)?);
    Ok(files)
}

/// Where the figure and the data of a command go, and whether its results are printed as JSON.
#[derive(Clone, Debug, Args)]
pub(crate) struct PlotFlags {
    #[arg(long, help_heading = heading::OUTPUT, value_name = "STEM", help = PLOT)]
    pub plot: Option<PathBuf>,
    #[command(flatten)]
    pub overwrite: OverwriteFlag,
    #[command(flatten)]
    pub json: JsonFlag,
}

/// Help of --plot, unless a command [`explains`](explained) it by a text of its own.
pub(crate) const PLOT: &str = "Plot to STEM.svg and STEM.png, with caption, CSV and JSON";

/// Returns what gives the flag --plot a command's help, to which the long help adds `more`, for `mut_args`.
// `mut_arg` would put the flag behind all others, as scripts of completion then list it.
pub(crate) fn explained(help: &'static str, more: &'static str) -> impl Fn(Arg) -> Arg {
    move |arg| match more {
        _ if arg.get_id() != "plot" => arg,
        "" => arg.help(help),
        more => arg.help(help).long_help(format!("{help}.\n\n{more}")),
    }
}

impl PlotFlags {
    /// Checks the files STEM + ending as [`OverwriteFlag::check`] does.
    pub fn check(&self, endings: &[&str], inputs: &Inputs) -> Result<(), Failure> {
        self.overwrite.check_stem(self.plot.as_deref(), endings, inputs)
    }

    /// Writes the files of [`plot`] if they are wanted, then prints the document as [`JsonFlag::show`] does.
    pub fn show(
        &self,
        document: &impl Serialize,
        figure_and_csv: impl FnOnce() -> (Figure, String),
        text: impl FnOnce() -> String,
    ) -> Result<Verdict, Failure> {
        let files = plot(self.plot.as_deref(), document, figure_and_csv)?;
        self.json.show(document, text, &files)
    }
}

/// Writes a line to standard error, with its control characters escaped.
pub(crate) fn note(line: &str) {
    // A failure to write this can't be reported anywhere.
    let _unwritten = writeln!(io::stderr(), "{}", printable(line));
}

/// Writes to standard error why a command failed.
pub(crate) fn complain(failure: &Failure) {
    note(&format!("resonarm: {failure}"));
}

/// The files that a command reads: none of its outputs may replace one of them, whatever may be overwritten.
#[derive(Clone, Debug, Default)]
pub(crate) struct Inputs(Vec<PathBuf>);

impl Inputs {
    /// Returns the inputs of a command that reads these files.
    pub fn of(files: impl IntoIterator<Item = impl AsRef<Path>>) -> Inputs {
        Inputs(files.into_iter().map(|file| file.as_ref().to_path_buf()).collect())
    }

    /// Returns the inputs of a command that reads a scenario, if one is given, with the files that it names.
    pub fn of_scenario(scenario: Option<&Path>) -> Inputs {
        Inputs(scenario.map_or(Vec::new(), Scenario::files))
    }

    /// Returns these inputs and another one, if it is given.
    #[must_use]
    pub fn and(mut self, file: Option<&Path>) -> Inputs {
        self.0.extend(file.map(Path::to_path_buf));
        self
    }

    /// Fails if an output leads to one of the inputs: by device and inode, so also through links.
    pub fn check(&self, output: &Path) -> Result<(), Failure> {
        match self.0.iter().find(|input| same_file(input, output)) {
            // A device or a pipe is not replaced: it may be both.
            Some(input) if input.is_file() => Err(Failure::SameFile { path: output.to_path_buf() }),
            _ => Ok(()),
        }
    }
}

/// Whether existing files may be overwritten. A command that writes files checks before it computes anything.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = heading::OUTPUT)]
pub(crate) struct OverwriteFlag {
    /// Overwrite existing files.
    #[arg(long)]
    pub overwrite: bool,
}

impl OverwriteFlag {
    /// Fails if one of these files is read by the command, or exists, unless it may be overwritten.
    pub fn check(self, files: impl IntoIterator<Item = PathBuf>, inputs: &Inputs) -> Result<(), Failure> {
        for path in files {
            inputs.check(&path)?;
            // `exists` follows links, and would take a dangling link for a free name.
            if !self.overwrite && path.symlink_metadata().is_ok() {
                return Err(Failure::Exists { path });
            }
        }
        Ok(())
    }

    /// Checks the files STEM + ending as [`check`](Self::check) does.
    pub fn check_stem(self, stem: Option<&Path>, endings: &[&str], inputs: &Inputs) -> Result<(), Failure> {
        self.check(stem.into_iter().flat_map(|stem| endings.iter().map(|ending| beside(stem, ending))), inputs)
    }
}

/// Fails unless the folder of STEM's files exists: commands that compute for minutes check first.
pub(crate) fn check_folder(stem: &Path) -> Result<(), Failure> {
    let folder = stem.parent().filter(|folder| !folder.as_os_str().is_empty());
    // Reading the folder gives the system's reason, which `exists` does not.
    folder.map(std::fs::read_dir).transpose().map_err(Failure::write(stem))?;
    Ok(())
}
