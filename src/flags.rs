//! Flags that several subcommands share.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Arg, Args, Command, ValueEnum};

use crate::failure::Failure;
use crate::help::heading;
use crate::numbers;
use resonarm::analysis::Coordinate;
use resonarm::integrate::Scheme;
use resonarm::realtime::{FifoPriority, Spin, ThreadSetup};
use resonarm::run::OnShortfall;
use resonarm::scenario::{Scenario, StructureKind};
use resonarm::structure::Preset;
use resonarm_numeric::seed;

/// Parses the number of points in a range; the maximum fits easily in memory and in a figure.
pub(crate) fn points() -> impl TypedValueParser<Value = u32> {
    numbers::integer(2..=1_000_000)
}

/// Parses a value by its name with the parser, and the message, of its type. The help and a shell list the names.
#[derive(Clone, Copy)]
pub(crate) struct ByName<T, const N: usize>(pub [T; N], pub fn(T) -> &'static str);

impl<T, const N: usize> TypedValueParser for ByName<T, N>
where
    T: FromStr<Err: core::error::Error + Send + Sync> + Copy + Send + Sync + 'static,
{
    type Value = T;

    fn parse_ref(&self, command: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<T, clap::Error> {
        str::parse::<T>.parse_ref(command, arg, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(self.0.iter().map(|one| PossibleValue::new(self.1(*one)))))
    }
}

/// Parses one of these values by its name.
pub(crate) fn one_of<T, const N: usize>(
    wanted: [T; N],
    name: impl Fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    described(wanted.map(|one| (one, name(one), "")))
}

/// Parses one of these values by its name. The long help explains each name by the text behind it, unless that is empty.
pub(crate) fn described<T, const N: usize>(
    wanted: [(T, &'static str, &'static str); N],
) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    let shown = wanted.map(|(_, name, text)| PossibleValue::new(name).help((!text.is_empty()).then_some(text)));
    PossibleValuesParser::new(shown).try_map(move |given| {
        // clap has refused any other name before, so that the error is never shown.
        let found = wanted.into_iter().find(|(_, name, _)| *name == given);
        found.map(|(value, ..)| value).ok_or("it must be one of these names")
    })
}

/// A name with a number, the value of a flag: `NAME=X`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NamedNumber {
    pub name: String,
    pub value: f64,
}

fn named_number(text: &str) -> Result<NamedNumber, String> {
    let (name, value) = text.split_once('=').ok_or("it must be a name with a number, NAME=X")?;
    Ok(NamedNumber { name: name.to_owned(), value: numbers::finite(value)? })
}

/// The scenario, and what of its structure differs. [`defaults`](crate::defaults) adds each command's defaults to the
/// help.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::SIMULATED)]
pub(crate) struct StructureFlags {
    /// TOML file with the whole scenario; flags take precedence over it.
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// Parameters of the two-link arm.
    #[arg(long, value_name = "NAME", value_parser = ByName(Preset::ALL, Preset::name))]
    pub preset: Option<Preset>,
    /// Angle of each link, degrees.
    ///
    /// It counts from the link before, from the base out. At 0 a link continues in the direction of the link before.
    #[arg(long, value_name = "A,B", value_delimiter = ',', num_args = 1)]
    pub angles_deg: Option<Vec<f64>>,
    /// Value of a structure's parameter, as link2.mass_kg=40; may be repeated.
    ///
    /// Modes and elements have parameters, too, as mode1.damping_ratio=0.01 and element1.gap_m=1e-3.
    #[arg(long, value_name = "NAME=X", allow_hyphen_values = true, value_parser = named_number)]
    pub set: Vec<NamedNumber>,
}

/// What the plant and the exciter of a run must agree on.
#[derive(Clone, Debug, Args)]
pub(crate) struct SessionFlags {
    #[command(flatten)]
    pub structure: StructureFlags,
    /// Sample rate, Hz, an integer from 1 to 65535.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "HZ")]
    pub rate_hz: Option<f64>,
    /// Seed of the noise, decimal or as 0x1F.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "N", value_parser = seed::parse)]
    pub seed: Option<u64>,
    /// Integration scheme.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "NAME", value_parser = ByName(Scheme::ALL, Scheme::name), hide_short_help = true)]
    pub scheme: Option<Scheme>,
    /// Length of the run, s.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "S")]
    pub duration_s: Option<f64>,
}

/// How strictly a run in real time needs a real-time thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum RealTimeThread {
    /// Uses what the system grants, and reports the rest.
    #[default]
    Auto,
    /// Refuses to run without all of it.
    Require,
    /// Asks for nothing.
    Off,
}

