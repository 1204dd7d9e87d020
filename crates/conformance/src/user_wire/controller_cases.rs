//! Cases for a controller on its own protocol, in real time and in lockstep: the tester is the scenario's plant.

use std::collections::BTreeMap;

use super::end::End;
use super::monitor::Heard;
use super::readings::said_every_ns;
use super::tester::Tester;
use crate::stop::{Stop, failed, inconclusive, skipped, wrong};
use crate::times::{GONE_NS, MARGIN_NS, MS, ms};
use resonarm_bench::node::mapped::mapping::{Arming, Source};
use resonarm_protocol::{Emergency, EmergencyCode, NodeState, OperatorRequest, Refusal};
use resonarm_scenario::wire::PresetSpec;

/// Time for which commands are observed, ns, beyond the time for which they are valid.
const WATCH_NS: u64 = 1000 * MS;
/// A load below this share of the exciter's limits counts as zero: a signal may have no value that is exactly zero.
const NEARLY_ZERO: f64 = 1e-3;
/// Time within which a controller that has heard that the plant is not armed any more reacts, ns: the mapping has no
/// time for it, so this is longer than any that does its work takes.
const REACTION_NS: u64 = GONE_NS;

/// Waits for a controller to send something.
fn meet(t: &mut Tester) -> Result<(), Stop> {
    if t.wait_for(0, t.settings.patience_ns, |_| true)?.is_some() {
        return Ok(());
    }
    t.heard_nothing("controller", " and restarted after each case")
}

/// Waits until the controller has armed the plant; where only an operator does, the tester does it.
fn await_arming(t: &mut Tester) -> Result<bool, Stop> {
    meet(t)?;
    if t.on.arming() == Arming::Operator {
        let now_ns = t.now_ns();
        t.plant()?.node.execute(now_ns, OperatorRequest::Arm);
    }
    t.until(t.settings.patience_ns, |t| t.is_armed())
}

/// Lets a controller arm the plant.
pub(super) fn begin(t: &mut Tester) -> Result<(), Stop> {
    match await_arming(t)? {
        true => Ok(()),
        false => inconclusive(not_armed(t)),
    }
}

/// The controller arms the plant as the mapping says.
pub(super) fn arms(t: &mut Tester) -> Result<(), Stop> {
    if t.on.arming() == Arming::Operator {
        return skipped("the plant is armed by its operator (arm = \"operator\")");
    }
    let start_ns = t.now_ns();
    if await_arming(t)? {
        t.note(format!("after {}", ms(t.now_ns() - start_ns)));
        return Ok(());
    }
    failed(not_armed(t))
}

/// Describes that the controller has not armed the plant, and what it does instead.
fn not_armed(t: &Tester) -> String {
    let asks = |action| t.heard().iter().filter(|heard| heard.asks(action)).count();
    let arm = asks("arm");
    let reset = asks("reset");
    let came = t.monitor.in_words();
    let how = match (t.on.arming(), t.on.preset) {
        (Arming::ZeroCommand, _) => String::from("no command of all messages was nearly zero at first"),
        (_, Some(PresetSpec::Cia402)) => format!("the last controlword is {}", controlword(t)),
        _ => format!("{arm} requests to arm and {reset} to reset came"),
    };
    format!("it doesn't arm the plant within {}: {how}; heard: {came}", ms(t.settings.patience_ns))
}

fn controlword(t: &Tester) -> String {
    let last = t.heard().iter().rev().find_map(|heard| heard.signal("Controlword"));
    last.map_or_else(|| String::from("none"), |word| format!("{:#06x}", word as u16))
}

/// Every frame has its length, its checksum and finite values.
pub(super) fn frames(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    t.until(t.settings.patience_ns, |t| t.is_armed() || t.monitor.refused().is_some())?;
    t.run_ns(WATCH_NS)?;
    if let Some(text) = t.monitor.refused() {
        return wrong(text);
    }
    let count = t.heard().len();
    t.note(format!("{count} frames"));
    Ok(())
}

/// The counters step by one.
pub(super) fn counters(t: &mut Tester) -> Result<(), Stop> {
    let mapping = t.on.mapping();
    if !mapping.is_some_and(|mapping| mapping.incoming.iter().any(|message| message.protection.counter.is_some())) {
        return skipped("no message of the controller has a counter");
    }
    meet(t)?;
    t.until(t.settings.patience_ns, |t| t.is_armed() || t.monitor.counter_fault().is_some())?;
    t.run_ns(WATCH_NS)?;
    counted(t)
}

/// The verdict on the counters of the frames so far.
pub(super) fn counted(t: &mut Tester) -> Result<(), Stop> {
    match (t.monitor.counter_fault(), t.monitor.counted()) {
        (Some(text), _) => wrong(text),
        (None, (0 | 1, _)) => inconclusive("no two frames with a counter came"),
        (None, (frames, messages)) => {
            t.note(format!("{frames} frames of {messages} messages"));
            Ok(())
        }
    }
}

