//! `resonarm basins`: which initial states reach which stable motion.

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags;
use crate::motion_flags::{MotionFlags, or_empty};
use crate::study;
use resonarm::analysis::EndedEarly;
use resonarm::analysis::time_domain::{BasinOutcome, StableMotion, StateCoordinate, reach, stable_motions};
use resonarm::arm::{Sine, State};
use resonarm::study::{Basins as Study, StateGrid};
use resonarm_figures::plot::{Axis, Color, Figure, Marker, Panel, Series};
use resonarm_numeric::number::short;

/// Most values of a coordinate.
const MOST: u32 = 1000;
/// Width of the drawn grid, px: the marks of its cells touch.
const DRAWN_PX: f64 = 420.0;
/// The widest mark, px: a wider one does not fit in the legend.
const WIDEST_PX: f64 = 16.0;

const EXAMPLES: &str = "\
Examples:
  resonarm basins --torque1-nm 60 --frequency-hz 22.1 --out basins
  resonarm basins --torque1-nm 60 --frequency-hz 22.1 --points 21,21
  resonarm basins --force-x-n 20 --frequency-hz 22.145 --coordinates alpha1_rad,alpha2_rad --from=-0.2,-0.2 --to 0.2,0.2

A state counts as having reached a stable motion when, over a quarter of the arm's slowest time constant, it has approached as
the linearisation at that motion says, but for a remainder of at most a quarter of the decay; until then it is integrated. States
of which that never holds within --time-constants are undecided, and marked as such.";

/// Which initial states reach which stable motion: basins of attraction over two coordinates of the state, at phase 0
/// of the excitation.
///
/// The stable motions are those of the branch that `continue` follows, and of the doubled branches that leave it, at
/// this frequency.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Basins {
    #[command(flatten)]
    pub(crate) motion: MotionFlags,
    /// Excitation frequency, Hz.
    #[arg(long, value_name = "F")]
    frequency_hz: f64,
    /// The two coordinates that vary: alpha1_rad, alpha2_rad, alpha_dot1_rad_s, alpha_dot2_rad_s. The others are those
    /// of
    /// --initial.
    #[arg(
        long,
        value_name = "NAMES",
        default_value = "alpha1_rad,alpha_dot1_rad_s",
        value_delimiter = ',',
        num_args = 1
    )]
    coordinates: Vec<StateCoordinate>,
    /// First value of each [default: minus the last].
    #[arg(long, value_name = "X,Y", value_delimiter = ',', num_args = 1)]
    from: Option<Vec<f64>>,
    /// Last value of each [default: 1.5 times as far as the largest stable motion reaches].
    #[arg(long, value_name = "X,Y", value_delimiter = ',', num_args = 1)]
    to: Option<Vec<f64>>,
    /// Number of values of each, evenly spaced, from 2 to 1000.
    #[arg(
        long,
        value_name = "NX,NY",
        default_value = "41,41",
        allow_hyphen_values = true,
        value_delimiter = ',',
        num_args = 1
    )]
    points: Vec<u32>,
}

#[derive(Serialize)]
struct MotionDocument {
    period: u32,
    largest_multiplier: f64,
    amplitude_rad: [f64; 2],
    /// α1, α2, rad, α̇1, α̇2, rad/s, at phase 0.
    section: Vec<[f64; 4]>,
    /// States of the grid that reach it.
    reached_by: usize,
}

/// An initial state in results.
#[derive(Serialize)]
struct Cell {
    at: [f64; 2],
    /// Which motion it reaches, from 1.
    motion: Option<usize>,
    /// Periods of the excitation until this was certain.
    periods: Option<u64>,
    /// `reaches`, `undecided` or `diverges`.
    outcome: &'static str,
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: [StateCoordinate; 2],
    motions: Vec<MotionDocument>,
    undecided: usize,
    diverging: usize,
    cells: Vec<Cell>,
}

