//! Steps shared by the cases for an exciter: exchange hellos, let it begin, read its commands.

use super::counters::sample;
use super::source::Samples;
use super::stop::{Stop, inconclusive};
use super::tester::{Heard, Tester, is_state};
use super::times::MS;
use resonarm_protocol::{Hello, Message, MessageKind, Node, NodeState, OperatorCommand, OperatorRequest};

/// Waits for an exciter and its hello; the tester then uses its rate.
pub(super) fn exchange_hellos(t: &mut Tester) -> Result<Hello, Stop> {
    let give_up_ns = t.now_ns() + t.settings.patience_ns;
    while t.now_ns() < give_up_ns && !t.refuses(MessageKind::ExciterHello) {
        let within_ns = (give_up_ns - t.now_ns()).min(1000 * MS);
        if t.wait_for(within_ns, |message| matches!(message, Message::ExciterHello(_)))?.is_some() {
            break;
        }
    }
    let Some(theirs) = t.last_hello() else {
        let instead = t.traffic.in_place_of(MessageKind::ExciterHello);
        return inconclusive(format!(
            "no hello of an exciter was received: check that it is on this bus and restarted after each case. Received instead: {instead}"
        ));
    };
    t.hello = Hello::new(t.network.profile(), theirs.rate_hz);
    Ok(theirs)
}

/// Lets an exciter arm the tester, and waits until it is operational.
pub(super) fn begin(t: &mut Tester) -> Result<(), Stop> {
    begin_with(t, Samples::Steady)
}

/// The same with samples of another kind.
pub(super) fn begin_with(t: &mut Tester, samples: Samples) -> Result<(), Stop> {
    exchange_hellos(t)?;
    t.boot()?;
    t.send_hello()?;
    t.source.arm_with(samples);
    // An earlier exciter that was stopped may still say that it is operational, but it arms nothing more.
    let patience_ns = t.settings.patience_ns;
    if t.wait_for(patience_ns, is_arm)?.is_none() {
        return t.unready("it doesn't arm the plant: check that it is restarted after each case");
    }
    if t.wait_for_state(patience_ns, NodeState::Operational)?.is_none() {
        return t.unready("it doesn't become operational when the plant does");
    }
    t.run_ns(100 * MS)?;
    // Its answers don't count either.
    t.source.unsent = None;
    t.source.wrong = None;
    Ok(())
}

/// Whether a message asks the plant to arm.
pub(super) fn is_arm(message: &Message) -> bool {
    matches!(message, Message::Operator(OperatorCommand { request: OperatorRequest::Arm, target: Node::Plant }))
}

/// The samples answered from index `from` of the log on, until the exciter boots: then it is another one.
pub(super) fn commands(t: &Tester, from: usize) -> Vec<u16> {
    let heard = &t.heard[from..];
    let boot = heard.iter().position(|heard| is_state(&heard.message, NodeState::BootUp)).unwrap_or(heard.len());
    commands_of(&heard[..boot]).collect()
}

/// The samples that an exciter has answered: of its messages only commands have one.
pub(super) fn commands_of(heard: &[Heard]) -> impl Iterator<Item = u16> {
    heard.iter().filter_map(|heard| sample(&heard.message))
}
