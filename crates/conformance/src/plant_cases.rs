//! Cases for a plant: samples, state table, times, commands that act.

use super::counters::sample;
use super::damage::Damage;
use super::plant_role::{arm, drive, exchange_hellos, forces, hold, instead, meet, run_samples, samples, timeout_ns};
use super::refusal_cases;
use super::source::Answers;
use super::stop::{Stop, failed, inconclusive, late, skipped};
use super::tester::{Tester, emergency, is_state, state_said};
use super::times::{MARGIN_NS, MS, ms};
use super::wire::Stopped;
use resonarm_protocol::timing::{COMMAND_TIMEOUT_NS, FORCE_RAMP_NS, HEARTBEAT_PERIOD_NS, HEARTBEAT_TIMEOUT_NS};
use resonarm_protocol::{
    EmergencyCode, Heartbeat, Hello, Message, MessageKind, Mismatch, Node, NodeState, OperatorCommand, OperatorRequest,
    Profile,
};

/// Delay with which a heartbeat that must be sent at once may come, by the plant's samples, ns: an adapter takes some
/// ms to pass a request on, and a plant without commands faults after this time.
const AT_ONCE_NS: u64 = COMMAND_TIMEOUT_NS;
/// Time for which a plant is stopped, ns: longer than any of its timeouts.
const STOP_NS: u64 = 400 * MS;

/// Every frame passes the protocol's checks; samples are complete and without a gap.
pub(super) fn frames(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    let from = t.heard.len();
    t.run_ns(300 * MS)?;
    t.check_frames()?;
    let kinds = [MessageKind::Head, MessageKind::AccelerometerB, MessageKind::AccelerometerC];
    let frame = |message: &Message| Some((message.kind(), sample(message)?));
    let frames: Vec<(MessageKind, u16)> = t.heard[from..].iter().filter_map(|heard| frame(&heard.message)).collect();
    let wanted: &[MessageKind] = match t.network.profile() {
        Profile::Classic => &kinds,
        Profile::Fd => &[MessageKind::Sensors],
    };
    // The log may begin in the middle of a sample, whose first frames are then missing.
    let Some(first) = frames.iter().position(|(kind, _)| *kind == wanted[0]) else {
        return late("no samples within 300 ms");
    };
    let start = frames[first].1;
    for (n, (kind, index)) in frames[first..].iter().enumerate() {
        let expected = (wanted[n % wanted.len()], start.wrapping_add((n / wanted.len()) as u16));
        if (*kind, *index) != expected {
            let (wanted, sample) = expected;
            return failed(format!("received {kind} with index {index}, expected {wanted} with index {sample}"));
        }
    }
    t.note(format!("{} frames", frames.len()));
    Ok(())
}

/// Without a hello that fits it does not arm, and states why.
pub(super) fn arms_for_a_hello(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    t.boot()?;
    refuses_to_arm(t, Mismatch::NoHello)?;
    let own = t.hello;
    let other = match own.profile {
        Profile::Classic => Profile::Fd,
        Profile::Fd => Profile::Classic,
    };
    let mut version = own.version;
    version.major += 1;
    // Of several mismatches the first in the order of version, profile, hash and rate is reported; the last two
    // hellos have two each.
    for (hello, mismatch) in [
        (Hello { version, ..own }, Mismatch::Version),
        (Hello { dbc_hash: own.dbc_hash ^ 1, ..own }, Mismatch::DbcHash),
        (Hello { profile: other, ..own }, Mismatch::Profile),
        (Hello { rate_hz: own.rate_hz ^ 1, ..own }, Mismatch::Rate),
        (Hello { rate_hz: own.rate_hz ^ 1, dbc_hash: own.dbc_hash ^ 1, ..own }, Mismatch::DbcHash),
        (Hello { profile: other, dbc_hash: own.dbc_hash ^ 1, ..own }, Mismatch::Profile),
    ] {
        t.hello = hello;
        t.send_hello()?;
        refuses_to_arm(t, mismatch)?;
    }
    Ok(())
}

fn refuses_to_arm(t: &mut Tester, mismatch: Mismatch) -> Result<(), Stop> {
    t.request(OperatorRequest::Arm)?;
    let word = t.wait_for(100 * MS + MARGIN_NS, |message| {
        emergency(message).is_some() || is_state(message, NodeState::Operational)
    })?;
    match word.and_then(|heard| emergency(&heard.message)) {
        Some(e) if (e.code, e.detail) == (EmergencyCode::Incompatible, mismatch as u16) => Ok(()),
        Some(e) => failed(format!("asked to arm ({mismatch}) it reports: {e}")),
        None if word.is_some() => failed(format!("it arms in spite of the mismatch: {mismatch}")),
        None => late(format!("asked to arm ({mismatch}) it says nothing within {}", ms(100 * MS + MARGIN_NS))),
    }
}

