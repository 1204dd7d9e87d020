//! `resonarm sweep` of a structure.

use serde::Serialize;
use serde_json::{Value, json};

use super::{Read, amplitude, displacement_panels, displacement_unit, label, load_unit, readings};
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::motion_flags::{DirectionFlag, MotionFlags, or_empty, periods};
use crate::study;
use resonarm::analysis::structure::time_domain::{Resonance, Sweep, SweepFrequencies};
use resonarm::analysis::structure::{Coordinate, Forced, Reading};
use resonarm::analysis::time_domain::{Direction, hysteresis};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::Dof;
use resonarm::study::{StructureChains, StructurePoint};
use resonarm_figures::plot::{Color, Dash, Figure, Marker, Panel, Series, Style};

/// What is asked for.
pub(crate) struct Asked<'a> {
    /// Initial state, wait and output.
    pub motion: &'a MotionFlags,
    /// The degree of freedom that is driven, with its name.
    pub drive: (Dof, &'a str),
    /// The peak of the load, N, or N·m at a joint.
    pub amplitude: f64,
    /// Where the motion is read; empty is where it is driven.
    pub at: &'a [String],
    /// The ends of the frequencies, Hz.
    pub ends: [f64; 2],
    /// Their number, if it is given.
    pub points: Option<u32>,
    /// Which way to step.
    pub direction: DirectionFlag,
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: Value,
    sweeps: Vec<SweepDocument>,
}

#[derive(Serialize)]
struct SweepDocument {
    direction: Direction,
    /// Resonances of the forced response in whose half-power band no step lies.
    stepped_over: Vec<Value>,
    points: Vec<Value>,
    #[serde(skip)]
    motions: Vec<Motion>,
}

/// A motion at a frequency, Hz.
struct Motion {
    frequency_hz: f64,
    point: StructurePoint,
    readings: Vec<Reading>,
}

impl SweepDocument {
    /// Adds the largest displacements of a degree of freedom over the frequency, by its number among those that are
    /// read: up as circles, down as squares.
    fn drawn(&self, panel: Panel, index: usize, name: &str, color: Color) -> Panel {
        let (shape, dash) = match self.direction {
            Direction::Up => (Marker::Circle, Dash::Solid),
            Direction::Down => (Marker::Square, Dash::Dashed),
        };
        let curve = |settled: Option<bool>| {
            let wanted = |motion: &&Motion| settled.is_none_or(|settled| motion.point.period.is_some() == settled);
            let of = |motion: &Motion| (motion.frequency_hz, motion.readings[index].largest);
            self.motions.iter().filter(wanted).map(of).collect::<Vec<_>>()
        };
        let stepped = format!("{name}, stepped {}", self.direction.name());
        let style = Style::Line { color, width: 0.8, dash };
        let line = Series::line(stepped.clone(), color, curve(None)).unlabelled().style(style);
        let settled = Series::markers(stepped, color, shape, curve(Some(true)));
        let unsettled = Series::markers(format!("{name}, not settled"), color, Marker::Cross, curve(Some(false)));
        panel.with(line).with_any(settled.marked(3.5, self.direction == Direction::Up)).with_any(unsettled)
    }
}

/// Amplitudes with a relative difference above this belong to different motions: each was proved to have settled.
const DIFFERENT: f64 = 1e-6;

/// Sweeps, and prints or writes the motions.
pub(crate) fn show(scenario: &Scenario, tested: &TestedAssembly, asked: &Asked<'_>) -> Result<Verdict, Failure> {
    let assembly = &tested.assembly;
    let read = super::read(asked.at, asked.drive, assembly)?;
    let dofs: Vec<Dof> = read.iter().map(|(dof, _)| *dof).collect();
    let forced = Forced::new(assembly.clone(), asked.drive.0, asked.amplitude);
    let start = asked.motion.initial_of_structure(tested)?;
    let SweepFrequencies { grid, stepped_over, unknown_beyond } =
        SweepFrequencies::new(&forced, &dofs, asked.ends, asked.points)?;
    if let Some(reason) = unknown_beyond {
        tracing::warn!("resonances are not looked for beyond: {reason}");
    }
    let directions = asked.direction.directions();
    let frequencies_hz: Vec<Vec<f64>> = directions.iter().map(|direction| grid.in_order(*direction)).collect();
    let configuration = asked.configuration(scenario, &start)?;
    let journal = asked.motion.journal()?;
    let options = asked.motion.options(0);
    let sweep = |values: &Vec<f64>| {
        let (forced, over, values) = (forced.clone(), Coordinate::FrequencyHz, values.clone());
        Sweep { forced, frequency_hz: asked.ends[0], over, values }
    };
    let chains = StructureChains { sweeps: frequencies_hz.iter().map(sweep).collect(), read: dofs, start, options };
    let Some(walked) = study::chains("sweep", chains, journal, &configuration)? else { return Ok(Verdict::Negative) };
    let sweeps = directions.iter().zip(frequencies_hz).zip(walked.points());
    let sweeps = sweeps.map(|((direction, hz), points)| {
        let motions: Vec<Motion> = hz.into_iter().zip(points).map(Motion::new).collect();
        let points = motions.iter().map(|motion| motion.document(&read)).collect();
        let stepped_over = stepped_over.iter().map(|found| missed(found, &read)).collect();
        SweepDocument { direction: *direction, stepped_over, points, motions }
    });
    let document =
        Document { configuration, coordinates: configuration::coordinates(assembly), sweeps: sweeps.collect() };
    let text = || document.text(&label(scenario, tested), &read, &stepped_over, asked.motion.time_constants);
    let figure = || Ok(document.figure(&read, asked, &label(scenario, tested)));
    asked.motion.show(&document, text, || document.csv(&read), figure)?;
    walked.finish()?;
    Ok(Verdict::Positive)
}

