//! `resonarm integrators`: the error and the cost of each scheme.

use core::hint::black_box;

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags::{self, StructureFlags};
use crate::help::heading;
use crate::numbers;
use crate::output::JsonFlag;
use crate::progress::Progress;
use resonarm::analysis::{EnergyDrift, Forced, ModeError, energy_drift, mode_errors};
use resonarm::integrate::{IntegrateError, Scheme};
use resonarm::realtime::{Clock, SystemClock};
use resonarm::scenario::Scenario;
use resonarm::structure::{Assembly, StepError, Stepper};

/// Measures the numerical damping, errors and cost of each integration scheme.
///
/// The errors are those of the frequency and of the energy. Damping and frequency error are those in every mode of a
/// chain; the cost is the time of a step.
#[derive(Debug, Args)]
#[command(
    after_long_help = "All values are measured on the chain without its dampers and without a load. docs/integrators.md describes how, and what each scheme is for."
)]
pub(crate) struct Integrators {
    #[command(flatten)]
    pub(crate) structure: StructureFlags,
    /// Integration rate, Hz.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "HZ")]
    rate_hz: Option<f64>,
    /// Steps of free vibration over which the energy is monitored, at least 10.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "N", default_value_t = 100_000, value_parser = numbers::integer(10..=u32::MAX))]
    drift_steps: u32,
    #[command(flatten)]
    json: JsonFlag,
}

/// Angles, rad, and rates, rad/s, with which the joints of the free vibration start, by turns: an amplitude at which a
/// chain is far from linear.
const START: [[f64; 2]; 2] = [[0.05, -0.08], [0.5, -1.0]];
/// The cost is the minimum over these rounds of steps, which keeps the influence of other processes small.
const COST_ROUNDS: u32 = 50;
const COST_STEPS: u32 = 500;

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: Value,
    /// The structure in words.
    #[serde(skip)]
    label: String,
    rate_hz: f64,
    default_scheme: Scheme,
    natural_frequencies_hz: Vec<f64>,
    schemes: Vec<Row>,
}

/// The measurements of a scheme; those that failed are missing, and `refused` says why.
#[derive(Serialize)]
struct Row {
    scheme: Scheme,
    order: u32,
    modes: Option<Vec<ModeError>>,
    energy: Option<EnergyDrift>,
    cost_ns: Option<f64>,
    refused: Option<String>,
}

impl Integrators {
    /// Returns the number of integration steps a second.
    pub(crate) fn rate_hz(&self, scenario: &Scenario) -> f64 {
        self.rate_hz.unwrap_or(scenario.simulation.step_rate_hz())
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.structure.scenario()?;
        let tested = scenario.under_test()?;
        let chain = undamped_chain(&tested.assembly)?;
        let rate_hz = self.rate_hz(&scenario);
        let progress = Progress::new("integrators", Scheme::ALL.len(), "schemes");
        let row = |scheme| {
            let row = self.row(&chain, scheme, rate_hz);
            progress.step();
            row
        };
        let schemes = Scheme::ALL.into_iter().map(row).collect::<Result<_, _>>()?;
        drop(progress);
        let document = Document {
            configuration: configuration::of_structure(&scenario, &tested),
            coordinates: configuration::coordinates(&chain),
            label: captions::label(&scenario, &tested),
            rate_hz,
            default_scheme: Scheme::default(),
            natural_frequencies_hz: chain.modes().iter().map(|mode| mode.frequency_hz).collect(),
            schemes,
        };
        self.json.show(&document, || document.table(self.drift_steps), &[])
    }

    /// Measures a scheme. If it fails, its row says why; an invalid rate ends the command.
    fn row(&self, chain: &Assembly, scheme: Scheme, rate_hz: f64) -> Result<Row, Failure> {
        let mut row = Row { scheme, order: scheme.order(), modes: None, energy: None, cost_ns: None, refused: None };
        match self.measure(chain, rate_hz, &mut row) {
            Err(error @ StepError::Integrate(IntegrateError::Rate { .. } | IntegrateError::RateTooHigh { .. })) => {
                return Err(if self.rate_hz.is_some() { flags::refused("--rate-hz", &error) } else { error.into() });
            }
            Err(error) => row.refused = Some(error.to_string()),
            Ok(()) => {}
        }
        Ok(row)
    }

