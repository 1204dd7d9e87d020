//! Periods, timeouts and limits, in nanoseconds unless the name says otherwise. `SPEC.md` says who keeps them.

/// Every node sends its heartbeat at this period, and at once when its state changes.
pub const HEARTBEAT_PERIOD_NS: u64 = 100_000_000;

/// A partner unheard for this long is lost: three heartbeats and half a period.
pub const HEARTBEAT_TIMEOUT_NS: u64 = 350_000_000;

/// Every node sends its hello at this period and when it boots; the exciter also when the plant boots, the plant also in
/// answer to each hello of the exciter.
pub const HELLO_PERIOD_NS: u64 = 1_000_000_000;

/// In real time: an operational plant without a valid command for this long has lost its controller.
pub const COMMAND_TIMEOUT_NS: u64 = 20_000_000;

/// In real time: an operational exciter without a whole sample of an operational plant for this long has lost it.
pub const SENSOR_TIMEOUT_NS: u64 = COMMAND_TIMEOUT_NS;

/// A command that answers a sample older than this is late and refused.
pub const COMMAND_AGE_NS: u64 = COMMAND_TIMEOUT_NS;

/// When the plant leaves the state operational, by a fault or disarmed, the held command goes linearly to zero in this
/// time.
pub const FORCE_RAMP_NS: u64 = 50_000_000;

/// In lockstep: how long, in wall-clock time, the plant waits for the command that answers the sample it published, and
/// the exciter for the next sample.
pub const LOCKSTEP_TIMEOUT_NS: u64 = 1_000_000_000;

/// The lowest sample rate, in Hz, that a real-time run can have: two sample periods in [`COMMAND_TIMEOUT_NS`].
pub const REAL_TIME_RATE_MIN_HZ: u16 = 100;

/// How many samples ago the sample `answered` was when the plant is at sample `now`. The index wraps at 2¹⁶, so the
/// age is the difference modulo 2¹⁶; a sample that is still to come has an age of nearly 2¹⁶ and is refused as late.
pub const fn command_age(now: u16, answered: u16) -> u16 {
    now.wrapping_sub(answered)
}

/// The largest age, in samples, that a command may have at the sample rate `rate_hz`: the whole samples that fit
/// [`COMMAND_AGE_NS`], and at least one. At most 1310 (at 65535 Hz), far from the wrap of the index.
pub const fn command_age_limit(rate_hz: u16) -> u16 {
    let samples = COMMAND_AGE_NS * rate_hz as u64 / 1_000_000_000;
    if samples == 0 { 1 } else { samples as u16 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_age_of_a_command_goes_over_the_wrap_of_the_index() {
        assert_eq!(command_age(5, 5), 0);
        assert_eq!(command_age(2, 65_535), 3);
        assert!(command_age(5, 6) > command_age_limit(u16::MAX));
    }

    #[test]
    fn the_age_limit_is_the_command_timeout_in_samples() {
        let limits = [(1, 1), (50, 1), (100, 2), (1000, 20), (1049, 20), (1050, 21), (65_535, 1310)];
        for (rate_hz, samples) in limits {
            assert_eq!(command_age_limit(rate_hz), samples, "at {rate_hz} Hz");
        }
    }
}
