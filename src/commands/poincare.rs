//! `resonarm poincare`: Poincaré sections, and bifurcation diagrams made of them.

use core::fmt::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::commands::continuation::DriveFlags;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::interval::{Ends, interval};
use crate::motion_flags::{DirectionFlag, MotionFlags, direction_name, or_empty};
use crate::{output, study};
use resonarm::analysis::time_domain::{Direction, Grid, Sweep, SweepParameter};
use resonarm::arm::{Arm, Load, Sine, State};
use resonarm::integrate::{Integrator, Scheme};
use resonarm::scenario::Scenario;
use resonarm::study::{Chain, Chains, Point};
use resonarm_figures::plot::{Axis, Color, Figure, Legend, Marker, Panel, Series, Style};

/// Points of the section to keep if a motion doesn't settle: of a single motion, and at each value of a diagram.
const SECTION_POINTS: usize = 2000;
const DIAGRAM_POINTS: usize = 200;

const EXAMPLES: &str = "\
Examples:
  resonarm poincare --torque1-nm 60 --frequency-hz 22.1
  resonarm poincare --parameter amplitude --frequency-hz 22.1 --from-nm 5 --to-nm 90 --out diagram
  resonarm poincare --parameter frequency --torque1-nm 60 --from-hz 21.9 --to-hz 22.3 --steps 21";

/// The states of the settled arm at phase 0 of the excitation: one section, or a bifurcation diagram in frequency or
/// amplitude.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Poincare {
    #[command(flatten)]
    pub(crate) motion: MotionFlags,
    /// Excitation frequency, Hz; not with --parameter frequency.
    #[arg(long, value_name = "F", allow_hyphen_values = true)]
    frequency_hz: Option<f64>,
    /// Quantity to step for a bifurcation diagram [default: nothing, one section].
    #[arg(long, value_enum)]
    parameter: Option<ParameterFlag>,
    #[command(flatten)]
    range: RangeFlags,
    /// Number of values, evenly spaced, both ends among them.
    #[arg(long, value_name = "N", default_value_t = 101, requires = "parameter")]
    steps: u32,
    /// Which way to step.
    #[arg(long, value_enum, default_value_t, requires = "parameter")]
    direction: DirectionFlag,
    /// Points of the section to keep if a motion doesn't settle [default: 2000, in a diagram 200].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    points: Option<u32>,
}

/// A quantity that can be stepped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ParameterFlag {
    /// Frequency of the excitation.
    Frequency,
    /// Amplitude of the excitation: torque at joint 1, or force at C in the direction of the force flags.
    Amplitude,
}

/// The interval of the stepped quantity, in its unit.
#[derive(Clone, Debug, Args)]
struct RangeFlags {
    /// One end of the frequencies, Hz.
    #[arg(long, value_name = "F", allow_hyphen_values = true)]
    from_hz: Option<f64>,
    /// The other end, Hz.
    #[arg(long, value_name = "F", allow_hyphen_values = true)]
    to_hz: Option<f64>,
    /// One end of the torques at joint 1, N·m.
    #[arg(long, value_name = "A", allow_hyphen_values = true)]
    from_nm: Option<f64>,
    /// The other end, N·m.
    #[arg(long, value_name = "A", allow_hyphen_values = true)]
    to_nm: Option<f64>,
    /// One end of the forces at C, N.
    #[arg(long, value_name = "A", allow_hyphen_values = true)]
    from_n: Option<f64>,
    /// The other end, N.
    #[arg(long, value_name = "A", allow_hyphen_values = true)]
    to_n: Option<f64>,
}

/// The stepped quantity, with its names in results and in figures.
struct Stepped {
    name: &'static str,
    axis: &'static str,
    /// The peak load; for the value 1 where the amplitude is stepped.
    load: Load,
    sweeps: Vec<Sweep>,
}

/// A motion in results.
#[derive(Serialize)]
struct MotionDocument {
    #[serde(skip_serializing_if = "Option::is_none")]
    direction: Option<Direction>,
    /// The stepped quantity, by its name.
    #[serde(flatten)]
    place: Map<String, Value>,
    period: Option<u32>,
    settling_periods: u64,
    drift: f64,
    amplitude_rad: [f64; 2],
    /// α1, α2, rad, α̇1, α̇2, rad/s, at phase 0.
    section: Vec<[f64; 4]>,
    #[serde(skip)]
    value: f64,
}

#[derive(Serialize)]
struct Document {
    /// What the results depend on; the load is that of the value 1 where the amplitude is stepped.
    configuration: Value,
    motions: Vec<MotionDocument>,
}