/// While the plant is armed the loads come in time.
pub(super) fn in_time(t: &mut Tester) -> Result<(), Stop> {
    let watch_ns = WATCH_NS + t.on.awaited_ns()?;
    begin(t)?;
    let from = t.mark();
    t.until(watch_ns, |t| !t.is_armed())?;
    let gaps = gaps(&t.heard()[from..], t.now_ns());
    match fault(t)? {
        Some(emergency) if emergency.code == EmergencyCode::CommandTimeout => {
            let what = why(&emergency);
            let later = ms(MARGIN_NS);
            return failed(format!("{what}, and {later} more; {gaps}"));
        }
        Some(emergency) => return inconclusive(format!("the plant of the tester faults: {emergency}")),
        None => {}
    }
    // A time between two commands needs two of them.
    if t.heard()[from..].iter().filter(|heard| heard.loads().next().is_some()).count() < 2 {
        return inconclusive("it disarmed the plant before two commands came");
    }
    t.note(gaps);
    Ok(())
}

/// The latched fault of the tester's plant.
pub(super) fn fault(t: &mut Tester) -> Result<Option<Emergency>, Stop> {
    Ok(t.plant()?.node.latched_fault())
}

/// A fault of the tester's plant in words.
pub(super) fn why(emergency: &Emergency) -> String {
    let refused = Refusal::ALL.into_iter().find(|refusal| *refusal as u16 == emergency.detail >> 8);
    match (emergency.code, refused) {
        (EmergencyCode::CommandTimeout, Some(refusal)) => {
            format!(
                "no command was accepted in time, {} were rejected, the last one as {refusal}",
                emergency.detail & 0xFF
            )
        }
        (EmergencyCode::CommandTimeout, None) => String::from("no command came in time"),
        _ => emergency.to_string(),
    }
}

/// The longest times between two frames with loads, and from the last to `end_ns`, in words.
fn gaps(heard: &[Heard], end_ns: u64) -> String {
    let mut last: BTreeMap<&str, (u64, u64)> = BTreeMap::new();
    for heard in heard.iter().filter(|heard| heard.loads().next().is_some()) {
        let (before_ns, longest_ns) = last.entry(&heard.message.message).or_insert((heard.at_ns, 0));
        (*before_ns, *longest_ns) = (heard.at_ns, (*longest_ns).max(heard.at_ns - *before_ns));
    }
    let in_words = |(message, (before_ns, longest_ns)): (&str, (u64, u64))| {
        format!("{message} at the longest {} apart", ms(longest_ns.max(end_ns - before_ns)))
    };
    let texts = last.into_iter().map(in_words).collect::<Vec<_>>().join(", ");
    if texts.is_empty() { String::from("no frame with a load came") } else { texts }
}

/// The controller commands no load before it arms the plant.
pub(super) fn before_arming(t: &mut Tester) -> Result<(), Stop> {
    match (t.on.preset, t.on.arming()) {
        (Some(PresetSpec::Odrive), _) => {
            return skipped("an ODrive may be given its torque before the loop is closed");
        }
        (_, Arming::Operator) => return skipped("an operator arms the plant, and the controller need not know when"),
        _ => {}
    }
    let start_ns = t.now_ns();
    begin(t)?;
    let limits = t.plant()?.limits();
    let early = t.heard().iter().find(|heard| heard.state != NodeState::Operational && has_load(heard, limits));
    match early {
        Some(heard) if heard.at_ns - start_ns < MARGIN_NS => inconclusive(
            "a controller was already at work when the case began: check that it is restarted after each case",
        ),
        Some(heard) => failed(format!("{} before it has armed the plant", commanded(heard))),
        None => Ok(()),
    }
}

/// Whether a frame commands a load beyond a thousandth of the limits, N and N·m.
fn has_load(heard: &Heard, (force_n, torque_nm): (f64, f64)) -> bool {
    let limit = |unit| if unit == "N" { force_n } else { torque_nm };
    heard.loads().any(|(_, value, unit)| value.abs() > NEARLY_ZERO * limit(unit))
}

fn commanded(heard: &Heard) -> String {
    let parts = heard.loads().map(|(name, value, unit)| format!("{name} {value:.3} {unit}"));
    format!("{} commands {}", heard.message.message, parts.collect::<Vec<_>>().join(", "))
}

