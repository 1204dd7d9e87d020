//! `resonarm integrators`: what each scheme adds to the arm, and what it costs.

use core::fmt::Write;
use core::hint::black_box;

use clap::Args;
use serde::Serialize;

use super::failure::{Failure, Verdict};
use super::flags::ArmFlags;
use super::output;
use crate::analysis::{EnergyDrift, ModeError, energy_drift, mode_errors};
use crate::arm::{Arm, Load, State};
use crate::integrate::{IntegrateError, Integrator, Scheme};
use crate::realtime::{Clock, SystemClock};
use crate::scenario::Scenario;

/// Each integration scheme's own damping and frequency error in both modes, its drift of energy, and its cost per step.
#[derive(Debug, Args)]
pub(super) struct Integrators {
    #[command(flatten)]
    arm: ArmFlags,
    /// Steps a second.
    #[arg(long, value_name = "HZ", default_value_t = 4000.0, allow_hyphen_values = true)]
    rate_hz: f64,
    /// Steps of free vibration over which the energy is watched.
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = clap::value_parser!(u32).range(10..))]
    drift_steps: u32,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// Where the free vibration starts: an amplitude at which the paper's folds appear.
const START: ([f64; 2], [f64; 2]) = ([0.05, -0.08], [0.5, -1.0]);
/// The cost is the least of so many rounds of so many steps: what else the machine does then weighs little.
const COST_ROUNDS: u32 = 50;
const COST_STEPS: u32 = 500;

#[derive(Serialize)]
struct Document {
    preset: String,
    beta2_deg: f64,
    rate_hz: f64,
    schemes: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    scheme: Scheme,
    order: u32,
    #[serde(flatten)]
    outcome: Outcome,
}

#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
enum Outcome {
    Measured { modes: [ModeError; 2], energy: EnergyDrift, cost_ns: f64 },
    Refused(String),
}

impl Integrators {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.arm.scenario(|| Ok(Scenario::default()))?;
        let arm = scenario.build_arm()?;
        let schemes = Scheme::ALL.into_iter().map(|scheme| self.row(&arm, scheme)).collect::<Result<_, _>>()?;
        let (preset, beta2_deg) = (scenario.arm.preset.clone(), scenario.arm.beta2_deg);
        let document = Document { preset, beta2_deg, rate_hz: self.rate_hz, schemes };
        if self.json {
            output::print_json(&document)?;
        } else {
            output::print(&document.table())?;
        }
        Ok(Verdict::Positive)
    }

    /// A rate that a scheme can't carry is a row of the table; a rate that is none ends the command.
    fn row(&self, arm: &Arm, scheme: Scheme) -> Result<Row, Failure> {
        let outcome = match self.measure(arm, scheme) {
            Ok(outcome) => outcome,
            Err(error @ IntegrateError::Rate { .. }) => return Err(error.into()),
            Err(error) => Outcome::Refused(error.to_string()),
        };
        Ok(Row { scheme, order: scheme.order(), outcome })
    }

    fn measure(&self, arm: &Arm, scheme: Scheme) -> Result<Outcome, IntegrateError> {
        let start = State::new(START.0, START.1);
        Ok(Outcome::Measured {
            modes: mode_errors(arm, scheme, self.rate_hz)?,
            energy: energy_drift(arm, scheme, self.rate_hz, &start, self.drift_steps)?,
            cost_ns: cost_ns(arm, scheme, self.rate_hz, &start)?,
        })
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
    fn table(&self) -> String {
        let mut text = format!(
            "{} at β2 = {}°, {} steps a second, without dampers\n\n",
            self.preset, self.beta2_deg, self.rate_hz
        );
        if let Some([low, high]) = self.schemes.iter().find_map(|row| row.outcome.modes()) {
            let _infallible = writeln!(
                text,
                "                        mode 1: {:.2} Hz        mode 2: {:.2} Hz            energy, {} steps",
                low.frequency_hz,
                high.frequency_hz,
                self.schemes.iter().find_map(|row| row.outcome.steps()).unwrap_or_default()
            );
        }
        text.push_str(
            "  scheme        order   damping  frequency     damping  frequency      change    spread   ns per step\n",
        );
        for row in &self.schemes {
            let _infallible = match &row.outcome {
                Outcome::Measured { modes: [low, high], energy, cost_ns } => writeln!(
                    text,
                    "  {:<12}  {:>5}  {:>+8.0e}  {:>+9.0e}    {:>+8.0e}  {:>+9.0e}    {:>+8.0e}  {:>8.0e}   {:>11.0}",
                    row.scheme,
                    row.order,
                    low.damping_ratio,
                    low.frequency_error,
                    high.damping_ratio,
                    high.frequency_error,
                    energy.change,
                    energy.spread,
                    cost_ns
                ),
                Outcome::Refused(reason) => writeln!(text, "  {:<12}  {:>5}  {reason}", row.scheme, row.order),
            };
        }
        text.push_str(
            "\nDamping: the scheme's own damping ratio. Frequency: its relative error. Energy: of free vibration from 0.05 and\n\
             -0.08 rad; change from the first tenth of the steps to the last, and largest less smallest, relative.\n",
        );
        text
    }
}

impl Outcome {
    fn modes(&self) -> Option<&[ModeError; 2]> {
        match self {
            Outcome::Measured { modes, .. } => Some(modes),
            Outcome::Refused(_) => None,
        }
    }

    fn steps(&self) -> Option<u32> {
        match self {
            Outcome::Measured { energy, .. } => Some(energy.steps),
            Outcome::Refused(_) => None,
        }
    }
}
