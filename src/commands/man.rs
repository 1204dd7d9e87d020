//! `resonarm man`: the help as manual pages.

use std::path::PathBuf;

use clap::{Args, Command};
use serde_json::json;

use crate::failure::{Failure, Verdict};
use crate::output::JsonFlag;

/// Writes the help of all commands as manual pages for `man`, one file for each command.
///
/// Pages of an earlier version are replaced.
#[derive(Debug, Args)]
pub(crate) struct Man {
    /// Folder for the pages, as `~/.local/share/man/man1`; it is created if missing.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    #[command(flatten)]
    json: JsonFlag,
}

impl Man {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let failed = Failure::write(&self.folder);
        std::fs::create_dir_all(&self.folder).map_err(&failed)?;
        // `help` repeats every command as its own subcommand, and each of these would get a page.
        let command = crate::whole().disable_help_subcommand(true);
        let mut pages = names(&command, "resonarm").into_iter().map(|name| self.folder.join(name)).collect::<Vec<_>>();
        clap_mangen::generate_to(command, &self.folder).map_err(failed)?;
        pages.sort();
        let count = pages.len();
        let text = || format!("{count} pages: `man -l {}`\n", self.folder.join("resonarm.1").display());
        self.json.show(&json!({ "pages": pages }), text, &[])
    }
}

/// Returns the names of the pages of a command and its subcommands, with hyphens for blanks.
fn names(command: &Command, name: &str) -> Vec<String> {
    // `generate_to` does not return the names of its files, so they are made here by its rule: hidden commands have
    // no page.
    let shown = command.get_subcommands().filter(|inner| !inner.is_hide_set());
    let inner = shown.flat_map(|inner| names(inner, &format!("{name}-{}", inner.get_name())));
    inner.chain([format!("{name}.1")]).collect()
}
