//! Commands that a plant must reject: they neither act nor keep it operational.

use super::damage::{Damage, needs_fd};
use super::plant_role::{arm, drive, forces, instead, meet, run_samples, samples, timeout_ns};
use super::source::Answers;
use super::stop::{Stop, failed, skipped, wrong};
use super::tester::{Heard, Tester, emergency};
use super::times::{MS, ms};
use resonarm_protocol::timing::COMMAND_AGE_NS;
use resonarm_protocol::{Emergency, EmergencyCode, Profile, Refusal, Trip};

/// Size of a command beyond the limit that a plant states, as a multiple of it: a plant that accepts it all the same
/// is driven hardly more than it can be.
const BEYOND_STATED: f64 = 1.01;

/// Time over which the force rises that drives a plant beyond its travel, ns: short, since a stop of the process ends
/// the try.
const SLOPE_NS: u64 = 250 * MS;
/// Time for which the force is applied for the plant to exceed its travel, ns.
const TRAVEL_NS: u64 = 5_000 * MS;

/// Damaged frames instead of commands.
pub(super) fn damaged(t: &mut Tester, damage: Damage) -> Result<(), Stop> {
    drive(t)?;
    let from = t.heard.len();
    t.answers = Answers::Damaged(-t.settings.force_n, damage);
    // A damaged frame must never act, whenever it comes, so no hold-up excuses it.
    let faulted = starves(t, from, wrong);
    match faulted {
        Err(Stop::Bus(error)) if needs_fd(damage, t.network.profile()) => {
            skipped(format!("the bus can't send a CAN FD frame: {error}"))
        }
        other => other.map(|_| ()),
    }
}

/// Commands for a sample that is too old, from arming on.
pub(super) fn old(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    let limit = samples(t, COMMAND_AGE_NS) as i16;
    shifted(t, -(limit + 1), wrong)
}

/// Commands for a future sample, from arming on.
pub(super) fn early(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    // Further than the plant advances while a command is on its way.
    shifted(t, 1000, failed)
}

fn shifted(t: &mut Tester, by: i16, acts: Acts) -> Result<(), Stop> {
    let from = t.heard.len();
    arm(t, Answers::Shifted(-t.settings.force_n, by))?;
    let emergency = starves(t, from, acts)?;
    says(&emergency, &[Refusal::Late])
}

/// Further commands for the sample that was answered.
pub(super) fn same_sample(t: &mut Tester) -> Result<(), Stop> {
    drive(t)?;
    let from = t.heard.len();
    // The counter goes on, so that the sample alone is what the plant must reject.
    t.answers = Answers::Always(-t.settings.force_n, t.answered.unwrap_or(0));
    let emergency = starves(t, from, wrong)?;
    says(&emergency, &[Refusal::Repeated, Refusal::Late])
}

/// Commands for the sample before the one that was answered.
pub(super) fn older(t: &mut Tester) -> Result<(), Stop> {
    drive(t)?;
    let from = t.heard.len();
    t.answers = Answers::Always(-t.settings.force_n, t.answered.unwrap_or(0).wrapping_sub(1));
    let emergency = starves(t, from, wrong)?;
    says(&emergency, &[Refusal::OutOfOrder, Refusal::Late])
}

/// Commands larger than the plant's exciter can produce. If no force is given, slightly more than the limit that the
/// plant states in the FD profile.
pub(super) fn too_large(t: &mut Tester) -> Result<(), Stop> {
    let none = "no force is given that the plant must reject (--beyond-n); a plant that accepts it would apply it";
    if t.settings.beyond_n.is_none() && t.network.profile() == Profile::Classic {
        return skipped(none);
    }
    drive(t)?;
    let stated_n = t.last_capabilities().map(|capabilities| BEYOND_STATED * capabilities.force_limit_n);
    let Some(beyond_n) = t.settings.beyond_n.or(stated_n).filter(|force_n| *force_n <= f64::from(f32::MAX)) else {
        return skipped(none);
    };
    t.note(format!("{beyond_n} N"));
    let from = t.heard.len();
    t.answers = Answers::Force(-beyond_n);
    let emergency = starves(t, from, wrong)?;
    says(&emergency, &[Refusal::OutOfRange])
}