impl RangeFlags {
    fn ends(&self) -> [Ends; 3] {
        [
            Ends { unit: "-hz", from: self.from_hz, to: self.to_hz },
            Ends { unit: "-nm", from: self.from_nm, to: self.to_nm },
            Ends { unit: "-n", from: self.from_n, to: self.to_n },
        ]
    }
}

impl Poincare {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.motion.scenario()?;
        let stepped = self.stepped()?;
        let chains = self.chains(&scenario, &stepped)?;
        let mut configuration = self.motion.configuration(&scenario, &stepped.load)?;
        configuration["poincare"] = json!({
            "parameter": stepped.name,
            "frequency_hz": self.frequency_hz,
            "values": stepped.sweeps.iter().map(|sweep| sweep.grid.values()).map(|v| [v.first(), v.last()]).collect::<Vec<_>>(),
            "directions": stepped.sweeps.iter().map(|sweep| sweep.direction).collect::<Vec<_>>(),
            "steps": self.parameter.map(|_| self.steps),
            "points": self.section_points(),
        });
        let journal = self.motion.make_out("poincare")?;
        let walked = study::walk("section", chains, journal.as_deref().map(|path| (path, &configuration)))?;
        let Some(walked) = walked else { return Ok(Verdict::Negative) };
        let document = self.document(configuration, &stepped, walked.points());
        if self.motion.json {
            output::print_json(&document)?;
        } else {
            output::print(&document.summary(self.motion.time_constants))?;
        }
        if let Some(out) = &self.motion.out {
            let files = self.write(out, &scenario, &stepped, &document)?;
            if !self.motion.json {
                output::print_written(&files)?;
            }
        }
        walked.finish()?;
        Ok(Verdict::Positive)
    }

    fn section_points(&self) -> usize {
        let usual = if self.parameter.is_some() { DIAGRAM_POINTS } else { SECTION_POINTS };
        self.points.map_or(usual, |points| points as usize)
    }

    /// The frequency that isn't stepped.
    fn frequency(&self) -> Result<f64, Failure> {
        self.frequency_hz
            .ok_or_else(|| Failure::Usage(String::from("give the excitation's frequency: --frequency-hz F")))
    }

    fn stepped(&self) -> Result<Stepped, Failure> {
        match self.parameter {
            None => {
                self.frequency()?;
                interval("a section without --parameter", None, &self.range.ends())?;
                let load = self.motion.drive.load()?;
                Ok(Stepped { name: "frequency_hz", axis: "", load, sweeps: Vec::new() })
            }
            Some(ParameterFlag::Frequency) if self.frequency_hz.is_some() => Err(Failure::Usage(String::from(
                "--frequency-hz is for a section or a diagram in amplitude: leave it out",
            ))),
            Some(ParameterFlag::Frequency) => {
                let load = self.motion.drive.load()?;
                let ends = self.interval("--parameter frequency", "-hz")?;
                let parameter = SweepParameter::Frequency { amplitude: load };
                self.steps("frequency_hz", "excitation frequency (Hz)", load, parameter, ends)
            }
            Some(ParameterFlag::Amplitude) => {
                let DriveFlags { torque1_nm, force_x_n, force_y_n } = &self.motion.drive;
                let is_force = force_x_n.is_some() || force_y_n.is_some();
                if torque1_nm.is_some() {
                    let refusal = "the amplitude is what is stepped: leave --torque1-nm out";
                    return Err(Failure::Usage(String::from(refusal)));
                }
                let (name, axis, unit) = if is_force {
                    ("force_n", "force at C (N)", "-n")
                } else {
                    ("torque1_nm", "torque at joint 1 (N·m)", "-nm")
                };
                let load = if is_force { self.motion.drive.direction()?.0 } else { Load::torque_nm(1.0, 0.0) };
                let ends = self.interval("--parameter amplitude", unit)?;
                let parameter = SweepParameter::Amplitude { unit: load, frequency_hz: self.frequency()? };
                self.steps(name, axis, load, parameter, ends)
            }
        }
    }

    fn interval(&self, parameter: &str, unit: &str) -> Result<(f64, f64), Failure> {
        Ok(interval(parameter, Some(unit), &self.range.ends())?.unwrap_or_default())
    }

    fn steps(
        &self,
        name: &'static str,
        axis: &'static str,
        load: Load,
        parameter: SweepParameter,
        (from, to): (f64, f64),
    ) -> Result<Stepped, Failure> {
        let grid = Grid::new(from, to, self.steps)?;
        let directions = self.direction.directions().iter();
        let sweep = |direction: &Direction| Sweep { parameter, grid: grid.clone(), direction: *direction };
        let sweeps = directions.map(sweep).collect();
        Ok(Stepped { name, axis, load, sweeps })
    }

    fn chains(&self, scenario: &Scenario, stepped: &Stepped) -> Result<Chains, Failure> {
        let arm = scenario.build_arm()?;
        let excitations: Vec<Vec<Sine>> = match self.parameter {
            None => vec![vec![Sine { amplitude: stepped.load, frequency_hz: self.frequency()? }]],
            Some(_) => stepped.sweeps.iter().map(Sweep::sines).collect(),
        };
        let chains = excitations.into_iter().map(|excitations| Chain { arm: arm.clone(), excitations }).collect();
        let options = self.motion.options(self.section_points());
        Ok(Chains { chains, start: MotionFlags::start(scenario), options })
    }

    fn document(&self, configuration: Value, stepped: &Stepped, points: &[Vec<Point>]) -> Document {
        let motion = |direction, value: f64, point: &Point| MotionDocument {
            direction,
            place: Map::from_iter([(String::from(stepped.name), json!(value))]),
            period: point.period,
            settling_periods: point.settling_periods,
            drift: point.drift,
            amplitude_rad: point.amplitude_rad,
            section: point.section.clone(),
            value,
        };
        let mut motions = Vec::new();
        for (k, chain) in points.iter().enumerate() {
            let sweep = stepped.sweeps.get(k);
            let values = sweep.map_or_else(|| vec![self.frequency_hz.unwrap_or_default()], Sweep::values);
            for (value, point) in values.into_iter().zip(chain) {
                motions.push(motion(sweep.map(|sweep| sweep.direction), value, point));
            }
        }
        Document { configuration, motions }
    }

    fn write(
        &self,
        out: &Path,
        scenario: &Scenario,
        stepped: &Stepped,
        document: &Document,
    ) -> Result<Vec<PathBuf>, Failure> {
        let mut files = vec![
            output::write(out.join("poincare.csv"), &document.csv(stepped.name))?,
            output::write_json(out.join("poincare.json"), document)?,
        ];
        let pose = captions::pose(&scenario.arm);
        let hz = self.frequency_hz.map_or(String::new(), |hz| format!("{hz} Hz"));
        let (load, direction) = (captions::load(&stepped.load), captions::direction(&stepped.load));
        let figure = match self.parameter {
            None => self.section_figure(scenario, stepped, document)?.subtitle(pose.and(load).and(hz)),
            Some(ParameterFlag::Frequency) => diagram(document, stepped).subtitle(pose.and(load)),
            Some(ParameterFlag::Amplitude) => diagram(document, stepped).subtitle(pose.and(direction).and(hz)),
        };
        files.extend(figure.write(&out.join("poincare"))?);
        Ok(files)
    }
}