/// Whether the real-time loop spins.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = heading::BUS)]
pub(crate) struct SpinFlag {
    /// Time to poll the clock before each deadline, µs, or auto, or off.
    ///
    /// The loop sleeps until then. `auto` measures how late sleeps are and polls for as long; `off` sleeps until the
    /// deadline. At most a quarter of the period.
    #[arg(long, value_name = "SPIN", default_value_t, allow_hyphen_values = true)]
    pub spin: Spin,
}

/// Thread settings that a run in real time asks of the system.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::BUS)]
pub(crate) struct ThreadFlags {
    /// Whether to ask for real-time scheduling, locked memory and the core.
    #[arg(long, value_enum, default_value_t)]
    rt: RealTimeThread,
    /// Core to pin the real-time loop to, from 0.
    ///
    /// Recorder, live view and python-can adapters move off it if there is another.
    #[arg(long, value_name = "N", value_parser = numbers::integer(0..=1023_usize))]
    core: Option<usize>,
    /// SCHED_FIFO priority of the real-time loop, 1 to 99.
    #[arg(long, value_name = "P", default_value_t = FifoPriority::DEFAULT.get(), value_parser = numbers::integer_checked_later(1..=99_u8), hide_short_help = true)]
    priority: u8,
    /// Keep all cores of the machine out of their idle states during the run.
    ///
    /// No wake-up then waits for a core to resume. It costs power, and takes time from other guests of a shared machine.
    #[arg(long, hide_short_help = true)]
    cores_awake: bool,
}

impl ThreadFlags {
    /// Returns the settings to ask for; `None` with --rt off.
    pub fn setup(&self) -> Result<Option<ThreadSetup>, Failure> {
        let priority = FifoPriority::try_from(self.priority).map_err(|error| Failure::usage(error.to_string()))?;
        let cores_awake = self.cores_awake;
        let setup = ThreadSetup { priority: Some(priority), core: self.core, cores_awake, ..ThreadSetup::default() };
        let left_out =
            |asked: &str| Err(Failure::usage(format!("{asked} and --rt off exclude each other: give one of them")));
        match (self.rt, self.core) {
            (RealTimeThread::Off, Some(core)) => left_out(&format!("--core {core}")),
            (RealTimeThread::Off, None) if cores_awake => left_out("--cores-awake"),
            (RealTimeThread::Off, None) => Ok(None),
            (RealTimeThread::Auto | RealTimeThread::Require, _) => Ok(Some(setup)),
        }
    }

    /// Says whether a setting that the system does not grant ends the run or is only warned of.
    pub fn on_shortfall(&self) -> OnShortfall {
        match self.rt {
            RealTimeThread::Require => OnShortfall::Refuse,
            RealTimeThread::Auto | RealTimeThread::Off => OnShortfall::Warn,
        }
    }
}

impl StructureFlags {
    /// Returns the scenario of the file, or the usual one, with the flags applied.
    pub fn scenario(&self) -> Result<Scenario, Failure> {
        self.scenario_or(|| Ok(Scenario::default()))
    }

    /// The scenario of the file, or `default`, with the flags applied.
    pub fn scenario_or(&self, default: impl FnOnce() -> Result<Scenario, Failure>) -> Result<Scenario, Failure> {
        let mut scenario = match &self.scenario {
            Some(path) => read_scenario(path)?,
            None => default()?,
        };
        if let Some(preset) = self.preset.map(Preset::name) {
            let kind = scenario.structure.kind;
            if kind != StructureKind::Preset {
                return Err(Failure::usage(format!(
                    "--preset {preset} is a structure of its own, but the scenario's [structure] is of the kind {kind}: leave --preset out"
                )));
            }
            scenario.structure.preset = Some(preset.to_owned());
        }
        if let Some(angles_deg) = &self.angles_deg {
            turn(&mut scenario, angles_deg)?;
        }
        if !self.set.is_empty() {
            let set = &mut scenario.structure.set;
            set.extend(self.set.iter().map(|NamedNumber { name, value }| (name.clone(), *value)));
        }
        Ok(scenario)
    }
}

/// Gives the links of a scenario's chain these angles, degrees.
fn turn(scenario: &mut Scenario, angles_deg: &[f64]) -> Result<(), Failure> {
    let section = &mut scenario.structure;
    // Parameters of `set` are applied after the section's own values, so they would undo the angles of the flag.
    section.set.retain(|name, _| !(name.starts_with("link") && name.ends_with(".angle_deg")));
    let mut angles: Vec<&mut f64> = match section.kind {
        StructureKind::Preset => section.angles_deg.iter_mut().collect(),
        StructureKind::Chain => section.links.iter_mut().map(|link| &mut link.angle_deg).collect(),
        StructureKind::Modal | StructureKind::Own | StructureKind::Fmu => {
            return Err(Failure::usage(format!(
                "--angles-deg turns the links of a chain, but the scenario's [structure] is of the kind {}: leave --angles-deg out",
                section.kind
            )));
        }
    };
    if angles.len() != angles_deg.len() {
        let got = angles_deg.len();
        let expected = angles.len();
        return Err(Failure::usage(format!("--angles-deg has {got} numbers, expected {expected}, one for each link")));
    }
    angles.iter_mut().zip(angles_deg).for_each(|(angle, given)| **angle = *given);
    Ok(())
}

