//! What stands on figures: symbols as print has them, with a minus sign and subscripts.

use crate::scenario::ArmSection;

/// α of each joint.
pub(super) const ALPHA: [&str; 2] = ["α₁", "α₂"];

/// An angle in degrees, with a minus sign where it is negative.
pub(super) fn degrees(value: f64) -> String {
    format!("{value}°").replace('-', "−")
}

/// The preset of an arm and its pose.
pub(super) fn pose(arm: &ArmSection) -> String {
    format!("{}, β₁ = {}, β₂ = {}", arm.preset, degrees(arm.beta1_deg), degrees(arm.beta2_deg))
}

/// The axis of the largest |α| over a period.
pub(super) fn largest(joint: usize) -> String {
    format!("largest |{}| (rad)", ALPHA[joint])
}
