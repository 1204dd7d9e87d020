//! The load that acted on the arm, from the responses in a recording.

use resonarm_bench::control::ResponsePoint;
use resonarm_bench::excitation::{ExcitationSpec, Phasor};
use resonarm_bench::plant::{ShakerAcross, TestedAssembly};
use resonarm_dynamics::arm::{Arm, ArmError, Load};
use resonarm_scenario::Scenario;

/// Amplitude of the load that acted, N or N·m: in open loop a shaker's force on the arm differs from the commanded one.
///
/// The converters fold images of the held command onto the fundamental; of these the head reads the share that acts on
/// the arm far above the natural frequencies.
///
/// # Errors
/// [`ArmError`] if the arm can't carry the shaker's armature.
pub fn acting_load(response: &ResponsePoint, scenario: &Scenario, arm: &Arm) -> Result<f64, ArmError> {
    let (Some(spec), Some(shaker)) = (&scenario.excitation, &scenario.rig.shaker) else { return Ok(response.load) };
    let share = arm.clone().with_attachment(shaker.armature())?.high_frequency_force_share();
    Ok(of_head(response, scenario, share, spec))
}

/// The same on a structure in place of the arm.
///
/// # Errors
/// [`ShakerAcross`] if the shaker pushes where the structure does not move.
pub fn acting_load_on(
    response: &ResponsePoint,
    scenario: &Scenario,
    tested: &TestedAssembly,
) -> Result<f64, ShakerAcross> {
    let (Some(spec), Some(shaker)) = (&scenario.excitation, &scenario.rig.shaker) else { return Ok(response.load) };
    let share = shaker.armature_at(&tested.places.exciter)?.high_frequency_force_share(&tested.assembly);
    Ok(of_head(response, scenario, share, spec))
}

/// The fundamental in the head without the images, of which it reads a share, N.
fn of_head(response: &ResponsePoint, scenario: &Scenario, share: f64, spec: &ExcitationSpec) -> f64 {
    let command_n = spec.amplitude.load().force_n;
    let images = share * scenario.sampling().images(response.frequency_hz);
    let head = [0, 1].map(|axis| response.head_force_n[axis] - Phasor::new(images * command_n[axis], 0.0));
    (head[0].norm_sqr() + head[1].norm_sqr()).sqrt()
}

/// The load of all responses of a recording: under control the one held by the law, in open loop the mean of those that
/// acted, N or N·m.
pub fn common_load(scenario: &Scenario, acting: &[f64]) -> Load {
    match (&scenario.control, &scenario.excitation) {
        (Some(control), _) => control.amplitude().load(),
        (None, Some(excitation)) => {
            let load = excitation.amplitude.load();
            let mean = acting.iter().sum::<f64>() / acting.len() as f64;
            load.scaled(mean / libm::hypot(load.force_n.norm(), load.torque_nm.norm()))
        }
        (None, None) => Load::default(),
    }
}
