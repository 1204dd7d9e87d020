//! What the cases about an exciter do again and again: meet it, let it begin, read what it commands.

use alloc::vec::Vec;

use super::source::Samples;
use super::tester::{MS, Stop, Tester, inconclusive, is_state};
use crate::protocol::{Hello, Message, Node, NodeState, OperatorCommand, OperatorRequest};

/// Waits for an exciter and its hello; the tester then speaks at its rate.
pub(super) fn greet(t: &mut Tester) -> Result<Hello, Stop> {
    t.wait_for(t.settings.patience_ns, |message| matches!(message, Message::ExciterHello(_)))?;
    let Some(theirs) = t.last_hello() else {
        return inconclusive("no hello of an exciter came: is it on this bus, and started again after each case?");
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
    greet(t)?;
    t.boot()?;
    t.send_hello()?;
    t.source.obey_with(samples);
    // An exciter that was here before and was stopped meanwhile may still say that it is operational; it arms no more.
    let patience_ns = t.settings.patience_ns;
    if t.wait_for(patience_ns, is_arm)?.is_none() {
        return t.unready("it doesn't arm the plant: is it started again after each case?");
    }
    if t.wait_for_state(patience_ns, NodeState::Operational)?.is_none() {
        return t.unready("it doesn't become operational when the plant does");
    }
    t.run_ns(100 * MS)?;
    // Nor do its answers count.
    (t.source.unsent, t.source.wrong) = (None, None);
    Ok(())
}

fn is_arm(message: &Message) -> bool {
    matches!(message, Message::Operator(OperatorCommand { request: OperatorRequest::Arm, target: Node::Plant }))
}

/// The samples that were answered, from a place in the log on, until it boots: then it is another exciter.
pub(super) fn commands(t: &Tester, from: usize) -> Vec<u16> {
    let sample = |message: &Message| match message {
        Message::Force(command) => Some(command.sample),
        Message::Torque(command) => Some(command.sample),
        _ => None,
    };
    let until_boot = t.heard[from..].iter().take_while(|heard| !is_state(&heard.message, NodeState::BootUp));
    until_boot.filter_map(|heard| sample(&heard.message)).collect()
}
