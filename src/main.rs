//! The command line, with one file for each subcommand.
//!
//! Results go to standard output, logs to standard error. Exit codes: 0 done, 1 a negative verdict, 2 bad usage or
//! input, 3 the environment lacks something.

mod basin_cells;
mod commands;
mod configuration;
mod continuation_flags;
mod defaults;
mod drive;
mod ended_early;
mod failure;
mod figures;
mod file_size;
mod flags;
mod live;
#[cfg(feature = "live")]
mod live_branch;
mod logging;
mod motion_flags;
mod numbers;
mod output;
mod progress;
mod quantity;
mod readings;
mod recordings;
mod responses;
mod session;
mod status;
mod structures;
mod study;
mod supervise;
mod walk_point;

#[cfg(test)]
mod readme_tests;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use failure::{Failure, Verdict};
use progress::Progress;

/// Real-time vibration simulator of a compliant-joint robot arm, with an exciter bridge over CAN.
#[derive(Debug, Parser)]
#[command(name = "resonarm", version, max_term_width = 120)]
#[command(
    after_help = "Exit codes: 0 done, 1 a negative verdict, 2 bad usage or input, 3 the environment lacks something.\n\
                        RESONARM_LOG sets what is logged, as `debug` or `resonarm_bus=trace`. Where standard error is no terminal, a line \
                        of progress is written every 10 s; the levels `error` and `off` suppress it, too."
)]
struct Cli {
    /// Log more: -v for what happens, -vv for every detail.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    #[command(subcommand)]
    command: Command,
}

/// Makes the commands from a table: each is the struct of its name in its module. One that does not count its work is
/// reported by lines that say that it is still running.
macro_rules! commands {
    ($($command:ident in $module:ident $(, reported as $name:literal)?;)*) => {
        #[derive(Debug, Subcommand)]
        enum Command {
            $($command(commands::$module::$command),)*
        }

        impl Command {
            fn execute(self) -> Result<Verdict, Failure> {
                match self {
                    $(Command::$command(command) => {
                        $(let _progress = Progress::uncounted($name);)?
                        command.execute()
                    })*
                }
            }
        }
    };
}

commands! {
    Demo in demo;
    Run in run;
    Exciter in exciter;
    Experiment in experiment;
    Simulate in simulate, reported as "simulate";
    Structure in structure;
    Modes in modes;
    Frf in frf;
    Integrators in integrators;
    Continue in continuation, reported as "continue";
    Backbone in backbone, reported as "backbone";
    Sweep in sweep;
    Poincare in poincare;
    Basins in basins;
    Compare in compare, reported as "compare";
    Paper in paper;
    Replay in replay;
    Resim in resim, reported as "resim";
    Identify in identify, reported as "identify";
    Inspect in inspect, reported as "inspect";
    Cut in cut, reported as "cut";
    Merge in cut, reported as "merge";
    Diff in diff, reported as "diff";
    Export in export, reported as "export";
    Fmu in fmu, reported as "fmu";
    Import in import, reported as "import";
    Recover in recover, reported as "recover";
    Protocol in protocol;
    Conformance in conformance, reported as "conformance";
    Doctor in doctor;
    Latency in latency, reported as "latency";
}

/// Runs the program on the process's arguments.
fn main() -> ExitCode {
    file_size::fail_writes_beyond_limit();
    let cli = match parse(std::env::args_os()) {
        Ok(cli) => cli,
        Err(error) => error.exit(),
    };
    if let Err(failure) = logging::log_to_stderr(cli.verbose) {
        output::complain(&failure);
        return failure.exit_code();
    }
    match cli.command.execute() {
        Ok(Verdict::Positive) => ExitCode::SUCCESS,
        Ok(Verdict::Negative) => ExitCode::from(1),
        // The reader of the output has closed it.
        Err(Failure::BrokenPipe) => ExitCode::SUCCESS,
        Err(failure) => {
            output::complain(&failure);
            failure.exit_code()
        }
    }
}

/// Checks that `arguments`, without the program's name, are a valid command line of this program, without running it.
///
/// # Errors The message that the program would print.
#[cfg(test)]
fn check_arguments<'a>(arguments: impl IntoIterator<Item = &'a str>) -> Result<(), String> {
    let command_line = core::iter::once("resonarm").chain(arguments);
    parse(command_line).map(|_cli| ()).map_err(|error| error.to_string())
}

/// The command line, with strict numbers, and the defaults in its help.
fn whole() -> clap::Command {
    defaults::stated(numbers::strict(Cli::command()))
}

fn parse(arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>) -> Result<Cli, clap::Error> {
    let mut command = whole();
    let matches = command.try_get_matches_from_mut(arguments)?;
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}
