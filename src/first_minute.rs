//! What the program says of itself: without arguments, and the commands of `--help` in groups.

use clap::Command;
use clap::builder::StyledStr;

/// What `resonarm` prints without arguments.
pub(crate) const BY_TRADE: &str = "\
Resonarm simulates the vibration of a robot arm, or of a structure of yours, on a CAN bus, and analyses it.

First          resonarm demo                    arm and controller in one process: a folded resonance, plotted
               resonarm quickstart my-bench     a folder with a scenario, a virtual bus and controllers to change
Controllers    resonarm run --bus vcan0         the plant on a bus, for your controller or firmware
               resonarm conformance plant --bus vcan0    whether a node keeps the protocol
Measurements   resonarm inspect run.mcap        what a recording holds; export and import convert it
               resonarm identify run.mcap       frequencies, damping and shapes from what was measured
Analysis       resonarm frf --from-hz 5 --to-hz 60       responses of the linear structure
               resonarm continue --drive f1x --amplitude 10 --from-hz 20 --to-hz 24     folds and stability
All commands   resonarm --help, and resonarm COMMAND --help
";

/// The command line whose help lists its commands in these groups, a title and the variants of the commands each.
pub(crate) fn in_groups(command: Command, groups: &[(&str, &[&str])]) -> Command {
    let listed = groups.iter().map(|(title, names)| format!("{title}:\n{}", list(&command, names))).collect::<String>();
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{listed}{{options-heading}}\n{{options}}{{after-help}}"
    ))
}

/// The lines of these commands, wrapped by clap as it wraps the whole list.
fn list(command: &Command, variants: &[&str]) -> StyledStr {
    let names = variants.iter().map(|variant| variant.to_lowercase());
    let found = names.filter_map(|name| command.find_subcommand(name)).cloned();
    let alone = Command::new("").help_template("{subcommands}\n\n").max_term_width(120).disable_help_subcommand(true);
    found.enumerate().fold(alone, |list, (order, one)| list.subcommand(one.display_order(order))).render_help()
}
