//! The command line, with one file for each subcommand.
//!
//! Results go to standard output, logs to standard error. Exit codes: 0 done, 1 a negative verdict, 2 bad usage or
//! input, 3 the environment lacks something.

mod backbone;
mod basins;
mod branch_plot;
mod branch_table;
mod captions;
mod compare;
mod configuration;
mod conformance;
mod continuation;
mod cut;
mod defaults;
mod demo;
mod demo_report;
mod diff;
mod doctor;
mod ended_early;
mod exciter;
mod experiment;
mod export;
mod failure;
mod file_size;
mod flags;
mod frf;
mod identify;
mod identify_angles;
mod identify_missing;
mod import;
mod inspect;
mod integrators;
mod interval;
mod latency;
mod latency_figure;
mod live;
mod logging;
mod modes;
mod motion_flags;
mod numbers;
mod output;
mod paper;
mod poincare;
mod progress;
mod protocol;
mod quantity;
mod readings;
mod recover;
mod replay;
mod resim;
mod responses;
mod run;
mod session;
mod simulate;
mod singular_curves;
mod status;
mod study;
mod supervise;
mod sweep;
mod time_range;
mod walk_flags;
mod walk_point;
mod zone_figure;

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

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Demo),
    Run(run::Run),
    Exciter(exciter::Exciter),
    Experiment(experiment::Experiment),
    Simulate(simulate::Simulate),
    Modes(modes::Modes),
    Frf(frf::Frf),
    Integrators(integrators::Integrators),
    Continue(continuation::Continue),
    Backbone(backbone::Backbone),
    Sweep(sweep::Sweep),
    Poincare(poincare::Poincare),
    Basins(basins::Basins),
    Compare(compare::Compare),
    Paper(paper::Paper),
    Replay(replay::Replay),
    Resim(resim::Resim),
    Identify(identify::Identify),
    Inspect(inspect::Inspect),
    Cut(cut::Cut),
    Merge(cut::Merge),
    Diff(diff::Diff),
    Export(export::Export),
    Import(import::Import),
    Recover(recover::Recover),
    Protocol(protocol::Protocol),
    Conformance(conformance::Conformance),
    Doctor(doctor::Doctor),
    Latency(latency::Latency),
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
    let result = match cli.command {
        Command::Demo(command) => command.execute(),
        Command::Run(command) => command.execute(),
        Command::Exciter(command) => command.execute(),
        Command::Experiment(command) => command.execute(),
        Command::Simulate(command) => uncounted("simulate", || command.execute()),
        Command::Modes(command) => command.execute(),
        Command::Frf(command) => command.execute(),
        Command::Integrators(command) => command.execute(),
        Command::Continue(command) => uncounted("continue", || command.execute()),
        Command::Paper(command) => command.execute(),
        Command::Backbone(command) => uncounted("backbone", || command.execute()),
        Command::Sweep(command) => command.execute(),
        Command::Poincare(command) => command.execute(),
        Command::Basins(command) => command.execute(),
        Command::Compare(command) => uncounted("compare", || command.execute()),
        Command::Replay(command) => command.execute(),
        Command::Resim(command) => uncounted("resim", || command.execute()),
        Command::Identify(command) => uncounted("identify", || command.execute()),
        Command::Inspect(command) => uncounted("inspect", || command.execute()),
        Command::Cut(command) => uncounted("cut", || command.execute()),
        Command::Merge(command) => uncounted("merge", || command.execute()),
        Command::Diff(command) => uncounted("diff", || command.execute()),
        Command::Export(command) => uncounted("export", || command.execute()),
        Command::Import(command) => uncounted("import", || command.execute()),
        Command::Recover(command) => uncounted("recover", || command.execute()),
        Command::Protocol(command) => command.execute(),
        Command::Conformance(command) => uncounted("conformance", || command.execute()),
        Command::Doctor(command) => command.execute(),
        Command::Latency(command) => uncounted("latency", || command.execute()),
    };
    match result {
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

/// Runs a command that does not count its work, with periodic lines that it is still running.
fn uncounted(name: &'static str, execute: impl FnOnce() -> Result<Verdict, Failure>) -> Result<Verdict, Failure> {
    let _progress = Progress::uncounted(name);
    execute()
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