impl Basins {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.motion.scenario()?;
        let arm = scenario.build_arm()?;
        let load = self.motion.drive.load()?;
        let sine = Sine { amplitude: load, frequency_hz: self.frequency_hz };
        let (motions, early) = stable_motions(&arm, &sine)?;
        for EndedEarly { reason, .. } in early {
            tracing::warn!("stable motions beyond are not known: {reason}");
        }
        if motions.is_empty() {
            tracing::error!(
                "no stable motion is known at {} Hz: no state can be said to reach one",
                short(&self.frequency_hz)
            );
            return Ok(Verdict::Negative);
        }
        let grid = self.grid(&motions, flags::state(scenario.arm.initial))?;
        let mut configuration = self.motion.configuration(&scenario, &load)?;
        configuration["basins"] = json!({
            "frequency_hz": self.frequency_hz,
            "coordinates": grid.coordinates,
            "from": grid.ends.map(|ends| ends[0]),
            "to": grid.ends.map(|ends| ends[1]),
            "points": grid.counts,
        });
        let journal = self.motion.make_out("basins")?;
        let basins = Study { arm, sine, motions: motions.clone(), grid, time_constants: self.motion.time_constants };
        let walked = study::basins(basins, journal, &configuration)?;
        let Some((walk, outcomes)) = walked else { return Ok(Verdict::Negative) };
        let document = Document::new(configuration, &grid, &motions, &outcomes);
        let figure = || {
            let conditions = captions::pose(&scenario.arm).and(captions::load(&load));
            Ok(document.figure(&grid).subtitle(conditions.and(format!("{} Hz", self.frequency_hz))))
        };
        let (text, csv) = (|| document.summary(self.motion.time_constants), || document.csv());
        self.motion.show("basins", &document, text, csv, figure)?;
        walk.finish()?;
        Ok(Verdict::Positive)
    }

    fn grid(&self, motions: &[StableMotion], others: State) -> Result<StateGrid, Failure> {
        let coordinates = pair("--coordinates", &self.coordinates)?;
        if coordinates[0] == coordinates[1] {
            let refusal = format!("--coordinates has {} twice: give two", coordinates[0].name());
            return Err(Failure::usage(refusal));
        }
        let counts = pair("--points", &self.points)?;
        if let Some(count) = counts.iter().find(|count| !(2..=MOST).contains(*count)) {
            return Err(Failure::usage(format!("--points has {count}: it must be from 2 to {MOST}")));
        }
        let reach = |coordinate| reach(motions, coordinate, self.frequency_hz);
        let to = self.to.as_ref().map_or_else(|| Ok(coordinates.map(reach)), |to| pair("--to", to))?;
        let from = self.from.as_ref().map_or_else(|| Ok(to.map(|to| -to)), |from| pair("--from", from))?;
        let ends = [0, 1].map(|axis| [from[axis], to[axis]]);
        match ends.iter().find(|[from, to]| !(from.is_finite() && to.is_finite() && from != to)) {
            Some([from, to]) => {
                let (from, to) = (short(from), short(to));
                Err(Failure::usage(format!("the grid goes from {from} to {to}: both must be numbers, and different")))
            }
            None => Ok(StateGrid { coordinates, ends, counts: counts.map(|count| count as usize), others }),
        }
    }
}

/// Two values of a flag.
fn pair<T: Copy>(flag: &str, values: &[T]) -> Result<[T; 2], Failure> {
    let count = values.len();
    <[T; 2]>::try_from(values).map_err(|_count| Failure::usage(format!("{flag} has {count} values: it needs two, X,Y")))
}

