//! `resonarm sweep`: stepped-sine sweeps in the time domain.

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::configuration;
use crate::drive::Drive;
use crate::failure::{Failure, Verdict};
use crate::figures::branches::of_each;
use crate::figures::captions;
use crate::flags::{self, repeated};
use crate::help::heading;
use crate::numbers;
use crate::output::or_empty;
use crate::read_at::{ReadAt, cells, columns, dofs, read_at, readings};
use crate::settling_flags::{DIRECTIONS, SettlingFlags, periods};
use crate::study;
use resonarm::analysis::time_domain::{
    Direction, Grid, Resonance, SettleOptions, Sweep as SteppedSweep, SweepFrequencies, hysteresis,
};
use resonarm::analysis::{Coordinate, Reading};
use resonarm::plant::TestedAssembly;
use resonarm::study::{SweepPoint, Sweeps};
use resonarm_figures::plot::{Color, Dash, Figure, Legend, Marker, Panel, Series, Style, Subtitle};
use resonarm_numeric::number::short;

const EXAMPLES: &str = "\
Examples:
  resonarm sweep --drive joint1=60 --from-hz 21.9 --to-hz 22.3 --points 41 \\
      --plot sweep
  resonarm sweep --drive joint1=60 --from-hz 21.9 --to-hz 22.3 --points 41 \\
      --direction down --at joint1,joint2
  resonarm sweep --drive tip.x=20 --over link2.angle_deg=60,70 --from-hz 22 \\
      --to-hz 23 --points 21 --plot poses
  resonarm sweep --scenario hardening.toml --drive tip.x=2 --from-hz 22 \\
      --to-hz 22.8 --points 9 --plot tip

The response is read as by `continue`: the largest displacement, the mean, and the component at the frequency of the drive. A
response that has not settled is read over 64 periods of the excitation.";

/// Simulates a stepped-sine test up and down in frequency, with jumps and hysteresis.
///
/// The structure settles at each step, as on a bench. Every response is followed until it is proved to have settled.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct Sweep {
    #[command(flatten)]
    pub(crate) settling: SettlingFlags,
    /// Degrees of freedom to read, as tip.x,joint1 [default: where the loads act].
    #[arg(long, help_heading = heading::LOADS, value_name = "DOF", value_delimiter = ',')]
    at: Vec<String>,
    /// One end of the frequencies, Hz.
    #[arg(long, help_heading = heading::RANGE, value_name = "F")]
    from_hz: f64,
    /// Other end of the frequencies, Hz.
    #[arg(long, help_heading = heading::RANGE, value_name = "F")]
    to_hz: f64,
    /// Number of frequencies, evenly spaced, with both ends [default: 101, and more at resonances].
    ///
    /// By default there are as many between the 101 as the resonances of the forced response need. With a number of
    /// yours, a resonance between two frequencies is reported.
    #[arg(long, help_heading = heading::RANGE, value_name = "N", value_parser = numbers::integer_checked_later(2..=1_000_000_u32))]
    points: Option<u32>,
    /// Direction of steps.
    #[arg(long, help_heading = heading::RANGE, value_parser = flags::described(DIRECTIONS), default_value = "both")]
    direction: &'static [Direction],
    /// Sweep at each of these values of a parameter, as link2.angle_deg=60,70.
    #[arg(long, help_heading = heading::RANGE, value_name = "NAME=X,…", allow_hyphen_values = true, value_parser = over_flag)]
    over: Option<OverFlag>,
}

/// A parameter with the values that it takes.
#[derive(Clone, Debug, PartialEq)]
struct OverFlag {
    name: String,
    values: Vec<f64>,
}

fn over_flag(text: &str) -> Result<OverFlag, String> {
    let (name, values) = text.split_once('=').ok_or("it must be a parameter with its values, NAME=X,X")?;
    let values: Vec<f64> = values.split(',').map(numbers::finite).collect::<Result<_, _>>()?;
    // Two sweeps at the same value could not be distinguished.
    match repeated(&values, |a, b| a == b) {
        Some(value) => Err(format!("{} is given twice: give each value once", short(value))),
        None => Ok(OverFlag { name: name.to_owned(), values }),
    }
}

/// Amplitudes with a relative difference above this belong to different responses: each was proved to have settled.
const DIFFERENT: f64 = 1e-6;

