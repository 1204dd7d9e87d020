//! Cases for a plant on a user protocol: the tester is the emulated exciter with a constant load.

use std::collections::BTreeMap;

use super::controller_cases::counted;
use super::end::End;
use super::monitor::Heard;
use super::protocol::UserWire;
use super::readings::{fault_within_ns, load_readings, load_within_ns, loads, says_state, state_within_ns};
use super::tester::{Alter, Tester};
use crate::stop::{Stop, failed, inconclusive, late, not_at_once, skipped, wrong};
use crate::times::{GONE_NS, MARGIN_NS, MS, ms};
use resonarm_bench::node::WireSpec;
use resonarm_bench::node::mapped::mapping::{Action, Incoming, Outgoing, Source, Trigger};
use resonarm_protocol::{EmergencyCode, Frame, FrameFormat, Id};

/// Time for which readings are counted, ns.
const WATCH_NS: u64 = 1500 * MS;
/// Time within which a load that is let go is zero, ns: the ramp takes 50 ms, and other plants may take longer.
const REST_NS: u64 = GONE_NS;
/// The tolerance of a load that a plant says to act, as a share of that commanded; as in the cases of Resonarm's
/// protocol.
const TOLERANCE: f64 = 0.2;
/// The tolerance of how often a message comes, as a share.
const RATE_TOLERANCE: f64 = 0.2;

/// Waits for a plant to send something.
pub(super) fn meet(t: &mut Tester) -> Result<(), Stop> {
    if t.wait_for(0, GONE_NS, |_| true)?.is_some() {
        return Ok(());
    }
    // One in lockstep, or whose readings are asked for, says nothing by itself.
    t.join()?;
    if t.wait_for(0, t.settings.patience_ns, |_| true)?.is_some() {
        return Ok(());
    }
    t.heard_nothing("plant", "")
}

/// Arms the plant, with zero load.
pub(super) fn arm(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    if is_armed_within(t, t.settings.patience_ns)? {
        return Ok(());
    }
    let patience = ms(t.settings.patience_ns);
    let said = said(t.heard());
    inconclusive(format!("asked to arm for {patience} it is not armed{said}"))
}

fn is_armed_within(t: &mut Tester, within_ns: u64) -> Result<bool, Stop> {
    if matches!(t.end, End::Listener) {
        t.join()?;
    }
    let give_up_ns = t.now_ns() + within_ns;
    loop {
        let left_ns = give_up_ns.saturating_sub(t.now_ns());
        if t.until(left_ns, |t| t.is_armed() || has_ended(t))? && t.is_armed() {
            return Ok(true);
        }
        if t.now_ns() >= give_up_ns {
            return Ok(false);
        }
        // A fault of before: it is reset, and armed anew.
        t.run_ns(20 * MS)?;
        let now_ns = t.now_ns();
        // An exciter whose work has ended otherwise than by a fault does not begin anew, and neither does the case.
        let begins_anew = if let End::Exciter(node) = &mut t.end { node.rearm(now_ns) } else { false };
        if !begins_anew {
            return Ok(false);
        }
    }
}

fn has_ended(t: &Tester) -> bool {
    matches!(&t.end, End::Exciter(node) if node.outcome().is_some())
}

/// The load of the cases, N or N·m.
pub(super) fn load_of(t: &Tester) -> f64 {
    if t.on.commands_torque() { t.settings.torque_nm } else { t.settings.force_n }
}

fn unit(t: &Tester) -> &'static str {
    if t.on.commands_torque() { "N m" } else { "N" }
}

/// Arms the plant and holds the load for a while.
pub(super) fn drive(t: &mut Tester) -> Result<(), Stop> {
    arm(t)?;
    t.command(load_of(t));
    hold(t)
}

/// Lets the plant hold its load until its readings say it.
pub(super) fn hold(t: &mut Tester) -> Result<(), Stop> {
    t.run_ns(load_within_ns(t))?;
    if t.is_armed() {
        return Ok(());
    }
    inconclusive(format!("it doesn't stay armed while it is commanded{}", said(t.heard())))
}

/// Returns what the plant reported last of its state and of a fault.
fn said(heard: &[Heard]) -> String {
    let state = heard.iter().rev().find_map(|heard| heard.says_state);
    let reason = heard.iter().rev().find_map(Heard::reason);
    match (state, reason) {
        (None, None) => String::new(),
        (state, reason) => {
            format!(": it says {}, reason {}", state.unwrap_or("no state"), reason.unwrap_or("none"))
        }
    }
}

