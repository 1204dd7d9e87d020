//! What ends a run.

use super::bench::Bench;
use super::finish::EndedBy;
use super::signals::Signals;

/// Conditions that end a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Ending {
    /// Ends the run after this many samples.
    pub after_samples: Option<u64>,
    /// Ends the run when an armed plant is disarmed or faults.
    pub on_disarm: bool,
    /// Ends the run if nobody has armed the plant after this time, ns.
    pub patience_ns: Option<u64>,
}

impl Ending {
    /// Returns the cause that ends the run now, if any. The time is read only where it matters.
    pub fn reached(&self, bench: &Bench, signals: &Signals, now_ns: impl Fn() -> u64) -> Option<EndedBy> {
        if signals.is_stopped() {
            Some(EndedBy::Signal)
        } else if self.on_disarm && bench.has_left_armed() {
            Some(EndedBy::Disarm)
        } else if self.after_samples.is_some_and(|samples| bench.sample() >= samples) {
            Some(EndedBy::Duration)
        } else if !bench.was_armed()
            && (signals.has_exciter_ended() || self.patience_ns.is_some_and(|patience_ns| now_ns() >= patience_ns))
        {
            Some(EndedBy::Patience)
        } else {
            None
        }
    }
}
