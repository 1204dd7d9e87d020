//! The end of a bounded wait: the only place where this crate reads a clock.

use core::time::Duration;
use std::time::Instant;

/// End of a wait, on the monotonic clock.
pub struct Deadline {
    /// `None` is never: beyond what the clock can express.
    end: Option<Instant>,
}

impl Deadline {
    /// Returns the deadline that is `timeout` from now.
    #[allow(clippy::disallowed_methods, reason = "a wait is bounded in real time whatever time the simulation has")]
    pub fn after(timeout: Duration) -> Deadline {
        Deadline { end: Instant::now().checked_add(timeout) }
    }

    /// The time left, for a system call that takes a relative timeout; zero once it has passed.
    #[allow(clippy::disallowed_methods, reason = "see `after`")]
    pub fn remaining(&self) -> Duration {
        match self.end {
            Some(end) => end.saturating_duration_since(Instant::now()),
            None => Duration::MAX,
        }
    }
}
