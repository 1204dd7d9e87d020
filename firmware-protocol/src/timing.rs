//! Periods, timeouts and limits, in nanoseconds unless the name says otherwise. `SPEC.md` says which node applies them.

/// Every node sends its heartbeat at least this often, and at once when its state changes.
pub const HEARTBEAT_PERIOD_NS: u64 = 100_000_000;

/// Timeout of the partner's heartbeat in real time, in time listened: three heartbeats and half a period.
pub const HEARTBEAT_TIMEOUT_NS: u64 = 350_000_000;

/// Every node sends its hello at least this often, when it boots, and in answer to the first hello of a partner that
/// has booted.
pub const HELLO_PERIOD_NS: u64 = 1_000_000_000;

/// Timeout of commands in real time, in time listened: an operational plant without a valid command for this long has
/// lost its controller, and an operational node that could not send any of its frames for this long has lost the bus.
pub const COMMAND_TIMEOUT_NS: u64 = 20_000_000;

/// Largest age of a command in real time: a command that answers a sample older than this is rejected as late.
pub const COMMAND_AGE_NS: u64 = COMMAND_TIMEOUT_NS;

/// Time in which the load held goes linearly to zero when the plant leaves the state operational, by a fault or
/// disarmed.
pub const FORCE_RAMP_NS: u64 = 50_000_000;

/// Time for which each node waits for the other in lockstep, in time listened. It replaces all other timeouts.
pub const LOCKSTEP_TIMEOUT_NS: u64 = 1_000_000_000;

/// The lowest sample rate, in Hz, that a real-time run can have: two sample periods in [`COMMAND_TIMEOUT_NS`].
pub const REAL_TIME_RATE_MIN_HZ: u16 = 100;

/// Longest time that counts as listened between two looks at the clock in lockstep. In real time it is a sample period.
pub const LOCKSTEP_LOOK_NS: u64 = 20_000_000;

/// Number of samples with a repeated or older index that make the exciter fault, counted from arming.
pub const STALE_SAMPLES_LIMIT: u64 = 10;

/// The smallest [`sample_window`], in samples.
pub const SAMPLE_WINDOW_MIN: u16 = 16;

/// A sample period, rounded down.
pub const fn sample_period_ns(rate_hz: u16) -> u64 {
    // No hello can state a rate of 0; the 1 only keeps the division defined.
    1_000_000_000 / if rate_hz == 0 { 1 } else { rate_hz as u64 }
}

/// Returns how far, in samples, the index of a sample may be from the last one answered: [`HEARTBEAT_TIMEOUT_NS`] in
/// samples, rounded down, and at least [`SAMPLE_WINDOW_MIN`]. Always below 2¹⁵.
pub const fn sample_window(rate_hz: u16) -> u16 {
    // At most 65535 · 0.35 = 22937, below 2¹⁵.
    let samples = (rate_hz as u64 * HEARTBEAT_TIMEOUT_NS / 1_000_000_000) as u16;
    if samples > SAMPLE_WINDOW_MIN { samples } else { SAMPLE_WINDOW_MIN }
}
