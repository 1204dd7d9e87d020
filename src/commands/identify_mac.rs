//! Modal assurance criterion of the modes that `resonarm identify` found against other modes.

use std::path::Path;

use nalgebra::Complex;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::failure::Failure;
use resonarm::identification::KnownPole;
use resonarm::identify::Band;
use resonarm::modal::assurance;
use resonarm::plant::TestedAssembly;
use resonarm::structure::StructureMode;
use resonarm_figures::plot::{Axis, Color, Figure, Legend, Note, Panel, Series};
use resonarm_numeric::number::short;
use resonarm_scenario::text_file;

/// Value of --mac for the modes of the scenario's structure.
pub(super) const COMPUTED: &str = "computed";
/// Least number of degrees of freedom: the criterion of one is always 1.
const LEAST: usize = 2;
/// Ranges of the figure's colours.
const LEVELS: u8 = 5;
/// Lightest level of the colour scale; the number on a tile is legible on it and on the four darker ones.
const LIGHTEST: u8 = 9;
/// Most modes of either side for which tiles have numbers.
const MOST_NUMBERS: usize = 20;
/// Height of a note over its point, as a share of the figure's height: numbers are lowered to the middle of their tile.
const NOTE_RISE: f64 = 0.023;

/// Shapes of modes over the same degrees of freedom.
pub(super) struct Shapes {
    /// Where they are from, for messages.
    from: String,
    at: Vec<String>,
    modes: Vec<NamedShape>,
}

struct NamedShape {
    name: String,
    components: Vec<Option<Complex<f64>>>,
}

/// The keys that are read from a document.
#[derive(Deserialize)]
struct OtherDocument {
    at: Vec<String>,
    modes: Vec<OtherMode>,
}

#[derive(Deserialize)]
struct OtherMode {
    /// The mode of a measured response has no number.
    mode: Option<u8>,
    pole_frequency_hz: f64,
    complex_shape: Vec<Option<[f64; 2]>>,
}

/// Modal assurance criterion of each identified mode with each of the others.
#[derive(Serialize)]
pub(super) struct Assurance {
    /// Document of the other modes, or `computed`.
    with: String,
    /// Degrees of freedom that were compared.
    at: Vec<String>,
    /// Names of the identified modes.
    rows: Vec<String>,
    /// Names of the other modes.
    columns: Vec<String>,
    /// Row by row, 0 to 1; none of a shape that is 0 at all of them.
    values: Vec<Vec<Option<f64>>>,
}

/// Returns the number of a mode in the scenario, if it has one, and its frequency.
fn name_of(mode: Option<u8>, frequency_hz: f64) -> String {
    mode.map_or(format!("{frequency_hz:.2} Hz"), |number| format!("{number}: {frequency_hz:.2} Hz"))
}

/// Reads keys of a document of `identify`.
pub(super) fn read_document<T: DeserializeOwned>(file: &Path) -> Result<T, Failure> {
    let name = file.display();
    let text =
        text_file::read_numbers(file).map_err(|source| Failure::usage(format!("{name} can't be read: {source}")))?;
    serde_json::from_str(&text)
        .map_err(|source| Failure::usage(format!("{name} is not a document of `identify --json`: {source}")))
}

impl Shapes {
    /// Returns the shapes of identified modes, given the number of each, its frequency and its shape.
    pub fn new<'a>(
        from: String,
        at: &[String],
        modes: impl IntoIterator<Item = (Option<u8>, f64, &'a [Option<[f64; 2]>])>,
    ) -> Shapes {
        let named = |(mode, hz, shape): (Option<u8>, f64, &[Option<[f64; 2]>])| NamedShape {
            name: name_of(mode, hz),
            components: shape.iter().map(|component| component.map(|[re, im]| Complex::new(re, im))).collect(),
        };
        Shapes { from, at: at.to_vec(), modes: modes.into_iter().map(named).collect() }
    }

    /// Reads a document of `identify`.
    pub fn read(file: &Path) -> Result<Shapes, Failure> {
        let name = file.display();
        let document: OtherDocument = read_document(file)?;
        if let Some(mode) = document.modes.iter().find(|mode| mode.complex_shape.len() != document.at.len()) {
            let got = mode.complex_shape.len();
            let expected = document.at.len();
            return Err(Failure::usage(format!(
                "{name} is not a document of `identify --json`: a shape has {got} components, expected {expected}"
            )));
        }
        if document.modes.is_empty() {
            return Err(Failure::usage(format!("{name} has no modes to compare with")));
        }
        let modes =
            document.modes.iter().map(|mode| (mode.mode, mode.pole_frequency_hz, mode.complex_shape.as_slice()));
        Ok(Shapes::new(name.to_string(), &document.at, modes))
    }

