//! `resonarm sweep`: stepped-sine sweeps in the time domain.

use clap::Args;
use serde::Serialize;
use serde_json::Value;

use crate::failure::{Failure, Verdict};
use crate::figures::captions::{self, degrees};
use crate::flags;
use crate::motion_flags::{DirectionFlag, MotionFlags, or_empty, periods};
use crate::readings::{self, ReadingsDocument, ReadingsFlag};
use crate::structures::{self, StructureDriveFlags};
use crate::study;
use resonarm::analysis::Resonance;
use resonarm::analysis::time_domain::{Direction, Sweep as SteppedSweep, SweepFrequencies, SweepParameter, hysteresis};
use resonarm::arm::{Arm, Load, Pose};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::{ArmSection, Scenario};
use resonarm::study::{Chain, ChainComputation, Chains, Point, StudyError};
use resonarm_figures::plot::{Axis, Color, Dash, Figure, Legend, Marker, Panel, Series, Style};
use resonarm_numeric::number::short;

const EXAMPLES: &str = "\
Examples:
  resonarm sweep --torque1-nm 60 --from-hz 21.9 --to-hz 22.3 --points 41 \\
      --plot sweep
  resonarm sweep --torque1-nm 60 --from-hz 21.9 --to-hz 22.3 --points 41 \\
      --direction down
  resonarm sweep --force-x-n 20 --over-beta2-deg 60,70 --from-hz 22 \\
      --to-hz 23 --plot poses
  resonarm sweep --scenario hardening.toml --drive tip.x --amplitude 2 \\
      --from-hz 22 --to-hz 22.8 --points 9 --plot tip";

/// How a motion without a period is read.
const UNUSUAL: &str = " A motion that has not settled is read over 64 periods of the excitation.";

/// Steps the frequency of a sine up and down and lets the arm, or a scenario's structure, settle at each step, as on a
/// bench, with jumps and hysteresis. Every motion is followed until it is proved to have settled.
#[derive(Debug, Args)]
#[command(after_long_help = readings::help_after(EXAMPLES, UNUSUAL))]
pub(crate) struct Sweep {
    #[command(flatten)]
    pub(crate) motion: MotionFlags,
    #[command(flatten)]
    structure: StructureDriveFlags,
    /// Of a structure: where the motion is read, separated by commas [default: where it is driven].
    #[arg(long, value_name = "DOF", value_delimiter = ',', requires = "drive")]
    at: Vec<String>,
    /// One end of the frequencies, Hz.
    #[arg(long, value_name = "F")]
    from_hz: f64,
    /// The other end, Hz.
    #[arg(long, value_name = "F")]
    to_hz: f64,
    /// Number of frequencies, evenly spaced, both ends among them; a resonance between two of them is reported
    /// [default: 101, and between them as many as the resonances of the forced response need].
    #[arg(long, value_name = "N")]
    points: Option<u32>,
    /// Which way to step.
    #[arg(long, value_enum, default_value_t)]
    direction: DirectionFlag,
    /// Sweep at each of these angles β2 instead of one, degrees.
    #[arg(long, value_name = "DEG,…", value_delimiter = ',')]
    over_beta2_deg: Vec<f64>,
    #[command(flatten)]
    readings: ReadingsFlag,
}

/// Amplitudes with a relative difference above this belong to different motions: each was proved to have settled.
const DIFFERENT: f64 = 1e-6;

/// The sweeps of one pose.
struct InPose {
    pose: Pose,
    arm: Arm,
    sweeps: Vec<SteppedSweep>,
    /// Resonances in whose half-power band no step lies.
    stepped_over: Vec<Resonance>,
}

#[derive(Serialize)]
struct SweepDocument {
    beta1_deg: f64,
    beta2_deg: f64,
    direction: Direction,
    /// Resonances of the forced response in whose half-power band no step lies: their peaks are not in the points.
    stepped_over: Vec<Resonance>,
    points: Vec<PointDocument>,
}

#[derive(Serialize)]
struct PointDocument {
    frequency_hz: f64,
    amplitude_rad: [f64; 2],
    harmonic1_rad: [f64; 2],
    period: Option<u32>,
    largest_multiplier: Option<f64>,
    settling_periods: u64,
    drift: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    readings: Option<ReadingsDocument>,
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    sweeps: Vec<SweepDocument>,
}

