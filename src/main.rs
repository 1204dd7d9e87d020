//! The command line, with one file for each subcommand.
//!
//! Results go to standard output, logs to standard error. Exit codes: 0 done, 1 a negative verdict, 2 bad usage or
//! input, 3 the environment lacks something.

mod commands;
mod computed_branch;
mod configuration;
mod continuation_flags;
mod defaults;
mod drive;
mod ended_early;
mod failure;
mod figures;
mod file_size;
mod first_minute;
mod flags;
mod help;
mod junit;
mod live;
#[cfg(feature = "live")]
mod live_branch;
mod logging;
mod measured_points;
mod memory;
mod numbers;
mod output;
mod page;
mod progress;
mod read_at;
mod recordings;
mod responses;
mod session;
mod settling_flags;
mod specifications;
mod start_state;
mod status;
mod study;
mod supervise;

#[cfg(test)]
mod readme_tests;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use failure::{Failure, Verdict};
use help::{LAST, heading};
use progress::Progress;

const ENVIRONMENT: &str = "\
Exit codes: 0 done, 1 a negative verdict, 2 bad usage or input, 3 the environment lacks something.

RESONARM_LOG sets what is logged, as `debug` or `resonarm_bus=trace`. Where standard error is not a terminal, long work \
writes a line of progress every 10 s; the levels `error` and `off` suppress it, too. NO_COLOR turns colours off.";

/// Simulates the vibration of a robot arm or of another structure in real time, as a plant on a CAN bus.
#[derive(Debug, Parser)]
#[command(name = "resonarm", version, max_term_width = 120)]
#[command(next_help_heading = heading::COMMON, next_display_order = LAST)]
#[command(
    after_help = "Exit codes: 0 done, 1 a negative verdict, 2 bad usage or input, 3 the environment lacks something."
)]
#[command(after_long_help = ENVIRONMENT)]
struct Cli {
    /// Log more: -v for what happens, -vv for every detail.
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
    /// Log errors only, and show no progress.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Leave the title and the subtitle out of figures, as papers want them.
    ///
    /// The caption in STEM.txt has both.
    #[arg(long, global = true, hide_short_help = true)]
    no_title: bool,
    #[command(subcommand)]
    command: Command,
}

/// Makes the commands from a table of groups, as the help lists them: each command is the struct of its name in its
/// module. One that does not count its work is reported by lines that say that it is still running.
macro_rules! commands {
    ($($group:literal { $($command:ident in $module:ident $(, reported as $name:literal)?;)* })*) => {
        #[derive(Debug, Subcommand)]
        #[command(defer = true)]
        enum Command {
            $($($command(commands::$module::$command),)*)*
        }

        impl Command {
            /// The groups, each with the variants of its commands, whose names in lower case the user types.
            const GROUPS: &[(&str, &[&str])] = &[$(($group, &[$(stringify!($command)),*])),*];

            /// Adds the arguments of each command, in the order of the variants.
            const ARGUMENTS: &[fn(clap::Command) -> clap::Command] =
                &[$($(<commands::$module::$command as clap::Args>::augment_args),*),*];

            fn execute(self) -> Result<Verdict, Failure> {
                match self {
                    $($(Command::$command(command) => {
                        // Under the name `_` it would be dropped at once: its lines end when the command does.
                        $(let _progress = Progress::uncounted($name);)?
                        command.execute()
                    })*)*
                }
            }
        }
    };
}

commands! {
    "Benches, a plant and a controller on a bus" {
        Demo in demo;
        Quickstart in quickstart;
        Run in run;
        Exciter in exciter;
        Experiment in experiment;
        Protocol in protocol;
        Conformance in conformance, reported as "conformance";
        Doctor in doctor;
        Latency in latency, reported as "latency";
    }
    "Recordings" {
        Inspect in inspect, reported as "inspect";
        Resim in resim, reported as "resim";
        Replay in replay;
        Plot in plot, reported as "plot";
        Survey in survey;
        Identify in identify, reported as "identify";
        Diff in diff, reported as "diff";
        Cut in cut, reported as "cut";
        Merge in cut, reported as "merge";
        Export in export, reported as "export";
        Import in import, reported as "import";
        Recover in recover, reported as "recover";
    }
    "Specifications of tests" {
        Spec in spec, reported as "spec";
        Verdict in verdict, reported as "verdict";
        Audit in audit, reported as "audit";
    }
    "Structures and their vibration" {
        Structure in structure;
        Modes in modes;
        Frf in frf;
        Simulate in simulate, reported as "simulate";
        Continue in continuation, reported as "continue";
        Backbone in backbone, reported as "backbone";
        Sweep in sweep;
        Poincare in poincare;
        Basins in basins;
        Compare in compare, reported as "compare";
        Paper in paper;
        Integrators in integrators;
    }
    "Other tools" {
        Fmu in fmu, reported as "fmu";
        Completions in completions;
        Man in man;
        Reference in reference;
    }
}

