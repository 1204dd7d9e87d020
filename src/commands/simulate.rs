//! `resonarm simulate`: the structure alone, under exact sines, for a stated time.

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::configuration;
use crate::drive::DriveFlags;
use crate::failure::{Failure, Verdict};
use crate::flags::{self, StructureFlags};
use crate::help::heading;
use crate::output::JsonFlag;
use crate::progress::timed;
use resonarm::integrate::Scheme;
use resonarm::scenario::{Scenario, SimulationSection};
use resonarm::structure::{Dof, StepLoad, Stepper};
use resonarm_numeric::number::short;

/// Simulates the structure under a sine, and prints the state at the end.
///
/// The excitation A·sin(2πft) is exact inside the step.
#[derive(Debug, Args)]
pub(crate) struct Simulate {
    #[command(flatten)]
    pub(crate) structure: StructureFlags,
    /// Initial state: coordinates, rates [default: that of the scenario, at rest].
    ///
    /// The coordinates of a chain are the deflections of its joints, rad.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "Q,V", value_delimiter = ',', num_args = 1)]
    initial: Option<Vec<f64>>,
    #[command(flatten)]
    drive: DriveFlags,
    /// Frequency f of the excitation, Hz.
    #[arg(long, help_heading = heading::LOADS, value_name = "F", default_value_t = 0.0)]
    frequency_hz: f64,
    /// Integration rate, Hz.
    ///
    /// Without it the rate is that of the scenario with this scheme.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "HZ")]
    rate_hz: Option<f64>,
    /// Integration scheme of a chain.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "NAME", value_parser = flags::ByName(Scheme::ALL, Scheme::name))]
    scheme: Option<Scheme>,
    /// Length of the simulation, s, a whole number of steps.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "S")]
    duration_s: f64,
    #[command(flatten)]
    json: JsonFlag,
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: Value,
    t_s: f64,
    position: Vec<f64>,
    velocity: Vec<f64>,
    /// States of the elements that have one.
    element_states: Vec<f64>,
    steps: u64,
    /// The number of switches of elements, each located within its step.
    switches: u64,
    /// The number of steps with more switches than are located.
    steps_not_located: u64,
    wall_s: f64,
}

/// The largest number of steps: some hours of computation.
const MOST_STEPS: u64 = 10_000_000_000;

impl Simulate {
    /// Returns the scheme, and the number of integration steps a second.
    pub(crate) fn scheme_and_rate(&self, scenario: &Scenario) -> Result<(Scheme, f64), Failure> {
        let scheme = self.scheme.unwrap_or(scenario.simulation.scheme);
        let simulation = SimulationSection { scheme, ..scenario.simulation.clone() };
        Ok((scheme, self.rate_hz.unwrap_or(simulation.step_rate_hz())))
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.structure.scenario()?;
        let tested = scenario.under_test()?;
        let assembly = &tested.assembly;
        let drive = if self.drive.is_empty() { None } else { Some(self.drive.drive(assembly)?) };
        let loads = drive.as_ref().map_or(&[][..], |drive| &drive.loads[..]);
        if self.frequency_hz <= 0.0 && !loads.is_empty() {
            let why = "an excitation A·sin(2πft) needs a positive frequency";
            return Err(Failure::value("--frequency-hz", self.frequency_hz, why));
        }
        let (scheme, rate_hz) = self.scheme_and_rate(&scenario)?;
        let dofs: Vec<Dof> = loads.iter().map(|load| load.at.dof).collect();
        let stepper = Stepper::new(assembly, &dofs, scheme, rate_hz);
        let mut stepper = stepper.map_err(|error| match self.rate_hz {
            Some(_) => flags::refused("--rate-hz", &error),
            None => error.into(),
        })?;
        let steps = self.steps(rate_hz)?;
        let initial = configuration::initial(self.initial.as_deref(), &tested)?;
        stepper.restore(&[&initial[..], &vec![0.0; assembly.element_states()]].concat())?;
        let (done, wall_s) = timed(|| {
            let amplitude: Vec<f64> = loads.iter().map(|load| load.amplitude).collect();
            let omega_rad_s = core::f64::consts::TAU * self.frequency_hz;
            let harmonics = drive.as_ref().map_or(&[][..], |drive| &drive.harmonics[..]);
            let load = StepLoad::Periodic { amplitude: &amplitude, omega_rad_s, harmonics };
            // The time is computed from the number of the step. A running sum of 1/rate would accumulate rounding
            // errors, and with them shift the phase of the sine.
            (0..steps).try_for_each(|k| stepper.advance_under(k as f64 / rate_hz, &load))
        });
        done?;
        let mut configuration = configuration::of_structure(&scenario, &tested);
        // Every document has the key, also without a load.
        configuration["drive"] = json!({});
        if let Some(drive) = &drive {
            drive.describe(&mut configuration);
        }
        configuration["frequency_hz"] = json!(self.frequency_hz);
        configuration["initial"] = json!(initial);
        configuration["scheme"] = json!(scheme);
        configuration["rate_hz"] = json!(rate_hz);
        let document = Document {
            configuration,
            coordinates: configuration::coordinates(assembly),
            t_s: steps as f64 / rate_hz,
            position: stepper.position().to_vec(),
            velocity: stepper.velocity().to_vec(),
            element_states: stepper.element_states().to_vec(),
            steps,
            switches: stepper.events(),
            steps_not_located: stepper.fallbacks(),
            wall_s,
        };
        let names = configuration::state_names(assembly);
        let names: Vec<&str> = names.iter().map(|name| name.as_str()).collect();
        self.json.show(&document, || document.text(&names, rate_hz), &[])
    }

