//! `resonarm poincare`: Poincaré sections, and bifurcation diagrams that consist of them.

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::configuration;
use crate::drive::Drive;
use crate::failure::{Failure, Verdict};
use crate::figures::captions;
use crate::figures::singular_curves::{coordinate, title};
use crate::flags::{described, interval};
use crate::help::heading;
use crate::numbers;
use crate::output::or_empty;
use crate::read_at::{ReadAt, dofs, read_at, readings};
use crate::settling_flags::{DIRECTIONS, SettlingFlags};
use crate::study;
use resonarm::analysis::Coordinate;
use resonarm::analysis::time_domain::{Direction, Grid, SettleOptions, Sweep, path, section_point};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::Assembly;
use resonarm::study::{SweepPoint, Sweeps};
use resonarm_figures::plot::{Axis, Color, Figure, Legend, Marker, Panel, Series};

/// Points of the section to keep if a response doesn't settle: of a single response, and at each value of a diagram.
const SECTION_POINTS: usize = 2000;
const DIAGRAM_POINTS: usize = 200;

const EXAMPLES: &str = "\
Examples:
  resonarm poincare --drive joint1=60 --frequency-hz 22.1 --at joint1,joint2
  resonarm poincare --parameter amplitude --drive joint1 --frequency-hz 22.1 \\
      --from 5 --to 90 --plot diagram
  resonarm poincare --parameter frequency --drive joint1=60 --from-hz 21.9 \\
      --to-hz 22.3 --points 21";

/// Computes Poincaré sections, and bifurcation diagrams made of them.
///
/// A section has the states of the settled structure at phase 0 of the excitation. A bifurcation diagram has sections in
/// the frequency, the amplitude or a parameter.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Poincare {
    #[command(flatten)]
    pub(crate) settling: SettlingFlags,
    /// Degrees of freedom to read, as tip.x,joint1 [default: where the loads act].
    #[arg(long, help_heading = heading::LOADS, value_name = "DOF", value_delimiter = ',')]
    at: Vec<String>,
    /// Frequency of the excitation, Hz; not with --parameter frequency.
    #[arg(long, help_heading = heading::LOADS, value_name = "F")]
    frequency_hz: Option<f64>,
    /// What is stepped: frequency, amplitude, or a parameter, as link2.angle_deg [default: none; a single section is computed].
    ///
    /// The sections at all values make a bifurcation diagram.
    #[arg(long, help_heading = heading::RANGE, value_name = "NAME")]
    parameter: Option<String>,
    #[command(flatten)]
    range: RangeFlags,
    /// Number of values, evenly spaced, with both ends.
    #[arg(long, help_heading = heading::RANGE, value_name = "N", default_value_t = 101, requires = "parameter", value_parser = numbers::integer_checked_later(2..=1_000_000_u32))]
    points: u32,
    /// Direction of steps.
    #[arg(long, help_heading = heading::RANGE, value_parser = described(DIRECTIONS), default_value = "both", requires = "parameter")]
    direction: &'static [Direction],
    /// Points of a section to keep if a response does not settle [default: 2000, in a diagram 200].
    ///
    /// It must be from 1 to 1000000.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "N", value_parser = numbers::integer(1..=1_000_000_u32))]
    section_points: Option<u32>,
}

/// The interval of the quantity that is stepped.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::RANGE)]
struct RangeFlags {
    /// One end of the frequencies, Hz.
    #[arg(long, value_name = "F")]
    from_hz: Option<f64>,
    /// Other end of the frequencies, Hz.
    #[arg(long, value_name = "F")]
    to_hz: Option<f64>,
    /// One end of the amplitudes, or of the parameter's values.
    ///
    /// An amplitude has the unit of the first load, a parameter the unit in its name.
    #[arg(long, value_name = "X")]
    from: Option<f64>,
    /// Other end of the amplitudes, or of the parameter's values.
    #[arg(long, value_name = "X")]
    to: Option<f64>,
}

