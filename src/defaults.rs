//! The defaults in the help that differ between commands, read from the scenarios that the commands use.

use clap::{Arg, Command};

use crate::commands::{demo, exciter, experiment, run};
use crate::failure::Failure;
use resonarm::control::PhaseWalkSpec;
use resonarm::rig::Load;
use resonarm::run::{Mode, Speed};
use resonarm::scenario::Scenario;
use resonarm::structure::Preset;
use resonarm_numeric::number::short;

/// Adds `[default: …]` in a command, or its subcommands, after the help of every flag whose default comes from a
/// scenario. If an embedded scenario can't be read, its command shows no defaults; running the command reports why.
pub(crate) fn stated(command: Command) -> Command {
    if command.has_subcommands() {
        return command.mut_subcommands(stated);
    }
    let all = defaults(command.get_name()).unwrap_or_default();
    let ends_by_itself = ["exciter", "fig9"].contains(&command.get_name());
    // Such commands reject the flag, and say why.
    let command = if ends_by_itself { command.mut_arg("duration_s", |arg| arg.hide(true)) } else { command };
    with(command, &all)
}

/// The flags of a command with their defaults.
type Defaults = Vec<(&'static str, String)>;

/// Adds to a command the defaults of the flags that it has.
fn with(command: Command, defaults: &Defaults) -> Command {
    defaults.iter().fold(command, |command, (id, default)| {
        let has_it = |arg: &Arg| arg.get_id() == id && arg.get_default_values().is_empty();
        if !command.get_arguments().any(has_it) {
            return command;
        }
        command.mut_arg(id, |arg| {
            let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
            // clap states its defaults in the long help in a paragraph of their own.
            let long = arg.get_long_help().map(|long| format!("{long}\n\n[default: {default}]"));
            let arg = arg.help(format!("{help} [default: {default}]"));
            match long {
                Some(long) => arg.long_help(long),
                None => arg,
            }
        })
    })
}

/// Returns the defaults of the command of this name.
fn defaults(command: &str) -> Result<Defaults, Failure> {
    let scenario = match command {
        "demo" => demo::scenario()?,
        "exciter" => exciter::scenario()?,
        "fig9" => experiment::fig9::scenario()?,
        _ => Scenario::default(),
    };
    let walk = PhaseWalkSpec::new(Load::default());
    let mut all = of_scenario(&scenario);
    match command {
        "demo" => all.push(("speed", short(&Speed::ACTUAL.times()).to_string())),
        "simulate" | "integrators" => {
            all.retain(|(id, _)| *id != "rate_hz");
            all.push(("rate_hz", short(&scenario.simulation.step_rate_hz()).to_string()));
        }
        "walk" => {
            all.push(("mode_number", u8::from(walk.mode_number).to_string()));
            all.push(("points", walk.points.to_string()));
            all.push(("duration_s", String::from("until the walk ends")));
        }
        "run" => {
            let free = of_scenario(&run::default_scenario(Mode::Free)?);
            // Both lists have the same flags in the same order.
            for ((_, default), (_, free)) in all.iter_mut().zip(free) {
                if *default != free {
                    *default = format!("{default}, with --mode free {free}");
                }
            }
            all.push((
                "duration_s",
                String::from("until it is stopped, with --mode free until the exciter has finished"),
            ));
        }
        // The only command with a preset and no scenario.
        "paper" => all = vec![("preset", Preset::default().name().to_owned())],
        _ => {}
    }
    Ok(all)
}

/// Returns a scenario's values for the flags of an arm and a session.
fn of_scenario(scenario: &Scenario) -> Defaults {
    let structure = &scenario.structure;
    let simulation = &scenario.simulation;
    let angles: Vec<String> = structure.angles_deg.iter().map(|angle_deg| short(angle_deg).to_string()).collect();
    vec![
        ("preset", structure.preset.clone().unwrap_or_default()),
        ("angles_deg", angles.join(",")),
        ("rate_hz", short(&simulation.rate_hz).to_string()),
        ("seed", simulation.seed.to_string()),
        ("scheme", simulation.scheme.to_string()),
    ]
}

#[cfg(test)]
mod tests {
    use clap::FromArgMatches;

    use super::*;
    use crate::commands::experiment::Kind;
    use crate::{Cli, whole};

    /// The other arguments that a command line with this flag needs.
    fn needed(path: &str, flag: &str) -> &'static str {
        match (path, flag) {
            ("simulate", _) => "--duration-s 1",
            ("exciter", _) => "--bus vcan0",
            ("conformance", _) => "--bus vcan0 --role plant",
            ("experiment walk", _) => "--drive joint1=1",
            ("paper", _) => "fig4",
            ("modes", "points") => "--over link2.angle_deg --from 0 --to 9",
            ("identify", "integration") => "x --angles y",
            ("identify" | "compare" | "inspect" | "resim", _) => "x",
            ("replay", _) => "x --bus vcan0",
            ("export", _) => "x --to csv",
            ("plot", _) => "x --of psd",
            ("verdict", _) => "navmat-p-9492 x",
            ("survey", _) => "x --out y",
            ("audit", _) => "--scenario x --specification navmat-p-9492 --controller y",
            ("cut" | "merge" | "import" | "diff" | "recover", _) => "x y",
            ("basins", _) => "--frequency-hz 1",
            ("sweep", _) => "--from-hz 1 --to-hz 2",
            ("poincare", "points" | "direction") => "--parameter frequency",
            ("fmu", _) => "--scenario bench.toml --out plant.fmu",
            ("protocol encode", _) => "Time",
            _ => "",
        }
    }

    /// Returns what the program reads of a command line. `whole` describes all commands; making it takes longer than using it.
    fn read(whole: &mut Command, path: &str, flag: &str, given: &[String]) -> Result<Cli, String> {
        let words = format!("resonarm {path} {}", needed(path, flag));
        let words = words.split_whitespace().map(str::to_owned).chain(given.iter().cloned());
        let matches = whole.try_get_matches_from_mut(words).map_err(|error| error.to_string())?;
        Cli::from_arg_matches(&matches).map_err(|error| error.to_string())
    }

    /// The values a command uses for the flags whose defaults the parser does not fill in.
    fn used(cli: &Cli) -> String {
        use crate::Command::*;
        let of = |scenario: Result<Scenario, Failure>| format!("{:?}", scenario.unwrap());
        match &cli.command {
            Demo(command) => format!("{} {:?}", of(command.scenario()), command.speed().unwrap()),
            Run(command) => of(command.scenario()),
            Exciter(command) => of(command.scenario()),
            Experiment(command) => match &command.experiment {
                Kind::Fig9(command) => of(command.scenario()),
                Kind::Walk(command) => of(command.scenario()),
            },
            Simulate(command) => {
                let scenario = command.structure.scenario().unwrap();
                format!("{:?} {scenario:?}", command.scheme_and_rate(&scenario).unwrap())
            }
            Integrators(command) => {
                let scenario = command.structure.scenario().unwrap();
                format!("{} {scenario:?}", command.rate_hz(&scenario))
            }
            Modes(command) => of(command.structure.scenario()),
            Frf(command) => of(command.structure.scenario()),
            Continue(command) => of(command.structure.scenario()),
            Backbone(command) => of(command.structure.scenario()),
            Sweep(command) => of(command.settling.structure.scenario()),
            Poincare(command) => of(command.settling.structure.scenario()),
            Basins(command) => of(command.settling.structure.scenario()),
            Paper(command) => command.preset().name().to_owned(),
            Identify(command) => format!("{:?}", command.integration()),
            other => panic!("{other:?}: say here what it computes with of the flag"),
        }
    }

    /// Every command without subcommands, with its path.
    fn leaves(command: &Command, path: &str) -> Vec<(String, Command)> {
        let subcommands = command.get_subcommands().filter(|sub| sub.get_name() != "help");
        subcommands
            .flat_map(|sub| {
                let path = format!("{path} {}", sub.get_name()).trim_start().to_owned();
                if sub.has_subcommands() { leaves(sub, &path) } else { vec![(path, sub.clone())] }
            })
            .collect()
    }

    /// The default that the help of a flag states, and whether the parser itself fills it in.
    fn stated_default(arg: &Arg) -> Option<(String, bool)> {
        let of_parser: Vec<_> = arg.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
        if arg.get_action().takes_values() && !of_parser.is_empty() {
            return Some((of_parser.join(","), true));
        }
        let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
        let (_, rest) = help.split_once("[default: ")?;
        Some((rest.split_once(']')?.0.to_owned(), false))
    }

    /// The default is words, not a value; it is listed under this name.
    enum Compared {
        Same,
        Words,
    }

    /// Compares a command with a flag at its default to the command without the flag, both with the arguments `others`.
    fn compare(whole: &mut Command, path: &str, arg: &Arg, others: &str, default: &str, of_parser: bool) -> Compared {
        let id = arg.get_id().as_str();
        let flag = arg.get_long().unwrap();
        let others: Vec<String> = others.split_whitespace().map(str::to_owned).collect();
        let bare = read(whole, path, id, &others).unwrap_or_else(|error| panic!("{path} --{flag}: {error}"));
        if default.contains(' ') {
            return Compared::Words;
        }
        match read(whole, path, id, &[others, vec![format!("--{flag}={default}")]].concat()) {
            Ok(given) if of_parser => assert_eq!(format!("{given:?}"), format!("{bare:?}"), "{path} --{flag}"),
            Ok(given) => assert_eq!(used(&given), used(&bare), "{path} --{flag}: {default}"),
            Err(error) if of_parser => panic!("{path} --{flag}: {error}"),
            Err(_no_value) => return Compared::Words,
        }
        Compared::Same
    }

    /// A flag at the default stated in its help gives the same as leaving the flag out. Defaults that are words, not
    /// values, are listed.
    #[test]
    fn every_default_in_the_help_is_the_commands() {
        let mut parser = whole();
        let mut values = 0;
        let mut words = Vec::new();
        for (path, command) in leaves(&whole(), "") {
            for arg in command.get_arguments().filter(|arg| arg.get_long().is_some()) {
                let Some((default, of_parser)) = stated_default(arg) else { continue };
                // A torque is commanded by a scenario's own protocol only.
                let beside = if arg.get_id() == "torque_nm" { "--scenario wire.toml" } else { "" };
                let cases = default.split_once(", with --mode free ").map_or_else(
                    || vec![(beside, default.as_str())],
                    |(on_a_bus, free)| vec![("", on_a_bus), ("--mode free", free)],
                );
                for (others, default) in cases {
                    match compare(&mut parser, &path, arg, others, default, of_parser) {
                        Compared::Same => values += 1,
                        Compared::Words => words.push(format!("{path} --{}: {default}", arg.get_long().unwrap())),
                    }
                }
            }
        }
        assert!(values > 100, "only {values} defaults are values");
        insta::assert_snapshot!(words.join("\n"), @r"
        run --patience-s: without end
        run --duration-s: until it is stopped
        run --duration-s: until the exciter has finished
        experiment walk --duration-s: until the walk ends
        conformance --beyond-n: none; in the FD profile 1.01 times the plant's limit
        conformance --beyond-n-per-s: none is tried
        conformance --beyond-travel-n: none is tried
        conformance --bit-rate-hz: without load alone
        conformance --expect-frequency-hz: no sine is expected
        conformance --pid: the case is left out
        replay --from-s: the beginning
        replay --to-s: the end
        plot --from-s: the beginning
        plot --to-s: the end
        plot --from-hz: 0, of srs that of two turns in the record
        plot --to-hz: half of the sample rate, of srs a tenth
        plot --segment-s: a power of two of samples, up to a fifth of the record
        survey --duration-s: from the least damping
        survey --exciters: where the scenario's load acts
        survey --sensors: all degrees of freedom
        survey --force-n: that of the scenario
        survey --highest-mode: the highest that the sample rate allows
        survey --from-hz: half of the first mode's
        survey --to-hz: 1.3 times the highest mode's
        identify --from-hz: that of the recorded excitation, or 1
        identify --to-hz: that of the recorded excitation, or 100
        identify --segment-s: whole periods, or an eighth of the record
        diff --parts: states,samples, or frames if there are neither
        diff --from-s: the beginning
        diff --to-s: the end
        cut --from-s: the beginning
        cut --to-s: the end
        export --parts: all that the format holds
        export --from-s: the beginning
        export --to-s: the end
        export --out: the recording's name, in the current folder
        import --from: by its ending, .log for candump, .asc, .blf
        import --interface: that of the first frame
        verdict --channels: those of the specification
        verdict --reference: the control channel itself
        verdict --from-s: the beginning
        verdict --to-s: the end
        frf --drive: joint1 of a chain
        frf --at: where the load acts
        frf --points: 801, and more about each natural frequency
        simulate --initial: that of the scenario, at rest
        continue --at: where the loads act
        backbone --at: where the loads act
        backbone --to: 0.3 at a joint
        sweep --initial: that of the scenario, at rest
        sweep --at: where the loads act
        sweep --points: 101, and more at resonances
        poincare --initial: that of the scenario, at rest
        poincare --at: where the loads act
        poincare --parameter: none; a single section is computed
        poincare --section-points: 2000, in a diagram 200
        basins --initial: that of the scenario, at rest
        basins --at: where the loads act
        basins --coordinates: the first coordinate and its rate
        basins --from: the negative of --to
        basins --to: 1.5 times as far as the largest stable response reaches
        compare --at: where the points move most
        fmu --library: libresonarm_fmu.so beside this program
        ");
    }
}
