//! The inputs that results depend on, for documents and journals.

use serde_json::{Value, json};

use crate::failure::Failure;
use resonarm::arm::Load;
use resonarm::excitation::Amplitude;
use resonarm::plant::TestedAssembly;
use resonarm::scenario::{Scenario, ScenarioError, StructureKind};
use resonarm::structure::{Assembly, BodySpec, Channel, CoordinateUnit, Coordinates, Dof, coordinate_channels};

/// The structure under test, with everything that its equations depend on.
pub(crate) fn of_structure(scenario: &Scenario, tested: &TestedAssembly) -> Value {
    let mut structure = json!(scenario.structure);
    if let (StructureKind::Preset, BodySpec::Chain(chain)) = (scenario.structure.kind, &tested.assembly.spec().body) {
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

/// The structure of a scenario; `None` of one whose equations are not known, an FMU or a program's own.
pub(crate) fn computable(scenario: &Scenario) -> Result<Option<TestedAssembly>, ScenarioError> {
    if scenario.foreign_structure().is_some() { Ok(None) } else { scenario.under_test().map(Some) }
}

/// The structure of a scenario and the peak load of its control or excitation by what it drives: N, N·m at a joint. Of a
/// structure whose equations are not known, forces act at `exciter_x` and `exciter_y`.
pub(crate) fn of_scenario(scenario: &Scenario) -> Result<Value, Failure> {
    let tested = computable(scenario)?;
    let mut configuration = match &tested {
        Some(tested) => of_structure(scenario, tested),
        None => json!({ "structure": scenario.structure }),
    };
    if let Some(amplitude) = scenario.amplitude() {
        configuration["drive"] = match &tested {
            Some(tested) => {
                let named = |(dof, load): (Dof, f64)| (tested.dof_name(dof), json!(load));
                tested.drives(amplitude).into_iter().map(named).collect()
            }
            None => {
                let Amplitude { torque1_nm, torque2_nm, force_x_n, force_y_n } = *amplitude;
                let loads = [torque1_nm, torque2_nm, force_x_n, force_y_n];
                let named = ["joint1", "joint2", "exciter_x", "exciter_y"].map(String::from).into_iter().zip(loads);
                named.filter(|(_, load)| *load != 0.0).map(|(name, load)| (name, json!(load))).collect()
            }
        };
    }
    Ok(configuration)
}

/// The arm with all its parameters, and its pose, or the structure in its place: results of every command depend on
/// them.
pub(crate) fn of_arm(scenario: &Scenario) -> Result<Value, Failure> {
    if scenario.is_fmu() {
        return Ok(json!({ "structure": scenario.structure }));
    }
    if let Some(tested) = scenario.tested_structure()? {
        return Ok(of_section(scenario, &tested));
    }
    let arm = scenario.build_arm()?;
    let mut configuration = json!({
        "preset": scenario.structure.preset,
        "parameters": arm.parameters(),
        "beta1_deg": arm.pose().beta1_deg,
        "beta2_deg": arm.pose().beta2_deg,
    });
    // β is the pose of the relaxed springs; at α = 0 the joints are deflected by this much.
    if arm.parameters().gravity.is_some() {
        configuration["static_deflection_rad"] = json!(<[f64; 2]>::from(arm.static_deflection_rad()));
    }
    if let Some(name) = &scenario.structure.name {
        configuration["name"] = json!(name);
    }
    Ok(configuration)
}

/// The section `[structure]` as it is stated, with name and unit of each coordinate.
pub(crate) fn of_section(scenario: &Scenario, tested: &TestedAssembly) -> Value {
    json!({ "structure": scenario.structure, "coordinates": coordinates(&tested.assembly) })
}

/// Name and unit of each coordinate of a structure.
pub(crate) fn coordinates(assembly: &Assembly) -> Value {
    let coordinate = |channel: &Channel| json!({ "name": channel.name, "unit": channel.quantity.unit() });
    channels(assembly).iter().take(assembly.coordinates()).map(coordinate).collect()
}

/// The names of the coordinates of a structure, then those of their rates.
pub(crate) fn state_names(assembly: &Assembly) -> Vec<&'static str> {
    channels(assembly).iter().map(|channel| channel.name).collect()
}

/// The initial state of `--initial`, or that of the scenario, of elements at rest.
pub(crate) fn initial(given: Option<&[f64]>, tested: &TestedAssembly) -> Result<Vec<f64>, Failure> {
    let (initial, needed) = (given.unwrap_or(&tested.initial), 2 * tested.assembly.coordinates());
    if initial.len() != needed {
        let known = state_names(&tested.assembly).join(", ");
        return Err(Failure::usage(format!("--initial has {} numbers: give {needed}, {known}", initial.len())));
    }
    Ok(initial.to_vec())
}

/// A coordinate by its number, from 0, or past them its rate, with its unit, for figures.
pub(crate) fn state_label(assembly: &Assembly, index: usize) -> String {
    let n = assembly.coordinates();
    let symbol = if assembly.coordinate_unit() == CoordinateUnit::Radian { "α" } else { "q" };
    let subscript = |digit: char| digit.to_digit(10).and_then(|digit| char::from_u32(u32::from('₀') + digit));
    let number: String = (index % n + 1).to_string().chars().filter_map(subscript).collect();
    let unit = channels(assembly)[index].quantity.unit();
    if index < n { format!("{symbol}{number} ({unit})") } else { format!("d{symbol}{number}/dt ({unit})") }
}

/// The channels of the coordinates and their rates.
fn channels(assembly: &Assembly) -> Vec<Channel> {
    let of = match assembly.coordinate_unit() {
        CoordinateUnit::Radian => Coordinates::Joints,
        CoordinateUnit::MetreRootKilogram => Coordinates::Modes,
    };
    coordinate_channels(of, assembly.coordinates())
}

/// The arm or structure, and the peak load.
pub(crate) fn of(scenario: &Scenario, load: &Load) -> Result<Value, Failure> {
    let mut configuration = of_arm(scenario)?;
    configuration["torque_nm"] = json!(<[f64; 2]>::from(load.torque_nm));
    configuration["force_n"] = json!(<[f64; 2]>::from(load.force_n));
    Ok(configuration)
}