/// The loads that the controller commands while the plant is armed act: all conditions are fulfilled.
pub(super) fn acts(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    let from = t.mark();
    let limits = t.plant()?.limits();
    let patience_ns = t.settings.patience_ns;
    // A ramp begins with loads that are nearly zero, and these show nothing.
    let is_load = |heard: &Heard| has_load(heard, limits);
    let ends = |heard: &Heard| heard.state != NodeState::Operational;
    let first = t.wait_for(from, patience_ns, |heard| is_load(heard) || ends(heard))?;
    let Some(first) = first.filter(is_load) else { return inconclusive("it commands nothing but zero") };
    t.until(REACTION_NS, |t| has_acted(t) || !t.is_armed())?;
    if has_acted(t) {
        return Ok(());
    }
    let refusals = t.plant()?.node.refusals();
    let refused =
        refusals.iter().filter(|(_, count)| *count > 0).map(|(refusal, count)| format!("{count} as {refusal}"));
    let refused = refused.collect::<Vec<_>>().join(", ");
    let refused = if refused.is_empty() { String::from("none was rejected") } else { format!("rejected: {refused}") };
    let hint = match t.on.preset {
        None => "are the values that `require` names sent?",
        Some(PresetSpec::Odrive) => "is the controller mode that of torques, passed through?",
        Some(PresetSpec::Cia402) => "is the mode of operation 10, and halt (bit 8 of the controlword) off?",
    };
    failed(format!("{}, and none acts; {refused}; {hint}", commanded(&first)))
}

fn has_acted(t: &Tester) -> bool {
    matches!(&t.end, End::Plant(plant) if plant.has_acted)
}

/// No load is beyond the exciter's limits.
pub(super) fn limits(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    t.until(WATCH_NS, |t| !t.is_armed())?;
    let beyond = match &t.end {
        End::Plant(plant) => plant.loads_beyond_limits(t.heard()),
        End::Listener | End::Exciter(_) => None,
    };
    if let Some(text) = beyond {
        return wrong(text);
    }
    let (force_n, torque_nm) = t.plant()?.limits();
    t.note(format!("within {force_n} N, {torque_nm} N m"));
    Ok(())
}

/// The plant faults, or is disarmed by its operator: the controller commands no more, or resets the fault, or arms the
/// plant anew, by what the mapping says.
pub(super) fn stops_once(t: &mut Tester, state: NodeState) -> Result<(), Stop> {
    let Some(said_every_ns) = said_every(t, state) else {
        let state = in_words(state);
        return skipped(format!("no reading that is sent at least twice a second says that the plant is {state}"));
    };
    let reacts_ns = REACTION_NS + said_every_ns;
    begin(t)?;
    t.run_ns(MARGIN_NS)?;
    if !t.is_armed() {
        return inconclusive("it disarmed the plant before the case could");
    }
    let now_ns = t.now_ns();
    let limits = t.plant()?.limits();
    match state {
        NodeState::Fault => t.plant()?.node.fault(now_ns, EmergencyCode::Overrun, 1),
        _ => t.plant()?.node.execute(now_ns, OperatorRequest::Disarm),
    }
    t.until(reacts_ns, |t| t.end.state() != state)?;
    if t.end.state() != state {
        let to = t.end.state();
        t.note(format!("it brings the plant to {to} after {}", ms(t.now_ns() - now_ns)));
        return Ok(());
    }
    let from = t.mark();
    // Past the time from which a command is certain, below.
    t.run_ns(WATCH_NS / 2 + 2 * t.watch.held_up_ns)?;
    let still = || t.heard()[from..].iter().filter(|heard| heard.state == state && has_load(heard, limits));
    let text = |heard: &Heard| {
        let what = commanded(heard);
        let since = ms(heard.at_ns - now_ns);
        format!("{what}, and the plant is {} for {since}", in_words(state))
    };
    // A hold-up of the tester delays its state by as much, and the time at which it hears a command.
    let certain_ns = now_ns + reacts_ns + 2 * t.watch.held_up_ns;
    match (still().find(|heard| heard.at_ns > certain_ns), still().next()) {
        (Some(heard), _) => wrong(text(heard)),
        (None, Some(heard)) => failed(text(heard)),
        (None, None) => Ok(()),
    }
}

/// A state in which the plant is not armed.
const fn in_words(state: NodeState) -> &'static str {
    match state {
        NodeState::Fault => "in fault",
        NodeState::BootUp | NodeState::PreOperational | NodeState::Operational => "disarmed",
    }
}

/// Returns the period of a reading that distinguishes this state, or a fault, from operational, ns; `None`: none does.
fn said_every(t: &Tester, state: NodeState) -> Option<u64> {
    let distinguishes = |source: &Source| match source {
        Source::State([_, idle, armed, fault]) => {
            let said = if state == NodeState::Fault { fault } else { idle };
            (said - armed).abs() > 0.0
        }
        Source::Reason { .. } => state == NodeState::Fault,
        Source::Value { .. } | Source::Sample { .. } => false,
    };
    if t.on.mapping().is_none() { Some(0) } else { said_every_ns(t.on, distinguishes) }
}
