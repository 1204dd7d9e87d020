//! Checks a load against what the exciter can produce and the protocol can state.

use super::ScenarioError;
use resonarm_bench::excitation::Amplitude;
use resonarm_bench::rig::{Exciter, ExciterSpec, MOST_JOINTS, ShakerSpec};
use resonarm_bench::structure::LoadSet;
use resonarm_protocol::Profile;
use resonarm_protocol::scaling::{FORCE, Scale, TORQUE};

/// Checks the peak of a section's load, exact and rounded as the protocol sends it. The plant would reject a
/// command beyond the limit in every sample.
pub(super) fn check(
    section: &str,
    amplitude: &Amplitude,
    exciter: &Exciter,
    profile: Profile,
) -> Result<(), ScenarioError> {
    match exciter {
        Exciter::Ideal(spec) => check_ideal(section, amplitude, spec, profile),
        Exciter::Shaker(spec) => check_shaker(section, amplitude, spec, profile),
    }
}

fn check_ideal(
    section: &str,
    amplitude: &Amplitude,
    exciter: &ExciterSpec,
    profile: Profile,
) -> Result<(), ScenarioError> {
    let unit = amplitude.unit();
    let check_axis = |key: &str, got, limit| check_axis((section, key, unit), got, limit, profile);
    let force = (FORCE, "rig.exciter.force_limit_n", exciter.force_limit_n);
    let torque = (TORQUE, "rig.exciter.torque_limit_nm", exciter.torque_limit_nm);
    check_axis("exciter_x", amplitude.force_x_n, force)?;
    check_axis("exciter_y", amplitude.force_y_n, force)?;
    check_axis("joint1", amplitude.torque1_nm, torque)?;
    check_axis("joint2", amplitude.torque2_nm, torque)?;
    // The others are not on the wire of Resonarm's protocol.
    for (place, got) in
        amplitude.load().parts().into_iter().enumerate().filter(|(place, _)| !LoadSet::NATIVE.has(*place))
    {
        let (_, limit_name, limit) = if place < MOST_JOINTS { torque } else { force };
        if got.abs() > limit {
            let name = format!("{section}.amplitude.{}", Amplitude::KEYS[place]);
            let fix = "lower it, or raise the limit if the exciter has more";
            return Err(ScenarioError::BeyondLimit { name, got, limit_name, limit, unit, fix });
        }
    }
    Ok(())
}

/// Checks a load for a shaker, which takes forces along its axis only. The exciter limits the size of the
/// force, the protocol each of its components.
fn check_shaker(
    section: &str,
    amplitude: &Amplitude,
    shaker: &ShakerSpec,
    profile: Profile,
) -> Result<(), ScenarioError> {
    if !shaker.is_along(&amplitude.load()) {
        return Err(ScenarioError::AcrossShaker { section: section.to_string(), direction_deg: shaker.direction_deg });
    }
    let limit = (FORCE, "the shaker's blocked force", shaker.force_limit_n());
    check_axis((section, "exciter_x", "N"), amplitude.force_x_n, limit, profile)?;
    check_axis((section, "exciter_y", "N"), amplitude.force_y_n, limit, profile)?;
    let (got, limit) = (shaker.along_n(&amplitude.load()).abs(), shaker.force_limit_n());
    if got > limit {
        let (name, limit_name, unit) = (format!("{section}.amplitude"), "the shaker's blocked force", "N");
        let fix = "lower it, or raise `current_limit_a` or `voltage_limit_v` of `rig.shaker` if it has more";
        return Err(ScenarioError::BeyondLimit { name, got, limit_name, limit, unit, fix });
    }
    Ok(())
}

fn check_axis(
    (section, key, unit): (&str, &str, &'static str),
    got: f64,
    (scale, limit_name, limit): (Scale, &'static str, f64),
    profile: Profile,
) -> Result<(), ScenarioError> {
    let name = || format!("{section}.amplitude.{key}");
    // The rounded value is checked as well: half a count above the limit is enough for the plant to reject the
    // command.
    let sent = match profile {
        Profile::Classic => {
            let counts = f64::from(scale.counts_per_unit());
            libm::rint(got.abs() * counts) / counts
        }
        Profile::Fd => f64::from(got.abs() as f32),
    };
    if got.abs() > limit || sent > limit {
        let fix = "lower it, or raise the limit if the exciter has more";
        return Err(ScenarioError::BeyondLimit { name: name(), got, limit_name, limit, unit, fix });
    }
    let range = scale.limit(profile);
    if sent > range {
        let fix = "lower it, or take `network.profile = \"fd\"`: a command can't say more";
        return Err(ScenarioError::BeyondLimit {
            name: name(),
            got,
            limit_name: "the range of the wire",
            limit: range,
            unit,
            fix,
        });
    }
    Ok(())
}

/// Returns the largest load along `amplitude` that the exciter can produce and the protocol can state, N or
/// N·m.
pub(super) fn largest(amplitude: &Amplitude, exciter: &Exciter, profile: Profile) -> f64 {
    let (force_limit_n, torque_limit_nm) = exciter.limits();
    let (limit, scale) = if amplitude.is_torque() { (torque_limit_nm, TORQUE) } else { (force_limit_n, FORCE) };
    let (load, range) = (amplitude.load(), scale.limit(profile));
    let (size, peak) =
        (libm::hypot(load.force_n.norm(), load.torque_nm.norm()), load.force_n.amax().max(load.torque_nm.amax()));
    match exciter {
        // An ideal exciter limits each axis by itself, so the largest component reaches the limit first and the
        // size may be larger by the ratio size/peak. A shaker limits the size; only the range of the protocol
        // is per axis.
        Exciter::Ideal(_) => limit.min(range) * size / peak,
        Exciter::Shaker(_) => limit.min(range * size / peak),
    }
}