/// The sections to compute.
struct Plan {
    drive: Drive,
    read: Vec<ReadAt>,
    /// The quantity that is stepped.
    over: Coordinate,
    /// The values of that quantity; a single section has none.
    grid: Option<Grid>,
    /// The frequency where it is not stepped, Hz.
    frequency_hz: f64,
}

#[derive(Serialize)]
struct ResponseDocument {
    #[serde(skip_serializing_if = "Option::is_none")]
    direction: Option<Direction>,
    /// The value of the quantity that is stepped; for a single section, the frequency in Hz.
    value: f64,
    period: Option<u32>,
    settling_periods: u64,
    drift: f64,
    readings: Value,
    /// The states at phase 0: coordinates, their rates, states of elements.
    section: Vec<Vec<f64>>,
}

#[derive(Serialize)]
struct Document {
    /// The inputs of the results; where the amplitude is stepped, the loads are those at the amplitude 1 of the first.
    configuration: Value,
    coordinates: Value,
    #[serde(rename = "motions")]
    responses: Vec<ResponseDocument>,
}

impl Poincare {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.settling.structure.scenario()?;
        let tested = scenario.under_test()?;
        let plan = self.plan(&tested)?;
        let start = self.settling.initial(&tested)?;
        let mut configuration = self.settling.configuration(&scenario, &tested, &plan.drive, &start);
        configuration["poincare"] = json!({
            "parameter": self.parameter, "frequency_hz": self.frequency_hz,
            "ends": plan.grid.as_ref().map(|grid| [grid.values().first().copied(), grid.values().last().copied()]),
            "directions": plan.grid.as_ref().map(|_grid| self.direction),
            "points": plan.grid.as_ref().map(|_grid| self.points),
            "section_points": self.section_points(), "at": self.at,
        });
        let journal = self.settling.journal()?;
        let sweeps = Sweeps {
            sweeps: self.sweeps(&tested, &plan),
            read: dofs(&plan.read),
            start,
            options: SettleOptions {
                time_constants: self.settling.time_constants,
                section_points: self.section_points(),
            },
        };
        let walked = study::sweeps("section", sweeps, journal, &configuration)?;
        let Some(walked) = walked else { return Ok(Verdict::Negative) };
        let coordinates = configuration::coordinates(&tested.assembly);
        let document = Document { configuration, coordinates, responses: self.responses(&plan, walked.points()) };
        let text = || document.summary(self.settling.time_constants);
        let csv = || document.csv(&plan, &tested.assembly);
        self.settling.show(&document, text, csv, || self.figure(&scenario, &tested, &plan, &document))?;
        walked.finish()?;
        Ok(Verdict::Positive)
    }

    fn section_points(&self) -> usize {
        let usual = if self.parameter.is_some() { DIAGRAM_POINTS } else { SECTION_POINTS };
        self.section_points.map_or(usual, |points| points as usize)
    }

    /// Returns the frequency that isn't stepped.
    fn frequency(&self) -> Result<f64, Failure> {
        self.frequency_hz
            .ok_or_else(|| Failure::usage("the frequency of the excitation is missing: give --frequency-hz F"))
    }

    /// Resolves the flags against the structure: the load, the readings, and the values of the quantity that is
    /// stepped.
    fn plan(&self, tested: &TestedAssembly) -> Result<Plan, Failure> {
        let assembly = &tested.assembly;
        let RangeFlags { from_hz, to_hz, from, to } = self.range;
        let hz = [from_hz, to_hz];
        let other = [from, to];
        let Some(name) = &self.parameter else {
            // Rejects an interval, through which nothing would be stepped.
            interval("a section without --parameter", None, hz, other)?;
            let drive = self.settling.drive.drive(assembly)?;
            let read = read_at(&self.at, &drive.driven(), assembly)?;
            let frequency_hz = self.frequency()?;
            return Ok(Plan { drive, read, over: Coordinate::FrequencyHz, grid: None, frequency_hz });
        };
        let over = coordinate("--parameter", name, assembly)?;
        let drive = self.settling.drive.along(over, assembly)?;
        let [from, to] = interval(&format!("--parameter {name}"), Some(over), hz, other)?.unwrap_or_default();
        let frequency_hz = match over {
            Coordinate::FrequencyHz if self.frequency_hz.is_some() => {
                return Err(Failure::usage(
                    "--frequency-hz is for a section or a diagram in another parameter: leave --frequency-hz out",
                ));
            }
            Coordinate::FrequencyHz => from,
            Coordinate::Amplitude | Coordinate::Parameter(_) => self.frequency()?,
        };
        let read = read_at(&self.at, &drive.driven(), assembly)?;
        Ok(Plan { drive, read, over, grid: Some(Grid::new(from, to, self.points)?), frequency_hz })
    }

    /// Returns a sweep for each direction, or the section alone.
    fn sweeps(&self, tested: &TestedAssembly, plan: &Plan) -> Vec<Sweep> {
        let sweep = |values: Vec<f64>| Sweep {
            forced: plan.drive.forced(&tested.assembly),
            frequency_hz: plan.frequency_hz,
            over: plan.over,
            values,
        };
        match &plan.grid {
            None => vec![sweep(vec![plan.frequency_hz])],
            Some(grid) => self.direction.iter().map(|direction| sweep(grid.in_order(*direction))).collect(),
        }
    }

    fn responses(&self, plan: &Plan, points: &[Vec<SweepPoint>]) -> Vec<ResponseDocument> {
        let response = |direction, value, point: &SweepPoint| ResponseDocument {
            direction,
            value,
            period: point.period,
            settling_periods: point.settling_periods,
            drift: point.drift,
            readings: readings(&point.readings(), &plan.read),
            section: point.section.clone(),
        };
        let mut responses = Vec::new();
        // A single section has one chain of points: `zip` ends after it, and its direction is not used.
        for (chain, direction) in points.iter().zip(self.direction) {
            let (direction, values) = match &plan.grid {
                None => (None, vec![plan.frequency_hz]),
                Some(grid) => (Some(*direction), grid.in_order(*direction)),
            };
            responses.extend(values.into_iter().zip(chain).map(|(value, point)| response(direction, value, point)));
        }
        responses
    }

    fn figure(
        &self,
        scenario: &Scenario,
        tested: &TestedAssembly,
        plan: &Plan,
        document: &Document,
    ) -> Result<Figure, Failure> {
        let varied: Vec<String> = plan.grid.iter().map(|_grid| plan.over.to_string()).collect();
        let load = plan.drive.words_without(&[plan.over]);
        let hz = self.frequency_hz.map_or(String::new(), |hz| format!("{hz} Hz"));
        let conditions = captions::structure(scenario, tested, &varied).and(load).and(hz);
        let figure = match &plan.grid {
            None => self.section_figure(tested, plan, document)?,
            Some(_) => self.diagram(tested, plan, document),
        };
        Ok(figure.subtitle(conditions))
    }

    /// Draws the section in the plane of each degree of freedom, over the path of the response if it is periodic: its
    /// few points alone would show little.
    fn section_figure(&self, tested: &TestedAssembly, plan: &Plan, document: &Document) -> Result<Figure, Failure> {
        let response = document.responses.first();
        // Only a periodic orbit returns to its start: for others there is no closed path to draw.
        let repeating = response.and_then(|response| Some((response.section.first()?, response.period?)));
        let states = match (repeating, self.sweeps(tested, plan).first()) {
            (Some((start, periods)), Some(sweep)) => path(&sweep.map(plan.frequency_hz)?, start, periods)?,
            _ => Vec::new(),
        };
        let mut figure = Figure::new("Poincaré section at phase 0 of the excitation");
        figure.columns = plan.read.len().min(2);
        for (index, at) in plan.read.iter().enumerate() {
            let plane = |state: &Vec<f64>| section_point(&tested.assembly, at.dof, state).into();
            let points: Vec<(f64, f64)> =
                document.responses.iter().flat_map(|response| &response.section).map(plane).collect();
            // The few points of a periodic orbit must be seen over its path; thousands of points of a chaotic one
            // must not merge.
            let size = if points.len() > 20 { 2.0 } else { 6.0 };
            let name = &at.name;
            let unit = at.unit();
            let [x, y] = [format!("{name} ({unit})"), format!("d{name}/dt ({unit}/s)")].map(Axis::linear);
            let panel = Panel::new(x, y).legend(if index == 0 { Legend::Bottom } else { Legend::None });
            let panel = panel.with_any(Series::line("response", Color::Grey, states.iter().map(plane).collect()));
            let section = Series::markers("section", Color::Blue, Marker::Circle, points);
            figure = figure.with(panel.with(section.marked(size, true)));
        }
        Ok(figure)
    }

    /// Draws the sections over the quantity that is stepped.
    fn diagram(&self, tested: &TestedAssembly, plan: &Plan, document: &Document) -> Figure {
        let mut figure = Figure::new("Bifurcation diagram: the section at phase 0 of the excitation");
        for (index, at) in plan.read.iter().enumerate() {
            let y = Axis::linear(format!("{} ({})", at.name, at.unit()));
            let mut panel = Panel::new(Axis::linear(title(plan.over, &plan.drive)), y);
            for direction in self.direction {
                let (color, size) = match direction {
                    Direction::Up => (Color::Blue, 3.5),
                    Direction::Down => (Color::Vermillion, 2.0),
                };
                let name = direction.name();
                // Periodic responses as a few points, others as a cloud of small ones.
                for (repeats, label, size) in [
                    (true, format!("stepped {name}"), size),
                    (false, format!("stepped {name}, not settled"), 0.4 * size),
                ] {
                    let responses = document.responses.iter().filter(|response| {
                        response.direction == Some(*direction) && response.period.is_some() == repeats
                    });
                    let of = |response: &ResponseDocument| {
                        let displacement = |state: &Vec<f64>| section_point(&tested.assembly, at.dof, state)[0];
                        let value = response.value;
                        response.section.iter().map(move |state| (value, displacement(state))).collect::<Vec<_>>()
                    };
                    let series = Series::markers(label, color, Marker::Circle, responses.flat_map(of).collect());
                    panel = panel.with_any(series.marked(size, true));
                }
            }
            figure = figure.with(if index > 0 { panel.legend(Legend::None) } else { panel });
        }
        figure
    }
}