fn readings(on: &UserWire) -> impl Iterator<Item = &Outgoing> {
    on.mapping().map_or(&[][..], |mapping| &mapping.outgoing).iter()
}

/// The first frame from `from` on that says a fault.
pub(super) fn judged_fault(t: &mut Tester, from: usize, since_ns: u64, within_ns: u64) -> Result<Option<Heard>, Stop> {
    let left_ns = (since_ns + within_ns).saturating_sub(t.now_ns());
    let heard = t.wait_for(from, left_ns, Heard::is_fault)?;
    if let Some(heard) = &heard {
        t.note(format!("fault after {}", ms(heard.at_ns.saturating_sub(since_ns))));
    }
    Ok(heard)
}

/// Every frame has its length, checksum and finite values.
pub(super) fn frames(t: &mut Tester) -> Result<(), Stop> {
    if t.wait_for(0, GONE_NS, |_| true)?.is_none() {
        meet(t)?;
    }
    if matches!(t.end, End::Listener) {
        t.join()?;
    }
    t.run_ns(WATCH_NS)?;
    if let Some(text) = t.monitor.refused() {
        return wrong(text);
    }
    if let Some(text) = unknown_state(t) {
        return wrong(text);
    }
    let count = t.heard().len();
    t.note(format!("{count} frames"));
    Ok(())
}

/// A number of a state that the mapping doesn't have.
fn unknown_state(t: &Tester) -> Option<String> {
    use resonarm_files::decoder::Meaning;
    t.heard().iter().filter(|heard| heard.is_taken()).find_map(|heard| {
        heard.message.signals.iter().find_map(|signal| {
            let is_unknown = signal.means.iter().any(|meaning| matches!(meaning, Meaning::State { name: None }));
            let value = signal.value.filter(|_| is_unknown)?;
            Some(format!("{} of {} is {value}: the mapping has no state for it", signal.name, heard.message.message))
        })
    })
}

/// The counters step by one.
pub(super) fn counters(t: &mut Tester) -> Result<(), Stop> {
    if !readings(t.on).any(|message| message.protection.counter.is_some()) {
        return skipped("no message of the plant has a counter");
    }
    meet(t)?;
    if matches!(t.end, End::Listener) {
        t.join()?;
    }
    t.run_ns(WATCH_NS)?;
    counted(t)
}

/// Each message comes as often as the mapping says.
pub(super) fn rates(t: &mut Tester) -> Result<(), Stop> {
    let on = t.on;
    let own = readings(on).filter(|message| message.trigger != Trigger::Sync);
    let due: Vec<(Id, u64)> = own.filter_map(|message| Some((message.id, on.sent_every_ns(message)?))).collect();
    // A message that comes less often than this can't be counted in the time.
    let due: Vec<(Id, u64)> = due.into_iter().filter(|(_, period_ns)| *period_ns <= WATCH_NS / 5).collect();
    if due.is_empty() {
        return skipped("no reading comes by itself at least every 300 ms");
    }
    meet(t)?;
    let from = t.mark();
    let start_ns = t.now_ns();
    t.run_ns(WATCH_NS)?;
    let watched_ns = t.now_ns() - start_ns;
    let mut counts: BTreeMap<Id, u64> = BTreeMap::new();
    t.heard()[from..].iter().for_each(|heard| *counts.entry(heard.id).or_default() += 1);
    for (id, period_ns) in due {
        let came = counts.get(&id).copied().unwrap_or(0) as f64;
        let expected = watched_ns as f64 / period_ns as f64;
        // The tolerance of the rate, a hold-up as long as the margin, and a frame at each end of the watch.
        let slack = RATE_TOLERANCE * expected + MARGIN_NS as f64 / period_ns as f64 + 2.0;
        if (came - expected).abs() > slack {
            return failed(format!(
                "{came} frames {id} came in {}, {expected:.0} are expected, one every {}",
                ms(watched_ns),
                ms(period_ns)
            ));
        }
        t.note(format!("{id} {:.1} a second", came * 1e9 / watched_ns as f64));
    }
    Ok(())
}

