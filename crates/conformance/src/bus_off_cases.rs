//! A node whose CAN controller is bus-off for a while.

use super::exciter_role::{begin, commands};
use super::plant_role::drive;
use super::stop::{Stop, failed, skipped};
use super::tester::{Tester, is_state};
use super::times::{MARGIN_NS, MS};
use super::wire::BusOff;
use resonarm_protocol::{EmergencyCode, NodeState};

/// Time for which the node is off the bus, ns: within the timeouts of a silent partner.
const OFF_NS: u64 = 100 * MS;

/// An operational plant faults.
pub(super) fn plant(t: &mut Tester) -> Result<(), Stop> {
    drive(t)?;
    lose(t).map(|_| ())
}

/// An operational exciter faults, and commands nothing more.
pub(super) fn exciter(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    let fault = lose(t)?;
    match commands(t, fault).first() {
        Some(sample) => failed(format!("it commands for sample {sample} after its heartbeat fault")),
        None => Ok(()),
    }
}

/// Takes the node off the bus; once back, it must report that and be in fault. Returns the index of its heartbeat in
/// the log.
fn lose(t: &mut Tester) -> Result<usize, Stop> {
    if t.wire.take_off(OFF_NS) == BusOff::Impossible {
        return skipped("only its own controller can go bus-off: no frame on this bus can cause it");
    }
    let from = t.heard.len();
    match t.wait_for_emergency(OFF_NS + 2 * MARGIN_NS)? {
        Some((_, e)) if e.code == EmergencyCode::BusLoss => {}
        Some((_, e)) => return failed(format!("after its controller was bus-off it reports: {e}")),
        None => return failed("its controller was bus-off, and it says nothing of it"),
    }
    t.run_ns(MARGIN_NS)?;
    match t.heard[from..].iter().position(|heard| is_state(&heard.message, NodeState::Fault)) {
        Some(place) => Ok(from + place),
        None => failed("no heartbeat fault after its emergency"),
    }
}
