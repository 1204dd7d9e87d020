//! `resonarm modes` of a structure.

use serde::Serialize;
use serde_json::Value;

use super::label;
use crate::commands::modes::pole_text;
use crate::configuration;
use crate::failure::{Failure, Verdict};
use crate::output::JsonFlag;
use resonarm::analysis::{Pole, structure_poles};
use resonarm::plant::TestedAssembly;
use resonarm::scenario::Scenario;
use resonarm::structure::StructureMode;

#[derive(Serialize)]
struct Document {
    configuration: Value,
    coordinates: Value,
    modes: Vec<Mode>,
}

/// A mode of the undamped structure, its shape in the coordinates, of unit modal mass; and the pole of the damped one, if that
/// oscillates.
#[derive(Serialize)]
struct Mode {
    frequency_hz: f64,
    damping_ratio: f64,
    shape: Vec<f64>,
    pole_frequency_hz: Option<f64>,
    pole_damping_ratio: Option<f64>,
}

impl Mode {
    fn new(mode: &StructureMode, pole: Option<Pole>) -> Mode {
        let StructureMode { frequency_hz, damping_ratio, shape } = mode.clone();
        let pole_frequency_hz = pole.map(|pole| pole.pole_frequency_hz);
        let pole_damping_ratio = pole.map(|pole| pole.pole_damping_ratio + 0.0);
        Mode { frequency_hz, damping_ratio, shape, pole_frequency_hz, pole_damping_ratio }
    }
}

/// Prints the natural modes of a structure at rest, with the slopes of its smooth elements.
pub(crate) fn show(scenario: &Scenario, tested: &TestedAssembly, json: JsonFlag) -> Result<Verdict, Failure> {
    let poles = structure_poles(&tested.assembly);
    let document = Document {
        configuration: configuration::of_arm(scenario)?,
        coordinates: configuration::coordinates(&tested.assembly),
        modes: tested.assembly.modes().iter().zip(poles).map(|(mode, pole)| Mode::new(mode, pole)).collect(),
    };
    let text = || {
        let mut text = format!(
            "{}\n  mode   undamped frequency   damping ratio   pole frequency |λ|/2π   −Re λ/|λ|\n",
            label(scenario, tested)
        );
        for (mode, number) in document.modes.iter().zip(1..) {
            let pole = match mode.frequency_hz == 0.0 {
                true => String::from("rigid"),
                false => pole_text(mode.pole_frequency_hz, mode.pole_damping_ratio),
            };
            text += &format!("  {number:4}   {:15.4} Hz   {:13.3e}   {pole}\n", mode.frequency_hz, mode.damping_ratio);
        }
        text
    };
    json.show(&document, text, &[])
}
