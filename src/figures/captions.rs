//! Texts on figures, with a typographic minus sign and subscripts.

use resonarm::analysis::Drive;
use resonarm::arm::Load;
use resonarm::scenario::ArmSection;
use resonarm_figures::plot::Subtitle;

/// α of each joint.
pub(crate) const ALPHA: [&str; 2] = ["α₁", "α₂"];

/// An angle in degrees, with a minus sign where it is negative.
pub(crate) fn degrees(value: f64) -> String {
    format!("{value}°").replace('-', "−")
}

/// An arm and its pose; the caption has the parameters that differ from the preset's.
pub(crate) fn pose(arm: &ArmSection) -> Subtitle {
    pose_without(arm, &[])
}

/// The same without the angles and parameters that vary, as `beta2_deg`.
pub(crate) fn pose_without(arm: &ArmSection, varied: &[&str]) -> Subtitle {
    let angles = [("beta1_deg", "β₁", arm.beta1_deg), ("beta2_deg", "β₂", arm.beta2_deg)];
    let fixed = angles.iter().filter(|(name, ..)| !varied.contains(name));
    let (line, description) = (arm.short_label_without(varied), arm.description_without(varied));
    let more = if line == description { Vec::new() } else { vec![format!("arm: {description}")] };
    fixed.fold(Subtitle { line, more }, |subtitle, (_, symbol, value)| {
        subtitle.and(format!("{symbol} = {}", degrees(*value)))
    })
}

/// The excitation in words.
pub(crate) fn load(load: &Load) -> String {
    let ([u1, u2], [fx, fy]) = (<[f64; 2]>::from(load.torque_nm), <[f64; 2]>::from(load.force_n));
    let parts = [(u1, "N·m at joint 1"), (u2, "N·m at joint 2"), (fx, "N at C along x"), (fy, "N at C along y")];
    let parts: Vec<String> =
        parts.iter().filter(|(value, _)| *value != 0.0).map(|(value, what)| format!("{value} {what}")).collect();
    parts.join(", ").replace('-', "−")
}

/// Where an excitation acts whose amplitude varies.
pub(crate) fn direction(load: &Load) -> String {
    match <[f64; 2]>::from(load.force_n) {
        [0.0, 0.0] => Drive::Torque1.label().to_owned(),
        [_, 0.0] => Drive::ForceX.label().to_owned(),
        [0.0, _] => Drive::ForceY.label().to_owned(),
        [x, y] => format!("force at C at {:.1}° to x", libm::atan2(y, x).to_degrees()).replace('-', "−"),
    }
}

/// The axis of the largest |α| over a period.
pub(crate) fn largest(joint: usize) -> String {
    format!("largest |{}| (rad)", ALPHA[joint])
}