/// A resonance that the steps miss.
fn missed(found: &Resonance, read: &Read<'_>) -> Value {
    let Resonance { reading, frequency_hz, largest, width_hz } = found;
    json!({ "at": read[*reading].1, "frequency_hz": frequency_hz, "largest": largest, "width_hz": width_hz })
}

impl Asked<'_> {
    fn configuration(&self, scenario: &Scenario, start: &[f64]) -> Result<Value, Failure> {
        let mut configuration = configuration::of_arm(scenario)?;
        configuration["initial"] = json!(start);
        configuration["time_constants"] = json!(self.motion.time_constants);
        configuration["drive"] = json!(self.drive.1);
        configuration["amplitude"] = json!(self.amplitude);
        configuration["sweep"] = json!({
            "from_hz": self.ends[0], "to_hz": self.ends[1], "points": self.points, "at": self.at,
            "directions": self.direction.directions(),
        });
        Ok(configuration)
    }
}

impl Motion {
    fn new((frequency_hz, point): (f64, &StructurePoint)) -> Motion {
        Motion { frequency_hz, readings: point.readings(), point: point.clone() }
    }

    fn largest(&self) -> Vec<f64> {
        self.readings.iter().map(|reading| reading.largest).collect()
    }

    fn document(&self, read: &Read<'_>) -> Value {
        let (point, coordinates) = (&self.point, self.point.coordinates());
        json!({
            "frequency_hz": self.frequency_hz,
            "largest": coordinates.iter().map(|of| of.largest).collect::<Vec<_>>(),
            "amplitude": coordinates.iter().map(|of| amplitude(&of.harmonic1)).collect::<Vec<_>>(),
            "readings": readings(&self.readings, read),
            "period": point.period, "largest_multiplier": point.largest_multiplier,
            "settling_periods": point.settling_periods, "drift": point.drift,
        })
    }
}

impl Document {
    /// The sweeps for people.
    fn text(&self, label: &str, read: &Read<'_>, stepped_over: &[Resonance], time_constants: f64) -> String {
        let mut text = String::new();
        for sweep in &self.sweeps {
            let of: Vec<Option<u32>> = sweep.motions.iter().map(|motion| motion.point.period).collect();
            text += &format!("{label}, stepped {}: {}", sweep.direction.name(), periods(&of, time_constants));
            for (index, (dof, name)) in read.iter().enumerate() {
                let sizes = sweep.motions.iter().map(|motion| (motion.readings[index].largest, motion.frequency_hz));
                if let Some((largest, hz)) = sizes.max_by(|a, b| a.0.total_cmp(&b.0)) {
                    text += &format!("  largest {name}  {largest:.6e} {} at {hz:.6} Hz\n", displacement_unit(*dof));
                }
            }
        }
        for Resonance { reading, frequency_hz, largest, width_hz } in stepped_over {
            let (dof, name) = read[*reading];
            text += &format!(
                "  stepped over: the resonance of {name} at {frequency_hz:.6} Hz, {largest:.6e} {} in the forced \
                 response, is {width_hz:.6} Hz wide, less than a step; take more --points, or none\n",
                displacement_unit(dof)
            );
        }
        if let [up, down] = self.sweeps.as_slice() {
            let motion = |motion: &Motion| (motion.frequency_hz, motion.largest());
            let rising: Vec<_> = up.motions.iter().map(motion).collect();
            let falling: Vec<_> = down.motions.iter().rev().map(motion).collect();
            let apart = hysteresis(&rising, &falling, DIFFERENT);
            for [first, last] in &apart {
                text += &format!("  up and down differ from {first:.6} to {last:.6} Hz\n");
            }
            text += if apart.is_empty() { "  up and down agree\n" } else { "" };
        }
        text
    }

    /// CSV: a line for each motion.
    fn csv(&self, read: &Read<'_>) -> String {
        let mut text = String::from("direction,frequency_hz");
        for (dof, name) in read {
            let (name, unit) = (name.replace('.', "_"), displacement_unit(*dof));
            text += &format!(",{name}_largest_{unit},{name}_mean_{unit},{name}_amplitude_{unit}");
        }
        text += ",period,largest_multiplier,settling_periods,drift\n";
        for sweep in &self.sweeps {
            for Motion { frequency_hz, point, readings } in &sweep.motions {
                text += &format!("{},{frequency_hz}", sweep.direction.name());
                for of in readings {
                    text += &format!(",{:e},{:e},{:e}", of.largest, of.mean, amplitude(&of.harmonic1));
                }
                text += &format!(
                    ",{},{},{},{:e}\n",
                    or_empty(point.period),
                    or_empty(point.largest_multiplier),
                    point.settling_periods,
                    point.drift
                );
            }
        }
        text
    }

    /// The largest displacements over the frequency.
    fn figure(&self, read: &Read<'_>, asked: &Asked<'_>, label: &str) -> Figure {
        let load = format!("{} {} at {}", asked.amplitude, load_unit(asked.drive.0), asked.drive.1);
        let figure =
            Figure::new("Stepped-sine response, settled at each frequency").subtitle(format!("{label}, {load}"));
        let panels = displacement_panels("excitation frequency (Hz)", read, |panel, index, name, color| {
            self.sweeps.iter().fold(panel, |panel, sweep| sweep.drawn(panel, index, name, color))
        });
        panels.into_iter().fold(figure, Figure::with)
    }
}