    fn measure(&self, chain: &Assembly, rate_hz: f64, row: &mut Row) -> Result<(), StepError> {
        // The joints take the values by turns, so that neighbours move against each other, for any number of links.
        let start: Vec<f64> =
            START.iter().flat_map(|by_turns| by_turns.iter().cycle().take(chain.coordinates())).copied().collect();
        row.modes = Some(mode_errors(chain, row.scheme, rate_hz)?);
        row.energy = Some(energy_drift(chain, row.scheme, rate_hz, &start, self.drift_steps)?);
        row.cost_ns = Some(cost_ns(chain, row.scheme, rate_hz, &start)?);
        Ok(())
    }
}

/// Returns the chain without damping, which the schemes step.
fn undamped_chain(assembly: &Assembly) -> Result<Assembly, Failure> {
    let Ok(joint1) = assembly.dof("joint1") else {
        return Err(Failure::usage(
            "the structure consists of modes, which are stepped by their exact solution, not by a scheme: use a chain",
        ));
    };
    if !assembly.is_smooth() {
        return Err(Failure::usage(
            "the structure has elements that switch, which are stepped from switch to switch, whatever the scheme: leave \
             them out",
        ));
    }
    Ok(Forced::new(assembly.clone(), joint1, 1.0).undamped()?.assembly().clone())
}

/// Measures the time of a step, ns.
fn cost_ns(chain: &Assembly, scheme: Scheme, rate_hz: f64, start: &[f64]) -> Result<f64, StepError> {
    let mut stepper = Stepper::new(chain, &[], scheme, rate_hz)?;
    let clock = SystemClock;
    let mut least_ns = u64::MAX;
    for _ in 0..COST_ROUNDS {
        // Every round repeats the same steps, so that rounds differ by disturbances only and the minimum is
        // meaningful.
        stepper.restore(start)?;
        let begin_ns = clock.now_ns();
        for k in 0..COST_STEPS {
            // `black_box` keeps the compiler from removing steps whose result is not used.
            stepper.advance(f64::from(k) / rate_hz, black_box(&[]))?;
        }
        black_box(stepper.position());
        least_ns = least_ns.min(clock.now_ns().saturating_sub(begin_ns));
    }
    Ok(least_ns as f64 / f64::from(COST_STEPS))
}

impl Document {
    fn table(&self, drift_steps: u32) -> String {
        let mut text =
            format!("{}, {} steps a second; default scheme: {}\n\n", self.label, self.rate_hz, self.default_scheme);
        text += &format!("{:<24}", "");
        for (hz, number) in self.natural_frequencies_hz.iter().zip(1..) {
            text += &format!("{:<24}", format!("mode {number}: {hz:.2} Hz"));
        }
        text += &format!("energy, {drift_steps} steps\n  scheme       order  ");
        self.natural_frequencies_hz.iter().for_each(|_mode| text += "   damping   frequency  ");
        text += "  change   spread   ns a step\n";
        let modes = self.natural_frequencies_hz.len();
        self.schemes.iter().for_each(|row| text.push_str(&row.line(modes)));
        text.push_str(
            "\nDamping: damping ratio that the scheme adds. Frequency: relative error of the frequency. Energy, relative, of a\n\
             free vibration that starts with the joints alternately at 0.05 and -0.08 rad: `change` is from the first tenth of\n\
             the steps to the last, `spread` is the largest value minus the smallest.\n",
        );
        text
    }
}

impl Row {
    fn line(&self, modes: usize) -> String {
        let small = |value: Option<f64>| value.map_or(String::from("–"), |value| format!("{value:+.1e}"));
        let mut line = format!("  {:<12}     {}  ", self.scheme, self.order);
        // A scheme that was refused has no modes, and a dash in each column.
        for k in 0..modes {
            let mode = self.modes.as_ref().map(|modes| modes[k]);
            let (damping, frequency) = (mode.map(|mode| mode.damping_ratio), mode.map(|mode| mode.frequency_error));
            line += &format!("  {:>8}    {:>8}  ", small(damping), small(frequency));
        }
        let spread = self.energy.map_or(String::from("–"), |energy| format!("{:.0e}", energy.spread));
        let cost = self.cost_ns.map_or(String::from("–"), |cost| format!("{cost:.0}"));
        let change = small(self.energy.map(|energy| energy.change));
        line += &format!("{change:>8}   {spread:>6}   {cost:>9}\n");
        if let Some(reason) = &self.refused {
            line += &format!("                 {reason}\n");
        }
        line
    }
}
