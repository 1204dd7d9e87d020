//! `resonarm modes` of a structure.

use serde::Serialize;
use serde_json::Value;

use super::label;
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::output::JsonFlag;
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::StructureMode;

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: Value,
    modes: Vec<Mode>,
}

/// A mode; its shape in the coordinates, of unit modal mass.
#[derive(Serialize)]
struct Mode {
    frequency_hz: f64,
    damping_ratio: f64,
    shape: Vec<f64>,
}

impl From<&StructureMode> for Mode {
    fn from(mode: &StructureMode) -> Mode {
        let StructureMode { frequency_hz, damping_ratio, shape } = mode.clone();
        Mode { frequency_hz, damping_ratio, shape }
    }
}

/// Prints the natural modes of a structure at rest, with the slopes of its smooth elements.
pub(crate) fn show(scenario: &Scenario, tested: &TestedAssembly, json: JsonFlag) -> Result<Verdict, Failure> {
    let document = Document {
        configuration: configuration::of_arm(scenario)?,
        coordinates: configuration::coordinates(&tested.assembly),
        modes: tested.assembly.modes().iter().map(Mode::from).collect(),
    };
    let text = || {
        let mut text = format!("{}\n  mode   undamped frequency   damping ratio\n", label(scenario, tested));
        for (mode, number) in document.modes.iter().zip(1..) {
            text += &format!("  {number:4}   {:15.4} Hz   {:13.3e}\n", mode.frequency_hz, mode.damping_ratio);
        }
        text
    };
    json.show(&document, text, &[])
}
