//! `resonarm basins`: which initial states reach which stable periodic response.

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::help::heading;
use crate::numbers;
use crate::output::or_empty;
use crate::read_at::{ReadAt, dofs, read_at, readings, words};
use crate::settling_flags::SettlingFlags;
use crate::study;
use resonarm::analysis::time_domain::{BasinOutcome, StableOrbit, reach, stable_orbits};
use resonarm::structure::Assembly;
use resonarm::study::StateGrid;
use resonarm_figures::plot::{Axis, Color, Figure, Legend, Marker, Panel, Series, Subtitle};
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

/// The largest number of values of a coordinate.
const MOST: u32 = 1000;

/// The grid of initial states.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::RANGE)]
struct GridFlags {
    /// First value of each coordinate [default: the negative of --to].
    #[arg(long, value_name = "X,Y", value_delimiter = ',', num_args = 1)]
    from: Option<Vec<f64>>,
    /// Last value of each coordinate [default: 1.5 times as far as the largest stable response reaches].
    #[arg(long, value_name = "X,Y", value_delimiter = ',', num_args = 1)]
    to: Option<Vec<f64>>,
    /// Number of values of each coordinate, evenly spaced, from 2 to 1000.
    #[arg(
        long,
        value_name = "NX,NY",
        default_value = "41,41",
        allow_hyphen_values = true,
        value_delimiter = ',',
        num_args = 1,
        value_parser = numbers::integer_checked_later(2..=MOST)
    )]
    points: Vec<u32>,
}

/// An initial state of the grid, as the results state it.
#[derive(Serialize)]
struct Cell {
    at: [f64; 2],
    /// The number of the response that it reaches, counted from 1.
    #[serde(rename = "motion")]
    orbit: Option<usize>,
    /// Periods of the excitation until this was certain.
    periods: Option<u64>,
    /// `reaches`, `undecided` or `diverges`.
    outcome: &'static str,
}

/// The cells of a grid, and the numbers of those without a response.
#[derive(Serialize)]
struct Cells {
    undecided: usize,
    diverging: usize,
    cells: Vec<Cell>,
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
        // The coordinates that do not vary keep these values in all states of the grid.
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
        let mut configuration = self.settling.configuration(&scenario, &tested, &drive, &grid.others);
        configuration["basins"] = json!({
            "frequency_hz": self.frequency_hz,
            "coordinates": names,
            "from": grid.ends.map(|ends| ends[0]),
            "to": grid.ends.map(|ends| ends[1]),
            "points": grid.counts,
        });
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
        let orbit = |(k, orbit): (usize, &StableOrbit)| {
            json!({
                "period": orbit.period,
                "largest_multiplier": orbit.largest_multiplier,
                "readings": readings(&orbit.readings, &read),
                "section": orbit.section,
                "reached_by": cells.reaching(k),
            })
        };
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

    /// Lists the responses, and how many of the grid's states reach each.
    fn text(&self, document: &Document, grid: &StateGrid, orbits: &[StableOrbit], read: &[ReadAt]) -> String {
        let all = document.cells.cells.len();
        let span = |axis: usize| {
            let [from, to] = grid.ends[axis].map(|end| significant(&end, 4));
            format!("{} from {from} to {to}", document.over[axis])
        };
        let mut text = format!("{all} states: {}, {}\n", span(0), span(1));
        for (k, orbit) in orbits.iter().enumerate() {
            let period = if orbit.period == 1 { String::new() } else { format!(", {} periods", orbit.period) };
            let number = k + 1;
            let largest = words(&orbit.readings, read);
            let reached = document.cells.reaching(k);
            text +=
                &format!("response {number}: largest {largest}{period}; reached by {reached} of these {all} states\n");
        }
        text + &document.cells.others(self.settling.time_constants)
    }
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
            let at = &read[0];
            let largest = orbit.readings[0].largest;
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

impl GridFlags {
    /// Returns the grid in two coordinates; without flags each of them extends as far as `reach`.
    fn grid(
        &self,
        coordinates: [usize; 2],
        names: [&str; 2],
        reach: [f64; 2],
        others: Vec<f64>,
    ) -> Result<StateGrid, Failure> {
        if names[0] == names[1] {
            return Err(Failure::usage(format!("--coordinates names {} twice: give two different ones", names[0])));
        }
        let counts = pair("--points", &self.points)?;
        if let Some(count) = counts.iter().find(|count| !(2..=MOST).contains(*count)) {
            return Err(Failure::usage(format!("--points has the value {count}: it must be from 2 to {MOST}")));
        }
        let to = self.to.as_ref().map_or(Ok(reach), |to| pair("--to", to))?;
        // Coordinates count from rest, so a grid without --from is symmetric about the state of rest.
        let from = self.from.as_ref().map_or_else(|| Ok(to.map(|to| -to)), |from| pair("--from", from))?;
        let ends = [0, 1].map(|axis| [from[axis], to[axis]]);
        match ends.iter().find(|[from, to]| !(from.is_finite() && to.is_finite() && from != to)) {
            Some([from, to]) => {
                let from = short(from);
                let to = short(to);
                Err(Failure::usage(format!("invalid grid from {from} to {to}: the ends must be two different numbers")))
            }
            None => Ok(StateGrid { coordinates, ends, counts: counts.map(|count| count as usize), others }),
        }
    }
}

/// Returns the two values of a flag.
fn pair<T: Copy>(flag: &str, values: &[T]) -> Result<[T; 2], Failure> {
    let count = values.len();
    <[T; 2]>::try_from(values).map_err(|_count| Failure::usage(format!("{flag} has {count} values, expected two: X,Y")))
}

impl Cells {
    /// Lists the fates of the states of a grid.
    fn new(grid: &StateGrid, outcomes: &[BasinOutcome]) -> Cells {
        let cell = |(index, outcome): (usize, &BasinOutcome)| {
            let (orbit, periods, name) = match outcome {
                BasinOutcome::Reaches { orbit, periods } => (Some(orbit + 1), Some(*periods), "reaches"),
                BasinOutcome::Undecided => (None, None, "undecided"),
                BasinOutcome::Diverges => (None, None, "diverges"),
            };
            Cell { at: grid.values(index), orbit, periods, outcome: name }
        };
        let cells: Vec<Cell> = outcomes.iter().enumerate().map(cell).collect();
        let count = |name: &str| cells.iter().filter(|cell| cell.outcome == name).count();
        Cells { undecided: count("undecided"), diverging: count("diverges"), cells }
    }

