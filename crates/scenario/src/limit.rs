//! Checks a load against what the exciter can produce and the protocol can state.

use crate::error::ScenarioError;
use resonarm_bench::rig::{Exciter, ExciterSpec, Load, MOST_JOINTS, ShakerSpec};
use resonarm_bench::structure::LoadSet;
use resonarm_protocol::Profile;
use resonarm_protocol::scaling::{FORCE, Scale, TORQUE};

/// Checks the peak of a section's load, exact and rounded as the protocol sends it. The plant would reject a
/// command beyond the limit in every sample.
pub(super) fn check(section: &str, amplitude: &Load, exciter: &Exciter, profile: Profile) -> Result<(), ScenarioError> {
    match exciter {
        Exciter::Ideal(spec) => check_ideal(section, amplitude, spec, profile),
        Exciter::Shaker(spec) => check_shaker(section, amplitude, spec, profile),
    }
}

fn check_ideal(section: &str, amplitude: &Load, exciter: &ExciterSpec, profile: Profile) -> Result<(), ScenarioError> {
    for (place, got) in amplitude.parts().into_iter().enumerate() {
        let limit = if place < MOST_JOINTS {
            (TORQUE, "rig.exciter.torque_limit_nm", exciter.torque_limit_nm)
        } else {
            (FORCE, "rig.exciter.force_limit_n", exciter.force_limit_n)
        };
        let axis = Axis { section, key: Load::NAMES[place], unit: amplitude.unit() };
        if LoadSet::NATIVE.has(place) {
            axis.check(got, limit, profile)?;
        } else {
            // Resonarm's protocol does not carry this part, so that it is never rounded.
            axis.check_size(got, got.abs(), limit)?;
        }
    }
    Ok(())
}

/// Checks a load for a shaker, which takes forces along its axis only. The exciter limits the size of the
/// force, the protocol each of its components.
fn check_shaker(section: &str, amplitude: &Load, shaker: &ShakerSpec, profile: Profile) -> Result<(), ScenarioError> {
    if !shaker.is_along(amplitude) {
        return Err(ScenarioError::AcrossShaker { section: section.to_string(), direction_deg: shaker.direction_deg });
    }
    let limit = (FORCE, "the shaker's blocked force", shaker.force_limit_n());
    for (key, got) in [("exciter_x", amplitude.force_n.x), ("exciter_y", amplitude.force_n.y)] {
        Axis { section, key, unit: "N" }.check(got, limit, profile)?;
    }
    let got = shaker.along_n(amplitude).abs();
    let limit = shaker.force_limit_n();
    if got > limit {
        let name = format!("{section}.amplitude");
        let limit_name = "the shaker's blocked force";
        let unit = "N";
        let fix = "lower it, or raise `current_limit_a` or `voltage_limit_v` of `rig.shaker` if it has more";
        return Err(ScenarioError::BeyondLimit { name, got, limit_name, limit, unit, fix });
    }
    Ok(())
}

/// One part of the load of a section of the scenario.
struct Axis<'a> {
    section: &'a str,
    key: &'static str,
    unit: &'static str,
}

/// The scaling of a quantity in frames, and the name and value of the exciter's limit, N or N·m.
type Limit = (Scale, &'static str, f64);

impl Axis<'_> {
    /// Checks a part that Resonarm's protocol carries. The rounded value is checked as well: half a count above the limit
    /// is enough for the plant to reject the command.
    fn check(&self, got: f64, limit: Limit, profile: Profile) -> Result<(), ScenarioError> {
        let (scale, ..) = limit;
        let sent = match profile {
            Profile::Classic => {
                let counts = f64::from(scale.counts_per_unit());
                // As the protocol rounds: to the nearest count, ties to even.
                libm::rint(got.abs() * counts) / counts
            }
            Profile::Fd => f64::from(got.abs() as f32),
        };
        self.check_size(got, sent, limit)?;
        let range = scale.limit(profile);
        let fix = "lower it, or use `network.profile = \"fd\"`, since a command can't state more";
        if sent > range { Err(self.beyond(got, "the range of the protocol", range, fix)) } else { Ok(()) }
    }

    /// Checks a part and its size as it is sent against the exciter's limit.
    fn check_size(&self, got: f64, sent: f64, (_, limit_name, limit): Limit) -> Result<(), ScenarioError> {
        let fix = "lower it, or raise the limit if the exciter has more";
        if got.abs() > limit || sent > limit { Err(self.beyond(got, limit_name, limit, fix)) } else { Ok(()) }
    }

    fn beyond(&self, got: f64, limit_name: &'static str, limit: f64, fix: &'static str) -> ScenarioError {
        let name = format!("{}.amplitude.{}", self.section, self.key);
        ScenarioError::BeyondLimit { name, got, limit_name, limit, unit: self.unit, fix }
    }
}

/// Returns the largest load along `amplitude` that the exciter can produce and the protocol can state, N or
/// N·m.
pub(super) fn largest(amplitude: &Load, exciter: &Exciter, profile: Profile) -> f64 {
    let (force_limit_n, torque_limit_nm) = exciter.limits();
    let (limit, scale) = if amplitude.has_torque() { (torque_limit_nm, TORQUE) } else { (force_limit_n, FORCE) };
    let range = scale.limit(profile);
    let size = libm::hypot(amplitude.force_n.norm(), amplitude.torque_nm.norm());
    let peak = amplitude.force_n.amax().max(amplitude.torque_nm.amax());
    match exciter {
        // An ideal exciter limits each axis by itself, so the largest component reaches the limit first and the
        // size may be larger by the ratio size/peak. A shaker limits the size; only the range of the protocol
        // is per axis.
        Exciter::Ideal(_) => limit.min(range) * size / peak,
        Exciter::Shaker(_) => limit.min(range * size / peak),
    }
}
