//! Gauges of a running loop: counts, lateness and load, written by the loop and read by a display.

use core::sync::atomic::{AtomicU8, AtomicU64, Ordering};

use resonarm_bench::rig::Load;
use resonarm_protocol::NodeState;

/// Gauges that the run's loop writes without waiting, and that a display reads. Each figure is consistent by itself;
/// two of them may belong to different samples.
#[derive(Debug, Default)]
pub struct Gauges {
    samples: AtomicU64,
    work_ns: AtomicU64,
    latest_ns: AtomicU64,
    overruns: AtomicU64,
    force_n: AtomicU64,
    torque_nm: AtomicU64,
    state: AtomicU8,
}

/// Readings of the gauges at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// Number of samples worked on.
    pub samples: u64,
    /// Total execution time of all samples, ns.
    pub work_ns: u64,
    /// Delay of the latest sample since the gauges were read before, ns.
    pub latest_ns: u64,
    /// Number of deadlines missed.
    pub overruns: u64,
    /// Largest magnitude of the force held since then, N.
    pub force_n: f64,
    /// Largest magnitude of the torques held since then, N·m.
    pub torque_nm: f64,
    /// State of the node.
    pub state: NodeState,
}

impl Gauges {
    /// Counts a sample with its delay, its execution time, and the deadlines missed before it. Never blocks, locks or
    /// allocates.
    pub(crate) fn count(&self, late_ns: u64, work_ns: u64, missed: u32) {
        self.samples.fetch_add(1, Ordering::Relaxed);
        self.work_ns.fetch_add(work_ns, Ordering::Relaxed);
        self.latest_ns.fetch_max(late_ns, Ordering::Relaxed);
        self.overruns.fetch_add(missed.into(), Ordering::Relaxed);
    }

    /// Sets the held load and the node's state. Never blocks, locks or allocates.
    pub(crate) fn set(&self, load: &Load, state: NodeState) {
        // The bits of numbers from 0 up are in the order of the numbers.
        self.force_n.fetch_max(load.force_n.norm().to_bits(), Ordering::Relaxed);
        self.torque_nm.fetch_max(load.torque_nm.norm().to_bits(), Ordering::Relaxed);
        self.set_state(state);
    }

    /// Sets an exciter's answered samples and its state. Never blocks, locks or allocates.
    pub(crate) fn set_answered(&self, samples: u64, state: NodeState) {
        self.samples.store(samples, Ordering::Relaxed);
        self.set_state(state);
    }

    fn set_state(&self, state: NodeState) {
        self.state.store(state.heartbeat_byte(), Ordering::Relaxed);
    }

    /// Reads the gauges, and restarts the latest sample and the largest loads.
    pub fn read(&self) -> Shown {
        // Each is taken and set back at once, so that what the loop writes meanwhile is there for the next reading.
        let [latest_ns, force, torque] =
            [&self.latest_ns, &self.force_n, &self.torque_nm].map(|of| of.swap(0, Ordering::Relaxed));
        Shown { latest_ns, force_n: f64::from_bits(force), torque_nm: f64::from_bits(torque), ..self.look() }
    }

    /// Reads the gauges and leaves them as they are.
    pub fn look(&self) -> Shown {
        Shown {
            samples: self.samples.load(Ordering::Relaxed),
            work_ns: self.work_ns.load(Ordering::Relaxed),
            latest_ns: self.latest_ns.load(Ordering::Relaxed),
            overruns: self.overruns.load(Ordering::Relaxed),
            force_n: f64::from_bits(self.force_n.load(Ordering::Relaxed)),
            torque_nm: f64::from_bits(self.torque_nm.load(Ordering::Relaxed)),
            state: NodeState::from_heartbeat_byte(self.state.load(Ordering::Relaxed)).unwrap_or(NodeState::BootUp),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Barrier;

    use super::*;

    #[test]
    fn the_latest_sample_is_looked_for_anew_after_each_reading() {
        let gauges = Gauges::default();
        assert_eq!(gauges.look().state, NodeState::BootUp);
        for (late_ns, work_ns, missed) in [(70, 5, 0), (900, 6, 2), (30, 7, 0)] {
            gauges.count(late_ns, work_ns, missed);
        }
        gauges.set(&Load::force_n(3.0, 4.0), NodeState::Operational);
        gauges.set(&Load::force_n(-1.0, 0.0), NodeState::Operational);
        let expected = Shown {
            samples: 3,
            work_ns: 18,
            latest_ns: 900,
            overruns: 2,
            force_n: 5.0,
            torque_nm: 0.0,
            state: NodeState::Operational,
        };
        assert_eq!((gauges.look(), gauges.read()), (expected, expected));
        assert_eq!(gauges.read(), Shown { latest_ns: 0, force_n: 0.0, ..expected });
    }

    /// A loop writes while somebody reads: each round one sample is late, and one of the readings shows it.
    #[test]
    fn what_comes_during_a_reading_is_shown_by_the_next() {
        const ROUNDS: u64 = 50_000;
        let gauges = Gauges::default();
        let begin = Barrier::new(2);
        let end = Barrier::new(2);
        let mut missed = Vec::new();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                for round in 1..=ROUNDS {
                    begin.wait();
                    gauges.count(round, 0, 0);
                    gauges.set(&Load::force_n(round as f64, 0.0), NodeState::Operational);
                    end.wait();
                }
            });
            for round in 1..=ROUNDS {
                begin.wait();
                let during = [(); 8].map(|()| gauges.read());
                end.wait();
                let shown = during.into_iter().chain([gauges.read()]);
                let most = shown.fold((0, 0.0_f64), |most, it| (most.0.max(it.latest_ns), most.1.max(it.force_n)));
                if most != (round, round as f64) {
                    missed.push((round, most));
                }
            }
        });
        assert_eq!(missed, []);
    }
}
