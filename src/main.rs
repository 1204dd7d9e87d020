//! The `resonarm` program.

use std::process::ExitCode;

fn main() -> ExitCode {
    resonarm::cli::main()
}
