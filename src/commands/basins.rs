//! `resonarm basins`: which initial states reach which stable periodic response.

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::basin_cells::Cells;
use crate::basin_grid::{GridFlags, pair};
use crate::configuration;
use crate::drive::Drive;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::help::heading;
use crate::read_at::{ReadAt, dofs, read_at, readings, words};
use crate::settling_flags::SettlingFlags;
use crate::study;
use resonarm::analysis::time_domain::{StableOrbit, reach, stable_orbits};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::Assembly;
use resonarm::study::StateGrid;
use resonarm_figures::plot::{Figure, Subtitle};
use resonarm_numeric::number::{short, significant};

const EXAMPLES: &str = "\
Examples:
  resonarm basins --drive joint1=60 --frequency-hz 22.1 --plot basins
  resonarm basins --drive joint1=60 --frequency-hz 22.1 --points 21,21
  resonarm basins --drive tip.x=20 --frequency-hz 22.145 \\
      --coordinates alpha1_rad,alpha2_rad --from=-0.2,-0.2 --to 0.2,0.2
  resonarm basins --scenario hardening.toml --drive tip.x=2 \\
      --frequency-hz 22.4 --points 9,9 --plot tip

A state has reached a stable response when, over a quarter of the slowest time constant, its deviation decays as the
linearisation at that response predicts; the remainder may be at most a quarter of the decay. Until then the state is
integrated. States that reach no response within --time-constants are marked as undecided.";

/// Computes basins of attraction: which initial states reach which stable response.
///
/// The initial states cover two coordinates of the state, at phase 0 of the excitation.
///
/// The stable responses are those of the branch that `continue` follows at this frequency and of the isolas that it finds,
/// those in which the structure settles from beside the unstable ones of these, and those of up to 12 periods of the load
/// in which undecided states settle. Others may exist.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Basins {
    #[command(flatten)]
    pub(crate) settling: SettlingFlags,
    /// Frequency of the excitation, Hz.
    #[arg(long, help_heading = heading::LOADS, value_name = "F")]
    frequency_hz: f64,
    /// Degrees of freedom to read, as tip.x,joint1 [default: where the loads act].
    #[arg(long, help_heading = heading::LOADS, value_name = "DOF", value_delimiter = ',')]
    at: Vec<String>,
    /// The two coordinates that vary, as alpha1_rad,alpha1_dot_rad_s [default: the first coordinate and its rate].
    ///
    /// They have the names of their channels; those of modes are q1_m_sqrt_kg and so on. The other coordinates are those
    /// of --initial.
    #[arg(long, help_heading = heading::RANGE, value_name = "NAMES", value_delimiter = ',', num_args = 1)]
    coordinates: Vec<String>,
    #[command(flatten)]
    grid: GridFlags,
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: Value,
    /// The names of the two coordinates that vary.
    over: [String; 2],
    #[serde(rename = "motions")]
    orbits: Vec<Value>,
    #[serde(flatten)]
    cells: Cells,
}

