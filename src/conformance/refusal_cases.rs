//! Commands that a plant must refuse: they neither act nor keep it operational.

use alloc::format;

use super::damage::{Damage, needs_fd};
use super::plant_role::{arm, drive, forces, meet, samples, timeout_ns};
use super::tester::{Answers, Stop, Tester, failed, ms};
use crate::protocol::timing::COMMAND_AGE_NS;
use crate::protocol::{Emergency, EmergencyCode, Refusal};

/// Damaged frames in place of commands.
pub(super) fn damaged(t: &mut Tester, damage: Damage) -> Result<(), Stop> {
    drive(t)?;
    let from = t.heard.len();
    t.answers = Answers::Damaged(-t.settings.force_n, damage);
    let faulted = starves(t, from);
    match faulted {
        Err(Stop::Bus(error)) if needs_fd(damage, t.network.profile()) => {
            Err(Stop::Skipped(format!("the bus can't send a CAN FD frame: {error}")))
        }
        other => other.map(|_| ()),
    }
}

/// Commands that answer an older sample than they may, from arming on.
pub(super) fn old(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    let limit = samples(t, COMMAND_AGE_NS) as i16;
    shifted(t, -(limit + 1))
}

/// Commands that answer a sample still to come, from arming on.
pub(super) fn early(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    // Further than the plant gets on while a command is on its way.
    shifted(t, 1000)
}

fn shifted(t: &mut Tester, by: i16) -> Result<(), Stop> {
    let from = t.heard.len();
    arm(t, Answers::Shifted(-t.settings.force_n, by))?;
    let emergency = starves(t, from)?;
    says(&emergency, &[Refusal::Late])
}

/// Further commands for the sample that was answered.
pub(super) fn same_sample(t: &mut Tester) -> Result<(), Stop> {
    drive(t)?;
    let from = t.heard.len();
    t.answers = Answers::Always(-t.settings.force_n, t.answered.unwrap_or(0));
    let emergency = starves(t, from)?;
    says(&emergency, &[Refusal::Repeated, Refusal::Late])
}

/// Commands larger than the plant's exciter can produce.
pub(super) fn too_large(t: &mut Tester) -> Result<(), Stop> {
    let Some(beyond_n) = t.settings.beyond_n else {
        return Err(Stop::Skipped(alloc::string::String::from(
            "no force is given that the plant must refuse (--beyond-n); a plant that takes it would apply it",
        )));
    };
    drive(t)?;
    let from = t.heard.len();
    t.answers = Answers::Force(-beyond_n);
    let emergency = starves(t, from)?;
    says(&emergency, &[Refusal::OutOfRange])
}

/// The plant faults for want of commands, and what it is sent meanwhile doesn't act.
fn starves(t: &mut Tester, from: usize) -> Result<Emergency, Stop> {
    let within_ns = timeout_ns(t);
    let text = format!("it feeds the timeout: no fault within {}", ms(within_ns));
    let word = t.expect_emergency(within_ns, EmergencyCode::CommandTimeout, text);
    let acted = forces(t, from).find(|(_, read_n)| *read_n < -0.5 * t.settings.force_n);
    if let Some((sample, read_n)) = acted {
        return failed(format!("it acts: the head reads {read_n:.2} N at sample {sample}"));
    }
    match word? {
        (_, e) if e.code == EmergencyCode::CommandTimeout => Ok(e),
        (_, e) => failed(format!("in place of a command timeout it says: {e}")),
    }
}

/// The reason in the emergency.
fn says(emergency: &Emergency, reasons: &[Refusal]) -> Result<(), Stop> {
    match Refusal::from_detail(emergency.detail) {
        (1.., Some(reason)) if reasons.contains(&reason) => Ok(()),
        _ => failed(format!("of the reason ({reasons:?} is right) it says: {emergency}")),
    }
}
