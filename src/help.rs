//! The headings of options in the help, and the options that all commands have.
//!
//! `-h` shows one line for each option that is used often, `--help` all options with their explanations. So the first
//! paragraph of an option's doc comment fits a line, and says what the value is, its unit, and its range.

use clap::{Arg, ArgAction, Command};

/// Headings of options, in the order in which every help has them.
///
/// A struct of flags gives all of them its heading by `next_help_heading`. One that also flattens other flags names the
/// heading at each of its own, since clap keeps the heading of flattened flags for those behind them.
pub(crate) mod heading {
    pub(crate) const BUS: &str = "Bus and time";
    pub(crate) const TEST: &str = "Tests and tolerances";
    pub(crate) const SIMULATED: &str = "What is simulated";
    pub(crate) const RECORDS: &str = "Selection of records";
    pub(crate) const LOADS: &str = "Excitation and response";
    pub(crate) const RANGE: &str = "Range and steps";
    pub(crate) const COMPUTATION: &str = "Computation";
    pub(crate) const NETWORK: &str = "Network";
    pub(crate) const LIVE: &str = "Live view";
    pub(crate) const OUTPUT: &str = "Output";
    pub(crate) const COMMON: &str = "Common to all commands";

    pub(crate) const ALL: [&str; 11] =
        [BUS, TEST, SIMULATED, RECORDS, LOADS, RANGE, COMPUTATION, NETWORK, LIVE, OUTPUT, COMMON];
}

/// Position of the common options within a command: behind all of its own.
pub(crate) const LAST: usize = 1000;

/// The program with -h and -V as clap makes them, but under the heading of the common options.
pub(crate) fn with_common_flags(command: Command) -> Command {
    let common = |id: &'static str, short: char| {
        // The order of -v, -q and --no-title begins at `LAST`: these two come behind them.
        Arg::new(id).short(short).long(id).global(true).help_heading(heading::COMMON).display_order(2 * LAST)
    };
    let help = common("help", 'h')
        .action(ArgAction::Help)
        .help("Print help: -h in short, --help with all options, explanations and examples");
    let version = common("version", 'V').action(ArgAction::Version).help("Print the version");
    command.disable_help_flag(true).disable_version_flag(true).propagate_version(true).args([help, version])
}

/// The command, and its subcommands, with its options in the order of their headings.
pub(crate) fn in_order(command: Command) -> Command {
    // clap shows a heading where its first option is, and flags that commands share have several headings.
    let mut sorted: Vec<Arg> = command.get_arguments().cloned().collect();
    // The sort is stable, so options of one heading keep the order of their fields. `None` is the least, which leaves
    // positional arguments in front.
    sorted.sort_by_key(position);
    let mut sorted = sorted.into_iter();
    // The arguments are visited in their order: each place gets the next one of the sorted list.
    command.mut_args(|arg| sorted.next().unwrap_or(arg)).mut_subcommands(in_order)
}

/// Position of an option's heading; `None` for a positional argument.
fn position(arg: &Arg) -> Option<usize> {
    heading::ALL.iter().position(|heading| Some(*heading) == arg.get_help_heading())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::whole;

    /// A screen, at 100 columns. The list of all commands alone is longer.
    const MOST_LINES: usize = 45;

    /// Every command below this one, as the user sees it, with its full name.
    fn commands(command: &Command) -> Vec<(String, Command)> {
        let below = command.get_subcommands().filter(|sub| sub.get_name() != "help");
        below
            .flat_map(|sub| [vec![(sub.get_bin_name().unwrap().to_owned(), sub.clone())], commands(sub)].concat())
            .collect()
    }

    /// Every command of the program, at 100 columns.
    pub(crate) fn commands_of_the_program() -> Vec<(String, Command)> {
        let mut program = whole().term_width(100);
        program.build();
        commands(&program)
    }

    #[test]
    fn the_short_help_of_every_command_fits_a_screen() {
        for (name, mut command) in commands_of_the_program() {
            let help = command.render_help().to_string();
            assert!(help.lines().count() <= MOST_LINES, "{name} -h has {} lines:\n{help}", help.lines().count());
        }
    }

    #[test]
    fn every_option_has_its_heading_in_the_common_order() {
        for (name, command) in commands_of_the_program() {
            let options: Vec<&Arg> = command.get_arguments().filter(|arg| !arg.is_positional()).collect();
            let positions: Vec<Option<usize>> = options.iter().map(|arg| position(arg)).collect();
            let without: Vec<_> =
                options.iter().filter(|arg| position(arg).is_none()).map(|arg| arg.get_id()).collect();
            assert!(without.is_empty(), "{name} has options without a heading: {without:?}");
            assert!(positions.is_sorted(), "{name}: {positions:?}");
        }
    }
}
