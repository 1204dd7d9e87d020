//! The system's clocks, and one of simulated time.

use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;
use std::sync::Arc;

use rustix::io::Errno;
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

const NS_PER_S: u64 = 1_000_000_000;

/// A clock that a loop can wait on. Tests drive the loop with a scripted one.
pub trait Clock {
    /// Nanoseconds since some fixed instant; never decreases.
    fn now_ns(&self) -> u64;

    /// Returns at `deadline_ns` or later; at once if that has passed.
    fn sleep_until_ns(&self, deadline_ns: u64);

    /// The same for a short time, without giving the core away: looks at the clock until then. Where time passes only
    /// by sleeping, it sleeps.
    fn spin_until_ns(&self, deadline_ns: u64) {
        self.sleep_until_ns(deadline_ns);
    }

    /// The time now in nanoseconds of the UNIX epoch, as the kernel stamps frames. It may be set at any moment.
    fn unix_ns(&self) -> u64 {
        unix_time_ns()
    }
}

/// `CLOCK_MONOTONIC`: nanoseconds since boot, without the time the machine was suspended, never set back.
#[derive(Clone, Copy, Debug, Default)]
pub struct SystemClock;

impl SystemClock {
    /// Returns the time at which the clock read 0, ns of the UNIX epoch.
    pub fn epoch_unix_ns(self) -> u64 {
        unix_time_ns().saturating_sub(self.now_ns())
    }

    /// Returns the reading of the clock, as the recorder wants it.
    pub fn elapsed() -> Duration {
        Duration::from_nanos(SystemClock.now_ns())
    }
}

impl Clock for SystemClock {
    fn now_ns(&self) -> u64 {
        to_ns(clock_gettime(ClockId::Monotonic))
    }

    /// Sleeps by `clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME)`. A signal that interrupts the sleep doesn't shorten
    /// it.
    fn sleep_until_ns(&self, deadline_ns: u64) {
        let deadline = to_timespec(deadline_ns);
        while let Err(error) = clock_nanosleep_absolute(ClockId::Monotonic, &deadline) {
            // An absolute sleep is resumed by calling it again. It has no other error for a valid time; if one came,
            // the deadline would still be kept, by polling.
            if error != Errno::INTR && self.now_ns() >= deadline_ns {
                return;
            }
        }
    }

    fn spin_until_ns(&self, deadline_ns: u64) {
        while self.now_ns() < deadline_ns {
            core::hint::spin_loop();
        }
    }
}

/// Waits until `deadline_ns`: asleep, but for the last `spin_ns`, in which it looks at the clock.
pub(super) fn wait_until(clock: &impl Clock, deadline_ns: u64, spin_ns: u64) {
    clock.sleep_until_ns(deadline_ns.saturating_sub(spin_ns));
    if spin_ns > 0 {
        clock.spin_until_ns(deadline_ns);
    }
}

/// A clock of simulated time: it advances when it is set or slept on. Copies show the same time.
#[derive(Clone, Debug, Default)]
pub struct VirtualClock(Arc<AtomicU64>);

impl VirtualClock {
    /// Advances to `now_ns`; a time that has passed changes nothing.
    pub fn advance_to_ns(&self, now_ns: u64) {
        // Only the time itself is shared, and no other memory is published with it, so it needs no ordering.
        self.0.fetch_max(now_ns, Ordering::Relaxed);
    }
}

impl Clock for VirtualClock {
    fn now_ns(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    fn sleep_until_ns(&self, deadline_ns: u64) {
        self.advance_to_ns(deadline_ns);
    }

    /// Simulated time begins with the epoch.
    fn unix_ns(&self) -> u64 {
        self.now_ns()
    }
}

/// Nanoseconds since the UNIX epoch (`CLOCK_REALTIME`). For time stamps only: this clock may be set at any moment.
pub fn unix_time_ns() -> u64 {
    to_ns(clock_gettime(ClockId::Realtime))
}

/// Neither clock is ever before its epoch on Linux (`CLOCK_REALTIME` can't be set below zero), so the conversion is
/// exact.
pub(super) fn to_ns(time: Timespec) -> u64 {
    time.tv_sec.unsigned_abs() * NS_PER_S + time.tv_nsec.unsigned_abs()
}

fn to_timespec(time_ns: u64) -> Timespec {
    Timespec { tv_sec: (time_ns / NS_PER_S).cast_signed(), tv_nsec: (time_ns % NS_PER_S).cast_signed() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_monotonic_clock_never_goes_back_and_sleeps_never_end_early() {
        let clock = SystemClock;
        let mut before = clock.now_ns();
        for _ in 0..20 {
            let deadline = before + 300_000;
            clock.sleep_until_ns(deadline);
            let now = clock.now_ns();
            assert!(now >= deadline, "woke {} ns early", deadline - now);
            before = now;
        }
    }

    #[test]
    fn a_deadline_that_has_passed_does_not_block() {
        SystemClock.sleep_until_ns(0);
        SystemClock.sleep_until_ns(SystemClock.now_ns());
    }

    #[test]
    fn simulated_time_passes_by_sleeping_and_never_goes_back() {
        let clock = VirtualClock::default();
        let copy = clock.clone();
        clock.sleep_until_ns(500);
        copy.advance_to_ns(300);
        assert_eq!((clock.now_ns(), copy.now_ns()), (500, 500));
    }

    #[test]
    fn conversions_are_inverse() {
        for time_ns in [0, 1, 999_999_999, 1_000_000_000, 1_000_000_001, 9_223_372_036_854_775_807] {
            assert_eq!(to_ns(to_timespec(time_ns)), time_ns);
        }
    }

    #[test]
    fn unix_time_is_after_this_was_written() {
        assert!(unix_time_ns() > 1_735_689_600 * NS_PER_S); // 2025-01-01
    }
}
