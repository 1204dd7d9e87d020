//! `resonarm simulate`: the arm alone, under an exact sine, for a stated time.

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::flags::{self, ArmFlags, parse_scheme};
use crate::output::JsonFlag;
use crate::progress::timed;
use crate::structures::{self, StructureDriveFlags};
use resonarm::arm::{Load, Sine};
use resonarm::integrate::{Integrator, Scheme};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::{Scenario, SimulationSection};
use resonarm_numeric::number::short;

/// Simulates the arm, or a scenario's structure, under A·sin(2πft), exact inside the step, and prints the state at the
/// end.
#[derive(Debug, Args)]
pub(crate) struct Simulate {
    #[command(flatten)]
    pub(crate) arm: ArmFlags,
    /// Initial state: α1,α2 in rad, α̇1,α̇2 in rad/s; of a structure its coordinates and their rates [default: that of
    /// the scenario, at rest].
    #[arg(long, value_name = "α1,α2,α̇1,α̇2", value_delimiter = ',', num_args = 1)]
    initial: Option<Vec<f64>>,
    /// Torque at joint 1, N·m.
    #[arg(long, value_name = "A", default_value_t = 0.0)]
    torque1_nm: f64,
    /// Force at point C along x, N.
    #[arg(long, value_name = "A", default_value_t = 0.0)]
    force_x_n: f64,
    /// Force at point C along y, N.
    #[arg(long, value_name = "A", default_value_t = 0.0)]
    force_y_n: f64,
    #[command(flatten)]
    drive: StructureDriveFlags,
    /// Frequency f of the excitation, Hz.
    #[arg(long, value_name = "F", default_value_t = 0.0)]
    frequency_hz: f64,
    /// Integration steps a second; without it as many as the scenario has with this scheme.
    #[arg(long, value_name = "R")]
    rate_hz: Option<f64>,
    /// Integration scheme: rk4, dop853, gl4, gl6, exponential, exponential8.
    #[arg(long, value_name = "NAME")]
    scheme: Option<String>,
    /// Length, s, a whole number of steps.
    #[arg(long, value_name = "T")]
    duration_s: f64,
    #[command(flatten)]
    json: JsonFlag,
}

#[derive(Serialize)]
struct Document {
    /// The arm, its pose, and everything else that the state depends on.
    configuration: Value,
    t_s: f64,
    alpha_rad: [f64; 2],
    alpha_dot_rad_s: [f64; 2],
    steps: u64,
    wall_s: f64,
}

/// The largest number of steps: some hours of computation.
const MOST_STEPS: u64 = 10_000_000_000;

impl Simulate {
    /// The scheme, and the integration steps a second.
    pub(crate) fn scheme_and_rate(&self, scenario: &Scenario) -> Result<(Scheme, f64), Failure> {
        let scheme = self.scheme.as_deref().map_or(Ok(scenario.simulation.scheme), parse_scheme)?;
        let simulation = SimulationSection { scheme, ..scenario.simulation.clone() };
        Ok((scheme, self.rate_hz.unwrap_or(simulation.step_rate_hz())))
    }

    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.arm.scenario()?;
        if let Some(tested) = scenario.tested_structure()? {
            return self.of_structure(&scenario, &tested);
        }
        self.drive.refuse()?;
        let arm = scenario.build_arm()?;
        let (scheme, rate_hz) = self.scheme_and_rate(&scenario)?;
        let integrator = Integrator::new(scheme, rate_hz, &arm).map_err(|error| match self.rate_hz {
            Some(_) => flags::refused("--rate-hz", &error),
            None => error.into(),
        })?;
        let steps = self.steps(rate_hz)?;
        let excitation = self.excitation()?;
        let initial = flags::initial(self.initial.as_deref(), &scenario)?;
        let step = |state, k: u64| integrator.step(&arm, k as f64 / rate_hz, &state, &excitation);
        let (end, wall_s) = timed(|| (0..steps).try_fold(flags::state(initial), step));
        let end = end?;
        let mut configuration = configuration::of(&scenario, &excitation.amplitude)?;
        configuration["frequency_hz"] = json!(excitation.frequency_hz);
        configuration["initial"] = json!(initial);
        configuration["scheme"] = json!(scheme);
        configuration["rate_hz"] = json!(rate_hz);
        let document = Document {
            configuration,
            t_s: steps as f64 / rate_hz,
            alpha_rad: end.alpha_rad.into(),
            alpha_dot_rad_s: end.alpha_dot_rad_s.into(),
            steps,
            wall_s,
        };
        let Document { t_s, alpha_rad: [x1, x2], alpha_dot_rad_s: [v1, v2], .. } = document;
        let text = || {
            format!(
                "t = {t_s} s after {steps} steps of {scheme} at {rate_hz} Hz, in {wall_s:.3} s\n\
                 α = {x1:+.12e}, {x2:+.12e} rad\nα̇ = {v1:+.12e}, {v2:+.12e} rad/s\n"
            )
        };
        self.json.show(&document, text, &[])
    }

    /// A structure in place of the arm.
    fn of_structure(&self, scenario: &Scenario, tested: &TestedAssembly) -> Result<Verdict, Failure> {
        if [self.torque1_nm, self.force_x_n, self.force_y_n].iter().any(|amplitude| *amplitude != 0.0) {
            return Err(structures::arm_drive(&tested.assembly));
        }
        let drive = self.drive.drive.as_ref().map(|_| self.drive.dof(&tested.assembly)).transpose()?;
        let amplitude = if drive.is_some() { self.drive.needed_amplitude()? } else { 0.0 };
        self.check_excitation(amplitude != 0.0)?;
        let (scheme, rate_hz) = self.scheme_and_rate(scenario)?;
        let asked = structures::simulate::Asked {
            initial: self.initial.as_deref(),
            drive,
            amplitude,
            frequency_hz: self.frequency_hz,
            scheme: (scheme, rate_hz),
            steps: self.steps(rate_hz)?,
            json: self.json,
        };
        structures::simulate::show(scenario, tested, asked)
    }

    /// The duration as a whole number of steps.
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
            return Err(Failure::usage(format!(
                "{}: at most {MOST_STEPS} are possible; take a shorter time or a lower rate",
                steps_text(steps)
            )));
        }
        if (exact - steps).abs() > 1e-6 {
            let nearest_s = steps / rate_hz;
            return Err(Failure::usage(format!(
                "{}, not a whole number: take {}, or another rate",
                steps_text(exact),
                short(&nearest_s)
            )));
        }
        Ok(steps as u64)
    }

    fn check_excitation(&self, has_amplitude: bool) -> Result<(), Failure> {
        if self.frequency_hz <= 0.0 && has_amplitude {
            let why = "an excitation A·sin(2πft) needs a positive frequency";
            return Err(Failure::value("--frequency-hz", self.frequency_hz, why));
        }
        Ok(())
    }

    fn excitation(&self) -> Result<Sine, Failure> {
        let amplitudes = [self.torque1_nm, self.force_x_n, self.force_y_n];
        self.check_excitation(amplitudes.iter().any(|amplitude| *amplitude != 0.0))?;
        let force_n = [self.force_x_n, self.force_y_n].into();
        let amplitude = Load { torque_nm: [self.torque1_nm, 0.0].into(), force_n };
        Ok(Sine { amplitude, frequency_hz: self.frequency_hz })
    }
}
