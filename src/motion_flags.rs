//! Flags that `sweep`, `poincare` and `basins` share.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use crate::commands::continuation::DriveFlags;
use crate::configuration;
use crate::failure::Failure;
use crate::flags::ArmFlags;
use crate::output::{self, OverwriteFlag};
use resonarm::analysis::time_domain::{Direction, SettleOptions};
use resonarm::arm::{Load, State};
use resonarm::plant::PlantSpecError;
use resonarm::scenario::Scenario;

/// The arm, its excitation and initial state, how long to wait, and where the results go.
#[derive(Clone, Debug, Args)]
pub(crate) struct MotionFlags {
    #[command(flatten)]
    pub arm: ArmFlags,
    #[command(flatten)]
    pub drive: DriveFlags,
    /// State in which the first motion begins: α1,α2 in rad, α̇1,α̇2 in rad/s [default: that of the scenario, at rest].
    #[arg(long, value_name = "α1,α2,α̇1,α̇2", allow_hyphen_values = true, value_delimiter = ',', num_args = 1)]
    initial: Option<Vec<f64>>,
    /// Longest wait for a motion to settle, in time constants of the arm's slowest mode.
    #[arg(long, value_name = "N", default_value_t = SettleOptions::default().time_constants, allow_hyphen_values = true)]
    pub time_constants: f64,
    /// Folder for the results: CSV, JSON, and figures as SVG and PNG with captions. A stopped run resumes from what it
    /// holds.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
}

/// The directions of stepping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum DirectionFlag {
    /// From the lowest value.
    Up,
    /// From the highest value.
    Down,
    /// Both, each from the initial state.
    #[default]
    Both,
}

impl DirectionFlag {
    pub const fn directions(self) -> &'static [Direction] {
        match self {
            DirectionFlag::Up => &[Direction::Up],
            DirectionFlag::Down => &[Direction::Down],
            DirectionFlag::Both => &[Direction::Up, Direction::Down],
        }
    }
}

/// The name of a direction in results.
pub(crate) const fn direction_name(direction: Direction) -> &'static str {
    match direction {
        Direction::Up => "up",
        Direction::Down => "down",
    }
}

impl MotionFlags {
    /// The scenario, with the initial state of the flags in it.
    pub fn scenario(&self) -> Result<Scenario, Failure> {
        let mut scenario = self.arm.scenario(|| Ok(Scenario::default()))?;
        if let Some(values) = &self.initial {
            scenario.arm.initial = <[f64; 4]>::try_from(values.as_slice()).map_err(|_wrong_count| {
                let count = values.len();
                Failure::Usage(format!("--initial has {count} numbers: it needs four, α1,α2,α̇1,α̇2 in rad and rad/s"))
            })?;
        }
        let initial = scenario.arm.initial;
        if initial.iter().all(|value| value.is_finite()) {
            Ok(scenario)
        } else {
            Err(PlantSpecError::Initial(initial).into())
        }
    }

    /// The state in which the first motion begins.
    pub fn start(scenario: &Scenario) -> State {
        let [x1, x2, v1, v2] = scenario.arm.initial;
        State::new([x1, x2], [v1, v2])
    }

    /// How long to wait, and how many points of the section to keep if a motion doesn't settle.
    pub fn options(&self, section_points: usize) -> SettleOptions {
        SettleOptions { time_constants: self.time_constants, section_points }
    }

    /// The folder for the results, created if missing, and the journal in it; all files are called `name`.
    pub fn make_out(&self, name: &str) -> Result<Option<PathBuf>, Failure> {
        let Some(out) = &self.out else { return Ok(None) };
        self.overwrite.check_stem(Some(&out.join(name)), output::PLOTTED)?;
        std::fs::create_dir_all(out).map_err(|source| Failure::Write { path: out.clone(), source })?;
        Ok(Some(out.join(name).with_extension("partial.jsonl")))
    }

    /// Everything in these flags that results depend on.
    pub fn configuration(&self, scenario: &Scenario, load: &Load) -> Result<Value, Failure> {
        let mut configuration = configuration::of(scenario, load)?;
        configuration["initial"] = json!(scenario.arm.initial);
        configuration["time_constants"] = json!(self.time_constants);
        Ok(configuration)
    }
}

/// A number in a table; empty if there is none.
pub(crate) fn or_empty(value: Option<impl ToString>) -> String {
    value.map_or(String::new(), |value| value.to_string())
}
