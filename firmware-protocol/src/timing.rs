//! Periods, timeouts and limits, in nanoseconds unless the name says otherwise. `SPEC.md` says who keeps them.

/// Every node sends its heartbeat at this period, and at once when its state changes.
pub const HEARTBEAT_PERIOD_NS: u64 = 100_000_000;

/// In real time: a partner without a sign of life for this long is lost: three heartbeats and half a period.
pub const HEARTBEAT_TIMEOUT_NS: u64 = 350_000_000;

/// Every node sends its hello at this period, when it boots, and in answer to the first hello of a partner that has booted.
pub const HELLO_PERIOD_NS: u64 = 1_000_000_000;

/// In real time: an operational plant without a valid command for this long has lost its controller.
pub const COMMAND_TIMEOUT_NS: u64 = 20_000_000;

/// In real time: a command that answers a sample older than this is late and refused.
pub const COMMAND_AGE_NS: u64 = COMMAND_TIMEOUT_NS;

/// When the plant leaves the state operational, by a fault or disarmed, the held command goes linearly to zero in this
/// time.
pub const FORCE_RAMP_NS: u64 = 50_000_000;

/// In lockstep: how long, in wall-clock time, each node waits for the other. It stands for all other timeouts.
pub const LOCKSTEP_TIMEOUT_NS: u64 = 1_000_000_000;

/// The lowest sample rate, in Hz, that a real-time run can have: two sample periods in [`COMMAND_TIMEOUT_NS`].
pub const REAL_TIME_RATE_MIN_HZ: u16 = 100;