impl Sweep {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.motion.structure.scenario()?;
        if let Some(tested) = scenario.tested_structure()? {
            return self.of_structure(&scenario, &tested);
        }
        self.structure.refuse()?;
        let scenario = self.motion.scenario()?;
        let load = self.motion.drive.load()?;
        self.check_poses()?;
        let poses = self.poses(&scenario, &load)?;
        let mut configuration = self.motion.configuration(&scenario, &load)?;
        configuration["sweep"] = serde_json::json!({
            "from_hz": self.from_hz,
            "to_hz": self.to_hz,
            "points": self.points,
            "directions": self.direction.directions(),
            "over_beta2_deg": self.over_beta2_deg,
        });
        let journal = self.motion.journal()?;
        let chains = self.chains(&scenario, &poses);
        let walked = study::chains("sweep", chains, journal, &configuration)?;
        let Some(walked) = walked else { return Ok(Verdict::Negative) };
        let mut document = document(configuration, &poses, walked.points());
        if self.readings.readings {
            document.read(&walked)?;
        }
        let (text, csv) = (|| document.summary(self.motion.time_constants), || document.csv());
        self.motion.show(&document, text, csv, || Ok(document.figure(&scenario, &load)))?;
        walked.finish()?;
        Ok(Verdict::Positive)
    }

    /// A structure in place of the arm.
    fn of_structure(&self, scenario: &Scenario, tested: &TestedAssembly) -> Result<Verdict, Failure> {
        if self.motion.drive.is_given() {
            return Err(structures::arm_drive(&tested.assembly));
        }
        if !self.over_beta2_deg.is_empty() || self.readings.readings {
            return Err(Failure::usage("--over-beta2-deg and --readings are for the two-link arm: leave them out"));
        }
        let asked = structures::sweep::Asked {
            motion: &self.motion,
            drive: self.structure.dof(&tested.assembly)?,
            amplitude: self.structure.needed_amplitude()?,
            at: &self.at,
            ends: [self.from_hz, self.to_hz],
            points: self.points,
            direction: self.direction,
        };
        structures::sweep::show(scenario, tested, &asked)
    }

    /// Each pose once: two sweeps of the same pose could not be distinguished.
    fn check_poses(&self) -> Result<(), Failure> {
        let angles = &self.over_beta2_deg;
        match angles.iter().enumerate().find(|(at, angle)| angles[..*at].contains(angle)) {
            Some((_, angle)) => {
                Err(Failure::usage(format!("--over-beta2-deg has {} twice: give each angle once", short(angle))))
            }
            None => Ok(()),
        }
    }

    fn poses(&self, scenario: &Scenario, load: &Load) -> Result<Vec<InPose>, Failure> {
        let pose = scenario.pose();
        let poses = if self.over_beta2_deg.is_empty() {
            vec![pose]
        } else {
            self.over_beta2_deg.iter().map(|beta2_deg| Pose { beta2_deg: *beta2_deg, ..pose }).collect()
        };
        poses.into_iter().map(|pose| self.in_pose(Arm::new(scenario.parameters()?, pose)?, pose, load)).collect()
    }

    /// The sweeps of one pose; without --points, over frequencies that resolve its resonances.
    fn in_pose(&self, arm: Arm, pose: Pose, load: &Load) -> Result<InPose, Failure> {
        let ends = [self.from_hz, self.to_hz];
        let SweepFrequencies { grid, stepped_over, unknown_beyond } =
            SweepFrequencies::new(&arm, load, ends, self.points)?;
        if let Some(reason) = unknown_beyond {
            tracing::warn!("β2 = {}: resonances are not looked for beyond: {reason}", degrees(pose.beta2_deg));
        }
        let sweeps = self.direction.sweeps(SweepParameter::Frequency { amplitude: *load }, &grid);
        Ok(InPose { pose, arm, sweeps, stepped_over })
    }

    /// One chain for each sweep in each pose.
    fn chains(&self, scenario: &Scenario, poses: &[InPose]) -> Chains {
        let of = |pose: &InPose, sweep: &SteppedSweep| Chain { arm: pose.arm.clone(), excitations: sweep.sines() };
        let chains = poses.iter().flat_map(|pose| pose.sweeps.iter().map(move |sweep| of(pose, sweep))).collect();
        Chains { chains, start: flags::state(scenario.arm.initial), options: self.motion.options(0) }
    }
}

