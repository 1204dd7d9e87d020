//! What results depend on, for documents and journals.

use serde_json::{Value, json};

use super::failure::Failure;
use crate::arm::Load;
use crate::scenario::Scenario;

/// The arm, its pose and the load at the crest: what results of every command depend on.
pub(super) fn of(scenario: &Scenario, load: &Load) -> Result<Value, Failure> {
    Ok(json!({
        "preset": scenario.arm.preset,
        "parameters": scenario.parameters()?,
        "beta1_deg": scenario.arm.beta1_deg,
        "beta2_deg": scenario.arm.beta2_deg,
        "torque_nm": <[f64; 2]>::from(load.torque_nm),
        "force_n": <[f64; 2]>::from(load.force_n),
    }))
}