    /// Returns the number of states that reach a response, which is counted from 0.
    fn reaching(&self, orbit: usize) -> usize {
        self.cells.iter().filter(|cell| cell.orbit == Some(orbit + 1)).count()
    }

    /// Says in words how many states reach no response, and what to try.
    fn others(&self, time_constants: f64) -> String {
        let mut text = String::new();
        if self.undecided > 0 {
            text += &format!(
                "undecided: {} states reach none of these within {time_constants} time constants (try more \
                 --time-constants)\n",
                self.undecided
            );
        }
        if self.diverging > 0 {
            text += &format!("beyond all bounds: {} states\n", self.diverging);
        }
        text
    }

    /// Returns a line for each state, whose coordinates have these names.
    fn csv(&self, [x, y]: [&str; 2]) -> String {
        let mut text = format!("{x},{y},outcome,motion,periods\n");
        for Cell { at: [x, y], orbit, periods, outcome } in &self.cells {
            let orbit = or_empty(*orbit);
            let periods = or_empty(*periods);
            text += &format!("{x},{y},{outcome},{orbit},{periods}\n");
        }
        text
    }

    /// Draws a tile for each state, in the colour of the response it reaches, which `labels` name; the sections of the
    /// responses are drawn over them. `spacing` is the distance of neighbouring states along each axis.
    fn figure(&self, [x, y]: [&str; 2], spacing: [f64; 2], labels: Vec<String>, sections: Vec<(f64, f64)>) -> Figure {
        let mut panel = Panel::new(Axis::linear(x), Axis::linear(y)).legend(Legend::Below);
        let cells = |wanted: &dyn Fn(&Cell) -> bool| {
            self.cells.iter().filter(|cell| wanted(cell)).map(|cell| (cell.at[0], cell.at[1])).collect::<Vec<_>>()
        };
        let colors = [Color::SkyBlue, Color::Vermillion, Color::Yellow, Color::Green, Color::Purple, Color::Blue];
        for (k, label) in labels.into_iter().enumerate() {
            // Seven stable orbits at one frequency would repeat a colour; grey and black are kept for the states that
            // reach none.
            let color = colors[k % colors.len()];
            let points = cells(&|cell| cell.orbit == Some(k + 1));
            panel = panel.with_any(Series::tiles(label, color, spacing, points));
        }
        for (outcome, label, color) in
            [("undecided", "undecided", Color::Grey), ("diverges", "beyond all bounds", Color::Black)]
        {
            let points = cells(&|cell| cell.outcome == outcome);
            panel = panel.with_any(Series::tiles(label, color, spacing, points));
        }
        // Drawn last, over the tiles. The other coordinates of an orbit are usually not those of the plane of the
        // grid, so that its mark is a projection and may lie in a tile of another colour.
        let sections = Series::markers("stable responses, projected", Color::Black, Marker::Diamond, sections);
        let panel = panel.with(sections.marked(8.0, false));
        Figure::new("Basins of attraction: where each initial state ends").with(panel)
    }
}
