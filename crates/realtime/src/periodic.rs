//! The periodic loop: tick k is due at `start + k / rate` on the monotonic clock, exactly, for ever.
//!
//! Simulated time is k / rate at tick k, whatever the clock says: **every tick is given out, once, in order**. Being
//! late changes when a tick is worked on, never which one it is.
//!
//! A *deadline* is the instant a tick is due. It is *missed* when the loop isn't asleep waiting for it: because the
//! work of a tick before took too long, or because the system woke the loop so late that more deadlines had passed.
//! After a miss the loop doesn't sleep; it gives out the ticks that are overdue one after another, each with its true
//! lateness, until it is ahead again:
//!
//! ```text
//!  deadline      d0        d1        d2        d3        d4        d5
//!                |---------|---------|---------|---------|---------|----
//!  on time       [0]       [1]       [2]       [3]       [4]       [5]
//!
//!  long work     [0]       [1----------------------][2-][3][4]     [5]      d2, d3 pass in tick 1, d4 in tick 3
//!  missed        0         0                        2   0  1       0        the sum is 3: d2, d3 counted in 2, d4 in 4
//!  lateness      ε         ε                        1.5 .9 .2      ε        periods; ε is the wake-up latency
//!
//!  late wake-up  [0]       . . . still asleep . . . [1][2][3]      [4]      d2, d3 pass in the sleep until d1
//!  missed        0                                  2  0  0        0
//!  lateness      ε                                  2.5 1.6 .7     ε
//! ```
//!
//! So [`Tick::missed`] counts each missed deadline once, in the first tick given out after it, and the sum over all
//! ticks is the number of overruns of the run. A lateness is recorded for every tick, including those that caught up: a
//! stall shows in the percentiles with its whole length, not as a single slow tick (no coordinated omission; G. Tene,
//! "How NOT to Measure Latency", talk, 2013).
//!
//! Each miss has an [`OverrunCause`]: the loop was asleep when the deadline passed, or at work, and then on the bus or
//! on something else for most of the time.
//!
//! The [`OverrunPolicy`] decides what a miss leads to. Under [`OverrunPolicy::Slip`], the default, a loop behind by
//! more than [`CATCH_UP_TICKS`] moves its schedule by the whole periods that it is behind, and continues from there: no
//! burst of stale samples on the bus, and no tick left out either. With s periods slipped so far, tick k is due at
//! start + (k + s) / rate:
//!
//! ```text
//!  deadline      d0        d1        d2        d3        d4        d5        d6        d7        d8
//!                |---------|---------|---------|---------|---------|---------|---------|---------|----
//!  stopped       [0]       [1]       . . . stopped until here . . . . . . . . . . .[2]   [3]      [4]
//!  missed        0         0                                                       5     0        0
//!  slipped       0         0                                                       4     0        0
//!  lateness      ε         ε                                                       4.4   ε        ε
//! ```
//!
//! Under the other policies every tick is caught up, and behind by more than [`MAX_LAG_NS`] the loop ends with an
//! error: the other end of the bus has long given it up.

use core::fmt;
use core::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::clock::{Clock, wait_until};
use crate::latency::{HistogramError, LatencyHistogram, Percentiles};
use crate::overrun_cause::{OverrunCause, OverrunCauses};
use crate::rate::SampleRate;

/// Time by which a tick may be behind its deadline: 1 s. A loop further behind ends with
/// [`PeriodicError::TooFarBehind`]. Only [`OverrunPolicy::Slip`], which does not catch up on ticks that old, continues.
pub const MAX_LAG_NS: u64 = 1_000_000_000;

/// Number of ticks that a loop that slips catches up: 3. At the highest load that the protocol recommends, 70 % of the
/// wire, the frames of a sample take 0.7 of a period, so the wire works off a backlog of 3 samples in 3 · 0.7/0.3 = 7
/// periods. A longer burst would hold stale forces for longer than it is worth.
pub const CATCH_UP_TICKS: u64 = 3;