/// The table of states, by requests and by a fault of the exciter.
pub(super) fn states(t: &mut Tester) -> Result<(), Stop> {
    use NodeState::{Fault, Operational, PreOperational};
    use OperatorRequest::{Arm, Disarm, Reset};
    meet(t)?;
    stays(t, PreOperational, &[Disarm, Reset])?;
    arm(t, Answers::Force(0.0))?;
    stays(t, Operational, &[Arm, Reset])?;
    let from = t.heard.len();
    t.request(Disarm)?;
    becomes(t, PreOperational)?;
    at_once(t, from, &format!("its heartbeat {PreOperational} after the request"), PreOperational)?;
    let from = t.heard.len();
    t.request(Arm)?;
    becomes(t, Operational)?;
    at_once(t, from, &format!("its heartbeat {Operational} after the request"), Operational)?;
    t.send(&Message::Heartbeat(Heartbeat { node: Node::Exciter, state: Fault }))?;
    let from = t.heard.len();
    becomes(t, Fault)?;
    let Some(before) = t.heard[from..].iter().position(|heard| emergency(&heard.message).is_some()) else {
        return failed("the heartbeat fault comes without an emergency before it");
    };
    if t.heard[from..from + before].iter().any(|heard| is_state(&heard.message, Fault)) {
        return failed("the heartbeat fault comes before its emergency");
    }
    at_once(t, from + before, "its heartbeat fault after its emergency", Fault)?;
    stays(t, Fault, &[Arm, Disarm])
}

/// The plant follows a reset in fault, also if it is in fault from the beginning.
pub(super) fn reset(t: &mut Tester) -> Result<(), Stop> {
    use NodeState::{Fault, Operational, PreOperational};
    exchange_hellos(t)?;
    t.request(OperatorRequest::Disarm)?;
    t.run_ns(HEARTBEAT_TIMEOUT_NS)?;
    if t.last_state() == Some(Fault) {
        leaves_fault(t)?;
    }
    arm(t, Answers::Force(0.0))?;
    if t.last_state() == Some(Operational) {
        t.send(&Message::Heartbeat(Heartbeat { node: Node::Exciter, state: Fault }))?;
        becomes(t, Fault)?;
    }
    leaves_fault(t)?;
    t.run_ns(HEARTBEAT_PERIOD_NS + MARGIN_NS)?;
    match t.last_state() {
        Some(PreOperational) | None => Ok(()),
        Some(state) => failed(format!("after the reset it says that it is {state}")),
    }
}

fn leaves_fault(t: &mut Tester) -> Result<(), Stop> {
    t.request(OperatorRequest::Reset)?;
    let text = format!("in fault it ignores the reset: no heartbeat pre-operational within {}", ms(MARGIN_NS));
    t.expect_state(MARGIN_NS, NodeState::PreOperational, text)
}

fn becomes(t: &mut Tester, state: NodeState) -> Result<(), Stop> {
    t.expect_state(MARGIN_NS, state, format!("no heartbeat {state} within {}", ms(MARGIN_NS)))
}

/// The heartbeat of a state was sent at once after index `from` of the log: by the plant's samples, which stop when it
/// is stopped. A request takes some samples to arrive, and a plant that catches up makes 3 at once.
fn at_once(t: &mut Tester, from: usize, what: &str, state: NodeState) -> Result<(), Stop> {
    let before = t.heard[from..].iter().position(|heard| is_state(&heard.message, state)).unwrap_or(0);
    let late = t.heard[from..from + before].iter().filter(|heard| is_sample(&heard.message)).count();
    let most = usize::from(samples(t, AT_ONCE_NS) + 4);
    t.note(format!("{late} samples before its heartbeat {state}"));
    if late <= most {
        return Ok(());
    }
    // While the tester is held up, samples come that the plant sent before it had the request: they can't be told from
    // those that it sent in place of the heartbeat.
    let text = format!("{what} comes {late} samples late, not at once");
    if late > most + usize::from(samples(t, t.watch.held_up_ns)) { failed(text) } else { undecided(t, &text) }
}

/// Returns inconclusive: what was seen may be due to a hold-up of the tester.
fn undecided(t: &Tester, text: &str) -> Result<(), Stop> {
    inconclusive(format!("{text}; but the tester was held up for {}", ms(t.watch.held_up_ns)))
}

fn is_sample(message: &Message) -> bool {
    matches!(message, Message::Head(_) | Message::Sensors(_))
}