/// A message is sent when it is asked for.
pub(super) fn requests(t: &mut Tester) -> Result<(), Stop> {
    let asked: Vec<(Id, FrameFormat, bool)> = readings(t.on)
        .filter(|message| message.is_on_request || message.trigger == Trigger::Request)
        .map(|message| (message.id, message.format, message.trigger == Trigger::Request))
        .collect();
    if asked.is_empty() {
        return skipped("no reading is sent on request");
    }
    t.run_ns(100 * MS)?;
    let mut silent = Vec::new();
    // Those that come by themselves too would show nothing.
    let alone = asked.iter().filter(|(_, _, is_alone)| *is_alone);
    for (id, format, _) in alone.copied() {
        let from = t.mark();
        let Ok(frame) = Frame::new(id, format, &[]) else { continue };
        t.send(&frame)?;
        if t.wait_for(from, MARGIN_NS, |heard| heard.id == id)?.is_none() {
            silent.push(format!("{id}"));
        }
    }
    if t.heard().is_empty() {
        return t.heard_nothing("plant", "");
    }
    match silent.is_empty() {
        true => Ok(()),
        false => not_at_once(format!("asked for {}, it doesn't answer within {}", silent.join(", "), ms(MARGIN_NS))),
    }
}

/// The plant is armed by what the mapping says.
pub(super) fn arms(t: &mut Tester) -> Result<(), Stop> {
    if !says_state(t) {
        return skipped("no reading that is sent at least twice a second carries the plant's state");
    }
    meet(t)?;
    let start_ns = t.now_ns();
    if is_armed_within(t, t.settings.patience_ns)? {
        t.note(format!("after {}", ms(t.now_ns() - start_ns)));
        return Ok(());
    }
    if t.heard().iter().all(|heard| !heard.is_taken()) {
        return inconclusive(format!("no valid frame of the plant came: {}", t.monitor.in_words()));
    }
    failed(format!("asked to arm for {} it is not armed{}", ms(t.settings.patience_ns), said(t.heard())))
}

/// The loads that are commanded act, in both directions.
pub(super) fn commands_act(t: &mut Tester) -> Result<(), Stop> {
    let names = load_readings(t);
    if names.is_empty() {
        return skipped("no reading that is sent at least twice a second carries the acting load");
    }
    drive(t)?;
    // Both signs, since a plant that takes the magnitude, or clips at zero, would pass with one.
    for load in [load_of(t), -load_of(t)] {
        t.command(load);
        hold(t)?;
        let unit = unit(t);
        let Some((_, read)) = loads(t.heard(), &names).last() else {
            return late(format!("no frame says {}", names.join(" or ")));
        };
        if (read - load).abs() > TOLERANCE * load.abs() {
            return failed(format!("commanded {load} {unit}, it says {read:.3} {unit}"));
        }
    }
    Ok(())
}

/// Silence: fault after the timeout, and no load.
pub(super) fn command_timeout(t: &mut Tester) -> Result<(), Stop> {
    t.on.awaited_ns()?;
    if !says_state(t) {
        return skipped("no reading that is sent at least twice a second carries the plant's fault");
    }
    drive(t)?;
    t.alter = Alter::Mute;
    let from = t.mark();
    let since_ns = t.commanded_ns;
    let timeout_ns = t.on.timeout_ns();
    let within_ns = timeout_ns + fault_within_ns(t);
    let fault = match judged_fault(t, from, since_ns, within_ns)? {
        Some(heard) => heard,
        None => {
            let text = format!("no fault {} after the last command, the timeout is {}", ms(within_ns), ms(timeout_ns));
            return match judged_fault(t, from, since_ns, within_ns + GONE_NS)? {
                Some(_) => not_at_once(text),
                None => late(text),
            };
        }
    };
    let age_ns = fault.at_ns.saturating_sub(since_ns);
    if age_ns + 2 * t.on.period_ns() < timeout_ns {
        return failed(format!("it faults {} after the last command, the timeout is {}", ms(age_ns), ms(timeout_ns)));
    }
    let reason = t.heard()[from..].iter().find_map(|heard| heard.reason().filter(|reason| *reason != "none"));
    if let Some(reason) = reason.filter(|_| has_reason(t, EmergencyCode::CommandTimeout))
        && reason != "command-timeout"
    {
        return failed(format!("without commands the reason of its fault is {reason}, not command-timeout"));
    }
    rests(t)
}

/// Whether the mapping has a number for this fault.
fn has_reason(t: &Tester, code: EmergencyCode) -> bool {
    readings(t.on).flat_map(|message| &message.signals).any(|signal| match &signal.source {
        Source::Reason { codes, .. } => codes.iter().any(|(of, _)| *of == code),
        _ => false,
    })
}

