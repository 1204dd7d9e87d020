//! `resonarm simulate` of a structure.

use serde::Serialize;
use serde_json::{Value, json};

use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::output::JsonFlag;
use crate::progress::timed;
use resonarm::integrate::Scheme;
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::{Dof, StepLoad, Stepper};

/// What is simulated.
pub(crate) struct Asked<'a> {
    /// The initial state, if it is not the scenario's.
    pub initial: Option<&'a [f64]>,
    /// The degree of freedom that is driven, with its name.
    pub drive: Option<(Dof, &'a str)>,
    /// The peak of the sine, N, or N·m at a joint.
    pub amplitude: f64,
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// The scheme, and integration steps a second, Hz.
    pub scheme: (Scheme, f64),
    /// The number of steps.
    pub steps: u64,
    /// How the document is printed.
    pub json: JsonFlag,
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
    /// Switches of elements, each located within its step.
    switches: u64,
    /// Steps with more switches than are located.
    steps_not_located: u64,
    wall_s: f64,
}

/// Simulates, and prints the state at the end.
pub(crate) fn show(scenario: &Scenario, tested: &TestedAssembly, asked: Asked<'_>) -> Result<Verdict, Failure> {
    let (assembly, (scheme, rate_hz)) = (&tested.assembly, asked.scheme);
    let n = assembly.coordinates();
    let initial = asked.initial.unwrap_or(&tested.initial);
    if initial.len() != 2 * n {
        let got = initial.len();
        return Err(Failure::usage(format!(
            "--initial has {got} numbers: give {}, the coordinates and their rates",
            2 * n
        )));
    }
    let drive: Vec<Dof> = asked.drive.iter().map(|(dof, _)| *dof).collect();
    let failed = |error: resonarm::structure::StepError| Failure::usage(error.to_string());
    let mut stepper = Stepper::new(assembly, &drive, scheme, rate_hz).map_err(failed)?;
    let start: Vec<f64> = initial.iter().copied().chain(vec![0.0; assembly.element_states()]).collect();
    stepper.restore(&start).map_err(failed)?;
    let (done, wall_s) = timed(|| {
        let amplitude = vec![asked.amplitude; drive.len()];
        let omega_rad_s = core::f64::consts::TAU * asked.frequency_hz;
        let load = StepLoad::Sine { amplitude: &amplitude, omega_rad_s };
        (0..asked.steps).try_for_each(|k| stepper.advance_under(k as f64 / rate_hz, &load))
    });
    done.map_err(failed)?;
    let mut configuration = configuration::of_arm(scenario)?;
    if let Some((_, name)) = asked.drive {
        configuration["drive"] = json!(name);
        configuration["amplitude"] = json!(asked.amplitude);
        configuration["frequency_hz"] = json!(asked.frequency_hz);
    }
    configuration["initial"] = json!(initial);
    configuration["scheme"] = json!(scheme);
    configuration["rate_hz"] = json!(rate_hz);
    let document = Document {
        configuration,
        coordinates: configuration::coordinates(assembly),
        t_s: asked.steps as f64 / rate_hz,
        position: stepper.position().to_vec(),
        velocity: stepper.velocity().to_vec(),
        element_states: stepper.element_states().to_vec(),
        steps: asked.steps,
        switches: stepper.events(),
        steps_not_located: stepper.fallbacks(),
        wall_s,
    };
    asked.json.show(&document, || document.text(rate_hz), &[])
}

impl Document {
    fn text(&self, rate_hz: f64) -> String {
        let mut text =
            format!("t = {} s after {} steps at {rate_hz} Hz, in {:.3} s\n", self.t_s, self.steps, self.wall_s);
        let numbers = |numbers: &[f64]| numbers.iter().map(|x| format!("{x:+.12e}")).collect::<Vec<_>>().join(", ");
        text += &format!("position {}\nvelocity {}\n", numbers(&self.position), numbers(&self.velocity));
        if !self.element_states.is_empty() {
            text += &format!("states of elements {}\n", numbers(&self.element_states));
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
