//! The inputs that results depend on, for documents and journals.

use serde_json::{Value, json};

use crate::failure::Failure;
use resonarm::plant::TestedAssembly;
use resonarm::rig::Load;
use resonarm::scenario::{Scenario, ScenarioError, StructureKind};
use resonarm::structure::{
    Assembly, BodySpec, Channel, ChannelName, CoordinateUnit, Coordinates, LOADS, coordinate_channels,
};

/// Describes the structure under test, with everything that its equations depend on.
pub(crate) fn of_structure(scenario: &Scenario, tested: &TestedAssembly) -> Value {
    let mut structure = json!(scenario.structure);
    if let (StructureKind::Preset, BodySpec::Chain(chain)) = (scenario.structure.kind, &tested.assembly.spec().body) {
        // The links are stated in full, since a later version may know other presets. Readers make a chain from
        // `links`, so the kind `preset` is left out.
        structure["angles_deg"] = chain.links.iter().map(|link| json!(link.angle_deg)).collect();
        structure["links"] = json!(chain.links);
        if chain.gravity_m_s2 != 0.0 {
            structure["gravity_m_s2"] = json!(chain.gravity_m_s2);
        }
        structure.as_object_mut().map(|keys| keys.remove("kind"));
    }
    let mut configuration = json!({ "structure": structure });
    // The angles are those of relaxed springs; at rest the joints are deflected by this much.
    if let Some(sag_rad) = tested.assembly.sag_rad() {
        configuration["static_deflection_rad"] = json!(sag_rad);
    }
    configuration
}

/// Describes the structure of a scenario; `None` of one whose equations are not known, an FMU or a program's own.
pub(crate) fn computable(scenario: &Scenario) -> Result<Option<TestedAssembly>, ScenarioError> {
    if scenario.foreign_structure().is_some() { Ok(None) } else { scenario.under_test().map(Some) }
}

/// Describes the structure of a scenario and the peak loads of its control or excitation.
pub(crate) fn of_scenario(scenario: &Scenario) -> Result<Value, Failure> {
    let tested = computable(scenario)?;
    let mut configuration = match &tested {
        Some(tested) => of_structure(scenario, tested),
        None => json!({ "structure": scenario.structure }),
    };
    if let Some(amplitude) = scenario.amplitude() {
        configuration["drive"] = commanded(amplitude, tested.as_ref());
    }
    Ok(configuration)
}

/// Describes the loads that a scenario commands, in the form of [`Drive::document`](crate::drive::Drive::document), by
/// the degrees of freedom that they act on. A load has its key in the scenario in place of the degree of freedom if it
/// acts at no point of the structure, or if the equations of the structure are not known.
fn commanded(amplitude: &Load, tested: Option<&TestedAssembly>) -> Value {
    let dofs = tested.map(TestedAssembly::loaded);
    let parts = amplitude.parts().into_iter().enumerate().filter(|(_, part)| *part != 0.0);
    let named = |(place, part): (usize, f64)| {
        let name = match tested.zip(dofs.and_then(|dofs| dofs[place])) {
            Some((tested, dof)) => tested.dof_name(dof),
            None => String::from(Load::NAMES[place]),
        };
        (name, json!({ "amplitude": part, "unit": LOADS[place].quantity.unit() }))
    };
    parts.map(named).collect()
}

/// Returns the name and unit of each coordinate of a structure.
pub(crate) fn coordinates(assembly: &Assembly) -> Value {
    let coordinate = |channel: &Channel| json!({ "name": channel.name, "unit": channel.quantity.unit() });
    channels(assembly).iter().take(assembly.coordinates()).map(coordinate).collect()
}

/// Returns the names of the coordinates of a structure, then those of their rates.
pub(crate) fn state_names(assembly: &Assembly) -> Vec<ChannelName> {
    channels(assembly).iter().map(|channel| channel.name).collect()
}

/// Returns the initial state of `--initial`, or that of the scenario, with elements at rest.
pub(crate) fn initial(given: Option<&[f64]>, tested: &TestedAssembly) -> Result<Vec<f64>, Failure> {
    let initial = given.unwrap_or(&tested.initial);
    let needed = 2 * tested.assembly.coordinates();
    if initial.len() != needed {
        let known = state_names(&tested.assembly).join(", ");
        return Err(Failure::usage(format!("--initial has {} numbers, expected {needed}: {known}", initial.len())));
    }
    Ok(initial.to_vec())
}

/// Returns the label in figures of a coordinate by its number from 0, or past the coordinates of a rate, with its unit.
pub(crate) fn state_label(assembly: &Assembly, index: usize) -> String {
    let n = assembly.coordinates();
    let symbol = if assembly.coordinate_unit() == CoordinateUnit::Radian { "α" } else { "q" };
    let subscript = |digit: char| digit.to_digit(10).and_then(|digit| char::from_u32(u32::from('₀') + digit));
    let number: String = (index % n + 1).to_string().chars().filter_map(subscript).collect();
    let unit = channels(assembly)[index].quantity.unit();
    if index < n { format!("{symbol}{number} ({unit})") } else { format!("d{symbol}{number}/dt ({unit})") }
}

/// Returns the channels of the coordinates and their rates.
fn channels(assembly: &Assembly) -> Vec<Channel> {
    let of = match assembly.coordinate_unit() {
        CoordinateUnit::Radian => Coordinates::Joints,
        CoordinateUnit::MetreRootKilogram => Coordinates::Modes,
    };
    coordinate_channels(of, assembly.coordinates())
}