/// Behaviour of the loop at a missed deadline. In text: `slip`, `continue`, `fault`, `stop`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OverrunPolicy {
    /// Up to three overdue ticks are run late, marked, and the run continues; further behind, the schedule moves
    /// by the periods missed, and the tick states it ([`Tick::slipped`]). No tick is left out.
    #[default]
    Slip,
    /// All overdue ticks are run late, one after another, marked, and the run continues.
    Continue,
    /// The loop continues, and each tick that reports a miss asks for a fault ([`Action::Fault`]): the plant's force
    /// goes to zero, and stays there until it is armed again.
    Fault,
    /// The loop ends with [`PeriodicError::Overrun`].
    Stop,
}

impl OverrunPolicy {
    /// All policies a loop can have.
    pub const ALL: [Self; 4] = [Self::Slip, Self::Continue, Self::Fault, Self::Stop];

    /// Returns the name of the policy in text.
    pub fn name(self) -> &'static str {
        match self {
            Self::Slip => "slip",
            Self::Continue => "continue",
            Self::Fault => "fault",
            Self::Stop => "stop",
        }
    }
}

impl fmt::Display for OverrunPolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for OverrunPolicy {
    type Err = UnknownOverrunPolicy;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|policy| policy.name() == text);
        found.ok_or_else(|| UnknownOverrunPolicy { got: text.to_owned() })
    }
}

/// A text that names no [`OverrunPolicy`].
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("unknown overrun policy `{got}`; it must be one of slip, continue, fault, stop")]
pub struct UnknownOverrunPolicy {
    /// Text that names no policy.
    pub got: String,
}

/// Action that a tick asks of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Do the work of the tick.
    Proceed,
    /// Put the plant into fault, then do the work of the tick.
    Fault,
}

/// One tick of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// Index k of the tick: 0, 1, 2 …, without gaps.
    pub index: u64,
    /// Time at which the tick was due, on the loop's clock, ns.
    pub deadline_ns: u64,
    /// Time at which the loop was awake for the tick, on the same clock, ns; `deadline_ns` or later.
    pub woke_ns: u64,
    /// Lateness of the tick: `woke_ns - deadline_ns`. The wake-up latency, or how far a tick that catches up is behind.
    pub wakeup_ns: u64,
    /// Deadlines missed and not reported by an earlier tick; 0 when on time.
    pub missed: u32,
    /// Cause of the missed deadlines; `None` if none was missed.
    pub cause: Option<OverrunCause>,
    /// Start of the time up to `woke_ns` for which the loop was held up, on its clock, ns: the deadline that it slept
    /// for, or where it did not sleep when it woke for the tick before.
    pub held_up_since_ns: u64,
    /// Periods by which the schedule moves with this tick; 0 but under [`OverrunPolicy::Slip`].
    pub slipped: u32,
    /// Action that the overrun policy asks for.
    pub action: Action,
}

/// The figures of a loop so far. The field names are those of the program's JSON.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LoopSummary {
    /// Ticks given out; a tick is a sample of the bench.
    pub samples: u64,
    /// Number of deadlines missed.
    pub overruns: u64,
    /// The same by cause, as far as the loop knows.
    pub overrun_causes: OverrunCauses,
    /// Periods by which the schedule was moved.
    pub slipped: u64,
    /// Lateness of all ticks, µs; `None` before the first.
    pub wakeup_us: Option<Percentiles>,
    /// Duration of the work of all finished ticks, µs; `None` before the first.
    pub exec_us: Option<Percentiles>,
}