/// The plant ignores the frames of a network with another base.
pub(super) fn foreign_base(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    t.boot()?;
    t.send_at_other_base(&Message::ExciterHello(t.hello))?;
    refuses_to_arm(t, Mismatch::NoHello)?;
    t.send_hello()?;
    let arm = OperatorCommand { request: OperatorRequest::Arm, target: Node::Plant };
    t.send_at_other_base(&Message::Operator(arm))?;
    if t.wait_for_state(MARGIN_NS, NodeState::Operational)?.is_some() {
        return failed("it arms for a request with another base");
    }
    refusal_cases::damaged(t, Damage::Base)
}

/// Stopped for longer than its timeouts, it resumes its work.
pub(super) fn stopped(t: &mut Tester) -> Result<(), Stop> {
    drive(t)?;
    let from = t.heard.len();
    if let Stopped::Impossible(why) = t.wire.stop_node(STOP_NS) {
        return skipped(why);
    }
    t.run_ns(STOP_NS + 2 * MARGIN_NS)?;
    if let Some(e) = t.heard[from..].iter().find_map(|heard| emergency(&heard.message)) {
        return failed(format!("stopped for {} it takes its own silence for its partner's: {e}", ms(STOP_NS)));
    }
    match forces(t, from).last() {
        Some(_) => Ok(()),
        None => late("it doesn't resume after it was stopped"),
    }
}

fn stays(t: &mut Tester, state: NodeState, requests: &[OperatorRequest]) -> Result<(), Stop> {
    for request in requests {
        t.request(*request)?;
        let other = t.wait_for(MARGIN_NS, |message| state_said(message).is_some_and(|said| said != state))?;
        match other.and_then(|heard| state_said(&heard.message)) {
            Some(NodeState::Fault) if state == NodeState::Operational => {
                return inconclusive(format!("{state} it faults, perhaps not by the request {}", named(*request)));
            }
            Some(to) => {
                return failed(format!("in the state {state} the request {} makes it {to}", named(*request)));
            }
            None => {}
        }
    }
    Ok(())
}

/// The name of a request in SPEC.md.
const fn named(request: OperatorRequest) -> &'static str {
    match request {
        OperatorRequest::Arm => "arm",
        OperatorRequest::Disarm => "disarm",
        OperatorRequest::Reset => "reset",
    }
}

/// The head reads the commanded force, in both directions.
pub(super) fn commands_act(t: &mut Tester) -> Result<(), Stop> {
    drive(t)?;
    for force_n in [t.settings.force_n, -t.settings.force_n] {
        t.answers = Answers::Force(force_n);
        hold(t)?;
        let Some((sample, read_n)) = forces(t, 0).last() else { return failed("the head measures no force") };
        if (read_n - force_n).abs() > 0.2 * force_n.abs() {
            return failed(format!("commanded {force_n} N, the head reads {read_n:.2} N at sample {sample}"));
        }
    }
    Ok(())
}

/// No command acts before the plant is armed.
pub(super) fn not_armed(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    let from = t.heard.len();
    t.answers = Answers::Force(t.settings.force_n);
    t.run_ns(200 * MS)?;
    if t.heard[from..].iter().any(|heard| is_state(&heard.message, NodeState::Operational)) {
        return failed("it became operational without a request");
    }
    match forces(t, from).find(|(_, read_n)| read_n.abs() > 0.5 * t.settings.force_n) {
        Some((sample, read_n)) => failed(format!("not armed, the head reads {read_n:.2} N at sample {sample}")),
        None => Ok(()),
    }
}

/// Silence of the exciter: fault within 20 ms, zero within another 50 ms, by the plant's own samples.
pub(super) fn command_timeout(t: &mut Tester) -> Result<(), Stop> {
    drive(t)?;
    t.answers = Answers::None;
    let from = t.heard.len();
    let last = t.answered.unwrap_or(0);
    let text = format!("no emergency {} after the last command", ms(timeout_ns(t)));
    let (_, e) = t.expect_emergency(timeout_ns(t), EmergencyCode::CommandTimeout, text)?;
    if e.code != EmergencyCode::CommandTimeout {
        return instead(&e, "without commands");
    }
    let age = e.sample.wrapping_sub(last);
    let wanted = samples(t, COMMAND_TIMEOUT_NS);
    // A plant that catches up makes up to 3 samples at once; the last command may be late by the tester's hold-up.
    let most = wanted + 4;
    let text = format!("it faults {age} samples after the last command, not {wanted} to {most}");
    if age + 1 < wanted || age > most + samples(t, t.watch.held_up_ns) {
        return failed(text);
    }
    if age > most {
        return undecided(t, &text);
    }
    t.note(format!("fault after {age} samples"));
    becomes_fault(t, from)?;
    ramps(t, from, e.sample)
}

