mod chains;
mod losses;
mod messages;
mod modal;
mod parameters;
mod polynomials;
mod preload;
mod schemes;
mod shaken;
mod switches;

use super::*;
use crate::integrate::Scheme;
use losses::loss_w;
use serde_json::Value;

/// The cases of a kind; see `tests/oracles/README.md`.
fn oracles(kind: &str) -> Vec<Value> {
    let file: Value = serde_json::from_str(include_str!("../../../../../tests/oracles/structures.json")).unwrap();
    file[kind].as_array().unwrap().clone()
}

fn numbers(of: &Value) -> Vec<f64> {
    of.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn chain_of(case: &Value) -> ChainSpec {
    ChainSpec { links: serde_json::from_value(case["links"].clone()).unwrap(), gravity_m_s2: 0.0, unstated: vec![] }
}

fn assembly(body: BodySpec, elements: Vec<ElementSpec>) -> Assembly {
    Assembly::new(&StructureSpec { body, elements }).unwrap()
}

/// An element to the ground.
fn grounded(at: Place, law: Law) -> ElementSpec {
    ElementSpec::Point { at, to: None, law }
}

/// A polynomial over places, with the powers and energies of its terms.
fn polynomial(at: &[Place], terms: &[(&[u8], f64)]) -> ElementSpec {
    let term = |&(powers, energy): &(&[u8], f64)| Term { powers: powers.to_vec(), energy };
    ElementSpec::Polynomial { at: at.to_vec(), terms: terms.iter().map(term).collect() }
}

fn along(point: &str, axis: Axis) -> Place {
    Place::Dof { point: point.into(), axis }
}

/// The modes of the oracles, with the points `tip` and `mid`.
fn two_modes(elements: Vec<ElementSpec>) -> Assembly {
    let mode = |frequency_hz, damping_ratio| ModeSpec { frequency_hz, damping_ratio };
    let shape =
        |point: &str, by_mode: [f64; 2]| ShapeSpec { point: point.into(), axis: Axis::X, by_mode: by_mode.into() };
    let modes = vec![mode(20.0, 0.004), mode(57.0, 0.006)];
    let shapes = vec![shape("tip", [0.5, -0.4]), shape("mid", [0.3, 0.35])];
    assembly(BodySpec::Modal(ModalSpec { modes, shapes }), elements)
}