impl Poincare {
    /// The section in the planes of both joints, over the path of the motion if it is periodic: its few points alone
    /// would show little.
    fn section_figure(&self, scenario: &Scenario, stepped: &Stepped, document: &Document) -> Result<Figure, Failure> {
        let sine = Sine { amplitude: stepped.load, frequency_hz: self.frequency()? };
        let motion = document.motions.first();
        let repeating = motion.and_then(|motion| Some((*motion.section.first()?, motion.period?)));
        let path = match repeating {
            Some((start, periods)) => path(&scenario.build_arm()?, &sine, start, periods)?,
            None => Vec::new(),
        };
        let mut figure = Figure::new("Poincaré section at phase 0 of the excitation");
        figure.columns = 2;
        for joint in 0..2 {
            let plane = |state: &[f64; 4]| (state[joint], state[2 + joint]);
            let points: Vec<_> = document.motions.iter().flat_map(|motion| &motion.section).map(plane).collect();
            let size = if points.len() > 20 { 2.0 } else { 6.0 };
            let style = Style::Markers { color: Color::Blue, shape: Marker::Circle, size, filled: true };
            let alpha = captions::ALPHA[joint];
            let [x, y] = [format!("{alpha} (rad)"), format!("d{alpha}/dt (rad/s)")].map(Axis::linear);
            let mut panel = Panel::new(x, y).legend(if joint == 0 { Legend::Auto } else { Legend::None });
            if !path.is_empty() {
                panel = panel.with(Series::line("motion", Color::Grey, path.iter().map(plane).collect()));
            }
            figure =
                figure.with(panel.with(Series::markers("section", Color::Blue, Marker::Circle, points).style(style)));
        }
        Ok(figure)
    }
}

