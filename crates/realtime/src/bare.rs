//! An empty loop: the machine's latency, to compare a run's figures with.

use crate::clock::{Clock, wait_until};
use crate::latency::LatencyHistogram;
use crate::rate::SampleRate;

/// Counts into `latencies` how late a loop wakes up that does nothing else, for `ticks` ticks at `rate`: it sleeps
/// until tick k is due, at start + k / rate, and looks at the clock, as cyclictest does (rt-tests). The last `spin_ns`
/// it spins. A tick that is overdue is not slept for, and counts with its whole lateness.
pub fn bare_wakeups<C: Clock>(clock: &C, rate: SampleRate, spin_ns: u64, ticks: u64, latencies: &mut LatencyHistogram) {
    let start_ns = clock.now_ns();
    // Tick 0 is due at the start itself: it is not slept for, and would count a latency that no sleep had.
    for tick in 1..=ticks {
        let deadline_ns = start_ns + rate.offset_ns(tick);
        wait_until(clock, deadline_ns, spin_ns);
        latencies.record(clock.now_ns().saturating_sub(deadline_ns));
    }
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::*;

    /// Wakes 5 µs late, once 2.5 ms late.
    #[derive(Default)]
    struct LateClock {
        now_ns: Cell<u64>,
        sleeps: Cell<u64>,
    }

    impl Clock for LateClock {
        fn now_ns(&self) -> u64 {
            self.now_ns.get()
        }

        fn sleep_until_ns(&self, deadline_ns: u64) {
            self.sleeps.set(self.sleeps.get() + 1);
            let late_ns = if self.sleeps.get() == 50 { 2_500_000 } else { 5_000 };
            self.now_ns.set(self.now_ns.get().max(deadline_ns + late_ns));
        }
    }

    #[test]
    fn a_stall_counts_in_every_tick_that_it_made_late() {
        let mut latencies = LatencyHistogram::new().unwrap();
        bare_wakeups(&LateClock::default(), SampleRate::new(1000.0).unwrap(), 0, 100, &mut latencies);
        let found = latencies.percentiles().unwrap();
        assert_eq!((latencies.count(), found.p50, found.max), (100, 5.003, 2500.0), "{found:?}");
        // Late by 2.5, 1.5 and 0.5 ms.
        assert!(found.p99 > 1400.0, "{found:?}");
    }
}
