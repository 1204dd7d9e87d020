//! The deadlines of the nodes.

use crate::timing;

/// A node's periods and timeouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Longest time listened without a valid command while armed (plant), or with frames waiting of which none can be
    /// sent (both), ns.
    pub command_timeout_ns: u64,
    /// Longest time listened without the partner's heartbeat, or without a whole sample (exciter), while armed,
    /// ns.
    pub partner_timeout_ns: u64,
    /// The most that counts as listened between two looks at the clock, ns. A node with running timeouts asks to be
    /// called at least this often.
    pub look_period_ns: u64,
    /// Largest age of a command, ns of simulated time: the age of the sample it answers.
    pub command_age_ns: u64,
    /// Time in which the load goes to zero after a fault or a disarm, ns of simulated time.
    pub ramp_ns: u64,
    /// Longest time between two heartbeats, ns.
    pub heartbeat_period_ns: u64,
    /// Longest time between two hellos, ns.
    pub hello_period_ns: u64,
}

impl Timing {
    /// The specification's times for a run in real time with `rate_hz` samples a second. A look period is one sample
    /// period.
    pub const fn real_time(rate_hz: u16) -> Timing {
        Timing {
            command_timeout_ns: timing::COMMAND_TIMEOUT_NS,
            partner_timeout_ns: timing::HEARTBEAT_TIMEOUT_NS,
            look_period_ns: timing::sample_period_ns(rate_hz),
            command_age_ns: timing::COMMAND_AGE_NS,
            ramp_ns: timing::FORCE_RAMP_NS,
            heartbeat_period_ns: timing::HEARTBEAT_PERIOD_NS,
            hello_period_ns: timing::HELLO_PERIOD_NS,
        }
    }

    /// The times for a run in lockstep, where each node waits up to `timeout_ns` for the other, and only a command that
    /// answers this very sample counts.
    pub const fn lockstep(timeout_ns: u64) -> Timing {
        Timing {
            command_timeout_ns: timeout_ns,
            partner_timeout_ns: timeout_ns,
            look_period_ns: timing::LOCKSTEP_LOOK_NS,
            command_age_ns: 0,
            ramp_ns: timing::FORCE_RAMP_NS,
            heartbeat_period_ns: timing::HEARTBEAT_PERIOD_NS,
            hello_period_ns: timing::HELLO_PERIOD_NS,
        }
    }

    /// Returns the time to send a message that is due at least every `period_ns`: two look periods early, so that a
    /// node that acts only at its ticks, and a little late, stays within the period.
    pub(super) const fn early(&self, period_ns: u64) -> u64 {
        let margin_ns = self.look_period_ns.saturating_mul(2);
        // Not before half of the period: for heartbeats that is 20 a second, the most that allows.
        let least_ns = period_ns / 2;
        let early_ns = period_ns.saturating_sub(margin_ns);
        if early_ns > least_ns { early_ns } else { least_ns }
    }
}
