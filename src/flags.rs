//! Flags that several subcommands share.

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, RangedI64ValueParser, TypedValueParser};
use clap::{Args, ValueEnum};

use crate::failure::Failure;
use resonarm::arm::State;
use resonarm::integrate::Scheme;
use resonarm::plant::PlantSpecError;
use resonarm::realtime::{FifoPriority, Spin, ThreadSetup};
use resonarm::run::OnShortfall;
use resonarm::scenario::Scenario;
use resonarm_numeric::seed;

/// The number of points in a range; the maximum fits easily in memory and in a figure.
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
        found.ok_or_else(|| format!("it is one of {}", wanted.map(&name).join(", ")))
    })
}

/// The arm and its pose. [`defaults`](crate::defaults) adds each command's defaults to the help.
#[derive(Clone, Debug, Args)]
pub(crate) struct ArmFlags {
    /// Parameter set: irb1600-fitted or irb1600-table1.
    #[arg(long, value_name = "NAME")]
    pub preset: Option<String>,
    /// Angle β1 of link 1 against the x axis, degrees.
    #[arg(long, value_name = "DEG")]
    pub beta1_deg: Option<f64>,
    /// Angle β2 of link 2 against link 1, degrees; 0 is the straight arm.
    #[arg(long, value_name = "DEG")]
    pub beta2_deg: Option<f64>,
    /// TOML file with the whole scenario, in place of the defaults; flags take precedence.
    #[arg(long, value_name = "FILE")]
    pub scenario: Option<PathBuf>,
}

/// What the plant and the exciter of a run must agree on.
#[derive(Clone, Debug, Args)]
pub(crate) struct SessionFlags {
    #[command(flatten)]
    pub arm: ArmFlags,
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
    /// The settings to ask for; `None` with --rt off.
    pub fn setup(&self) -> Result<Option<ThreadSetup>, Failure> {
        let priority = FifoPriority::try_from(self.priority).map_err(|error| Failure::usage(error.to_string()))?;
        let cores_awake = self.cores_awake;
        let setup = ThreadSetup { priority: Some(priority), core: self.core, cores_awake, ..ThreadSetup::default() };
        let left_out =
            |asked: &str| Err(Failure::usage(format!("{asked} asks for what --rt off leaves out: give one of them")));
        match (self.rt, self.core) {
            (RealTimeThread::Off, Some(core)) => left_out(&format!("--core {core}")),
            (RealTimeThread::Off, None) if cores_awake => left_out("--cores-awake"),
            (RealTimeThread::Off, None) => Ok(None),
            (RealTimeThread::Auto | RealTimeThread::Require, _) => Ok(Some(setup)),
        }
    }

    /// How to react if the system does not grant a setting.
    pub fn on_shortfall(&self) -> OnShortfall {
        match self.rt {
            RealTimeThread::Require => OnShortfall::Refuse,
            RealTimeThread::Auto | RealTimeThread::Off => OnShortfall::Warn,
        }
    }
}

impl ArmFlags {
    /// Refuses the arm's flags for a structure without an arm.
    fn refuse_for(&self, scenario: &Scenario) -> Result<(), Failure> {
        let kind = scenario.structure.as_ref().map_or("arm", |section| section.kind.name());
        let given = [
            ("--preset", self.preset.is_some()),
            ("--beta1-deg", self.beta1_deg.is_some()),
            ("--beta2-deg", self.beta2_deg.is_some()),
        ];
        match given.into_iter().find(|(_, is_given)| *is_given && kind != "arm") {
            Some((flag, _)) => Err(Failure::usage(format!(
                "{flag} is for the two-link arm, and the scenario's [structure] is of the kind {kind}: leave it out"
            ))),
            None => Ok(()),
        }
    }

    /// The scenario of the file, or the usual one, with the flags applied.
    pub fn scenario(&self) -> Result<Scenario, Failure> {
        self.scenario_or(|| Ok(Scenario::default()))
    }

    /// The scenario of the file, or `default`, with the flags applied.
    pub fn scenario_or(&self, default: impl FnOnce() -> Result<Scenario, Failure>) -> Result<Scenario, Failure> {
        let mut scenario = match &self.scenario {
            Some(path) => read_scenario(path)?,
            None => default()?,
        };
        self.refuse_for(&scenario)?;
        let arm = &mut scenario.arm;
        if let Some(preset) = &self.preset {
            arm.preset.clone_from(preset);
        }
        arm.beta1_deg = self.beta1_deg.unwrap_or(arm.beta1_deg);
        arm.beta2_deg = self.beta2_deg.unwrap_or(arm.beta2_deg);
        Ok(scenario)
    }
}

impl SessionFlags {
    /// Refuses --duration-s for work that ends by itself, and says why.
    pub fn refuse_duration(&self, why: &str) -> Result<(), Failure> {
        let refused = |duration_s| Err(Failure::value("--duration-s", duration_s, format!("{why}, leave it out")));
        self.duration_s.map_or(Ok(()), refused)
    }

    /// The scenario of the file, or `default`, with the flags applied.
    pub fn scenario_or(&self, default: impl FnOnce() -> Result<Scenario, Failure>) -> Result<Scenario, Failure> {
        let mut scenario = self.arm.scenario_or(default)?;
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

/// The initial state of --initial or of the scenario: α1, α2, rad, α̇1, α̇2, rad/s.
pub(crate) fn initial(given: Option<&[f64]>, scenario: &Scenario) -> Result<[f64; 4], Failure> {
    let initial = given.map_or(Ok(scenario.arm.initial), <[f64; 4]>::try_from).map_err(|_wrong_count| {
        let count = given.map_or(0, <[f64]>::len);
        Failure::usage(format!("--initial has {count} numbers: it needs four, α1,α2,α̇1,α̇2 in rad and rad/s"))
    })?;
    let is_finite = initial.iter().all(|value| value.is_finite());
    if is_finite { Ok(initial) } else { Err(PlantSpecError::Initial(initial.to_vec()).into()) }
}

pub(crate) fn state([x1, x2, v1, v2]: [f64; 4]) -> State {
    State::new([x1, x2], [v1, v2])
}

/// The failure for a flag whose value was refused with `error`.
pub(crate) fn refused(flag: &str, error: &impl core::fmt::Display) -> Failure {
    Failure::usage(format!("{flag}: {error}"))
}

pub(crate) fn parse_scheme(name: &str) -> Result<Scheme, Failure> {
    name.parse().map_err(|error: resonarm::integrate::UnknownScheme| Failure::usage(error.to_string()))
}
/// Reads a scenario, and warns of what is doubtful in the files that it names.
pub(crate) fn read_scenario(path: &Path) -> Result<Scenario, Failure> {
    let scenario = Scenario::read(path)?;
    for warning in scenario.structure.iter().flat_map(|section| &section.warnings) {
        tracing::warn!("{}: {warning}", path.display());
    }
    Ok(scenario)
}