/// Commands that change the load in a sample period by more than the plant accepts.
pub(super) fn too_fast(t: &mut Tester) -> Result<(), Stop> {
    let Some(beyond_n_per_s) = t.settings.beyond_n_per_s else {
        return skipped("no rate of change is given that the plant must reject (--beyond-n-per-s)");
    };
    drive(t)?;
    let force_n = t.settings.force_n;
    let jump_n = beyond_n_per_s / f64::from(t.hello.rate_hz);
    if jump_n < 2.0 * force_n {
        let least = 2.0 * force_n * f64::from(t.hello.rate_hz);
        return skipped(format!(
            "--beyond-n-per-s must be at least {least}: from sample to sample the other cases command --force-n both \
             ways"
        ));
    }
    if !t.can_command(force_n - jump_n) {
        return skipped(format!(
            "at {} samples a second --beyond-n-per-s asks for a command of {} N, which profile {} can't carry",
            t.hello.rate_hz,
            force_n - jump_n,
            t.network.profile()
        ));
    }
    let from = t.heard.len();
    t.answers = Answers::Force(force_n - jump_n);
    let emergency = starves(t, from, failed)?;
    says(&emergency, &[Refusal::RateOfChange])
}

/// A ramp to a force with which the arm exceeds the plant's travel.
pub(super) fn too_far(t: &mut Tester) -> Result<(), Stop> {
    let Some(beyond_n) = t.settings.beyond_travel_n else {
        return skipped("no force is given that drives the plant beyond a travel (--beyond-travel-n)");
    };
    meet(t)?;
    let from = t.heard.len();
    let force_n = t.settings.force_n;
    // An arm that still rings from an earlier try may exceed the travel at once.
    arm(t, Answers::Force(force_n))?;
    let word = |heard: &Heard| emergency(&heard.message);
    let mut tripped = None;
    let slope = samples(t, SLOPE_NS);
    for part in 1..=slope {
        t.answers = Answers::Force(force_n + (beyond_n - force_n) * f64::from(part) / f64::from(slope));
        run_samples(t, 1)?;
        tripped = t.heard[from..].iter().find_map(word);
        if tripped.is_some() {
            break;
        }
    }
    let text = format!("it doesn't trip within {}", ms(TRAVEL_NS));
    let tripped = match tripped {
        Some(emergency) => emergency,
        None => t.expect_emergency(TRAVEL_NS, EmergencyCode::ExciterTripped, text)?.1,
    };
    if (tripped.code, tripped.detail) != (EmergencyCode::ExciterTripped, Trip::Travel as u16) {
        return failed(format!("expected a trip at its travel, but it reports: {tripped}"));
    }
    run_samples(t, 12)?;
    // The load held at the sample named may still be read: a converter with a filter reads up to five holds.
    let is_after = |sample: u16| (6..1 << 15).contains(&sample.wrapping_sub(tripped.sample));
    match forces(t, from).find(|(sample, read_n)| is_after(*sample) && read_n.abs() > 0.2 * force_n) {
        Some((sample, read_n)) => failed(format!("it still acts: the head reads {read_n:.2} N at sample {sample}")),
        None => Ok(()),
    }
}

/// Verdict on a command that acts: [`wrong`] if it must never act, whenever it comes, and [`failed`] if a command that
/// comes late because the tester was held up may act.
type Acts = fn(String) -> Result<Emergency, Stop>;

/// The plant faults for lack of commands, and the commands sent meanwhile don't act.
fn starves(t: &mut Tester, from: usize, acts: Acts) -> Result<Emergency, Stop> {
    let within_ns = timeout_ns(t);
    let text = format!("it restarts the timeout: no fault within {}", ms(within_ns));
    let word = t.expect_emergency(within_ns, EmergencyCode::CommandTimeout, text);
    // Bad commands have the opposite sign of good ones, so that none that acts is taken for a good one. This is
    // looked at before the emergency, since it is the worse fault.
    let acted = forces(t, from).find(|(_, read_n)| *read_n < -0.5 * t.settings.force_n);
    if let Some((sample, read_n)) = acted {
        return acts(format!("it acts: the head reads {read_n:.2} N at sample {sample}"));
    }
    match word? {
        (_, e) if e.code == EmergencyCode::CommandTimeout => Ok(e),
        (_, e) => instead(&e, "instead of a command timeout"),
    }
}

/// Checks the reason in the emergency.
fn says(emergency: &Emergency, reasons: &[Refusal]) -> Result<(), Stop> {
    match Refusal::from_detail(emergency.detail) {
        (1.., Some(reason)) if reasons.contains(&reason) => Ok(()),
        _ => {
            let right = reasons.iter().map(|reason| format!("{} ({reason})", *reason as u8)).collect::<Vec<_>>();
            failed(format!("the reason in its emergency must be {}: {emergency}", right.join(" or ")))
        }
    }
}