impl Document {
    /// Says how many responses there are of each period.
    fn summary(&self, time_constants: f64) -> String {
        let mut text = String::new();
        let mut periods: Vec<Option<u32>> = self.responses.iter().map(|response| response.period).collect();
        // Orbits that have not settled come last.
        periods.sort_by_key(|period| period.unwrap_or(u32::MAX));
        periods.dedup();
        for period in periods {
            let count = self.responses.iter().filter(|response| response.period == period).count();
            let noun = if count == 1 { "response" } else { "responses" };
            text += &match period {
                Some(1) => format!("{count} {noun} with the period of the excitation\n"),
                Some(period) => format!("{count} {noun} of {period} periods of the excitation\n"),
                None => format!(
                    "{count} {noun} not settled within {time_constants} time constants: quasi-periodic, chaotic, of a \
                     period above 8, or still settling (try more --time-constants)\n"
                ),
            };
        }
        text
    }

    /// Returns a line for each point of a section: the coordinates and their rates.
    fn csv(&self, plan: &Plan, assembly: &Assembly) -> String {
        let names = configuration::state_names(assembly);
        let varied = plan.over.to_string().replace('.', "_");
        let mut text = format!("direction,{varied},period,{}\n", names.join(","));
        for response in &self.responses {
            let direction = or_empty(response.direction.map(Direction::name));
            let period = or_empty(response.period);
            for state in &response.section {
                text += &format!("{direction},{},{period}", response.value);
                // The states of elements follow the rates. They have no channel, and therefore no column.
                state.iter().take(names.len()).for_each(|value| text += &format!(",{value}"));
                text.push('\n');
            }
        }
        text
    }
}
