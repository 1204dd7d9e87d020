//! Each message of a node has its own counter, which steps by 1.

use super::exciter_role;
use super::plant_role::meet;
use super::stop::{Stop, wrong};
use super::tester::{Tester, emergency};
use super::times::{MARGIN_NS, MS};
use resonarm_protocol::{Message, OperatorRequest};

/// Number of times that a node is made to send its rare messages.
const ROUNDS: u32 = 4;

/// Checks a plant, which is made to send hellos and to refuse to arm.
pub(super) fn plant(t: &mut Tester) -> Result<(), Stop> {
    meet(t)?;
    for _ in 0..ROUNDS {
        // After a boot the plant knows no hello, so that it rejects the request by an emergency.
        t.boot()?;
        t.request(OperatorRequest::Arm)?;
        t.wait_for(MARGIN_NS, |message| emergency(message).is_some())?;
        t.send_hello()?;
        t.wait_for(MARGIN_NS, |message| matches!(message, Message::PlantHello(_)))?;
    }
    t.run_ns(300 * MS)?;
    judge(t)
}

/// Checks an exciter, which is made to send hellos and to arm.
pub(super) fn exciter(t: &mut Tester) -> Result<(), Stop> {
    exciter_role::exchange_hellos(t)?;
    for _ in 0..ROUNDS {
        t.boot()?;
        t.send_hello()?;
        t.wait_for(MARGIN_NS, |message| matches!(message, Message::ExciterHello(_)))?;
    }
    exciter_role::begin(t)?;
    t.run_ns(300 * MS)?;
    judge(t)
}

fn judge(t: &mut Tester) -> Result<(), Stop> {
    if let Some(text) = t.counters.fault() {
        return wrong(text);
    }
    let [kinds, steps] = t.counters.counted();
    t.note(format!("{steps} steps of {kinds} messages"));
    Ok(())
}
