//! The coil of a shaker that drives a chain.

use crate::structure::armature::{Armature, Coil};
use crate::structure::coil::Circuit;

/// The coil of a shaker that drives a chain.
#[derive(Clone, Debug)]
pub(super) struct Driver {
    pub armature: Armature,
    /// Circuit of a coil in voltage mode; `None` in current mode.
    pub circuit: Option<Circuit>,
    pub step_s: f64,
    /// Current at the end of the last step, A.
    pub current_a: f64,
}

impl Driver {
    /// A coil without current, for steps of `step_s`, s; `None` if its current changes too slowly for the closed form
    /// of a step.
    pub fn new(armature: &Armature, step_s: f64) -> Option<Driver> {
        let circuit = Circuit::new(&armature.coil, step_s);
        let fits = circuit.is_some() || matches!(armature.coil, Coil::Current { .. });
        fits.then_some(Driver { armature: *armature, circuit, step_s, current_a: 0.0 })
    }
}
