//! The overview that is printed without arguments, and the grouping of the commands in `--help`.

use clap::Command;
use clap::builder::StyledStr;

use crate::help::heading::COMMON;

/// The text that `resonarm` prints without arguments.
pub(crate) const BY_TRADE: &str = "\
Resonarm simulates the vibration of a robot arm, or of a structure of yours, on a CAN bus, and analyses it.

First         resonarm demo                          arm and controller in one process: a folded resonance, plotted
              resonarm quickstart my-bench           a folder with a bench, and controllers in three languages
Controllers   resonarm run --bus vcan0               the plant on a bus, for your controller or firmware
              resonarm conformance --bus vcan0 --role plant      tests a node for protocol conformance
Measurements  resonarm inspect run.mcap              shows a recording; export and import convert it
              resonarm identify run.mcap             natural frequencies and damping from what was measured
Analysis      resonarm frf --plot responses          responses of the linear structure
              resonarm continue --drive joint1=60 --from-hz 21 --to-hz 23 --plot branch    folds and stability
All commands  resonarm --help, and resonarm COMMAND --help
";

/// Makes the help of a command line list its commands in these groups, a title and the variants of the commands each.
pub(crate) fn in_groups(command: Command, groups: &[(&str, &[&str])]) -> Command {
    let listed =
        groups.iter().map(|(title, names)| format!("{title}:\n{}\n", list(&command, names))).collect::<String>();
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{listed}{COMMON}:\n{{options}}{{after-help}}"
    ))
}

/// Returns the lines of these commands, wrapped by clap as it wraps the whole list.
fn list(command: &Command, variants: &[&str]) -> StyledStr {
    let names = variants.iter().map(|variant| variant.to_lowercase());
    let found = names.filter_map(|name| command.find_subcommand(name)).cloned();
    // clap can't group subcommands. A command of its own for each group lends its list, wrapped as clap wraps the
    // whole one.
    let alone = Command::new("").help_template("{subcommands}\n").max_term_width(120).disable_help_subcommand(true);
    found.enumerate().fold(alone, |list, (order, one)| list.subcommand(one.display_order(order))).render_help()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_it_says_of_itself_are_commands() {
        assert!(BY_TRADE.lines().count() <= 12 && BY_TRADE.lines().all(|line| line.chars().count() <= 120));
        let shown = BY_TRADE.lines().skip(2).filter(|line| !line.starts_with("All commands"));
        for line in shown {
            let command = line.split_once("resonarm ").map_or("", |(_, rest)| rest);
            let command = command.split("  ").next().unwrap_or_default();
            assert_eq!(crate::check_arguments(command.split(' ')), Ok(()), "{command}");
        }
    }
}