fn document(configuration: Value, poses: &[InPose], points: &[Vec<Point>]) -> Document {
    let each = poses.iter().flat_map(|pose| pose.sweeps.iter().map(move |sweep| (pose, sweep)));
    let sweeps = each.zip(points).map(|((in_pose, sweep), points)| SweepDocument {
        beta1_deg: in_pose.pose.beta1_deg,
        beta2_deg: in_pose.pose.beta2_deg,
        direction: sweep.direction,
        stepped_over: in_pose.stepped_over.clone(),
        points: sweep.values().into_iter().zip(points).map(|(hz, point)| PointDocument::new(hz, point)).collect(),
    });
    Document { configuration, sweeps: sweeps.collect() }
}

impl PointDocument {
    fn new(frequency_hz: f64, point: &Point) -> PointDocument {
        PointDocument {
            frequency_hz,
            amplitude_rad: point.amplitude_rad,
            harmonic1_rad: point.harmonic1_rad,
            period: point.period,
            largest_multiplier: point.largest_multiplier,
            settling_periods: point.settling_periods,
            drift: point.drift,
            readings: None,
        }
    }
}

impl SweepDocument {
    /// The points as a curve of |αᵢ|: the settled ones or the others.
    fn curve(&self, joint: usize, settled: bool) -> Vec<(f64, f64)> {
        let of = |point: &PointDocument| (point.frequency_hz, point.amplitude_rad[joint]);
        self.points.iter().filter(|point| point.period.is_some() == settled).map(of).collect()
    }
}

/// Where two sweeps, up and down over the same frequencies, reached different motions.
fn differences(up: &SweepDocument, down: &SweepDocument) -> String {
    let motion = |point: &PointDocument| (point.frequency_hz, point.amplitude_rad);
    let up: Vec<_> = up.points.iter().map(motion).collect();
    let down: Vec<_> = down.points.iter().rev().map(motion).collect();
    let mut text = String::new();
    for [first, last] in hysteresis(&up, &down, DIFFERENT) {
        text += &format!("  up and down differ from {first:.6} to {last:.6} Hz\n");
    }
    if text.is_empty() { String::from("  up and down agree\n") } else { text }
}

impl Document {
    /// Adds the readings of every point.
    fn read(&mut self, walked: &ChainComputation) -> Result<(), StudyError> {
        for (sweep, readings) in self.sweeps.iter_mut().zip(walked.readings()?) {
            for (point, read) in sweep.points.iter_mut().zip(readings) {
                point.readings = Some(ReadingsDocument(read));
            }
        }
        Ok(())
    }

    /// The sweeps for people.
    fn summary(&self, time_constants: f64) -> String {
        let mut text = String::new();
        for same in self.by_pose() {
            for sweep in same {
                let direction = sweep.direction.name();
                text += &format!("β2 = {}, stepped {direction}: ", degrees(sweep.beta2_deg));
                let of: Vec<Option<u32>> = sweep.points.iter().map(|point| point.period).collect();
                text.push_str(&periods(&of, time_constants));
                for joint in 0..2 {
                    let points = sweep.points.iter().map(|point| (point.amplitude_rad[joint], point.frequency_hz));
                    if let Some((amplitude, hz)) = points.max_by(|a, b| a.0.total_cmp(&b.0)) {
                        text += &format!("  largest |α{}|  {amplitude:.6} rad at {hz:.6} Hz\n", joint + 1);
                    }
                }
            }
            for found in same.first().iter().flat_map(|sweep| &sweep.stepped_over) {
                let Resonance { joint, frequency_hz, amplitude_rad, width_hz } = found;
                text += &format!(
                    "  stepped over: the resonance of α{joint} at {frequency_hz:.6} Hz, {amplitude_rad:.6} rad in the forced \
                     response, is {width_hz:.6} Hz wide, less than a step; take more --points, or none\n"
                );
            }
            if let [up, down] = same {
                text.push_str(&differences(up, down));
            }
        }
        text
    }

