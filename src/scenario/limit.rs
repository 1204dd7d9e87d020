//! The excitation against what its exciter can produce and what the wire can carry.

use super::ScenarioError;
use crate::excitation::Amplitude;
use crate::protocol::scaling::{FORCE, Scale, TORQUE};
use crate::rig::ExciterSpec;

/// Checks the crest of an excitation, as it is and as the wire rounds it: a command beyond the limit would be refused sample
/// by sample.
pub(super) fn check(amplitude: &Amplitude, exciter: &ExciterSpec) -> Result<(), ScenarioError> {
    let force = (FORCE, "rig.exciter.force_limit_n", exciter.force_limit_n);
    let torque = (TORQUE, "rig.exciter.torque_limit_nm", exciter.torque_limit_nm);
    check_axis("excitation.amplitude.force_x_n", amplitude.force_x_n, force)?;
    check_axis("excitation.amplitude.force_y_n", amplitude.force_y_n, force)?;
    check_axis("excitation.amplitude.torque1_nm", amplitude.torque1_nm, torque)?;
    check_axis("excitation.amplitude.torque2_nm", amplitude.torque2_nm, torque)
}

fn check_axis(
    name: &'static str,
    got: f64,
    (scale, limit_name, limit): (Scale, &'static str, f64),
) -> Result<(), ScenarioError> {
    let counts = f64::from(scale.counts_per_unit());
    let sent = libm::rint(got.abs() * counts) / counts;
    if got.abs() > limit || sent > limit {
        let mend = "lower it, or raise the limit if the exciter has more";
        return Err(ScenarioError::BeyondLimit { name, got, limit_name, limit, mend });
    }
    if sent > scale.max() {
        let mend = "lower it: a command can't say more";
        return Err(ScenarioError::BeyondLimit {
            name,
            got,
            limit_name: "the range of the wire",
            limit: scale.max(),
            mend,
        });
    }
    Ok(())
}
