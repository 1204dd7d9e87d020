//! `resonarm basins`: which initial states reach which stable motion.

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::basin_cells::Cells;
use crate::basin_grid::{GridFlags, pair};
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::flags;
use crate::motion_flags::MotionFlags;
use crate::structures::{self, StructureDriveFlags};
use crate::study;
use resonarm::analysis::EndedEarly;
use resonarm::analysis::time_domain::{
    BasinOutcome, StableMotion, StateCoordinate, UnknownStateCoordinate, reach, stable_motions,
};
use resonarm::arm::Sine;
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::study::{Basins as Study, StateGrid};
use resonarm_figures::plot::Figure;
use resonarm_numeric::number::short;

const EXAMPLES: &str = "\
Examples:
  resonarm basins --torque1-nm 60 --frequency-hz 22.1 --plot basins
  resonarm basins --torque1-nm 60 --frequency-hz 22.1 --points 21,21
  resonarm basins --force-x-n 20 --frequency-hz 22.145 \\
      --coordinates alpha1_rad,alpha2_rad --from=-0.2,-0.2 --to 0.2,0.2
  resonarm basins --scenario hardening.toml --drive tip.x --amplitude 2 \\
      --frequency-hz 22.4 --points 9,9 --plot tip

A state counts as having reached a stable motion when, over a quarter of the slowest time constant, it has approached as
the linearisation at that motion says, but for a remainder of at most a quarter of the decay; until then it is integrated. States
of which that never holds within --time-constants are undecided, and marked as such.";

/// Which initial states reach which stable motion: basins of attraction over two coordinates of the state, at phase 0
/// of the excitation.
///
/// The stable motions are those of the branch that `continue` follows, and of the doubled branches that leave it, at
/// this frequency; of a structure those of the branch, and those in which it settles from beside its unstable ones.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Basins {
    #[command(flatten)]
    pub(crate) motion: MotionFlags,
    /// Excitation frequency, Hz.
    #[arg(long, value_name = "F")]
    frequency_hz: f64,
    #[command(flatten)]
    structure: StructureDriveFlags,
    /// The two coordinates that vary: alpha1_rad, alpha2_rad, alpha1_dot_rad_s, alpha2_dot_rad_s; of a structure the
    /// names of its coordinates, as alpha3_rad or q1_m_sqrt_kg, and of their rates. The others are those of --initial
    /// [default: the first and its rate].
    #[arg(long, value_name = "NAMES", value_delimiter = ',', num_args = 1)]
    coordinates: Vec<String>,
    #[command(flatten)]
    grid: GridFlags,
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

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: [StateCoordinate; 2],
    motions: Vec<MotionDocument>,
    #[serde(flatten)]
    cells: Cells,
}

impl Basins {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.motion.structure.scenario()?;
        if let Some(tested) = scenario.tested_structure()? {
            return self.of_structure(&scenario, &tested);
        }
        self.structure.refuse()?;
        let scenario = self.motion.scenario()?;
        let arm = scenario.build_arm()?;
        let load = self.motion.drive.load()?;
        let coordinates = self.arm_coordinates()?;
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
        let reach = coordinates.map(|coordinate| reach(&motions, coordinate, self.frequency_hz));
        let names = coordinates.map(StateCoordinate::name);
        let grid = self.grid.grid(coordinates, names, reach, flags::state(scenario.arm.initial))?;
        let mut configuration = self.motion.configuration(&scenario, &load)?;
        configuration["basins"] = json!({
            "frequency_hz": self.frequency_hz,
            "coordinates": grid.coordinates,
            "from": grid.ends.map(|ends| ends[0]),
            "to": grid.ends.map(|ends| ends[1]),
            "points": grid.counts,
        });
        let journal = self.motion.journal()?;
        let basins = Study { arm, sine, motions: motions.clone(), grid, time_constants: self.motion.time_constants };
        let walked = study::basins(basins, journal, &configuration)?;
        let Some((walk, outcomes)) = walked else { return Ok(Verdict::Negative) };
        let document = Document::new(configuration, &grid, &motions, &outcomes);
        let figure = || {
            let conditions = captions::pose(&scenario.arm).and(captions::load(&load));
            Ok(document.figure(&grid).subtitle(conditions.and(format!("{} Hz", self.frequency_hz))))
        };
        let (text, csv) = (|| document.summary(self.motion.time_constants), || document.csv());
        self.motion.show(&document, text, csv, figure)?;
        walk.finish()?;
        Ok(Verdict::Positive)
    }

    /// A structure in place of the arm.
    fn of_structure(&self, scenario: &Scenario, tested: &TestedAssembly) -> Result<Verdict, Failure> {
        if self.motion.drive.is_given() {
            return Err(structures::arm_drive(&tested.assembly));
        }
        let asked = structures::basins::Asked {
            motion: &self.motion,
            drive: self.structure.dof(&tested.assembly)?,
            amplitude: self.structure.needed_amplitude()?,
            frequency_hz: self.frequency_hz,
            coordinates: &self.coordinates,
            grid: &self.grid,
        };
        structures::basins::show(scenario, tested, &asked)
    }

    /// The coordinates of the arm that vary.
    fn arm_coordinates(&self) -> Result<[StateCoordinate; 2], Failure> {
        if self.coordinates.is_empty() {
            return Ok([StateCoordinate::Alpha1, StateCoordinate::AlphaDot1]);
        }
        let parse = |name: &String| {
            name.parse().map_err(|error: UnknownStateCoordinate| Failure::usage(format!("--coordinates: {error}")))
        };
        pair("--coordinates", &self.coordinates.iter().map(parse).collect::<Result<Vec<_>, _>>()?)
    }
}

impl Document {
    fn new(configuration: Value, grid: &StateGrid, motions: &[StableMotion], outcomes: &[BasinOutcome]) -> Document {
        let cells = Cells::new(grid, outcomes);
        let motion = |(k, motion): (usize, &StableMotion)| MotionDocument {
            period: motion.period,
            largest_multiplier: motion.largest_multiplier,
            amplitude_rad: motion.amplitude_rad,
            section: motion.section.iter().map(|state| StateCoordinate::ALL.map(|which| which.of(state))).collect(),
            reached_by: cells.reaching(k),
        };
        let motions = motions.iter().enumerate().map(motion).collect();
        Document { configuration, coordinates: grid.coordinates, motions, cells }
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
        text + &self.cells.others(time_constants)
    }

    fn csv(&self) -> String {
        self.cells.csv(self.coordinates.map(StateCoordinate::name))
    }

    fn figure(&self, grid: &StateGrid) -> Figure {
        let label = |(k, motion): (usize, &MotionDocument)| {
            format!("reaches motion {}: |α₁| to {:.3} rad", k + 1, motion.amplitude_rad[0])
        };
        let labels = self.motions.iter().enumerate().map(label).collect();
        let places = self.coordinates.map(|which| StateCoordinate::ALL.iter().position(|other| *other == which));
        let [x, y] = places.map(Option::unwrap_or_default);
        let sections = self.motions.iter().flat_map(|motion| &motion.section).map(|state| (state[x], state[y]));
        self.cells.figure(self.coordinates.map(StateCoordinate::label), grid.spacing(), labels, sections.collect())
    }
}
