//! Flags that `sweep`, `poincare` and `basins` share.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};

use crate::configuration;
use crate::drive::{Drive, DriveFlags};
use crate::failure::Failure;
use crate::flags::StructureFlags;
use crate::help::heading;
use crate::output::{self, Inputs, PlotFlags};
use resonarm::analysis::time_domain::{Direction, SettleOptions};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm_figures::plot::{Figure, beside};

/// The structure, its excitation and initial state, how long to wait, and where the results go.
#[derive(Clone, Debug, Args)]
#[command(mut_args(output::explained(output::PLOT, "A command that was stopped resumes from STEM.partial.jsonl.")))]
pub(crate) struct SettlingFlags {
    #[command(flatten)]
    pub structure: StructureFlags,
    #[command(flatten)]
    pub drive: DriveFlags,
    /// Initial state: coordinates, rates [default: that of the scenario, at rest].
    ///
    /// The first response begins there. The coordinates of a chain are the deflections of its joints, rad.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "Q,V", value_delimiter = ',', num_args = 1)]
    initial: Option<Vec<f64>>,
    /// Longest settling time, in time constants of the slowest mode.
    #[arg(long, help_heading = heading::COMPUTATION, value_name = "N", default_value_t = SettleOptions::default().time_constants)]
    pub time_constants: f64,
    #[command(flatten)]
    output: PlotFlags,
}

/// The directions in which a quantity is stepped, in order, with the names by which the user chooses them.
pub(crate) const DIRECTIONS: [(&[Direction], &str, &str); 3] = [
    (&[Direction::Up], "up", "From the lowest value"),
    (&[Direction::Down], "down", "From the highest value"),
    (&[Direction::Up, Direction::Down], "both", "Both, each from the initial state"),
];

impl SettlingFlags {
    /// Returns the initial state: coordinates and rates of --initial or the scenario, and elements at rest.
    pub fn initial(&self, tested: &TestedAssembly) -> Result<Vec<f64>, Failure> {
        let initial = configuration::initial(self.initial.as_deref(), tested)?;
        Ok([initial, vec![0.0; tested.assembly.element_states()]].concat())
    }

    /// Returns the journal from which a stopped command resumes, if results are written to files. Fails if one of the
    /// files to be written exists and may not be overwritten, or if there is no folder for them.
    pub fn journal(&self) -> Result<Option<PathBuf>, Failure> {
        let Some(stem) = &self.output.plot else { return Ok(None) };
        let inputs = Inputs::of_scenario(self.structure.scenario.as_deref());
        self.output.check(output::PLOTTED, &inputs)?;
        // A journal that exists is resumed, whatever may be overwritten; but it must not be a file that is read.
        inputs.check(&beside(stem, ".partial.jsonl"))?;
        output::check_folder(stem)?;
        Ok(Some(beside(stem, ".partial.jsonl")))
    }

    /// Prints a document, then writes its table, itself and its figure to the files of `--plot`, if it is given.
    pub fn show(
        &self,
        document: &impl Serialize,
        text: impl FnOnce() -> String,
        csv: impl FnOnce() -> String,
        figure: impl FnOnce() -> Result<Figure, Failure>,
    ) -> Result<(), Failure> {
        // Printed first: a full disk must not take the results of a long computation as well.
        self.output.json.show(document, text, &[])?;
        let Some(stem) = &self.output.plot else { return Ok(()) };
        let csv = output::write(beside(stem, ".csv"), &csv())?;
        let json = output::write_json(beside(stem, ".json"), document)?;
        let drawn = output::draw(figure()?, stem)?;
        self.output.json.list(&[&[csv, json][..], &drawn].concat())
    }

    /// Returns everything in these flags that results depend on.
    pub fn configuration(&self, scenario: &Scenario, tested: &TestedAssembly, drive: &Drive, start: &[f64]) -> Value {
        let mut configuration = configuration::of_structure(scenario, tested);
        drive.describe(&mut configuration);
        configuration["initial"] = json!(start);
        configuration["time_constants"] = json!(self.time_constants);
        configuration
    }
}

/// Says how many responses there are with these periods, and how many of them have another period than the excitation.
pub(crate) fn periods(periods: &[Option<u32>], time_constants: f64) -> String {
    let longer = periods.iter().flatten().filter(|period| **period > 1).count();
    let unsettled = periods.iter().filter(|period| period.is_none()).count();
    let mut text = format!("{} responses", periods.len());
    if longer > 0 {
        text += &format!(", {longer} of them of a longer period than the excitation");
    }
    if unsettled > 0 {
        text += &format!(", {unsettled} not settled within {time_constants} time constants");
    }
    text.push('\n');
    text
}