/// States of a path between two points of a section, and the least rate at which it is integrated, Hz.
const PATH_STATES: f64 = 400.0;
const PATH_RATE_HZ: f64 = 4000.0;

/// The states of a motion over its `periods` periods of the excitation, from its state at phase 0.
fn path(arm: &Arm, sine: &Sine, start: [f64; 4], periods: u32) -> Result<Vec<[f64; 4]>, Failure> {
    let least = (PATH_RATE_HZ / sine.frequency_hz / PATH_STATES).ceil().max(1.0);
    let steps_per_state = least.min(1000.0) as u32;
    let rate_hz = PATH_STATES * f64::from(steps_per_state) * sine.frequency_hz;
    let integrator = Integrator::new(Scheme::default(), rate_hz, arm)?;
    let mut state = State::new([start[0], start[1]], [start[2], start[3]]);
    let mut path = vec![start];
    for step in 1..=PATH_STATES as u32 * steps_per_state * periods {
        state = integrator.step(arm, f64::from(step - 1) / rate_hz, &state, sine)?;
        if step % steps_per_state == 0 {
            path.push([state.alpha_rad.x, state.alpha_rad.y, state.alpha_dot_rad_s.x, state.alpha_dot_rad_s.y]);
        }
    }
    Ok(path)
}

impl Document {
    /// The number of motions of each period.
    fn summary(&self, time_constants: f64) -> String {
        let mut text = String::new();
        let mut periods: Vec<Option<u32>> = self.motions.iter().map(|motion| motion.period).collect();
        periods.sort_by_key(|period| period.unwrap_or(u32::MAX));
        periods.dedup();
        for period in periods {
            let count = self.motions.iter().filter(|motion| motion.period == period).count();
            let motions = if count == 1 { "motion" } else { "motions" };
            let _infallible = match period {
                Some(1) => writeln!(text, "{count} {motions} with the period of the excitation"),
                Some(period) => writeln!(text, "{count} {motions} of {period} periods of the excitation"),
                None => writeln!(
                    text,
                    "{count} {motions} not settled within {time_constants} time constants: quasi-periodic, chaotic, of a \
                     period above 8, or still settling (try more --time-constants)"
                ),
            };
        }
        text
    }

    fn csv(&self, name: &str) -> String {
        let mut text = format!("direction,{name},period,alpha1_rad,alpha2_rad,alpha_dot1_rad_s,alpha_dot2_rad_s\n");
        for motion in &self.motions {
            let (direction, period) = (or_empty(motion.direction.map(direction_name)), or_empty(motion.period));
            for [x1, x2, v1, v2] in &motion.section {
                let _infallible = writeln!(text, "{direction},{},{period},{x1},{x2},{v1},{v2}", motion.value);
            }
        }
        text
    }
}

/// The sections over the stepped quantity.
fn diagram(document: &Document, stepped: &Stepped) -> Figure {
    let mut figure = Figure::new("Bifurcation diagram: the section at phase 0 of the excitation");
    for joint in 0..2 {
        let axis = Axis::linear(format!("{} (rad)", captions::ALPHA[joint]));
        let mut panel = Panel::new(Axis::linear(stepped.axis), axis);
        for sweep in &stepped.sweeps {
            let (color, size) = match sweep.direction {
                Direction::Up => (Color::Blue, 3.5),
                Direction::Down => (Color::Vermillion, 2.0),
            };
            let direction = direction_name(sweep.direction);
            // Periodic motions as a few points, others as a cloud of small ones.
            for (repeats, label, size) in [
                (true, format!("stepped {direction}"), size),
                (false, format!("stepped {direction}, not settled"), 0.4 * size),
            ] {
                let motions = document.motions.iter();
                let motions = motions
                    .filter(|motion| motion.direction == Some(sweep.direction) && motion.period.is_some() == repeats);
                let points = motions.flat_map(|motion| motion.section.iter().map(|state| (motion.value, state[joint])));
                let points: Vec<_> = points.collect();
                if !points.is_empty() {
                    let style = Style::Markers { color, shape: Marker::Circle, size, filled: true };
                    panel = panel.with(Series::markers(label, color, Marker::Circle, points).style(style));
                }
            }
        }
        figure = figure.with(if joint == 1 { panel.legend(Legend::None) } else { panel });
    }
    figure
}