pub(super) fn becomes_fault(t: &mut Tester, from: usize) -> Result<(), Stop> {
    run_samples(t, samples(t, 2 * FORCE_RAMP_NS))?;
    match t.heard[from..].iter().any(|heard| is_state(&heard.message, NodeState::Fault)) {
        true => Ok(()),
        false => late("no heartbeat fault after its emergency"),
    }
}

/// The load held goes to zero in equal steps when the plant is disarmed.
pub(super) fn disarm(t: &mut Tester) -> Result<(), Stop> {
    drive(t)?;
    let from = t.heard.len();
    t.request(OperatorRequest::Disarm)?;
    becomes(t, NodeState::PreOperational)?;
    let Some((left_at, _)) = forces(t, from.saturating_sub(20)).last() else {
        return failed("the head measures no force");
    };
    run_samples(t, samples(t, 2 * FORCE_RAMP_NS))?;
    ramps(t, from, left_at)
}

/// The ramp from the sample at which the plant left operational.
pub(super) fn ramps(t: &mut Tester, from: usize, left_at: u16) -> Result<(), Stop> {
    let force_n = t.settings.force_n;
    let steps = samples(t, FORCE_RAMP_NS);
    // On the wire, the end of operational is known to a few samples.
    let slack_n = force_n * (0.15 + 3.0 / f64::from(steps));
    let mut after = 0;
    for (sample, read_n) in forces(t, from) {
        let n = sample.wrapping_sub(left_at);
        // Beyond half of the range the sample is one from before.
        if n == 0 || n > 0x8000 {
            continue;
        }
        after = after.max(n);
        let wanted_n = force_n * f64::from(steps.saturating_sub(n)) / f64::from(steps);
        if (read_n - wanted_n).abs() > slack_n {
            return failed(format!(
                "{n} samples after it left operational the head reads {read_n:.2} N, not {wanted_n:.2} N as a ramp of \
                 {steps} samples from {force_n} N has"
            ));
        }
    }
    if after < steps + 2 { inconclusive(format!("only {after} samples of the ramp were received")) } else { Ok(()) }
}

/// A fault and a boot of the exciter are faults of an operational plant.
pub(super) fn partner_fault(t: &mut Tester) -> Result<(), Stop> {
    for state in [NodeState::Fault, NodeState::BootUp] {
        meet(t)?;
        arm(t, Answers::Force(0.0))?;
        t.send(&Message::Heartbeat(Heartbeat { node: Node::Exciter, state }))?;
        let text = format!("no emergency after the exciter's heartbeat {state}");
        let (_, e) = t.expect_emergency(MARGIN_NS, EmergencyCode::PartnerFault, text)?;
        if e.code != EmergencyCode::PartnerFault {
            return instead(&e, &format!("after the exciter's heartbeat {state}"));
        }
        if t.wait_for_emergency(HEARTBEAT_TIMEOUT_NS)?.is_some() {
            return failed("it reports its fault more than once");
        }
    }
    Ok(())
}

/// The exciter leaves: the plant disarms, and forgets its hello.
pub(super) fn exciter_leaves(t: &mut Tester) -> Result<(), Stop> {
    drive(t)?;
    t.is_alive = false;
    t.send_emergency(EmergencyCode::Leaving, 0)?;
    let word = t.wait_for(MARGIN_NS, |message| {
        is_state(message, NodeState::PreOperational) || is_state(message, NodeState::Fault)
    })?;
    match word {
        Some(heard) if is_state(&heard.message, NodeState::PreOperational) => {}
        Some(_) => return failed("it faults when the exciter leaves"),
        None => return late("it isn't disarmed when the exciter leaves"),
    }
    refuses_to_arm(t, Mismatch::NoHello)
}

/// Another node with the plant's identifiers.
pub(super) fn second_sender(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    let hello = Message::PlantHello(t.hello);
    let Ok(frame) = t.stranger().frame(&hello) else { return inconclusive("the tester can't make a hello") };
    t.send_frame(&frame)?;
    let identifier = MessageKind::PlantHello.id(t.network);
    let text = "it ignores its own hello from another node";
    match t.expect_emergency(MARGIN_NS, EmergencyCode::SecondSender, text)? {
        (_, e) if (e.code, e.detail) == (EmergencyCode::SecondSender, identifier) => Ok(()),
        (_, e) => failed(format!("hearing its own hello from another node it reports: {e}")),
    }
}