/// Runs the program on the process's arguments.
fn main() -> ExitCode {
    memory::exit_where_memory_is_missing();
    file_size::fail_writes_beyond_limit();
    // Before clap, which would print its help and end with exit code 2 for a missing command.
    if std::env::args_os().len() < 2 {
        return conclude(output::print(first_minute::BY_TRADE).map(|()| Verdict::Positive));
    }
    let cli = match parse(std::env::args_os()) {
        Ok(cli) => cli,
        Err(error) => error.exit(),
    };
    if let Err(failure) = logging::log_to_stderr(cli.verbose, cli.quiet) {
        output::complain(&failure);
        return failure.exit_code();
    }
    if cli.no_title {
        output::leave_titles_out();
    }
    conclude(cli.command.execute())
}

/// Returns the exit code, and prints the message of a failure.
fn conclude(result: Result<Verdict, Failure>) -> ExitCode {
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

/// Checks that `arguments`, without the program's name, are a valid command line of this program, without running it.
///
/// # Errors
/// The message that the program would print.
#[cfg(test)]
fn check_arguments<'a>(arguments: impl IntoIterator<Item = &'a str>) -> Result<(), String> {
    let command_line = core::iter::once("resonarm").chain(arguments);
    parse(command_line).map(|_cli| ()).map_err(|error| error.to_string())
}

/// Returns the command line, whose help lists the commands in groups.
fn whole() -> clap::Command {
    first_minute::in_groups(with_arguments(|_name| true), Command::GROUPS)
}

/// Returns the command line with the arguments of the wanted commands, with strict numbers and the defaults in the
/// help. The arguments of all commands take milliseconds to make, longer than many commands run.
fn with_arguments(is_wanted: impl Fn(&str) -> bool) -> clap::Command {
    let command = help::with_common_flags(Cli::command());
    let names: Vec<String> = command.get_subcommands().map(|sub| sub.get_name().to_owned()).collect();
    let wanted = names.into_iter().zip(Command::ARGUMENTS).filter(|(name, _)| is_wanted(name));
    wanted.fold(command, |command, (name, augment)| {
        // The arguments are added here, since clap adds deferred ones only while it parses.
        let add = |bare: clap::Command| augment(bare.defer(|command| command));
        command.mut_subcommand(name, |bare| help::in_order(defaults::stated(numbers::strict(add(bare)))))
    })
}

/// Returns the command that a command line begins with, after flags for logging; `None` if anything else comes first.
fn named(arguments: &[OsString]) -> Option<&str> {
    let sets_logging = |flag: &str| {
        ["--verbose", "--quiet", "-q"].contains(&flag)
            // -vv is one flag given twice, in one word.
            || flag.strip_prefix("-v").is_some_and(|more| more.chars().all(|c| c == 'v'))
    };
    let mut words = arguments.iter().skip(1).map(|word| word.to_str());
    let name = words.find(|word| !word.is_some_and(sets_logging)).flatten()?;
    let commands = || Command::GROUPS.iter().flat_map(|(_, commands)| *commands);
    commands().any(|command| command.to_lowercase() == name).then_some(name)
}

/// Parses a command line. Only the arguments of its command are made, if it names one.
fn parse(arguments: impl IntoIterator<Item = impl Into<OsString>>) -> Result<Cli, clap::Error> {
    let arguments: Vec<OsString> = arguments.into_iter().map(Into::into).collect();
    // `named` gives up where anything unusual comes first. All arguments are then made: slower, and still right.
    let mut command = match named(&arguments) {
        Some(name) => with_arguments(|command| command == name),
        None => whole(),
    };
    let matches = command.try_get_matches_from_mut(arguments)?;
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaves(command: &clap::Command, path: Vec<String>) -> Vec<Vec<String>> {
        let of = |sub: &clap::Command| leaves(sub, [&path[..], &[sub.get_name().to_owned()]].concat());
        let below: Vec<_> = command.get_subcommands().flat_map(of).collect();
        if below.is_empty() { vec![path] } else { below }
    }

    /// The help of every command is the same if only its own arguments are made.
    #[test]
    fn a_command_alone_is_that_of_the_whole() {
        let paths = leaves(&whole(), vec![]);
        assert!(paths.len() > 35, "{paths:?}");
        for path in paths {
            let words =
                [&[String::from("resonarm"), String::from("-vv")], &path[..], &[String::from("--help")]].concat();
            let help =
                |mut command: clap::Command| command.try_get_matches_from_mut(&words).map_err(|help| help.to_string());
            let name = named(&words.iter().map(OsString::from).collect::<Vec<_>>()).map(String::from);
            assert_eq!(name.as_ref(), path.first());
            assert_eq!(help(with_arguments(|command| command == path[0])).err(), help(whole()).err(), "{path:?}");
        }
        for words in ["resonarm run", "resonarm -q run", "resonarm --quiet -vv run"] {
            assert_eq!(named(&words.split(' ').map(OsString::from).collect::<Vec<_>>()), Some("run"), "{words}");
        }
        for words in ["resonarm", "resonarm help run", "resonarm --rate-hz 1 run", "resonarm -x run", "resonarm runs"] {
            assert_eq!(named(&words.split(' ').map(OsString::from).collect::<Vec<_>>()), None, "{words}");
        }
    }
}
