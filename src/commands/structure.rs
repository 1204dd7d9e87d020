//! `resonarm structure`: checks a scenario's structure, lists its parts and writes it as a section of a scenario.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::identify_mac::read_document;
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::figures::captions::label;
use crate::flags::read_scenario;
use crate::help::heading;
use crate::output::{self, Inputs, JsonFlag, OverwriteFlag};
use resonarm::plant::TestedAssembly;
use resonarm::rig::PlaceName;
use resonarm::scenario::structure::{ModeSection, NotModal};
use resonarm::scenario::{Scenario, StructureKind, StructureSection};
use resonarm::structure::{BodySpec, Link};
use resonarm_numeric::number::short;

/// Checks a scenario's structure, and prints its parts and natural frequencies.
///
/// The parts are links or modes, points and elements.
///
/// What the scenario takes from files (URDF, UFF, matrices) is shown as the links or modes that it makes. With --out it
/// is written as a section [structure] that needs no file. With --from-modes it is the modal structure of the modes
/// that a scenario's chain has about its rest, and with --from-identified of those that `resonarm identify` found.
#[derive(Debug, Args)]
pub(crate) struct Structure {
    /// TOML file with the scenario.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// TOML file with a scenario, to take the modes of its chain as a modal structure.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "FILE", conflicts_with = "scenario")]
    from_modes: Option<PathBuf>,
    /// Document of `identify --json`, to take its modes as a modal structure.
    ///
    /// Points are those of the accelerometers; the document may have positions of them, and lines. There must be one where the force acts: otherwise shapes have no scale. Modes
    /// without deviations are taken with a warning that states the reasons.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "FILE", conflicts_with_all = ["scenario", "from_modes"])]
    from_identified: Option<PathBuf>,
    /// Write the section [structure], with the links or modes from files in it, to this TOML file.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
}

/// Document that `structure --json` prints.
#[derive(Serialize)]
struct Document {
    /// Section `[structure]` of the scenario.
    configuration: Value,
    /// Name and unit of each coordinate.
    coordinates: Value,
    /// The names of the points.
    points: Vec<String>,
    /// The degrees of freedom for loads and readings: a point and an axis, or a joint.
    degrees_of_freedom: Vec<String>,
    natural_frequencies_hz: Vec<f64>,
    damping_ratios: Vec<f64>,
}

impl Structure {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let read = self.from_modes.as_deref().or(self.scenario.as_deref());
        let inputs = Inputs::of_scenario(read).and(self.from_identified.as_deref());
        self.overwrite.check(self.out.clone(), &inputs)?;
        let scenario = self.scenario()?;
        let tested = scenario.under_test()?;
        let document = Document::new(&scenario, &tested);
        let written = self.out.clone().map(|path| output::write(path, &toml_of(&scenario.structure)?)).transpose()?;
        self.json.show(&document, || document.text(&scenario, &tested), written.as_slice())
    }

    /// Reads the scenario, or makes that of the modes of one, or of identified ones.
    fn scenario(&self) -> Result<Scenario, Failure> {
        match (&self.scenario, &self.from_modes, &self.from_identified) {
            (Some(path), ..) => read_scenario(path),
            (_, Some(path), _) => of_modes(path),
            (.., Some(path)) => of_identified(path),
            (None, None, None) => Err(Failure::usage(
                "the structure is missing: give --scenario FILE, --from-modes FILE or --from-identified FILE",
            )),
        }
    }
}

/// Reads a scenario and replaces its structure by the modes of it.
fn of_modes(path: &Path) -> Result<Scenario, Failure> {
    let scenario = read_scenario(path)?;
    let assembly = scenario.under_test()?.assembly;
    let refused = |error: NotModal| Failure::usage(format!("{}: {error}", path.display()));
    let structure = StructureSection::from_modes(&assembly, None).map_err(refused)?;
    Ok(Scenario { structure, ..scenario })
}

/// The keys that are read from a document of `identify`.
#[derive(Deserialize)]
struct Identified {
    at: Vec<String>,
    modes: Vec<IdentifiedMode>,
    /// Positions of points, m, and lines through them; not all documents have them.
    #[serde(default)]
    positions_m: BTreeMap<String, [f64; 3]>,
    #[serde(default)]
    lines: Vec<Vec<String>>,
}

#[derive(Deserialize)]
struct IdentifiedMode {
    pole_frequency_hz: f64,
    pole_damping_ratio: f64,
    /// None of a mode whose modal mass is unknown.
    shape_per_sqrt_kg: Option<Vec<Option<f64>>>,
    doubts: Vec<Doubt>,
}

/// A reason for which a mode has no deviations.
#[derive(Deserialize)]
struct Doubt {
    text: String,
}

