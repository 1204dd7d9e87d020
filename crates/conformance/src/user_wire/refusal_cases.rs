//! Frames that a plant must reject: what is wrong with them neither acts nor restarts the timeout.

use super::craft::Damage;
use super::plant_cases::{drive, in_words, judged_fault, load_of};
use super::readings::{fault_within_ns, load_readings, load_within_ns, loads, says_state};
use super::tester::{Alter, Tester};
use crate::stop::{Stop, late, not_at_once, skipped, wrong};
use crate::times::{GONE_NS, ms};

/// A load that acts has at least this share of what was commanded.
const ACTS: f64 = 0.5;

/// Commands that are damaged in this way are rejected.
pub(super) fn damaged(t: &mut Tester, damage: Damage) -> Result<(), Stop> {
    if !damage.is_possible(t.on) {
        return skipped(match damage {
            Damage::Checksum => "not every message with loads has a checksum",
            Damage::Repeated => "not every message with loads has a counter",
            Damage::Jump => "not every message with loads has a counter of which so many values can be lost",
            Damage::Short => "not every message with loads can be too short",
            Damage::NotFinite => "not every message with loads has one that is a floating-point number",
        });
    }
    t.on.awaited_ns()?;
    let names = load_readings(t);
    let has_state = says_state(t);
    if names.is_empty() && !has_state {
        return skipped("no reading that is sent at least twice a second carries the plant's state or the acting load");
    }
    drive(t)?;
    t.command(-load_of(t));
    t.alter = Alter::Commands(damage);
    let from = t.mark();
    let since_ns = t.commanded_ns;
    let timeout_ns = t.on.timeout_ns();
    let within_ns = timeout_ns + fault_within_ns(t);
    let is_said = judged_fault(t, from, since_ns, within_ns)?.is_some();
    let acted = loads(&t.heard()[from..], &names).find(|(_, read)| *read < -ACTS * load_of(t)).map(|(_, read)| read);
    if let Some(read) = acted {
        return wrong(format!("it accepts them: commanded {} that way, it {}", -load_of(t), in_words(t, read)));
    }
    if is_said || !has_state {
        return Ok(());
    }
    let text = format!("they feed the timeout: no fault {} after the last good command", ms(within_ns));
    match judged_fault(t, from, since_ns, within_ns + GONE_NS)? {
        Some(_) => not_at_once(text),
        None => late(text),
    }
}

/// A load beyond the exciter's limits is rejected: what was held stays, or the plant faults.
pub(super) fn too_large(t: &mut Tester) -> Result<(), Stop> {
    let Some(beyond_n) = t.settings.beyond_n else {
        return skipped("no load that it must reject is given (--beyond-n)");
    };
    if t.on.commands_torque() {
        return skipped("the protocol commands torques, and --beyond-n is a force");
    }
    let names = load_readings(t);
    if names.is_empty() {
        return skipped("no reading that is sent at least twice a second carries the acting load");
    }
    drive(t)?;
    if !t.can_command(-beyond_n) {
        return skipped(format!("no signal of the protocol can command {beyond_n} N (--beyond-n)"));
    }
    let from = t.mark();
    t.command(-beyond_n);
    // The plant may fault as well.
    t.run_ns(load_within_ns(t))?;
    match loads(&t.heard()[from..], &names).find(|(_, read)| *read < -ACTS * load_of(t)) {
        Some((_, read)) => wrong(format!("commanded {beyond_n} N in the other direction, it {}", in_words(t, read))),
        None => Ok(()),
    }
}