/// The reported load becomes zero.
pub(super) fn rests(t: &mut Tester) -> Result<(), Stop> {
    let names = load_readings(t);
    let load = load_of(t);
    let unit = unit(t);
    if names.is_empty() {
        return Ok(());
    }
    t.run_ns(REST_NS)?;
    let from = t.mark();
    t.run_ns(load_within_ns(t))?;
    match loads(&t.heard()[from..], &names).last() {
        Some((_, read)) if read.abs() > TOLERANCE * load => {
            failed(format!("{} later it still says {read:.3} {unit}", ms(REST_NS)))
        }
        _ => Ok(()),
    }
}

/// Disarmed by what the mapping says, it is not armed, and no load acts.
pub(super) fn disarm(t: &mut Tester) -> Result<(), Stop> {
    if !says_state(t) && load_readings(t).is_empty() {
        return skipped("no reading that is sent at least twice a second carries the plant's state or the acting load");
    }
    drive(t)?;
    let now_ns = t.now_ns();
    let from = t.mark();
    if let End::Exciter(node) = &mut t.end {
        // Leaving disarms the plant by whatever the mapping says, and then commands no more.
        node.leave(now_ns);
    }
    let within_ns = state_within_ns(t);
    t.run_ns(within_ns)?;
    let last = t.heard()[from..].iter().rev().find(|heard| heard.says_state.is_some());
    if let Some(state) =
        last.and_then(|heard| heard.says_state).filter(|state| *state == "operational" || *state == "fault")
    {
        return failed(format!("{} after it was disarmed it says that it is {state}", ms(within_ns)));
    }
    rests(t)
}

/// A fault is reset by what the mapping says.
pub(super) fn reset(t: &mut Tester) -> Result<(), Stop> {
    t.on.awaited_ns()?;
    let resets = t.on.mapping().is_none_or(|mapping| asks(&mapping.incoming, Action::Reset));
    if !resets || !says_state(t) {
        return skipped("no message resets a fault, or no reading that is sent at least twice a second carries one");
    }
    arm(t)?;
    t.alter = Alter::Mute;
    let from = t.mark();
    let since_ns = t.commanded_ns;
    if judged_fault(t, from, since_ns, t.on.timeout_ns() + GONE_NS)?.is_none() {
        return inconclusive("without commands it doesn't fault: the case plant-command-timeout tests this");
    }
    // The load has come to rest.
    t.run_ns(MARGIN_NS)?;
    t.alter = Alter::Nothing;
    t.join()?;
    let start_ns = t.now_ns();
    match is_armed_within(t, t.settings.patience_ns)? {
        true => {
            t.note(format!("armed again after {}", ms(t.now_ns() - start_ns)));
            Ok(())
        }
        false => failed(format!("reset and asked to arm for {} it stays in fault", ms(t.settings.patience_ns))),
    }
}

fn asks(incoming: &[Incoming], wanted: Action) -> bool {
    incoming.iter().flat_map(|m| &m.events).flat_map(|e| &e.actions).any(|(_, action)| *action == wanted)
}

/// A message that stops makes it fault.
pub(super) fn stop(t: &mut Tester) -> Result<(), Stop> {
    let stops = t.on.mapping().is_some_and(|mapping| asks(&mapping.incoming, Action::Stop));
    if !stops || !says_state(t) {
        return skipped(
            "no message stops the plant, or no reading that is sent at least twice a second carries a fault",
        );
    }
    drive(t)?;
    let Some(frame) = t.sent.stop(t.on) else { return skipped("no frame can be made of what stops the plant") };
    let from = t.mark();
    let now_ns = t.now_ns();
    t.send(&frame)?;
    let within_ns = fault_within_ns(t);
    match judged_fault(t, from, now_ns, within_ns)? {
        Some(_) => rests(t),
        None => not_at_once(format!("asked to stop it says no fault within {}", ms(within_ns))),
    }
}

/// The nominal load of a user protocol in words, for reports.
pub(super) fn in_words(t: &Tester, load: f64) -> String {
    let of = match &t.on.spec {
        WireSpec::Mapped(_) => "says",
        WireSpec::Cia402(_) => "says in its torque actual value",
    };
    format!("{of} {load:.3} {}", unit(t))
}