/// The sweeps of one structure.
struct Variant {
    /// The value of the parameter of `--over`.
    value: Option<f64>,
    structure: TestedAssembly,
    grid: Grid,
    /// Resonances in whose half-power band no step lies.
    stepped_over: Vec<Resonance>,
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: Value,
    /// The parameter of `--over`.
    #[serde(skip_serializing_if = "Option::is_none")]
    over: Option<String>,
    sweeps: Vec<SweepDocument>,
}

#[derive(Serialize)]
struct SweepDocument {
    /// The value of the parameter of `--over`.
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<f64>,
    direction: Direction,
    /// Resonances of the forced response in whose half-power band no step lies: their peaks are not in the points.
    stepped_over: Vec<Value>,
    points: Vec<Value>,
    /// The value in words, with the name of the parameter.
    #[serde(skip)]
    at_value: Option<String>,
    #[serde(skip)]
    missed: Vec<Resonance>,
    #[serde(skip)]
    responses: Vec<Response>,
}

/// A settled response and its frequency, Hz.
struct Response {
    frequency_hz: f64,
    point: SweepPoint,
    readings: Vec<Reading>,
}

impl Sweep {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let scenario = self.settling.structure.scenario()?;
        let tested = scenario.under_test()?;
        let assembly = &tested.assembly;
        let drive = self.settling.drive.drive(assembly)?;
        let read = read_at(&self.at, &drive.driven(), assembly)?;
        let start = self.settling.initial(&tested)?;
        let variants = self.variants(&tested, &drive, &read)?;
        let mut configuration = self.settling.configuration(&scenario, &tested, &drive, &start);
        configuration["sweep"] = json!({
            "from_hz": self.from_hz, "to_hz": self.to_hz, "points": self.points, "at": self.at,
            "directions": self.direction,
            "over": self.over.as_ref().map(|over| json!({ &*over.name: over.values })),
        });
        let journal = self.settling.journal()?;
        let sweeps = Sweeps {
            sweeps: self.sweeps(&variants, &drive),
            read: dofs(&read),
            start,
            options: SettleOptions { time_constants: self.settling.time_constants, section_points: 0 },
        };
        let walked = study::sweeps("sweep", sweeps, journal, &configuration)?;
        let Some(walked) = walked else { return Ok(Verdict::Negative) };
        let document = Document {
            configuration,
            coordinates: configuration::coordinates(assembly),
            over: self.over.as_ref().map(|over| over.name.clone()),
            sweeps: self.documents(&variants, walked.points(), &read),
        };
        let label = captions::label(&scenario, &tested);
        let text = || document.text(&label, &read, self.settling.time_constants);
        let varied: Vec<String> = document.over.iter().cloned().collect();
        let conditions = || captions::structure(&scenario, &tested, &varied).and(drive.words());
        let figure = || Ok(document.figure(conditions(), &read));
        self.settling.show(&document, text, || document.csv(&read), figure)?;
        walked.finish()?;
        Ok(Verdict::Positive)
    }

    /// Returns the structure at each value of the parameter, or as it is; without --points with frequencies that
    /// resolve its resonances.
    fn variants(&self, tested: &TestedAssembly, drive: &Drive, read: &[ReadAt]) -> Result<Vec<Variant>, Failure> {
        let mut structures = Vec::new();
        match &self.over {
            None => structures.push((None, tested.clone())),
            Some(OverFlag { name, values }) => {
                let refused = |error| flags::refused("--over", &error);
                let parameter = tested.assembly.parameter(name).map_err(refused)?;
                for value in values {
                    let assembly = tested.assembly.with(parameter, *value).map_err(refused)?;
                    structures.push((Some(*value), TestedAssembly { assembly, ..tested.clone() }));
                }
            }
        }
        let variant = |(value, structure): (Option<f64>, TestedAssembly)| {
            let forced = drive.forced(&structure.assembly);
            let SweepFrequencies { grid, stepped_over, unknown_beyond } =
                SweepFrequencies::new(&forced, &dofs(read), [self.from_hz, self.to_hz], self.points)?;
            if let Some(reason) = unknown_beyond {
                let at = self.at_value(value).map_or(String::new(), |value| value + ": ");
                tracing::warn!("{at}the search for resonances ended early: {reason}");
            }
            Ok(Variant { value, structure, grid, stepped_over })
        };
        structures.into_iter().map(variant).collect()
    }

    /// Returns the value of the parameter in words, `link2.angle_deg = 60`; none without `--over`.
    fn at_value(&self, value: Option<f64>) -> Option<String> {
        Some(format!("{} = {}", self.over.as_ref()?.name, short(&value?)))
    }

    /// Returns each structure with each direction, in the order of the sweeps.
    fn each<'a>(&'a self, variants: &'a [Variant]) -> impl Iterator<Item = (&'a Variant, Direction)> {
        variants.iter().flat_map(|variant| self.direction.iter().map(move |direction| (variant, *direction)))
    }

    /// Returns a sweep for each direction and structure.
    fn sweeps(&self, variants: &[Variant], drive: &Drive) -> Vec<SteppedSweep> {
        let sweep = |(variant, direction): (&Variant, Direction)| SteppedSweep {
            forced: drive.forced(&variant.structure.assembly),
            frequency_hz: self.from_hz,
            over: Coordinate::FrequencyHz,
            values: variant.grid.in_order(direction),
        };
        self.each(variants).map(sweep).collect()
    }

    fn documents(&self, variants: &[Variant], points: &[Vec<SweepPoint>], read: &[ReadAt]) -> Vec<SweepDocument> {
        let document = |((variant, direction), points): ((&Variant, Direction), &Vec<SweepPoint>)| {
            let hz = variant.grid.in_order(direction).into_iter();
            let responses: Vec<Response> = hz.zip(points).map(Response::new).collect();
            SweepDocument {
                value: variant.value,
                at_value: self.at_value(variant.value),
                direction,
                stepped_over: variant.stepped_over.iter().map(|found| missed(found, read)).collect(),
                points: responses.iter().map(|response| response.document(read)).collect(),
                missed: variant.stepped_over.clone(),
                responses,
            }
        };
        self.each(variants).zip(points).map(document).collect()
    }
}

