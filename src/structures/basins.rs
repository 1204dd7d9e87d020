//! `resonarm basins` of a structure.

use serde::Serialize;
use serde_json::{Value, json};

use super::{amplitude, displacement_unit, label, load_unit, readings};
use crate::basin_cells::Cells;
use crate::basin_grid::{GridFlags, pair};
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::motion_flags::MotionFlags;
use crate::study;
use resonarm::analysis::structure::Forced;
use resonarm::analysis::structure::time_domain::{StableMotion, reach, stable_motions};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::{Assembly, Dof};
use resonarm::study::{StateGrid, StructureBasins};
use resonarm_figures::plot::Figure;
use resonarm_numeric::number::short;

/// A grid in two coordinates, by their numbers.
type Grid = StateGrid<usize, Vec<f64>>;

/// What is asked for.
pub(crate) struct Asked<'a> {
    /// Initial state, wait and output.
    pub motion: &'a MotionFlags,
    /// The degree of freedom that is driven, with its name.
    pub drive: (Dof, &'a str),
    /// The peak of the load, N, or N·m at a joint.
    pub amplitude: f64,
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// The names of the two coordinates that vary; empty are the first and its rate.
    pub coordinates: &'a [String],
    /// The grid of the initial states.
    pub grid: &'a GridFlags,
}

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: Value,
    /// The two that vary, by their names.
    over: [String; 2],
    motions: Vec<Value>,
    #[serde(flatten)]
    cells: Cells,
}

/// Computes the basins, and prints or writes them.
pub(crate) fn show(scenario: &Scenario, tested: &TestedAssembly, asked: &Asked<'_>) -> Result<Verdict, Failure> {
    let assembly = &tested.assembly;
    let forced = Forced::new(assembly.clone(), asked.drive.0, asked.amplitude);
    let others = asked.motion.initial_of_structure(tested)?;
    let (over, names) = asked.over(assembly)?;
    let (motions, early) = stable_motions(&forced, &[asked.drive.0], asked.frequency_hz, &|| false)?;
    if let Some(early) = early {
        tracing::warn!("stable motions beyond are not known: {}", early.reason);
    }
    if motions.is_empty() {
        let hz = short(&asked.frequency_hz);
        tracing::error!("no stable motion is known at {hz} Hz: no state can be said to reach one");
        return Ok(Verdict::Negative);
    }
    let far = over.map(|index| reach(&motions, index, asked.frequency_hz));
    let grid = asked.grid.grid(over, [&names[0], &names[1]], far, others.clone())?;
    let configuration = asked.configuration(scenario, &others, &grid, &names)?;
    let journal = asked.motion.journal()?;
    let basins = StructureBasins {
        forced,
        frequency_hz: asked.frequency_hz,
        motions: motions.clone(),
        grid: grid.clone(),
        time_constants: asked.motion.time_constants,
    };
    let walked = study::basins(basins, journal, &configuration)?;
    let Some((walk, outcomes)) = walked else { return Ok(Verdict::Negative) };
    let cells = Cells::new(&grid, &outcomes);
    let motion = |(k, motion): (usize, &StableMotion)| asked.motion_document(motion, cells.reaching(k));
    let documents = motions.iter().enumerate().map(motion).collect();
    let coordinates = configuration::coordinates(assembly);
    let document = Document { configuration, coordinates, over: names, motions: documents, cells };
    let text = || asked.text(&document, &motions);
    let figure = || Ok(asked.figure(&document, &grid, &motions, tested, &label(scenario, tested)));
    let csv = || document.cells.csv([&document.over[0], &document.over[1]]);
    asked.motion.show(&document, text, csv, figure)?;
    walk.finish()?;
    Ok(Verdict::Positive)
}

impl Asked<'_> {
    /// The numbers and names of the coordinates that vary.
    fn over(&self, assembly: &Assembly) -> Result<([usize; 2], [String; 2]), Failure> {
        let known = configuration::state_names(assembly);
        let over = if self.coordinates.is_empty() {
            [0, assembly.coordinates()]
        } else {
            let number = |name: &String| {
                let refusal = || {
                    let known = known.join(", ");
                    Failure::usage(format!(
                        "--coordinates: there is no coordinate `{name}`: the coordinates are {known}"
                    ))
                };
                known.iter().position(|known| known == name).ok_or_else(refusal)
            };
            pair("--coordinates", &self.coordinates.iter().map(number).collect::<Result<Vec<_>, _>>()?)?
        };
        Ok((over, over.map(|index| known[index].to_owned())))
    }

    fn configuration(
        &self,
        scenario: &Scenario,
        others: &[f64],
        grid: &Grid,
        names: &[String; 2],
    ) -> Result<Value, Failure> {
        let mut configuration = configuration::of_arm(scenario)?;
        configuration["initial"] = json!(others);
        configuration["time_constants"] = json!(self.motion.time_constants);
        configuration["drive"] = json!(self.drive.1);
        configuration["amplitude"] = json!(self.amplitude);
        configuration["basins"] = json!({
            "frequency_hz": self.frequency_hz,
            "coordinates": names,
            "from": grid.ends.map(|ends| ends[0]),
            "to": grid.ends.map(|ends| ends[1]),
            "points": grid.counts,
        });
        Ok(configuration)
    }

    fn motion_document(&self, motion: &StableMotion, reached_by: usize) -> Value {
        json!({
            "period": motion.period,
            "largest_multiplier": motion.largest_multiplier,
            "largest": motion.coordinates.iter().map(|of| of.largest).collect::<Vec<_>>(),
            "amplitude": motion.coordinates.iter().map(|of| amplitude(&of.harmonic1)).collect::<Vec<_>>(),
            "readings": readings(&motion.readings, &vec![self.drive]),
            "section": motion.section,
            "reached_by": reached_by,
        })
    }

    /// The motions, and how many states reach each.
    fn text(&self, document: &Document, motions: &[StableMotion]) -> String {
        let (mut text, all) = (String::new(), document.cells.len());
        let (dof, name) = self.drive;
        for (k, motion) in motions.iter().enumerate() {
            let period = if motion.period == 1 { String::new() } else { format!(", {} periods", motion.period) };
            text += &format!(
                "motion {}: largest {name} {:.6e} {}{period}; reached by {} of {all} states\n",
                k + 1,
                motion.readings[0].largest,
                displacement_unit(dof),
                document.cells.reaching(k)
            );
        }
        text + &document.cells.others(self.motion.time_constants)
    }

    fn figure(
        &self,
        document: &Document,
        grid: &Grid,
        motions: &[StableMotion],
        tested: &TestedAssembly,
        label: &str,
    ) -> Figure {
        let assembly = &tested.assembly;
        let (dof, name) = self.drive;
        let labelled = |(k, motion): (usize, &StableMotion)| {
            let (largest, unit) = (motion.readings[0].largest, displacement_unit(dof));
            format!("reaches motion {}: {name} to {largest:.2e} {unit}", k + 1)
        };
        let labels = motions.iter().enumerate().map(labelled).collect();
        let [x, y] = grid.coordinates;
        let sections = motions.iter().flat_map(|motion| &motion.section).map(|state| (state[x], state[y])).collect();
        let load = format!("{} {} at {name}, {} Hz", self.amplitude, load_unit(dof), self.frequency_hz);
        let [x_label, y_label] = grid.coordinates.map(|index| configuration::state_label(assembly, index));
        document
            .cells
            .figure([&x_label, &y_label], grid.spacing(), labels, sections)
            .subtitle(format!("{label}, {load}"))
    }
}