impl Document {
    fn new(configuration: Value, grid: &StateGrid, motions: &[StableMotion], outcomes: &[BasinOutcome]) -> Document {
        let cell = |(index, outcome): (usize, &BasinOutcome)| {
            let (motion, periods, name) = match outcome {
                BasinOutcome::Reaches { motion, periods } => (Some(motion + 1), Some(*periods), "reaches"),
                BasinOutcome::Undecided => (None, None, "undecided"),
                BasinOutcome::Diverges => (None, None, "diverges"),
            };
            Cell { at: grid.values(index), motion, periods, outcome: name }
        };
        let cells: Vec<Cell> = outcomes.iter().enumerate().map(cell).collect();
        let motion = |(k, motion): (usize, &StableMotion)| MotionDocument {
            period: motion.period,
            largest_multiplier: motion.largest_multiplier,
            amplitude_rad: motion.amplitude_rad,
            section: motion.section.iter().map(|state| StateCoordinate::ALL.map(|which| which.of(state))).collect(),
            reached_by: cells.iter().filter(|cell| cell.motion == Some(k + 1)).count(),
        };
        let count = |name: &str| cells.iter().filter(|cell| cell.outcome == name).count();
        Document {
            configuration,
            coordinates: grid.coordinates,
            motions: motions.iter().enumerate().map(motion).collect(),
            undecided: count("undecided"),
            diverging: count("diverges"),
            cells,
        }
    }

    /// The motions, and how many states reach each.
    fn summary(&self, time_constants: f64) -> String {
        let (mut text, all) = (String::new(), self.cells.len());
        for (k, motion) in self.motions.iter().enumerate() {
            let [a1, a2] = motion.amplitude_rad;
            let period = if motion.period == 1 { String::new() } else { format!(", {} periods", motion.period) };
            text += &format!(
                "motion {}: largest |α1| {a1:.6} rad, |α2| {a2:.6} rad{period}; reached by {} of {all} states\n",
                k + 1,
                motion.reached_by
            );
        }
        if self.undecided > 0 {
            text += &format!(
                "undecided: {} states come to none of these within {time_constants} time constants (try more \
                 --time-constants)\n",
                self.undecided
            );
        }
        if self.diverging > 0 {
            text += &format!("beyond all bounds: {} states\n", self.diverging);
        }
        text
    }

    fn csv(&self) -> String {
        let [x, y] = self.coordinates.map(StateCoordinate::name);
        let mut text = format!("{x},{y},outcome,motion,periods\n");
        for Cell { at: [x, y], motion, periods, outcome } in &self.cells {
            let (motion, periods) = (or_empty(*motion), or_empty(*periods));
            text += &format!("{x},{y},{outcome},{motion},{periods}\n");
        }
        text
    }

    /// A mark for each state, in the colour of the motion it reaches; the sections of the motions over them.
    fn figure(&self, grid: &StateGrid) -> Figure {
        let [x, y] = self.coordinates;
        let mut panel = Panel::new(Axis::linear(x.label()), Axis::linear(y.label()));
        let size = (DRAWN_PX / grid.counts[0] as f64).clamp(0.5, WIDEST_PX);
        let cells = |wanted: &dyn Fn(&Cell) -> bool| {
            self.cells.iter().filter(|cell| wanted(cell)).map(|cell| (cell.at[0], cell.at[1])).collect::<Vec<_>>()
        };
        let colors = [Color::SkyBlue, Color::Vermillion, Color::Yellow, Color::Green, Color::Purple, Color::Blue];
        for (k, motion) in self.motions.iter().enumerate() {
            let color = colors[k % colors.len()];
            let label = format!("reaches motion {}: |α₁| to {:.3} rad", k + 1, motion.amplitude_rad[0]);
            let points = cells(&|cell| cell.motion == Some(k + 1));
            panel = panel.with_any(Series::markers(label, color, Marker::Square, points).marked(size, true));
        }
        for (outcome, label, color) in
            [("undecided", "undecided", Color::Grey), ("diverges", "beyond all bounds", Color::Black)]
        {
            let points = cells(&|cell| cell.outcome == outcome);
            panel = panel.with_any(Series::markers(label, color, Marker::Cross, points));
        }
        let place = |which: StateCoordinate| StateCoordinate::ALL.iter().position(|other| *other == which).unwrap_or(0);
        let sections = self.motions.iter().flat_map(|motion| &motion.section);
        let sections: Vec<_> = sections.map(|state| (state[place(x)], state[place(y)])).collect();
        let panel = panel.with(Series::markers("stable motions, projected", Color::Black, Marker::Diamond, sections));
        Figure::new("Basins of attraction: where each initial state ends").with(panel)
    }
}
