//! Steps shared by the cases for a plant: exchange hellos, arm it, read its force.

use super::source::Answers;
use super::stop::{Stop, failed, inconclusive};
use super::tester::{Heard, Tester, emergency};
use super::times::{GONE_NS, MARGIN_NS, MS};
use resonarm_protocol::timing::{COMMAND_TIMEOUT_NS, HEARTBEAT_TIMEOUT_NS};
use resonarm_protocol::{
    Emergency, EmergencyCode, Hello, Message, MessageKind, NodeState, OperatorRequest, SensorPair, SensorValues, Trip,
};

/// The tester boots, and waits for the plant's hello.
pub(super) fn exchange_hellos(t: &mut Tester) -> Result<Hello, Stop> {
    let give_up_ns = t.now_ns() + t.settings.patience_ns;
    while t.now_ns() < give_up_ns && !t.refuses(MessageKind::PlantHello) {
        t.boot()?;
        t.send_hello()?;
        let heard =
            t.wait_for(t.settings.patience_ns.min(1000 * MS), |message| matches!(message, Message::PlantHello(_)))?;
        if let Some(Heard { message: Message::PlantHello(hello), .. }) = heard {
            // A new tester copies the plant's version and rate.
            t.hello = Hello::new(t.network.profile(), hello.rate_hz);
            t.send_hello()?;
            return Ok(hello);
        }
    }
    let instead = t.traffic.in_place_of(MessageKind::PlantHello);
    inconclusive(format!(
        "no hello of a plant was received: check that it is on this bus, with this base, these node ids and this profile. Received instead: {instead}"
    ))
}

/// Meets a plant and brings it to pre-operational, with no load.
pub(super) fn meet(t: &mut Tester) -> Result<(), Stop> {
    exchange_hellos(t)?;
    t.request(OperatorRequest::Reset)?;
    t.request(OperatorRequest::Disarm)?;
    if t.wait_for_state(HEARTBEAT_TIMEOUT_NS, NodeState::PreOperational)?.is_none() {
        return inconclusive(match t.last_state() {
            Some(NodeState::Fault) => "it stays in fault after a reset",
            _ => "no heartbeat pre-operational came after reset and disarm",
        });
    }
    t.run_ns(100 * MS)
}

/// Arms the plant; its samples are answered like this.
pub(super) fn arm(t: &mut Tester, answers: Answers) -> Result<(), Stop> {
    t.answers = answers;
    t.request(OperatorRequest::Arm)?;
    let word = t.wait_for(100 * MS + MARGIN_NS, |message| {
        emergency(message).is_some()
            || matches!(message, Message::Heartbeat(heartbeat) if heartbeat.state != NodeState::PreOperational)
    })?;
    match word.map(|heard| heard.message) {
        Some(Message::Heartbeat(heartbeat)) if heartbeat.state == NodeState::Operational => Ok(()),
        Some(Message::Emergency(emergency)) => inconclusive(format!("it won't be armed: {emergency}")),
        _ => t.unready("it doesn't answer the request to arm it"),
    }
}

/// Meets the plant, arms it, and holds the force for a while.
pub(super) fn drive(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    arm(t, Answers::Force(t.settings.force_n))?;
    hold(t)
}

/// Lets the plant hold its command for 60 ms, and at least 10 samples, by its own samples.
pub(super) fn hold(t: &mut Tester) -> Result<(), Stop> {
    let from = t.heard.len();
    run_samples(t, samples(t, 60 * MS).max(10))?;
    match t.heard[from..].iter().find_map(|heard| emergency(&heard.message)) {
        Some(emergency) => inconclusive(format!("it faults while it is answered: {emergency}")),
        None => Ok(()),
    }
}

/// Judges an emergency other than the required one. A trip at the travel is not the case's doing.
pub(super) fn instead<T>(e: &Emergency, when: &str) -> Result<T, Stop> {
    if (e.code, e.detail) == (EmergencyCode::ExciterTripped, Trip::Travel as u16) {
        return inconclusive(format!("{when} it reports: {e}; let the arm come to rest first, or use less --force-n"));
    }
    failed(format!("{when} it reports: {e}"))
}

/// Lets the plant make so many samples.
pub(super) fn run_samples(t: &mut Tester, n: u16) -> Result<(), Stop> {
    let from = t.heard.len();
    let period_ns = period_ns(t);
    // The samples are counted and not the time: a plant that is held up makes them later.
    let give_up_ns = t.now_ns() + u64::from(n) * period_ns + GONE_NS;
    while forces(t, from).count() < usize::from(n) {
        if t.now_ns() >= give_up_ns {
            return inconclusive(format!("only {} of {n} samples were received", forces(t, from).count()));
        }
        t.run_ns(period_ns)?;
    }
    Ok(())
}

pub(super) fn period_ns(t: &Tester) -> u64 {
    resonarm_protocol::timing::sample_period_ns(t.hello.rate_hz)
}

/// The number of samples in a time, rounded up.
pub(super) fn samples(t: &Tester, ns: u64) -> u16 {
    u16::try_from(ns.div_ceil(period_ns(t))).unwrap_or(u16::MAX)
}

/// The longest wait for a plant to fault for lack of commands, ns.
pub(super) fn timeout_ns(t: &Tester) -> u64 {
    COMMAND_TIMEOUT_NS + 4 * period_ns(t) + MARGIN_NS
}

/// The forces along x received from index `from` of the log on: index of the sample, N.
pub(super) fn forces(t: &Tester<'_>, from: usize) -> impl Iterator<Item = (u16, f64)> {
    t.heard[from..].iter().flat_map(|heard| {
        let along_x = |values: SensorValues| values.force_n[0].value;
        let [first, second] = match heard.message {
            Message::Head(head) => [Some((head.sample, head.force_x_n)), None],
            Message::Sensors(sensors) => [Some((sensors.sample, along_x(sensors.values))), None],
            Message::SensorPair(SensorPair { values: [first, second], sample }) => {
                [Some((sample, along_x(first))), Some((sample.wrapping_add(1), along_x(second)))]
            }
            _ => [None, None],
        };
        first.into_iter().chain(second)
    })
}