    /// Returns the duration as a whole number of steps.
    fn steps(&self, rate_hz: f64) -> Result<u64, Failure> {
        let exact = self.duration_s * rate_hz;
        let steps = exact.round();
        if !(exact.is_finite() && steps >= 1.0) {
            return Err(Failure::value("--duration-s", self.duration_s, "it must be a positive number"));
        }
        let steps_text = |count: f64| {
            let [duration_s, rate_hz] = [self.duration_s, rate_hz].map(|value| short(&value).to_string());
            format!("--duration-s {duration_s} is {} steps at {rate_hz} Hz", short(&count))
        };
        if steps > MOST_STEPS as f64 {
            let why = format!("at most {MOST_STEPS} are possible; choose a shorter time or a lower rate");
            return Err(Failure::usage(format!("{}: {why}", steps_text(steps))));
        }
        // The product of two decimal fractions carries a rounding error of some 1e-16 of it. The tolerance is above
        // that up to 1e9 steps, and far below any fraction that is meant.
        if (exact - steps).abs() > 1e-6 {
            let got = steps_text(exact);
            let nearest_s = steps / rate_hz;
            let nearest = short(&nearest_s);
            return Err(Failure::usage(format!("{got}, not a whole number: choose {nearest}, or another rate")));
        }
        Ok(steps as u64)
    }
}

impl Document {
    /// Lists the state by the names of its channels, then the switches.
    fn text(&self, names: &[&str], rate_hz: f64) -> String {
        let mut text =
            format!("t = {} s after {} steps at {rate_hz} Hz, in {:.3} s\n", self.t_s, self.steps, self.wall_s);
        let width = names.iter().map(|name| name.len()).max().unwrap_or_default();
        for (name, value) in names.iter().zip(self.position.iter().chain(&self.velocity)) {
            text += &format!("  {name:width$}  {value:+.12e}\n");
        }
        for (value, number) in self.element_states.iter().zip(1..) {
            text += &format!("  state {number} of the elements  {value:+.12e}\n");
        }
        if self.switches > 0 {
            text += &format!("{} switches of elements\n", self.switches);
        }
        if self.steps_not_located > 0 {
            text += &format!(
                "{} steps had more switches than are located: their error is of first order; raise --rate-hz\n",
                self.steps_not_located
            );
        }
        text
    }
}