/// Returns a scenario with the modal structure of the modes in a document. |λ|/2π of a pole λ is the undamped natural frequency
/// of a mode that no damping couples to the others.
fn of_identified(path: &Path) -> Result<Scenario, Failure> {
    let Identified { at, modes: found, positions_m: points, lines } = read_document(path)?;
    let mut modes = Vec::new();
    for (mode, number) in found.iter().zip(1..) {
        let name = format!("{}: mode {number}, at {:.2} Hz", path.display(), mode.pole_frequency_hz);
        let Some(shape) = &mode.shape_per_sqrt_kg else {
            return Err(Failure::usage(format!(
                "{name}, has no modal mass (shape_per_sqrt_kg): place an accelerometer where the force acts"
            )));
        };
        if shape.len() != at.len() {
            let got = shape.len();
            let expected = at.len();
            return Err(Failure::usage(format!(
                "{name}, has {got} components, expected {expected}, one for each of `at`"
            )));
        }
        for doubt in &mode.doubts {
            tracing::warn!("{name}, has no deviations: {}", doubt.text);
        }
        modes.push(ModeSection {
            frequency_hz: mode.pole_frequency_hz,
            damping_ratio: mode.pole_damping_ratio,
            shape: at.iter().zip(shape).filter_map(|(name, part)| Some((name.clone(), (*part)?))).collect(),
            participation: BTreeMap::new(),
        });
    }
    if modes.is_empty() {
        return Err(Failure::usage(format!("{} has no modes to make a structure of", path.display())));
    }
    let structure =
        StructureSection { kind: StructureKind::Modal, modes, points, lines, ..StructureSection::default() };
    let mut scenario = Scenario { structure, ..Scenario::default() };
    // Nodes of a file have no point that is usual for the exciter.
    scenario.rig.exciter.at = at.first().and_then(|name| PlaceName::new(name));
    Ok(scenario)
}

/// Writes the section alone, without the paths of files that it notes: they would count from another folder.
fn toml_of(section: &StructureSection) -> Result<String, Failure> {
    toml::to_string(&BTreeMap::from([("structure", section.without_source())]))
        .map_err(|error| Failure::usage(format!("the structure can't be written as TOML: {error}")))
}

impl Document {
    fn new(scenario: &Scenario, tested: &TestedAssembly) -> Document {
        let modes = tested.assembly.modes();
        Document {
            configuration: configuration::of_structure(scenario, tested),
            coordinates: configuration::coordinates(&tested.assembly),
            points: tested.assembly.points(),
            degrees_of_freedom: tested.assembly.dof_names(),
            natural_frequencies_hz: modes.iter().map(|mode| mode.frequency_hz).collect(),
            damping_ratios: modes.iter().map(|mode| mode.damping_ratio).collect(),
        }
    }

    fn text(&self, scenario: &Scenario, tested: &TestedAssembly) -> String {
        let mut text = label(scenario, tested) + "\n";
        if let BodySpec::Chain(chain) = &tested.assembly.spec().body {
            text += &links(&chain.links);
        }
        text += &format!("points: {}\n", self.points.join(", "));
        text += &elements(scenario);
        text += "  mode   undamped frequency   damping ratio\n";
        for ((frequency_hz, ratio), number) in self.natural_frequencies_hz.iter().zip(&self.damping_ratios).zip(1..) {
            text += &format!("  {number:4}   {frequency_hz:15.4} Hz   {ratio:13.3e}\n");
        }
        text
    }
}

fn links(links: &[Link]) -> String {
    // Centres of mass beside the line of the link are rare; the column appears only where there is one.
    let is_straight = links.iter().all(|link| link.centre_of_mass_off_m == 0.0);
    let off = |text: String| if is_straight { String::new() } else { text };
    let mut text = format!(
        "  link   length m     mass kg   centre m{}   inertia kg·m²    angle °   stiffness N·m/rad   damping N·m·s/rad\n",
        off(String::from("      off m"))
    );
    for (link, number) in links.iter().zip(1..) {
        text += &format!(
            "  {number:4} {:10.5} {:11.5} {:10.5}{} {:15.6} {:10.4} {:19} {:19}\n",
            link.length_m,
            link.mass_kg,
            link.centre_of_mass_m,
            off(format!(" {:10.5}", link.centre_of_mass_off_m)),
            link.inertia_kg_m2,
            link.angle_deg,
            short(&link.stiffness_nm_rad),
            short(&link.damping_nm_s_rad)
        );
    }
    text
}

/// Returns a line for each element, with the values as the scenario states them.
fn elements(scenario: &Scenario) -> String {
    let elements = scenario.structure.elements.iter();
    let line = |(element, number): (&resonarm::scenario::structure::ElementSection, usize)| {
        let values = element.values.iter().map(|(key, value)| format!(", {key} = {}", short(value)));
        // Only polynomials have terms; too many for a line.
        let terms = match element.terms.len() {
            0 => String::new(),
            1 => String::from(", 1 term"),
            count => format!(", {count} terms"),
        };
        format!("element {number}: {} {}{}{terms}\n", element.kind, element.place(), values.collect::<String>())
    };
    elements.zip(1..).map(line).collect()
}
