//! `resonarm integrators`: the error and the cost of each scheme.

use core::hint::black_box;

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::flags::{self, ArmFlags};
use crate::output::JsonFlag;
use crate::progress::Progress;
use resonarm::analysis::{EnergyDrift, ModeError, energy_drift, mode_errors, modes};
use resonarm::arm::{Arm, Load, State};
use resonarm::integrate::{IntegrateError, Integrator, Scheme};
use resonarm::realtime::{Clock, SystemClock};
use resonarm::scenario::{ArmSection, Scenario};

/// Each integration scheme's numerical damping and frequency error in both modes, its drift of energy, and its cost per
/// step.
#[derive(Debug, Args)]
#[command(
    after_help = "All is measured on the arm without its dampers and without load. docs/integrators.md describes how, and what each scheme is for."
)]
pub(crate) struct Integrators {
    #[command(flatten)]
    pub(crate) arm: ArmFlags,
    /// Integration steps a second, else as many as the scenario has.
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<f64>,
    /// Steps of free vibration over which the energy is monitored, at least 10.
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = clap::value_parser!(u32).range(10..))]
    drift_steps: u32,
    #[command(flatten)]
    json: JsonFlag,
}

/// Where the free vibration starts: an amplitude at which the arm is far from linear.
const START: ([f64; 2], [f64; 2]) = ([0.05, -0.08], [0.5, -1.0]);
/// The cost is the minimum over these rounds of steps, which keeps the influence of other processes small.
const COST_ROUNDS: u32 = 50;
const COST_STEPS: u32 = 500;

#[derive(Serialize)]
struct Document {
    configuration: Value,
    /// The same for people.
    #[serde(skip)]
    arm: String,
    rate_hz: f64,
    default_scheme: Scheme,
    natural_frequencies_hz: [f64; 2],
    schemes: Vec<Row>,
}

/// The measurements of a scheme; those that failed are missing, and `refused` says why.
#[derive(Serialize)]
struct Row {
    scheme: Scheme,
    order: u32,
    modes: Option<[ModeError; 2]>,
    energy: Option<EnergyDrift>,
    cost_ns: Option<f64>,
    refused: Option<String>,
}

impl Integrators {
    /// Integration steps a second.
    pub(crate) fn rate_hz(&self, scenario: &Scenario) -> f64 {
        self.rate_hz.unwrap_or(scenario.simulation.step_rate_hz())
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.arm.scenario()?;
        let arm = scenario.build_arm()?;
        let rate_hz = self.rate_hz(&scenario);
        let progress = Progress::new("integrators", Scheme::ALL.len(), "schemes");
        let row = |scheme| {
            let row = self.row(&arm, scheme, rate_hz);
            progress.step();
            row
        };
        let schemes = Scheme::ALL.into_iter().map(row).collect::<Result<_, _>>()?;
        drop(progress);
        let configuration = configuration::of_arm(&scenario)?;
        let ArmSection { beta1_deg, beta2_deg, .. } = scenario.arm;
        let arm_in_pose = format!("{} at β1 = {beta1_deg}°, β2 = {beta2_deg}°", scenario.arm.label());
        let natural_frequencies_hz = modes(&arm).map(|mode| mode.frequency_hz);
        let default_scheme = Scheme::default();
        let document =
            Document { configuration, arm: arm_in_pose, rate_hz, default_scheme, natural_frequencies_hz, schemes };
        self.json.show(&document, || document.table(self.drift_steps), &[])
    }

    /// If a scheme fails, its row says why; an invalid rate ends the command.
    fn row(&self, arm: &Arm, scheme: Scheme, rate_hz: f64) -> Result<Row, Failure> {
        let mut row = Row { scheme, order: scheme.order(), modes: None, energy: None, cost_ns: None, refused: None };
        match self.measure(arm, rate_hz, &mut row) {
            Err(error @ (IntegrateError::Rate { .. } | IntegrateError::RateTooHigh { .. })) => {
                return Err(if self.rate_hz.is_some() { flags::refused("--rate-hz", &error) } else { error.into() });
            }
            Err(error) => row.refused = Some(error.to_string()),
            Ok(()) => {}
        }
        Ok(row)
    }

    fn measure(&self, arm: &Arm, rate_hz: f64, row: &mut Row) -> Result<(), IntegrateError> {
        let start = State::new(START.0, START.1);
        row.modes = Some(mode_errors(arm, row.scheme, rate_hz)?);
        row.energy = Some(energy_drift(arm, row.scheme, rate_hz, &start, self.drift_steps)?);
        row.cost_ns = Some(cost_ns(arm, row.scheme, rate_hz, &start)?);
        Ok(())
    }
}

/// The time of a step, ns.
fn cost_ns(arm: &Arm, scheme: Scheme, rate_hz: f64, start: &State) -> Result<f64, IntegrateError> {
    let integrator = Integrator::new(scheme, rate_hz, arm)?;
    let clock = SystemClock;
    let mut least_ns = u64::MAX;
    for _ in 0..COST_ROUNDS {
        let begin_ns = clock.now_ns();
        let end = (0..COST_STEPS).try_fold(*start, |state, k| {
            integrator.step(arm, f64::from(k) * integrator.step_s(), &state, black_box(&Load::default()))
        })?;
        black_box(end);
        least_ns = least_ns.min(clock.now_ns().saturating_sub(begin_ns));
    }
    Ok(least_ns as f64 / f64::from(COST_STEPS))
}

impl Document {
    fn table(&self, drift_steps: u32) -> String {
        let mut text =
            format!("{}, {} steps a second; default scheme: {}\n\n", self.arm, self.rate_hz, self.default_scheme);
        let [low, high] = self.natural_frequencies_hz.map(|frequency_hz| format!("{frequency_hz:.2} Hz"));
        text += &format!(
            "                        {:<22}  {:<22}  energy, {drift_steps} steps\n  \
             scheme       order     damping   frequency     damping   frequency    change   spread   ns a step\n",
            format!("mode 1: {low}"),
            format!("mode 2: {high}"),
        );
        self.schemes.iter().for_each(|row| text.push_str(&row.line()));
        text.push_str(
            "\nDamping: the damping ratio that the scheme adds. Frequency: its relative error. Energy: of a free vibration from\n\
             0.05 and -0.08 rad, relative; change from the first tenth of the steps to the last, and largest less smallest.\n",
        );
        text
    }
}

impl Row {
    fn line(&self) -> String {
        let small = |value: Option<f64>| value.map_or(String::from("–"), |value| format!("{value:+.1e}"));
        let modes = self.modes;
        let numbers = [
            small(modes.map(|[low, _]| low.damping_ratio)),
            small(modes.map(|[low, _]| low.frequency_error)),
            small(modes.map(|[_, high]| high.damping_ratio)),
            small(modes.map(|[_, high]| high.frequency_error)),
            small(self.energy.map(|energy| energy.change)),
            self.energy.map_or(String::from("–"), |energy| format!("{:.0e}", energy.spread)),
            self.cost_ns.map_or(String::from("–"), |cost| format!("{cost:.0}")),
        ];
        let [low_damping, low_frequency, high_damping, high_frequency, change, spread, cost] = numbers;
        let mut line = format!(
            "  {:<12}     {}    {low_damping:>8}    {low_frequency:>8}    {high_damping:>8}    {high_frequency:>8}  {change:>8}   \
             {spread:>6}   {cost:>9}\n",
            self.scheme, self.order
        );
        if let Some(reason) = &self.refused {
            line += &format!("                 {reason}\n");
        }
        line
    }
}