    /// Returns the normal modes of a structure whose poles are in the band, at these degrees of freedom.
    pub fn computed(
        tested: &TestedAssembly,
        poles: &[KnownPole],
        band: Band,
        at: &[String],
    ) -> Result<Shapes, Failure> {
        let assembly = &tested.assembly;
        let direction = |name: &String| Some(assembly.direction_at_rest(assembly.dof(name).ok()?));
        let known: Vec<(&String, Vec<f64>)> = at.iter().filter_map(|name| Some((name, direction(name)?))).collect();
        let modes = assembly
            .modes()
            .iter()
            .zip(poles)
            .zip(1..)
            .filter(|((_, pole), _)| (band.from_hz..=band.to_hz).contains(&pole.frequency_hz));
        let named = |((mode, pole), number): ((&StructureMode, &KnownPole), u8)| {
            let along = |direction: &[f64]| direction.iter().zip(&mode.shape).map(|(d, part)| d * part).sum::<f64>();
            let component = |(_, direction): &(&String, Vec<f64>)| Some(Complex::new(along(direction), 0.0));
            NamedShape {
                name: name_of(Some(number), pole.frequency_hz),
                components: known.iter().map(component).collect(),
            }
        };
        let modes: Vec<NamedShape> = modes.map(named).collect();
        if modes.is_empty() {
            let from_hz = short(&band.from_hz);
            let to_hz = short(&band.to_hz);
            return Err(Failure::usage(format!(
                "--mac {COMPUTED}: the structure has no mode from {from_hz} to {to_hz} Hz: widen the band"
            )));
        }
        Ok(Shapes { from: String::from(COMPUTED), at: known.iter().map(|(name, _)| (*name).clone()).collect(), modes })
    }

    /// Says whether all modes have a component at a degree of freedom.
    fn has(&self, dof: &str) -> bool {
        let place = self.at.iter().position(|at| at == dof);
        place.is_some_and(|place| self.modes.iter().all(|mode| mode.components[place].is_some()))
    }

    /// Returns the components of a mode at these degrees of freedom.
    fn components(&self, mode: &NamedShape, at: &[String]) -> Vec<Complex<f64>> {
        let component = |dof: &String| mode.components[self.at.iter().position(|at| at == dof)?];
        at.iter().filter_map(component).collect()
    }
}

impl Assurance {
    /// Compares the shapes at the degrees of freedom that all of them have.
    pub fn new(found: &Shapes, other: &Shapes) -> Result<Assurance, Failure> {
        let at: Vec<String> = found.at.iter().filter(|dof| found.has(dof) && other.has(dof)).cloned().collect();
        if at.len() < LEAST {
            let common = if at.is_empty() { String::from("none") } else { at.join(", ") };
            return Err(Failure::usage(format!(
                "--mac: of the degrees of freedom of {} ({}) and {} ({}) all shapes have {common} in common: expected at \
                 least {LEAST}, since the criterion of one is always 1",
                found.from,
                found.at.join(", "),
                other.from,
                other.at.join(", ")
            )));
        }
        let names = |shapes: &Shapes| shapes.modes.iter().map(|mode| mode.name.clone()).collect();
        let row = |mode: &NamedShape| {
            let shape = found.components(mode, &at);
            let with = |mode| assurance(&shape, &other.components(mode, &at));
            other.modes.iter().map(|mode| Some(with(mode)).filter(|value| value.is_finite())).collect()
        };
        Ok(Assurance {
            with: other.from.clone(),
            rows: names(found),
            columns: names(other),
            values: found.modes.iter().map(row).collect(),
            at,
        })
    }

    /// Returns the name of the other modes for people.
    pub fn others(&self) -> String {
        if self.with == COMPUTED { String::from("computed modes") } else { format!("modes of {}", self.with) }
    }

    /// Returns the table as text, with a line for each mode.
    pub fn text(&self) -> String {
        let room = |names: &[String]| names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
        // A value has five characters, as 0.123.
        let first = room(&self.rows);
        let other = room(&self.columns).max(5);
        let columns: String = self.columns.iter().map(|name| format!("   {name:>other$}")).collect();
        let mut text = format!(
            "\n  modal assurance criterion with {}, over {}\n  {:first$}{columns}\n",
            self.others(),
            self.at.join(", "),
            ""
        );
        for (name, row) in self.rows.iter().zip(&self.values) {
            let cell = |value: &Option<f64>| value.map_or(String::from("–"), |value| format!("{value:.3}"));
            let values: String = row.iter().map(|value| format!("   {:>other$}", cell(value))).collect();
            text += &format!("  {name:>first$}{values}\n");
        }
        text
    }

    /// Draws a tile for each pair of modes.
    pub fn figure(&self) -> Figure {
        // The value 1 belongs to the highest range.
        let level = |value: f64| ((value * f64::from(LEVELS)) as u8).min(LEVELS - 1);
        let places = || {
            let row = |(row, y): (&Vec<Option<f64>>, u32)| {
                let of_row = row.iter().zip(1_u32..);
                let known = of_row.filter_map(move |(value, x)| Some((f64::from(x), f64::from(y), (*value)?)));
                known.collect::<Vec<_>>()
            };
            self.values.iter().zip(1_u32..).flat_map(row)
        };
        let mut panel = Panel::new(
            Axis::names(self.others(), self.columns.clone()),
            Axis::names("identified modes", self.rows.clone()),
        )
        .legend(Legend::Below);
        for of in 0..LEVELS {
            let points = places().filter(|(_, _, value)| level(*value) == of).map(|(x, y, _)| (x, y)).collect();
            let [from, to] = [of, of + 1].map(|end| f64::from(end) / f64::from(LEVELS));
            let color = Color::Level(LIGHTEST - of);
            panel = panel.with_any(Series::tiles(format!("{from} to {to}"), color, [1.0, 1.0], points));
        }
        if self.rows.len().max(self.columns.len()) <= MOST_NUMBERS {
            let drop = NOTE_RISE * self.rows.len() as f64;
            panel.notes =
                places().map(|(x, y, value)| Note { at: (x, y - drop), text: format!("{value:.2}") }).collect();
        }
        Figure::new("Modal assurance criterion").subtitle(format!("over {}", self.at.join(", "))).with(panel)
    }
}
