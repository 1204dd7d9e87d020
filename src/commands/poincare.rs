//! `resonarm poincare`: Poincaré sections, and bifurcation diagrams made of them.

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags;
use crate::motion_flags::{DirectionFlag, MotionFlags, or_empty};
use crate::quantity::{Ends, Quantity, interval};
use crate::study;
use resonarm::analysis::Coordinate;
use resonarm::analysis::time_domain::{Direction, Grid, Sweep, SweepParameter, path};
use resonarm::arm::{Load, Sine, State};
use resonarm::scenario::Scenario;
use resonarm::study::{Chain, Chains, Point};
use resonarm_figures::plot::{Axis, Color, Figure, Legend, Marker, Panel, Series};

/// Points of the section to keep if a motion doesn't settle: of a single motion, and at each value of a diagram.
const SECTION_POINTS: usize = 2000;
const DIAGRAM_POINTS: usize = 200;

const EXAMPLES: &str = "\
Examples:
  resonarm poincare --torque1-nm 60 --frequency-hz 22.1
  resonarm poincare --parameter amplitude --frequency-hz 22.1 --from-nm 5 \\
      --to-nm 90 --plot diagram
  resonarm poincare --parameter frequency --torque1-nm 60 --from-hz 21.9 \\
      --to-hz 22.3 --points 21";

/// The states of the settled arm at phase 0 of the excitation: one section, or a bifurcation diagram in frequency or
/// amplitude.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Poincare {
    #[command(flatten)]
    pub(crate) motion: MotionFlags,
    /// Excitation frequency, Hz; not with --parameter frequency.
    #[arg(long, value_name = "F")]
    frequency_hz: Option<f64>,
    /// Quantity to step for a bifurcation diagram [default: nothing, one section].
    #[arg(long, value_enum)]
    parameter: Option<ParameterFlag>,
    #[command(flatten)]
    range: RangeFlags,
    /// Number of values, evenly spaced, both ends among them.
    #[arg(long, value_name = "N", default_value_t = 101, requires = "parameter")]
    points: u32,
    /// Which way to step.
    #[arg(long, value_enum, default_value_t, requires = "parameter")]
    direction: DirectionFlag,
    /// Points of the section to keep if a motion doesn't settle [default: 2000, in a diagram 200].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    section_points: Option<u32>,
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
    #[arg(long, value_name = "F")]
    from_hz: Option<f64>,
    /// The other end, Hz.
    #[arg(long, value_name = "F")]
    to_hz: Option<f64>,
    /// One end of the torques at joint 1, N·m.
    #[arg(long, value_name = "A")]
    from_nm: Option<f64>,
    /// The other end, N·m.
    #[arg(long, value_name = "A")]
    to_nm: Option<f64>,
    /// One end of the forces at C, N.
    #[arg(long, value_name = "A")]
    from_n: Option<f64>,
    /// The other end, N.
    #[arg(long, value_name = "A")]
    to_n: Option<f64>,
}

