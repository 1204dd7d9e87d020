//! The deadlines of the nodes, as data.

use resonarm_protocol::timing;

/// How long a node waits for what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Longest time without a valid command (plant) or a sample (exciter) while armed, ns.
    pub command_timeout_ns: u64,
    /// Longest time without a sign of life of the partner while armed, ns.
    pub partner_timeout_ns: u64,
    /// Largest age of a command, ns of simulated time: how old the sample it answers may be.
    pub command_age_ns: u64,
    /// How long the load takes to go to zero after a fault or a disarm, ns of simulated time.
    pub ramp_ns: u64,
    /// Time between two heartbeats, ns.
    pub heartbeat_period_ns: u64,
    /// Time between two hellos, ns.
    pub hello_period_ns: u64,
}

impl Timing {
    /// The specification's times for a run in real time.
    pub const fn real_time() -> Timing {
        Timing {
            command_timeout_ns: timing::COMMAND_TIMEOUT_NS,
            partner_timeout_ns: timing::HEARTBEAT_TIMEOUT_NS,
            command_age_ns: timing::COMMAND_AGE_NS,
            ramp_ns: timing::FORCE_RAMP_NS,
            heartbeat_period_ns: timing::HEARTBEAT_PERIOD_NS,
            hello_period_ns: timing::HELLO_PERIOD_NS,
        }
    }

    /// The times for a run in lockstep, where each end waits up to `timeout_ns` for the other, and only a command that
    /// answers the very sample counts.
    pub const fn lockstep(timeout_ns: u64) -> Timing {
        Timing {
            command_timeout_ns: timeout_ns,
            partner_timeout_ns: timeout_ns,
            command_age_ns: 0,
            ..Timing::real_time()
        }
    }
}
