//! Good and bad frames at random, for a time set: nothing bad acts, and nothing good is rejected.

use super::exciter_role::{begin, commands};
use super::plant_role::{drive, forces, period_ns};
use super::soak::Soak;
use super::source::{Answers, Samples};
use super::stop::{Stop, failed, late, skipped};
use super::tester::{Tester, emergency, is_state};
use super::times::{MARGIN_NS, MS, ms};
use super::tries::held_up_limit_ns;
use resonarm_protocol::timing::COMMAND_AGE_NS;
use resonarm_protocol::{EmergencyCode, NodeState};
use resonarm_session::run::Mode;

/// Interval of judging the log, ns.
const LOOK_NS: u64 = 100 * MS;

fn is_asked(t: &Tester) -> Result<(), Stop> {
    match t.settings.soak_ns {
        0 => skipped("no duration is given for it (--soak-s)"),
        _ => Ok(()),
    }
}

/// A plant accepts the good commands and no bad one. If a hold-up of the tester makes it fault, the soak starts over.
pub(super) fn plant(t: &mut Tester) -> Result<(), Stop> {
    is_asked(t)?;
    t.soak = Some(Soak::new(t.settings.seed));
    let mut left_ns = t.settings.soak_ns;
    while left_ns > 0 {
        drive(t)?;
        // A hold-up in an earlier round must not excuse a fault in this one.
        t.watch.held_up_ns = 0;
        // One sample more than the plant still accepts.
        let limit = i16::try_from(COMMAND_AGE_NS.div_ceil(period_ns(t)) + 1).unwrap_or(i16::MAX);
        t.answers = Answers::Soak(t.settings.force_n, limit);
        left_ns = left_ns.saturating_sub(soaked(t, left_ns)?);
    }
    let sent = t.soak.take().map_or_else(String::new, |soak| format!("{} good commands, {} bad", soak.good, soak.bad));
    t.note(sent);
    t.check_frames()
}

/// Soaks until the time is over, or the plant faults for lack of commands while the tester was held up; returns the
/// duration, ns.
fn soaked(t: &mut Tester, most_ns: u64) -> Result<u64, Stop> {
    let start_ns = t.now_ns();
    loop {
        let ran_ns = t.now_ns() - start_ns;
        if ran_ns >= most_ns {
            return Ok(ran_ns);
        }
        // Judged messages are dropped: a soak may take hours.
        t.heard.clear();
        t.run_ns(LOOK_NS.min(most_ns - ran_ns))?;
        if let Some((sample, read_n)) = forces(t, 0).find(|(_, read_n)| *read_n < -0.5 * t.settings.force_n) {
            return failed(format!("a bad command acts: the head reads {read_n:.2} N at sample {sample}"));
        }
        match t.heard.iter().find_map(|heard| emergency(&heard.message)) {
            Some(e)
                if e.code == EmergencyCode::CommandTimeout
                    && t.watch.held_up_ns > held_up_limit_ns(Mode::RealTime, t.tested) =>
            {
                return Ok(t.now_ns() - start_ns);
            }
            Some(e) => return failed(format!("it faults after {} of good commands: {e}", ms(t.now_ns() - start_ns))),
            None => {}
        }
    }
}

/// An exciter answers the good samples, each once, and no bad one.
pub(super) fn exciter(t: &mut Tester) -> Result<(), Stop> {
    is_asked(t)?;
    begin(t)?;
    t.heard.clear();
    t.soak = Some(Soak::new(t.settings.seed));
    t.source.samples = Samples::Soak;
    let end_ns = t.now_ns() + t.settings.soak_ns;
    while t.now_ns() < end_ns {
        t.run_ns(LOOK_NS)?;
        judge(t)?;
        t.heard.clear();
    }
    // Good samples alone at the end show that the exciter still works.
    t.source.samples = Samples::Steady;
    t.run_ns(2 * MARGIN_NS)?;
    judge(t)?;
    let sent = t.soak.take().map_or_else(String::new, |soak| format!("{} good samples, {} bad", soak.good, soak.bad));
    t.note(sent);
    t.check_frames()?;
    if commands(t, 0).is_empty() { late("after the bad samples it answers no good one") } else { Ok(()) }
}

fn judge(t: &Tester) -> Result<(), Stop> {
    if let Some(e) = t.heard.iter().find_map(|heard| emergency(&heard.message)) {
        return failed(format!("it faults: {e}"));
    }
    if t.heard.iter().any(|heard| is_state(&heard.message, NodeState::PreOperational)) {
        return failed("it ends");
    }
    match (t.source.wrong, t.source.unsent) {
        (Some(sample), _) => failed(format!("it answers sample {sample}, which was bad or has been answered")),
        (None, Some(sample)) => failed(format!("it answers sample {sample} before that is sent")),
        (None, None) => Ok(()),
    }
}