/// A loop that ticks with a fixed rate. The module's text states its guarantees.
///
/// Neither [`Periodic::tick`] nor [`Periodic::finish`] allocates, locks or blocks, save for the sleep itself.
#[derive(Debug)]
pub struct Periodic<'c, C: Clock> {
    clock: &'c C,
    rate: SampleRate,
    policy: OverrunPolicy,
    /// Time for which the loop spins before a deadline, ns.
    spin_ns: u64,
    start_ns: u64,
    /// Index of the tick to give out next.
    next: u64,
    /// Periods by which the schedule was moved: tick k is due with period k + slipped.
    slipped: u64,
    /// Periods below this one were waited for or counted as missed.
    settled: u64,
    causes: OverrunCauses,
    /// Time at which the loop woke for the last tick, and how much of that tick's work went to the bus, ns.
    last_woke_ns: u64,
    last_bus_ns: u64,
    wakeup: LatencyHistogram,
    exec: LatencyHistogram,
}

impl<'c, C: Clock> Periodic<'c, C> {
    /// A loop whose tick 0 is due one period from now: call it last, right before the loop.
    ///
    /// # Errors
    /// [`HistogramError`] if the latency histograms can't be built.
    pub fn start(clock: &'c C, rate: SampleRate, policy: OverrunPolicy) -> Result<Self, HistogramError> {
        let wakeup = LatencyHistogram::new()?;
        let exec = LatencyHistogram::new()?;
        let now_ns = clock.now_ns();
        Ok(Self {
            clock,
            rate,
            policy,
            spin_ns: 0,
            // A tick due now would be late already, so that every run would begin with a miss.
            start_ns: now_ns + rate.offset_ns(1),
            next: 0,
            slipped: 0,
            settled: 0,
            causes: OverrunCauses::default(),
            last_woke_ns: now_ns,
            last_bus_ns: 0,
            wakeup,
            exec,
        })
    }

    /// The same loop, which sleeps until `spin_ns` before a deadline and looks at the clock from there on. Less than a
    /// period, or others on its core starve: [`Spin::choose`](super::Spin::choose) bounds it.
    #[must_use]
    pub fn spinning(self, spin_ns: u64) -> Self {
        Self { spin_ns, ..self }
    }

    /// Returns the lateness of the ticks, and the execution times of those finished.
    pub fn into_histograms(self) -> [LatencyHistogram; 2] {
        [self.wakeup, self.exec]
    }

    /// Returns the time at which tick 0 is due, on the loop's clock, ns.
    pub fn start_ns(&self) -> u64 {
        self.start_ns
    }

    /// Sleeps until the next tick is due, if it isn't overdue, and gives it out.
    ///
    /// # Errors
    /// [`PeriodicError::Overrun`] if a deadline was missed and the policy is to stop;
    /// [`PeriodicError::TooFarBehind`] if the tick is late by more than [`MAX_LAG_NS`] and the policy is not to slip.
    /// The tick named by the error is not given out, the deadlines missed up to it are in [`LoopSummary::overruns`],
    /// and the loop is over.
    pub fn tick(&mut self) -> Result<Tick, PeriodicError> {
        let index = self.next;
        let period = index + self.slipped;
        let deadline_ns = self.start_ns + self.rate.offset_ns(period);
        let ready_ns = self.clock.now_ns();
        let (woke_ns, held_up_since_ns, cause) = if ready_ns <= deadline_ns {
            // The loop waits for this deadline, so a late wake-up misses only those after it.
            self.settled = period + 1;
            wait_until(self.clock, deadline_ns, self.spin_ns);
            (self.clock.now_ns(), deadline_ns, OverrunCause::WokeLate)
        } else {
            // Since the last wake-up: what came before it was sleep, not work.
            let work_ns = ready_ns.saturating_sub(self.last_woke_ns);
            (ready_ns, self.last_woke_ns, OverrunCause::of_work(work_ns, self.last_bus_ns))
        };
        // Counted before an error may end the loop, so that the summary includes these deadlines.
        let missed = self.count_missed(woke_ns, cause);
        let late_ns = woke_ns.saturating_sub(deadline_ns);
        if late_ns > MAX_LAG_NS && self.policy != OverrunPolicy::Slip {
            return Err(PeriodicError::TooFarBehind { index, late_ns });
        }
        if missed > 0 && self.policy == OverrunPolicy::Stop {
            return Err(PeriodicError::Overrun { index, missed, late_ns });
        }
        let slipped = self.slip(period, woke_ns);
        let faulty = missed > 0 && self.policy == OverrunPolicy::Fault;
        let action = if faulty { Action::Fault } else { Action::Proceed };
        let cause = (missed > 0).then_some(cause);
        self.next = index + 1;
        self.last_woke_ns = woke_ns;
        self.wakeup.record(late_ns);
        Ok(Tick { index, deadline_ns, woke_ns, wakeup_ns: late_ns, missed, cause, held_up_since_ns, slipped, action })
    }

