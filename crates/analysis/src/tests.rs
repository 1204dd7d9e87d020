use resonarm_dynamics::arm::{Arm, Pose, Preset};

/// The arm of a preset in a pose.
pub(crate) fn arm_at(preset: Preset, beta1_deg: f64, beta2_deg: f64) -> Arm {
    Arm::new(preset.parameters().unwrap(), Pose { beta1_deg, beta2_deg }).unwrap()
}