/// Describes a resonance that the steps miss.
fn missed(found: &Resonance, read: &[ReadAt]) -> Value {
    let Resonance { reading, frequency_hz, largest, width_hz } = found;
    json!({ "at": read[*reading].name, "frequency_hz": frequency_hz, "largest": largest, "width_hz": width_hz })
}

impl Response {
    fn new((frequency_hz, point): (f64, &SweepPoint)) -> Response {
        Response { frequency_hz, readings: point.readings(), point: point.clone() }
    }

    fn document(&self, read: &[ReadAt]) -> Value {
        let point = &self.point;
        json!({
            "frequency_hz": self.frequency_hz, "readings": readings(&self.readings, read),
            "period": point.period, "largest_multiplier": point.largest_multiplier,
            "settling_periods": point.settling_periods, "drift": point.drift, "state": point.end,
        })
    }
}

impl SweepDocument {
    /// Adds to a panel the largest displacements of a degree of freedom over the frequency, by its number among those
    /// that are read: up as circles, down as squares.
    fn drawn(&self, panel: Panel, index: usize) -> Panel {
        let (color, shape) = match self.direction {
            Direction::Up => (Color::Blue, Marker::Circle),
            Direction::Down => (Color::Vermillion, Marker::Square),
        };
        let curve = |settled: Option<bool>| {
            let wanted =
                |response: &&Response| settled.is_none_or(|settled| response.point.period.is_some() == settled);
            let of = |response: &Response| (response.frequency_hz, response.readings[index].largest);
            self.responses.iter().filter(wanted).map(of).collect::<Vec<_>>()
        };
        let stepped = format!("stepped {}", self.direction.name());
        let style = Style::Line { color, width: 0.8, dash: Dash::Solid };
        let line = Series::line(stepped.clone(), color, curve(None)).unlabelled().style(style);
        let unsettled = Series::markers(format!("{stepped}, not settled"), color, Marker::Cross, curve(Some(false)));
        let settled = Series::markers(stepped, color, shape, curve(Some(true)));
        // Filled on the way up and open on the way down, so that both are seen where they coincide.
        panel.with(line).with_any(settled.marked(3.5, self.direction == Direction::Up)).with_any(unsettled)
    }
}

impl Document {
    /// Returns the sweeps of each structure.
    fn of_structures(&self) -> impl Iterator<Item = &[SweepDocument]> {
        // The sweeps of one structure follow each other, and `OverFlag` rejects equal values, so chunks are
        // structures.
        self.sweeps.chunk_by(|a, b| a.value == b.value)
    }