impl Basins {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.settling.structure.scenario()?;
        let tested = scenario.under_test()?;
        let assembly = &tested.assembly;
        let drive = self.settling.drive.drive(assembly)?;
        let read = read_at(&self.at, &drive.driven(), assembly)?;
        let forced = drive.forced(assembly);
        let others = self.settling.initial(&tested)?;
        let (over, names) = self.over(assembly)?;
        let (orbits, early) = stable_orbits(&forced, &dofs(&read), self.frequency_hz, &|| false)?;
        if let Some(early) = early {
            tracing::warn!(
                "the branch ended early, so stable periodic responses beyond its end are unknown: {}",
                early.reason
            );
        }
        // A negative verdict, not an error: the branch may have no stable orbit at this frequency.
        if orbits.is_empty() {
            let hz = short(&self.frequency_hz);
            tracing::error!("no stable periodic response is known at {hz} Hz, so no state can be assigned to one");
            return Ok(Verdict::Negative);
        }
        let far = over.map(|index| reach(&orbits, index, self.frequency_hz));
        let grid = self.grid.grid(over, [&names[0], &names[1]], far, others.clone())?;
        let configuration = self.configuration(&scenario, &tested, &drive, &grid, &names);
        let journal = self.settling.journal()?;
        let basins = resonarm::study::Basins {
            forced,
            frequency_hz: self.frequency_hz,
            orbits,
            grid: grid.clone(),
            time_constants: self.settling.time_constants,
        };
        let walked = study::basins(basins, &dofs(&read), journal, &configuration)?;
        let Some((walk, outcomes)) = walked else { return Ok(Verdict::Negative) };
        let cells = Cells::new(&grid, &outcomes);
        let orbits = walk.orbits();
        let orbit = |(k, orbit): (usize, &StableOrbit)| orbit_document(orbit, &read, cells.reaching(k));
        let documents = orbits.iter().enumerate().map(orbit).collect();
        let coordinates = configuration::coordinates(assembly);
        let document = Document { configuration, coordinates, over: names, orbits: documents, cells };
        let text = || self.text(&document, &grid, orbits, &read);
        let conditions = captions::structure(&scenario, &tested, &[]).and(drive.words());
        let conditions = conditions.and(format!("{} Hz", self.frequency_hz));
        let figure = || Ok(document.figure(&grid, orbits, &read, assembly, conditions));
        let csv = || document.cells.csv([&document.over[0], &document.over[1]]);
        self.settling.show(&document, text, csv, figure)?;
        // The journal is removed only now. If the results could not be written, the same command resumes from it.
        walk.finish()?;
        Ok(Verdict::Positive)
    }

    /// Returns the numbers and names of the coordinates that vary.
    fn over(&self, assembly: &Assembly) -> Result<([usize; 2], [String; 2]), Failure> {
        // States of elements are no choice for an axis: they have no channel and no unit.
        let known = configuration::state_names(assembly);
        let over = if self.coordinates.is_empty() {
            // A state lists all coordinates, then all rates: this is the first coordinate and its rate.
            [0, assembly.coordinates()]
        } else {
            let number = |name: &String| {
                let refusal = || {
                    let known = known.join(", ");
                    Failure::usage(format!("--coordinates: unknown coordinate `{name}`: the coordinates are {known}"))
                };
                known.iter().position(|known| known == name.as_str()).ok_or_else(refusal)
            };
            pair("--coordinates", &self.coordinates.iter().map(number).collect::<Result<Vec<_>, _>>()?)?
        };
        Ok((over, over.map(|index| known[index].to_string())))
    }

    fn configuration(
        &self,
        scenario: &Scenario,
        tested: &TestedAssembly,
        drive: &Drive,
        grid: &StateGrid,
        names: &[String; 2],
    ) -> Value {
        let mut configuration = self.settling.configuration(scenario, tested, drive, &grid.others);
        configuration["basins"] = json!({
            "frequency_hz": self.frequency_hz,
            "coordinates": names,
            "from": grid.ends.map(|ends| ends[0]),
            "to": grid.ends.map(|ends| ends[1]),
            "points": grid.counts,
        });
        configuration
    }

    /// Lists the responses, and how many of the grid's states reach each.
    fn text(&self, document: &Document, grid: &StateGrid, orbits: &[StableOrbit], read: &[ReadAt]) -> String {
        let all = document.cells.len();
        let span = |axis: usize| {
            let [from, to] = grid.ends[axis].map(|end| significant(&end, 4));
            format!("{} from {from} to {to}", document.over[axis])
        };
        let mut text = format!("{all} states: {}, {}\n", span(0), span(1));
        for (k, orbit) in orbits.iter().enumerate() {
            let period = if orbit.period == 1 { String::new() } else { format!(", {} periods", orbit.period) };
            text += &format!(
                "response {}: largest {}{period}; reached by {} of these {all} states\n",
                k + 1,
                words(&orbit.readings, read),
                document.cells.reaching(k)
            );
        }
        text + &document.cells.others(self.settling.time_constants)
    }
}

fn orbit_document(orbit: &StableOrbit, read: &[ReadAt], reached_by: usize) -> Value {
    json!({
        "period": orbit.period,
        "largest_multiplier": orbit.largest_multiplier,
        "readings": readings(&orbit.readings, read),
        "section": orbit.section,
        "reached_by": reached_by,
    })
}

impl Document {
    fn figure(
        &self,
        grid: &StateGrid,
        orbits: &[StableOrbit],
        read: &[ReadAt],
        assembly: &Assembly,
        conditions: Subtitle,
    ) -> Figure {
        let labelled = |(k, orbit): (usize, &StableOrbit)| {
            let (at, largest) = (&read[0], orbit.readings[0].largest);
            let period = if orbit.period == 1 { String::new() } else { format!(", {} periods", orbit.period) };
            format!("reaches response {}: {} to {largest:.2e} {}{period}", k + 1, at.name, at.unit())
        };
        let labels = orbits.iter().enumerate().map(labelled).collect();
        let [x, y] = grid.coordinates;
        let sections = orbits.iter().flat_map(|orbit| &orbit.section).map(|state| (state[x], state[y])).collect();
        let [x_label, y_label] = grid.coordinates.map(|index| configuration::state_label(assembly, index));
        self.cells.figure([&x_label, &y_label], grid.spacing(), labels, sections).subtitle(conditions)
    }
}