    /// Moves the schedule if the policy is to slip and the tick due with `period` is too far behind: by the whole
    /// periods since, so that it counts as due with the last period that has begun.
    fn slip(&mut self, period: u64, now_ns: u64) -> u32 {
        let behind = self.rate.last_due(now_ns.saturating_sub(self.start_ns)).saturating_sub(period);
        if self.policy != OverrunPolicy::Slip || behind <= CATCH_UP_TICKS {
            return 0;
        }
        self.slipped += behind;
        u32::try_from(behind).unwrap_or(u32::MAX)
    }

    /// Ends the work of `tick`, of which `bus_ns` went to the bus, and returns how long it took since the loop woke for
    /// it, ns.
    pub fn finish(&mut self, tick: &Tick, bus_ns: u64) -> u64 {
        self.last_bus_ns = bus_ns;
        let exec_ns = self.clock.now_ns().saturating_sub(tick.woke_ns);
        self.exec.record(exec_ns);
        exec_ns
    }

    /// The figures so far.
    pub fn summary(&self) -> LoopSummary {
        LoopSummary {
            samples: self.next,
            overruns: self.causes.total(),
            overrun_causes: self.causes,
            slipped: self.slipped,
            wakeup_us: self.wakeup.percentiles(),
            exec_us: self.exec.percentiles(),
        }
    }

    /// Counts the deadlines that have passed at `now_ns` and that were neither waited for nor counted before.
    fn count_missed(&mut self, now_ns: u64, cause: OverrunCause) -> u32 {
        let passed = match now_ns.checked_sub(self.start_ns) {
            Some(offset_ns) => self.rate.last_due(offset_ns) + 1,
            None => 0,
        };
        let missed = passed.saturating_sub(self.settled);
        self.settled += missed;
        self.causes.count(cause, missed);
        u32::try_from(missed).unwrap_or(u32::MAX) // 2^32 periods are 11 hours at least
    }
}

/// Reason why a periodic loop ended by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum PeriodicError {
    /// Deadlines were missed, and the policy is to stop.
    #[error(
        "overrun at sample {index}: {missed} deadline(s) missed, {:.3} ms late, and the overrun policy is `stop`; lower \
         the rate, give the loop a core of its own, or choose the policy `slip`, `continue` or `fault`",
        *late_ns as f64 / 1e6
    )]
    Overrun {
        /// The tick that is late.
        index: u64,
        /// Deadlines missed and not reported by an earlier tick.
        missed: u32,
        /// Lateness of the tick, ns.
        late_ns: u64,
    },
    /// The loop can no longer catch up.
    #[error(
        "the loop is {:.3} s behind at sample {index}, more than the {:.0} s allowed; the machine can't keep \
         this rate, or the process was paused: lower the rate, choose the policy `slip`, or run in lockstep",
        *late_ns as f64 / 1e9,
        MAX_LAG_NS as f64 / 1e9
    )]
    TooFarBehind {
        /// The tick that is late.
        index: u64,
        /// Lateness of the tick, ns.
        late_ns: u64,
    },
}

#[cfg(test)]
#[path = "periodic_tests.rs"]
mod tests;