/// What is stepped; without sweeps nothing.
struct Stepped {
    quantity: Quantity,
    /// The peak load; for the value 1 where the amplitude is stepped.
    load: Load,
    sweeps: Vec<Sweep>,
}

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
            "parameter": stepped.quantity.name,
            "frequency_hz": self.frequency_hz,
            "values": stepped.sweeps.iter().map(|sweep| sweep.grid.values()).map(|v| [v.first(), v.last()]).collect::<Vec<_>>(),
            "directions": stepped.sweeps.iter().map(|sweep| sweep.direction).collect::<Vec<_>>(),
            "points": self.parameter.map(|_| self.points),
            "section_points": self.section_points(),
        });
        let journal = self.motion.journal()?;
        let walked = study::chains("section", chains, journal, &configuration)?;
        let Some(walked) = walked else { return Ok(Verdict::Negative) };
        let document = self.document(configuration, &stepped, walked.points());
        let (text, csv) = (|| document.summary(self.motion.time_constants), || document.csv(stepped.quantity.name));
        self.motion.show(&document, text, csv, || self.figure(&scenario, &stepped, &document))?;
        walked.finish()?;
        Ok(Verdict::Positive)
    }

    fn section_points(&self) -> usize {
        let usual = if self.parameter.is_some() { DIAGRAM_POINTS } else { SECTION_POINTS };
        self.section_points.map_or(usual, |points| points as usize)
    }

    /// The frequency that isn't stepped.
    fn frequency(&self) -> Result<f64, Failure> {
        self.frequency_hz.ok_or_else(|| Failure::usage("give the excitation's frequency: --frequency-hz F"))
    }

    fn stepped(&self) -> Result<Stepped, Failure> {
        let (drive, given) = (&self.motion.drive, self.range.ends());
        let (parameter, quantity, load) = match self.parameter {
            None => {
                self.frequency()?;
                interval("a section without --parameter", None, &given)?;
                return Ok(Stepped { quantity: Quantity::frequency(), load: drive.load()?, sweeps: Vec::new() });
            }
            Some(ParameterFlag::Frequency) if self.frequency_hz.is_some() => {
                let refusal = "--frequency-hz is for a section or a diagram in amplitude: leave it out";
                return Err(Failure::usage(refusal));
            }
            Some(ParameterFlag::Frequency) => ("--parameter frequency", Quantity::frequency(), drive.load()?),
            Some(ParameterFlag::Amplitude) => {
                let (direction, _) = drive.direction_of("is stepped")?;
                ("--parameter amplitude", Quantity::amplitude(drive), direction)
            }
        };
        let (from, to) = quantity.interval(parameter, &given)?;
        let parameter = match quantity.coordinate {
            Coordinate::FrequencyHz => SweepParameter::Frequency { amplitude: load },
            Coordinate::Parameter(_) => SweepParameter::Amplitude { unit: load, frequency_hz: self.frequency()? },
        };
        let sweeps = self.direction.sweeps(parameter, &Grid::new(from, to, self.points)?);
        Ok(Stepped { quantity, load, sweeps })
    }

    fn chains(&self, scenario: &Scenario, stepped: &Stepped) -> Result<Chains, Failure> {
        let arm = scenario.build_arm()?;
        let excitations: Vec<Vec<Sine>> = match self.parameter {
            None => vec![vec![Sine { amplitude: stepped.load, frequency_hz: self.frequency()? }]],
            Some(_) => stepped.sweeps.iter().map(Sweep::sines).collect(),
        };
        let chains = excitations.into_iter().map(|excitations| Chain { arm: arm.clone(), excitations }).collect();
        let options = self.motion.options(self.section_points());
        Ok(Chains { chains, start: flags::state(scenario.arm.initial), options })
    }

    fn document(&self, configuration: Value, stepped: &Stepped, points: &[Vec<Point>]) -> Document {
        let motion = |direction, value: f64, point: &Point| MotionDocument {
            direction,
            place: Map::from_iter([(String::from(stepped.quantity.name), json!(value))]),
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

    fn figure(&self, scenario: &Scenario, stepped: &Stepped, document: &Document) -> Result<Figure, Failure> {
        let pose = captions::pose(&scenario.arm);
        let hz = self.frequency_hz.map_or(String::new(), |hz| format!("{hz} Hz"));
        let (load, direction) = (captions::load(&stepped.load), captions::direction(&stepped.load));
        Ok(match self.parameter {
            None => self.section_figure(scenario, stepped, document)?.subtitle(pose.and(load).and(hz)),
            Some(ParameterFlag::Frequency) => diagram(document, stepped).subtitle(pose.and(load)),
            Some(ParameterFlag::Amplitude) => diagram(document, stepped).subtitle(pose.and(direction).and(hz)),
        })
    }

    /// The section in the planes of both joints, over the path of the motion if it is periodic: its few points alone
    /// would show little.
    fn section_figure(&self, scenario: &Scenario, stepped: &Stepped, document: &Document) -> Result<Figure, Failure> {
        let sine = Sine { amplitude: stepped.load, frequency_hz: self.frequency()? };
        let motion = document.motions.first();
        let repeating = motion.and_then(|motion| Some((motion.section.first()?, motion.period?)));
        let path = match repeating {
            Some((start, periods)) => path(&scenario.build_arm()?, &sine, &flags::state(*start), periods)?,
            None => Vec::new(),
        };
        let mut figure = Figure::new("Poincaré section at phase 0 of the excitation");
        figure.columns = 2;
        for joint in 0..2 {
            let plane = |state: &[f64; 4]| (state[joint], state[2 + joint]);
            let on_path = |state: &State| (state.alpha_rad[joint], state.alpha_dot_rad_s[joint]);
            let points: Vec<_> = document.motions.iter().flat_map(|motion| &motion.section).map(plane).collect();
            let size = if points.len() > 20 { 2.0 } else { 6.0 };
            let alpha = captions::ALPHA[joint];
            let [x, y] = [format!("{alpha} (rad)"), format!("d{alpha}/dt (rad/s)")].map(Axis::linear);
            let panel = Panel::new(x, y).legend(if joint == 0 { Legend::Bottom } else { Legend::None });
            let panel = panel.with_any(Series::line("motion", Color::Grey, path.iter().map(on_path).collect()));
            let section = Series::markers("section", Color::Blue, Marker::Circle, points);
            figure = figure.with(panel.with(section.marked(size, true)));
        }
        Ok(figure)
    }
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
            text += &match period {
                Some(1) => format!("{count} {motions} with the period of the excitation\n"),
                Some(period) => format!("{count} {motions} of {period} periods of the excitation\n"),
                None => format!(
                    "{count} {motions} not settled within {time_constants} time constants: quasi-periodic, chaotic, of a \
                     period above 8, or still settling (try more --time-constants)\n"
                ),
            };
        }
        text
    }

    fn csv(&self, name: &str) -> String {
        let mut text = format!("direction,{name},period,alpha1_rad,alpha2_rad,alpha1_dot_rad_s,alpha2_dot_rad_s\n");
        for motion in &self.motions {
            let (direction, period) = (or_empty(motion.direction.map(Direction::name)), or_empty(motion.period));
            for [x1, x2, v1, v2] in &motion.section {
                text += &format!("{direction},{},{period},{x1},{x2},{v1},{v2}\n", motion.value);
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
        let mut panel = Panel::new(Axis::linear(&stepped.quantity.label), axis);
        for sweep in &stepped.sweeps {
            let (color, size) = match sweep.direction {
                Direction::Up => (Color::Blue, 3.5),
                Direction::Down => (Color::Vermillion, 2.0),
            };
            let direction = sweep.direction.name();
            // Periodic motions as a few points, others as a cloud of small ones.
            for (repeats, label, size) in [
                (true, format!("stepped {direction}"), size),
                (false, format!("stepped {direction}, not settled"), 0.4 * size),
            ] {
                let motions = document.motions.iter();
                let motions = motions
                    .filter(|motion| motion.direction == Some(sweep.direction) && motion.period.is_some() == repeats);
                let points = motions.flat_map(|motion| motion.section.iter().map(|state| (motion.value, state[joint])));
                let series = Series::markers(label, color, Marker::Circle, points.collect());
                panel = panel.with_any(series.marked(size, true));
            }
        }
        figure = figure.with(if joint == 1 { panel.legend(Legend::None) } else { panel });
    }
    figure
}
