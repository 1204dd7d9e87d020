//! A bus that is lost, and may come back.

use super::signals::BusLoss;
use resonarm_bus::{BusError, ControllerState};

/// The time for which a run continues without its bus, ns: long enough for a controller's automatic restart, or for
/// plugging the cable in again.
const PATIENCE_NS: u64 = 10_000_000_000;

/// A time in which the bus is lost.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outage {
    since_ns: u64,
    /// Cause of the loss.
    pub cause: BusLoss,
    /// Whether a frame was received since.
    was_heard: bool,
}

impl Outage {
    /// Starts the outage with this error, from which the bus may recover.
    pub fn new(now_ns: u64, error: &BusError) -> Outage {
        Outage { since_ns: now_ns, cause: BusLoss::of(error), was_heard: false }
    }

    /// Notes that a frame was received.
    pub fn hear(&mut self) {
        self.was_heard = true;
    }

    /// Says whether the outage is over, now that the bus has accepted a frame. The kernel also accepts frames for a
    /// controller that is bus-off; not all controllers report that they are back, but then frames are received.
    pub fn is_over(&self, controller: ControllerState) -> bool {
        // A node that is bus-off neither sends nor receives (ISO 11898-1), so a frame from the bus proves that it is
        // back.
        controller != ControllerState::BusOff || self.was_heard
    }

    /// Says whether the outage has lasted too long.
    pub fn is_too_long(&self, now_ns: u64) -> bool {
        is_too_long(self.since_ns, now_ns)
    }
}

/// Says whether a run ends since it has missed its bus since then.
pub(super) fn is_too_long(since_ns: u64, now_ns: u64) -> bool {
    now_ns.saturating_sub(since_ns) > PATIENCE_NS
}
