//! Flags that several subcommands share.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::builder::{PossibleValuesParser, RangedI64ValueParser, TypedValueParser};
use clap::{Args, ValueEnum};

use crate::failure::Failure;
use crate::numbers;
use resonarm::integrate::Scheme;
use resonarm::realtime::{FifoPriority, Spin, ThreadSetup};
use resonarm::run::OnShortfall;
use resonarm::scenario::{Scenario, StructureKind};
use resonarm_numeric::seed;

/// Parses the number of points in a range; the maximum fits easily in memory and in a figure.
pub(crate) fn points() -> RangedI64ValueParser<u32> {
    RangedI64ValueParser::new().range(2..=1_000_000)
}

/// Parses one of these values by its name.
pub(crate) fn one_of<T, const N: usize>(
    wanted: [T; N],
    name: impl Fn(T) -> &'static str + Clone + Send + Sync + 'static,
) -> impl TypedValueParser<Value = T>
where
    T: Copy + Send + Sync + 'static,
{
    PossibleValuesParser::new(wanted.map(&name)).try_map(move |text| {
        let found = wanted.into_iter().find(|one| name(*one) == text);
        found.ok_or_else(|| format!("it must be one of {}", wanted.map(&name).join(", ")))
    })
}

/// A name with a number, the value of a flag: `NAME=X`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NamedNumber {
    pub name: String,
    pub value: f64,
}

impl FromStr for NamedNumber {
    type Err = String;

    fn from_str(text: &str) -> Result<NamedNumber, String> {
        let (name, value) = text.split_once('=').ok_or("it must be a name with a number, NAME=X")?;
        Ok(NamedNumber { name: name.to_owned(), value: numbers::finite(value)? })
    }
}

/// The scenario, and what of its structure differs. [`defaults`](crate::defaults) adds each command's defaults to the
/// help.
#[derive(Clone, Debug, Args)]
pub(crate) struct StructureFlags {
    /// TOML file with the whole scenario, in place of the defaults; flags take precedence.
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
    /// Parameters of the two-link arm: irb1600-fitted or irb1600-table1.
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// Angle of each link of a chain against the link before, degrees, from the base out; 0 goes straight on.
    #[arg(long, value_name = "A,B", value_delimiter = ',', num_args = 1)]
    pub angles_deg: Option<Vec<f64>>,
    /// Value of a parameter of the structure, as link2.mass_kg=40, mode1.damping_ratio=0.01 or element1.gap_m=1e-3; may
    /// be repeated.
    #[arg(long, value_name = "NAME=X", allow_hyphen_values = true)]
    pub set: Vec<NamedNumber>,
}

/// What the plant and the exciter of a run must agree on.
#[derive(Clone, Debug, Args)]
pub(crate) struct SessionFlags {
    #[command(flatten)]
    pub structure: StructureFlags,
    /// Samples a second, whole Hz.
    #[arg(long, value_name = "HZ")]
    pub rate_hz: Option<f64>,
    /// Seed of the sensor noise, decimal or as 0x1F.
    #[arg(long, value_name = "N", value_parser = seed::parse)]
    pub seed: Option<u64>,
    /// Integration scheme: rk4, dop853, gl4, gl6, exponential, exponential8.
    #[arg(long, value_name = "NAME")]
    pub scheme: Option<String>,
    /// Length of the run, s.
    #[arg(long, value_name = "S")]
    pub duration_s: Option<f64>,
}

/// How strictly a run in real time needs a real-time thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum RealTimeThread {
    // Uses what the system grants and reports the rest. No documentation: the help would repeat that of the flag.
    #[default]
    Auto,
    // Refuses to run without all of it.
    Require,
    // Asks for nothing.
    Off,
}

/// Whether the real-time loop spins.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct SpinFlag {
    /// Sleep until this many µs before each deadline, then poll the clock; auto measures how late sleeps are, off
    /// sleeps until the deadline. At most a quarter of the period.
    #[arg(long, value_name = "SPIN", default_value_t, allow_hyphen_values = true)]
    pub spin: Spin,
}

/// Thread settings that a run in real time asks of the system.
#[derive(Clone, Debug, Args)]
pub(crate) struct ThreadFlags {
    /// Real-time scheduling, locked memory and the core: auto takes what the system grants and reports the rest,
    /// require refuses to run without them, off does not ask.
    #[arg(long, value_enum, default_value_t)]
    rt: RealTimeThread,
    /// Core to pin the real-time loop to; recorder, live view and python-can adapters move off it if there is another.
    #[arg(long, value_name = "N")]
    core: Option<usize>,
    /// SCHED_FIFO priority of the real-time loop, 1 to 99.
    #[arg(long, value_name = "P", default_value_t = FifoPriority::DEFAULT.get())]
    priority: u8,
    /// Keep all cores of the machine out of their idle states during the run, so that no wake-up waits for one to
    /// resume. It costs power, and takes time from other guests of a shared machine.
    #[arg(long)]
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
        if let Some(preset) = &self.preset {
            let kind = scenario.structure.kind;
            if kind != StructureKind::Preset {
                return Err(Failure::usage(format!(
                    "--preset {preset} is a structure of its own, but the scenario's [structure] is of the kind {}: leave --preset out",
                    kind.name()
                )));
            }
            scenario.structure.preset = Some(preset.clone());
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
                section.kind.name()
            )));
        }
    };
    if angles.len() != angles_deg.len() {
        return Err(Failure::usage(format!(
            "--angles-deg has {} numbers, expected {}, one for each link",
            angles_deg.len(),
            angles.len()
        )));
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
        if let Some(scheme) = &self.scheme {
            simulation.scheme = parse_scheme(scheme)?;
        }
        Ok(scenario)
    }
}

/// Returns the failure for a flag whose value was rejected with `error`.
pub(crate) fn refused(flag: &str, error: &impl core::fmt::Display) -> Failure {
    Failure::usage(format!("{flag}: {error}"))
}

pub(crate) fn parse_scheme(name: &str) -> Result<Scheme, Failure> {
    name.parse().map_err(|error: resonarm::integrate::UnknownScheme| Failure::usage(error.to_string()))
}
/// Reads a scenario, and warns of doubtful content in the files that it names.
pub(crate) fn read_scenario(path: &Path) -> Result<Scenario, Failure> {
    let scenario = Scenario::read(path)?;
    for warning in &scenario.structure.warnings {
        tracing::warn!("{}: {warning}", path.display());
    }
    Ok(scenario)
}
