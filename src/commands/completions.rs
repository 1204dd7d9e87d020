//! `resonarm completions`: scripts that let a shell complete commands and flags.

use clap::Args;
use clap_complete::Shell;

use crate::failure::{Failure, Verdict};
use crate::output;

/// Prints a script that lets a shell complete commands and flags.
#[derive(Debug, Args)]
#[command(
    after_help = "bash: resonarm completions bash > ~/.local/share/bash-completion/completions/resonarm\nfish: resonarm completions fish > ~/.config/fish/completions/resonarm.fish\nzsh: into the file _resonarm of a folder in $fpath."
)]
pub(crate) struct Completions {
    /// Shell that reads the script.
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

impl Completions {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut crate::whole(), "resonarm", &mut script);
        output::print(&String::from_utf8_lossy(&script))?;
        Ok(Verdict::Positive)
    }
}
