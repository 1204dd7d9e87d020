//! Cases for lockstep, where the plant waits for the answer to each sample.

use super::exciter_role::{begin_with, commands, commands_of};
use super::plant_cases::{becomes_fault, ramps};
use super::plant_role::{drive, forces, run_samples};
use super::source::{Answers, Samples};
use super::stop::{Stop, failed, inconclusive, late};
use super::tester::{Tester, emergency};
use super::times::{MARGIN_NS, MS, ms};
use resonarm_protocol::timing::LOCKSTEP_TIMEOUT_NS;
use resonarm_protocol::{Emergency, EmergencyCode, NodeState, Refusal};

/// Holds the force, and then leaves a sample unanswered: returns its index.
fn leave_unanswered(t: &mut Tester) -> Result<u16, Stop> {
    drive(t)?;
    t.answers = Answers::None;
    t.run_ns(MARGIN_NS)?;
    match forces(t, 0).last() {
        // The last sample was answered, and the next did not come: there is none to leave unanswered.
        Some((sample, _)) if t.answered == Some(sample) => {
            late(format!("after the answer to sample {sample}, no other sample was received within {}", ms(MARGIN_NS)))
        }
        Some((sample, _)) => Ok(sample),
        None => inconclusive("no sample was received"),
    }
}

/// No sample is sent before the one before it is answered, and none is left out.
pub(super) fn plant_waits(t: &mut Tester) -> Result<(), Stop> {
    let sample = leave_unanswered(t)?;
    let from = t.heard.len();
    t.run_ns(2 * MARGIN_NS)?;
    stays_at(t, from, sample, "without an answer")?;
    continues(t, sample)
}

/// The plant accepts only the command for this very sample.
pub(super) fn plant_takes_no_other(t: &mut Tester) -> Result<(), Stop> {
    let sample = leave_unanswered(t)?;
    // The neighbours are the likeliest mistakes: an answer one sample late, or one ahead.
    for by in [-1, 1] {
        let from = t.heard.len();
        t.answer_with(Answers::Shifted(t.settings.force_n, by), sample)?;
        t.run_ns(MARGIN_NS)?;
        let other = sample.wrapping_add_signed(by);
        stays_at(t, from, sample, &format!("for the command that answers sample {other}"))?;
    }
    continues(t, sample)
}

fn stays_at(t: &Tester, from: usize, sample: u16, why: &str) -> Result<(), Stop> {
    match forces(t, from).next() {
        Some((next, _)) => failed(format!("it waits at sample {sample}, and continues with {next} {why}")),
        None => Ok(()),
    }
}

/// Once answered, it continues without a gap.
fn continues(t: &mut Tester, sample: u16) -> Result<(), Stop> {
    let from = t.heard.len();
    t.answers = Answers::Force(t.settings.force_n);
    t.answer_with(t.answers, sample)?;
    run_samples(t, 20)?;
    for (n, (index, _)) in forces(t, from).enumerate() {
        let expected = sample.wrapping_add(1 + n as u16);
        if index != expected {
            return failed(format!("received sample {index}, expected {expected}"));
        }
    }
    Ok(())
}

/// Without an answer it faults after a second, and samples show the ramp.
pub(super) fn plant_timeout(t: &mut Tester) -> Result<(), Stop> {
    leave_unanswered(t)?;
    let from = t.heard.len();
    let e = times_out(t, t.answered_ns, EmergencyCode::CommandTimeout)?;
    becomes_fault(t, from)?;
    ramps(t, from, e.sample)
}