    fn by_pose(&self) -> impl Iterator<Item = &[SweepDocument]> {
        self.sweeps.chunk_by(|a, b| a.beta2_deg == b.beta2_deg)
    }

    fn csv(&self) -> String {
        let is_read = self.sweeps.iter().flat_map(|sweep| &sweep.points).any(|point| point.readings.is_some());
        let with_readings = readings::columns(is_read);
        let mut text = format!(
            "beta1_deg,beta2_deg,direction,frequency_hz,amplitude1_rad,amplitude2_rad,harmonic1_alpha1_rad,\
             harmonic1_alpha2_rad,period,largest_multiplier,settling_periods,drift{with_readings}\n"
        );
        for sweep in &self.sweeps {
            for point in &sweep.points {
                let ([a1, a2], [h1, h2]) = (point.amplitude_rad, point.harmonic1_rad);
                let read = point.readings.as_ref().map_or_else(String::new, ReadingsDocument::cells);
                text += &format!(
                    "{},{},{},{},{a1},{a2},{h1},{h2},{},{},{},{:e}{read}\n",
                    sweep.beta1_deg,
                    sweep.beta2_deg,
                    sweep.direction.name(),
                    point.frequency_hz,
                    or_empty(point.period),
                    or_empty(point.largest_multiplier),
                    point.settling_periods,
                    point.drift
                );
            }
        }
        text
    }

    /// |α1| above |α2|; for several poses a row each, |α1| on the left and |α2| on the right.
    fn figure(&self, scenario: &Scenario, load: &Load) -> Figure {
        let (one, load) = (self.by_pose().count() == 1, captions::load(load));
        let pose = match self.sweeps.first() {
            Some(sweep) if one => captions::pose(&ArmSection { beta2_deg: sweep.beta2_deg, ..scenario.arm.clone() }),
            _ => captions::pose_without(&scenario.arm, &["beta2_deg"]),
        };
        let mut figure = Figure::new("Stepped-sine response, settled at each frequency").subtitle(pose.and(load));
        figure.columns = if one { 1 } else { 2 };
        for same in self.by_pose() {
            for joint in 0..2 {
                // One legend: of a single pose in the last panel of the first row, of several below all panels.
                let panel = match same.first() {
                    Some(first) if !one => panel(same, joint).title(format!("β₂ = {}", degrees(first.beta2_deg))),
                    _ => panel(same, joint),
                };
                let has_legend = figure.panels.len() + 1 == figure.columns;
                figure = figure.with(match (has_legend, one) {
                    (true, true) => panel,
                    (true, false) => panel.legend(Legend::Bottom),
                    (false, _) => panel.legend(Legend::None),
                });
            }
        }
        figure
    }
}

/// The sweeps of one pose.
fn panel(sweeps: &[SweepDocument], joint: usize) -> Panel {
    let label = captions::largest(joint);
    let mut panel = Panel::new(Axis::linear("excitation frequency (Hz)"), Axis::linear(label));
    for sweep in sweeps {
        let (color, shape) = match sweep.direction {
            Direction::Up => (Color::Blue, Marker::Circle),
            Direction::Down => (Color::Vermillion, Marker::Square),
        };
        let name = sweep.direction.name();
        let line = sweep.points.iter().map(|point| (point.frequency_hz, point.amplitude_rad[joint])).collect();
        panel = panel.with(Series::line(name, color, line).unlabelled().style(Style::Line {
            color,
            width: 0.8,
            dash: Dash::Solid,
        }));
        for (settled, label) in [(true, format!("stepped {name}")), (false, format!("stepped {name}, not settled"))] {
            let points = sweep.curve(joint, settled);
            let series = Series::markers(label, color, if settled { shape } else { Marker::Cross }, points);
            let is_filled = sweep.direction == Direction::Up;
            panel = panel.with_any(if settled { series.marked(3.5, is_filled) } else { series });
        }
    }
    panel
}