    /// Describes the sweeps in words.
    fn text(&self, label: &str, read: &[ReadAt], time_constants: f64) -> String {
        let mut text = String::new();
        for same in self.of_structures() {
            for sweep in same {
                let of: Vec<Option<u32>> = sweep.responses.iter().map(|response| response.point.period).collect();
                let value = sweep.at_value.as_ref().map_or(String::new(), |value| format!(", {value}"));
                let direction = sweep.direction.name();
                text += &format!("{label}{value}, stepped {direction}: {}", periods(&of, time_constants));
                for (index, at) in read.iter().enumerate() {
                    let sizes = sweep
                        .responses
                        .iter()
                        .map(|response| (response.readings[index].largest, response.frequency_hz));
                    if let Some((largest, hz)) = sizes.max_by(|a, b| a.0.total_cmp(&b.0)) {
                        text += &format!("  largest {}  {largest:.6e} {} at {hz:.6} Hz\n", at.name, at.unit());
                    }
                }
            }
            for Resonance { reading, frequency_hz, largest, width_hz } in same.iter().take(1).flat_map(|of| &of.missed)
            {
                let name = &read[*reading].name;
                let unit = read[*reading].unit();
                text += &format!(
                    "  stepped over: the resonance of {name} at {frequency_hz:.6} Hz, {largest:.6e} {unit} in the forced \
                     response, is {width_hz:.6} Hz wide, less than a step; use more --points, or leave --points out\n"
                );
            }
            if let [up, down] = same {
                let largest = |reading: &Reading| reading.largest;
                let response = |response: &Response| {
                    (response.frequency_hz, response.readings.iter().map(largest).collect::<Vec<_>>())
                };
                let rising: Vec<_> = up.responses.iter().map(response).collect();
                // Both directions must list the frequencies in the same order to be compared place by place.
                let falling: Vec<_> = down.responses.iter().rev().map(response).collect();
                let apart = hysteresis(&rising, &falling, DIFFERENT);
                for [first, last] in &apart {
                    text += &format!("  up and down differ from {first:.6} to {last:.6} Hz\n");
                }
                text += if apart.is_empty() { "  up and down agree\n" } else { "" };
            }
        }
        text
    }

    /// Returns a line for each response, with the units in the names of the columns.
    fn csv(&self, read: &[ReadAt]) -> String {
        let over = self.over.as_ref().map_or(String::new(), |name| format!("{},", name.replace('.', "_")));
        let mut text =
            format!("{over}direction,frequency_hz,period,largest_multiplier,settling_periods,drift{}\n", columns(read));
        for sweep in &self.sweeps {
            let value = sweep.value.map_or(String::new(), |value| format!("{value},"));
            for Response { frequency_hz, point, readings } in &sweep.responses {
                text += &format!(
                    "{value}{},{frequency_hz},{},{},{},{:e}{}\n",
                    sweep.direction.name(),
                    or_empty(point.period),
                    or_empty(point.largest_multiplier),
                    point.settling_periods,
                    point.drift,
                    cells(readings)
                );
            }
        }
        text
    }

    /// Draws the largest displacements over the frequency; of several structures a row each.
    fn figure(&self, conditions: Subtitle, read: &[ReadAt]) -> Figure {
        let mut figure = Figure::new("Stepped-sine response, settled at each frequency").subtitle(conditions);
        let drawn = |figure: Figure, same: &[SweepDocument]| {
            of_each(figure, "excitation frequency (Hz)", read, |panel, index| {
                same.iter().fold(panel, |panel, sweep| sweep.drawn(panel, index))
            })
        };
        if self.over.is_none() {
            return drawn(figure, &self.sweeps);
        }
        for same in self.of_structures() {
            let title = same.first().and_then(|sweep| sweep.at_value.clone()).unwrap_or_default();
            for (index, panel) in drawn(Figure::new(""), same).panels.into_iter().enumerate() {
                // One legend below all panels.
                let is_first = figure.panels.is_empty();
                let panel = if index == 0 { panel.title(title.clone()) } else { panel };
                figure = figure.with(panel.legend(if is_first { Legend::Bottom } else { Legend::None }));
            }
        }
        figure.columns = read.len().min(3);
        figure
    }
}