/// An exciter whose command was rejected gives up for lack of samples: the plant reports the refusal.
pub(super) fn plant_reports_refusal(t: &mut Tester) -> Result<(), Stop> {
    let sample = leave_unanswered(t)?;
    t.answer_with(Answers::Shifted(t.settings.force_n, -1), sample)?;
    t.run_ns(MARGIN_NS)?;
    t.send_emergency(EmergencyCode::SensorTimeout, sample)?;
    t.send_state(NodeState::Fault)?;
    let text = "no emergency after its exciter has faulted";
    match t.expect_emergency(MARGIN_NS, EmergencyCode::CommandTimeout, text)? {
        (_, e) if e.code == EmergencyCode::CommandTimeout && Refusal::from_detail(e.detail).1.is_some() => Ok(()),
        (_, e) => failed(format!("after a rejected command and its exciter's fault it reports: {e}")),
    }
}

/// The emergency is sent a second after the last message that the node waited for, not earlier.
fn times_out(t: &mut Tester, sent_ns: u64, code: EmergencyCode) -> Result<Emergency, Stop> {
    let within_ns = LOCKSTEP_TIMEOUT_NS + 2 * MARGIN_NS;
    let Some((heard, e)) = t.wait_for_emergency(within_ns)? else {
        return late(format!("no emergency {code} within {}", ms(within_ns)));
    };
    let took_ns = heard.at_ns.saturating_sub(sent_ns);
    if e.code != code {
        return failed(format!("expected emergency {code}, but it reports: {e}"));
    }
    t.note(format!("fault after {}", ms(took_ns)));
    if took_ns < LOCKSTEP_TIMEOUT_NS {
        return failed(format!("it faults after {}, and must wait {}", ms(took_ns), ms(LOCKSTEP_TIMEOUT_NS)));
    }
    Ok(e)
}

/// Each sample is answered once, and leads to the next.
pub(super) fn exciter_answers(t: &mut Tester) -> Result<(), Stop> {
    let begun = t.heard.len();
    begin_with(t, Samples::Awaited)?;
    let from = t.heard.len();
    t.run_ns(300 * MS)?;
    t.check_frames()?;
    let answered = commands(t, from);
    let awaited = t.source.index.wrapping_sub(1);
    let last = commands_of(&t.heard[begun..]).last();
    t.note(format!("{} samples answered in {}", answered.len(), ms(300 * MS)));
    if let Some(sample) = t.source.unsent {
        return failed(format!("it answers sample {sample} before that is sent"));
    }
    match answered.windows(2).find(|two| two[1] != two[0].wrapping_add(1)) {
        Some(two) => failed(format!("after sample {} it answers {}", two[0], two[1])),
        None if answered.len() < 3 && last.is_some_and(|last| last != awaited) => {
            late(format!("sample {awaited} waits for its answer, and it answers sample {}", last.unwrap_or_default()))
        }
        None if answered.len() < 3 => late(format!("it answers {} samples in {}", answered.len(), ms(300 * MS))),
        None => Ok(()),
    }
}

/// A slow plant is not a fault.
pub(super) fn exciter_waits(t: &mut Tester) -> Result<(), Stop> {
    begin_with(t, Samples::Awaited)?;
    for _ in 0..2 {
        t.source.begin(Samples::Off);
        // Near the limit, but with room for a hold-up of the tester, which makes the pause longer than planned.
        if let Some((_, e)) = t.wait_for_emergency(LOCKSTEP_TIMEOUT_NS * 7 / 10)? {
            return failed(format!("it doesn't wait for the next sample: {e}"));
        }
        let from = t.heard.len();
        t.source.begin(Samples::Awaited);
        t.run_ns(MARGIN_NS)?;
        if commands(t, from).is_empty() {
            return late("it doesn't continue with the samples after a pause");
        }
    }
    Ok(())
}

/// A plant that is silent for a second is a fault.
pub(super) fn exciter_timeout(t: &mut Tester) -> Result<(), Stop> {
    begin_with(t, Samples::Awaited)?;
    t.source.begin(Samples::Off);
    let from = t.heard.len();
    times_out(t, t.source.sent_ns, EmergencyCode::SensorTimeout)?;
    match t.heard[from..].iter().filter(|heard| emergency(&heard.message).is_some()).count() {
        1 => Ok(()),
        n => failed(format!("it reports its fault {n} times")),
    }
}
