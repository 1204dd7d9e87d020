//! The load that acted on a structure, computed from the responses in a recording.

use resonarm_bench::control::ResponsePoint;
use resonarm_bench::excitation::{ExcitationSpec, Phasor};
use resonarm_bench::plant::{ShakerAcross, TestedAssembly};
use resonarm_scenario::Scenario;

/// Returns the amplitude of the load that acted, N or N·m: in open loop a shaker's force on the structure differs from
/// the commanded one.
///
/// The converters fold images of the held command onto the fundamental; of these the head reads the share that acts on
/// the structure far above the natural frequencies.
///
/// # Errors
/// [`ShakerAcross`] if the shaker pushes where the structure does not move.
pub fn acting_load(
    response: &ResponsePoint,
    scenario: &Scenario,
    tested: &TestedAssembly,
) -> Result<f64, ShakerAcross> {
    let (Some(spec), Some(shaker)) = (&scenario.excitation, &scenario.rig.shaker) else { return Ok(response.load) };
    let share = shaker.armature_at(&tested.places.exciter)?.high_frequency_force_share(&tested.assembly);
    Ok(of_head(response, scenario, share, spec))
}

/// Returns the fundamental in the head without the images, of which it reads a share, N.
fn of_head(response: &ResponsePoint, scenario: &Scenario, share: f64, spec: &ExcitationSpec) -> f64 {
    let command_n = spec.amplitude.force_n;
    let images = share * scenario.sampling().images(response.frequency_hz);
    // Images are in phase with the command, which is the reference of the phasors, so they are real.
    let head = [0, 1].map(|axis| response.head_force_n[axis] - Phasor::new(images * command_n[axis], 0.0));
    (head[0].norm_sqr() + head[1].norm_sqr()).sqrt()
}