impl SessionFlags {
    /// Rejects --duration-s for work that ends by itself, and says why.
    pub fn refuse_duration(&self, why: &str) -> Result<(), Failure> {
        let refused = |duration_s| Err(Failure::value("--duration-s", duration_s, format!("{why}, leave it out")));
        self.duration_s.map_or(Ok(()), refused)
    }

    /// The scenario of the file, or `default`, with the flags applied.
    pub fn scenario_or(&self, default: impl FnOnce() -> Result<Scenario, Failure>) -> Result<Scenario, Failure> {
        let mut scenario = self.structure.scenario_or(default)?;
        let simulation = &mut scenario.simulation;
        simulation.rate_hz = self.rate_hz.unwrap_or(simulation.rate_hz);
        simulation.seed = self.seed.unwrap_or(simulation.seed);
        simulation.duration_s = self.duration_s.or(simulation.duration_s);
        simulation.scheme = self.scheme.unwrap_or(simulation.scheme);
        Ok(scenario)
    }
}

/// Returns the first value of a repeatable flag that is the same as one before it.
pub(crate) fn repeated<T>(values: &[T], is_same: impl Fn(&T, &T) -> bool) -> Option<&T> {
    let mut known = values.iter().enumerate();
    known.find(|(place, value)| values[..*place].iter().any(|before| is_same(before, value))).map(|(_, value)| value)
}

/// Returns the failure for a flag whose value was rejected with `error`.
pub(crate) fn refused(flag: &str, error: &impl core::fmt::Display) -> Failure {
    Failure::usage(format!("{flag}: {error}"))
}

/// Reads a scenario, and warns of doubtful content.
pub(crate) fn read_scenario(path: &Path) -> Result<Scenario, Failure> {
    let scenario = Scenario::read(path)?;
    for warning in scenario.structure.warnings() {
        tracing::warn!("{}: {warning}", path.display());
    }
    Ok(scenario)
}

/// Returns both ends of the interval of a coordinate, `hz` of the frequency and `other` of any other one; with `None` no
/// interval is allowed. Ends in the other unit are an error.
pub(crate) fn interval(
    parameter: &str,
    coordinate: Option<Coordinate>,
    hz: [Option<f64>; 2],
    other: [Option<f64>; 2],
) -> Result<Option<[f64; 2]>, Failure> {
    let wanted = coordinate.map(|of| if of == Coordinate::FrequencyHz { "-hz" } else { "" });
    let needs = wanted.map_or_else(String::new, |unit| format!("; give its interval by --from{unit} a --to{unit} b"));
    // Ends that have no place here are told first: they are why the others are missing.
    for (unit, [from, to]) in [("-hz", hz), ("", other)].into_iter().filter(|(unit, _)| Some(*unit) != wanted) {
        if let Some(end) = from.map(|_| "from").or(to.map(|_| "to")) {
            return Err(Failure::usage(format!("--{end}{unit} is not for {parameter}{needs}")));
        }
    }
    let Some(unit) = wanted else { return Ok(None) };
    match if unit == "-hz" { hz } else { other } {
        [Some(from), Some(to)] => Ok(Some([from, to])),
        _ => Err(Failure::usage(format!("{parameter} needs an interval: give it by --from{unit} a --to{unit} b"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_the_ends_in_the_unit_wanted_and_no_others() {
        let none = [None, None];
        let both = [Some(20.0), Some(23.0)];
        let hz = Some(Coordinate::FrequencyHz);
        let load = Some(Coordinate::Amplitude);
        assert_eq!(interval("a sweep", hz, both, none).unwrap(), Some([20.0, 23.0]));
        assert_eq!(interval("a diagram", load, none, both).unwrap(), Some([20.0, 23.0]));
        assert_eq!(interval("a section", None, none, none).unwrap(), None);
        let says = |of, hz, other| interval("--parameter amplitude", of, hz, other).unwrap_err().to_string();
        insta::assert_snapshot!(says(load, both, none), @"--from-hz is not for --parameter amplitude; give its interval by --from a --to b");
        insta::assert_snapshot!(says(load, none, [None, Some(1.0)]), @"--parameter amplitude needs an interval: give it by --from a --to b");
        insta::assert_snapshot!(says(load, none, none), @"--parameter amplitude needs an interval: give it by --from a --to b");
        insta::assert_snapshot!(says(None, none, [None, Some(1.0)]), @"--to is not for --parameter amplitude");
    }
}
