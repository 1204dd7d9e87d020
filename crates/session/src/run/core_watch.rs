//! Finds causes of missed deadlines that the loop itself can't see: a second thread checks periodically which threads
//! have used the loop's core.
//!
//! ```text
//! run loop ── Overrun ──► ring ──► thread beside it, every LOOK ◄── /proc/stat, schedstat
//! ```
//!
//! The loop never waits for this thread. The time between two checks is a *span*. For each span the kernel reports how
//! long the host had the core, and how long the loop's thread waited for it though it could have run. An overrun takes
//! the cause
//!
//! - *stolen* if, in the spans that it touches, the host had the core for at least half of the delay;
//! - else *preempted* if the loop's thread waited for at least half of the delay beyond its usual wait;
//! - else the cause that the loop reports.
//!
//! The kernel counts the host's share in units of 10 ms, which may end anywhere in the span, so a unit is added to a
//! share that is not zero. The usual wait is the mean time that the thread waits for each of its turns, in the spans
//! without an overrun.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;
use std::collections::VecDeque;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use rtrb::{Consumer, Producer, RingBuffer};

use super::watch::{Notice, Watched};
use resonarm_files::recording::{Channel, Event, Record};
use resonarm_realtime::{Clock, CoreShare, OverrunCause, OverrunCauses, STEAL_UNIT_NS, Share, SystemClock, Tick};

/// Interval between two checks.
const LOOK: Duration = Duration::from_millis(50);
/// Overruns on their way to the thread: at 10 kHz those of 100 ms, each a tick late.
const OVERRUNS: usize = 1024;
/// Spans that are kept, for overruns that last longer than one.
const SPANS: usize = 256;
/// Stack of the thread: far more than reading three files takes.
const STACK_BYTES: usize = 256 * 1024;

/// Deadlines that were missed together, reported by the tick after them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Overrun {
    /// The sample that was late.
    pub sample: u64,
    /// Cause, as far as the loop can tell.
    pub cause: OverrunCause,
    /// Number of deadlines that were missed.
    pub missed: u32,
    /// Start and end of the delay, on the loop's clock, ns.
    pub held_up_ns: (u64, u64),
    /// The time at which the run began, on the same clock, ns.
    pub run_start_ns: u64,
}

impl Overrun {
    /// Returns the overrun that `tick` reports, if any, in a run that began at `run_start_ns`.
    pub fn of(tick: &Tick, run_start_ns: u64) -> Option<Overrun> {
        let held_up_ns = (tick.held_up_since_ns, tick.woke_ns);
        let cause = tick.cause?;
        Some(Overrun { sample: tick.index, cause, missed: tick.missed, held_up_ns, run_start_ns })
    }
}

/// The thread beside a loop, which ends with it.
pub(super) struct CoreWatch {
    overruns: Producer<Overrun>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Found>>,
}

impl CoreWatch {
    /// Starts the thread for the calling thread, before that becomes a real-time thread: threads started later would
    /// stay on its core. Its findings go to `record` and to watchers.
    ///
    /// # Errors
    /// The error of the operating system if it has no thread left.
    pub fn start(record: Option<Channel>, watched: Option<Watched>) -> std::io::Result<CoreWatch> {
        let (overruns, reported) = RingBuffer::new(OVERRUNS);
        let stop = Arc::new(AtomicBool::new(false));
        // Made here, on the thread that is watched, and not on the one that watches it.
        let share = CoreShare::of_this_thread();
        let asked = Arc::clone(&stop);
        let thread = thread::Builder::new()
            .name(String::from("core-watch"))
            .stack_size(STACK_BYTES)
            .spawn(move || look_on(share, reported, (record, watched), &asked))?;
        Ok(CoreWatch { overruns, stop, thread: Some(thread) })
    }

    /// Reports an overrun. Never blocks, locks or allocates; one that finds the ring full keeps the loop's cause.
    pub fn report(&mut self, overrun: Overrun) {
        let _full = self.overruns.push(overrun);
    }

    /// Ends the thread, and moves those of `causes` for which it has found another cause.
    pub fn finish(mut self, causes: OverrunCauses) -> OverrunCauses {
        match self.end() {
            Some(Ok(found)) => found.moved(causes),
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            None => causes,
        }
    }

    fn end(&mut self) -> Option<thread::Result<Found>> {
        let thread = self.thread.take()?;
        self.stop.store(true, Ordering::Release);
        thread.thread().unpark();
        Some(thread.join())
    }
}

impl Drop for CoreWatch {
    /// Ends the thread of a run that did not start: it would run forever, and hold the recording open.
    fn drop(&mut self) {
        let _nobody_asks = self.end();
    }
}

/// Runs the thread until it is asked to stop; then checks a last time.
fn look_on(
    mut share: CoreShare,
    mut reported: Consumer<Overrun>,
    (mut record, mut watched): (Option<Channel>, Option<Watched>),
    stop: &AtomicBool,
) -> Found {
    let mut spans = Spans::default();
    let mut found = Found::default();
    let mut last_ns = SystemClock.now_ns();
    share.look();
    loop {
        thread::park_timeout(LOOK);
        let is_last = stop.load(Ordering::Acquire);
        // First the overruns, then the look: so each is over by the end of the span.
        let overruns: Vec<Overrun> = core::iter::from_fn(|| reported.pop().ok()).collect();
        let now_ns = SystemClock.now_ns();
        if let Some(share) = share.look() {
            spans.add(Span { from_ns: last_ns, to_ns: now_ns, share }, overruns.is_empty());
        }
        for overrun in &overruns {
            let Some(taken) = spans.explain(overrun) else { continue };
            found.count(taken, overrun);
            let event = taken.record(overrun);
            if let Some(channel) = &mut record {
                // A full channel counts what it loses.
                let _counted = channel.push(&event);
            }
            watched.iter_mut().for_each(|watched| watched.notify(Notice::Record(event)));
        }
        last_ns = now_ns;
        if is_last {
            return found;
        }
    }
}

/// Owner of the core during the delay of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Taken {
    /// The host of the virtual machine.
    Stolen,
    /// Other threads of this machine.
    Preempted,
}

impl Taken {
    /// Returns the event of an overrun; its value is the number of missed deadlines.
    fn record(self, overrun: &Overrun) -> Record {
        let name = match self {
            Taken::Stolen => "overrun.stolen",
            Taken::Preempted => "overrun.preempted",
        };
        let time_ns = overrun.held_up_ns.1.saturating_sub(overrun.run_start_ns);
        Record::Event(Event { sample: overrun.sample, time_ns, name, value: i64::from(overrun.missed) })
    }
}

/// Deadlines for which another cause was found, by the cause that the loop gave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Found {
    stolen: OverrunCauses,
    preempted: OverrunCauses,
}

impl Found {
    fn count(&mut self, taken: Taken, overrun: &Overrun) {
        let causes = match taken {
            Taken::Stolen => &mut self.stolen,
            Taken::Preempted => &mut self.preempted,
        };
        causes.count(overrun.cause, overrun.missed.into());
    }

    /// Moves the found causes in the loop's own counts: the sum stays.
    fn moved(mut self, mut causes: OverrunCauses) -> OverrunCauses {
        for cause in OverrunCause::ALL {
            let stolen = *self.stolen.of(cause);
            let preempted = *self.preempted.of(cause);
            // Never below 0: what is moved was counted by the loop before it was reported to this thread.
            *causes.of(cause) -= stolen + preempted;
            causes.stolen += stolen;
            causes.preempted += preempted;
        }
        causes
    }
}

/// The time between two checks, on the loop's clock.
#[derive(Clone, Copy, Debug)]
struct Span {
    from_ns: u64,
    to_ns: u64,
    share: Share,
}

/// The last spans, and the usual wait in them.
#[derive(Debug, Default)]
struct Spans {
    last: VecDeque<Span>,
    /// In the spans without an overrun, the time that the thread waited, and the number of its turns.
    usual: (u64, u64),
}

impl Spans {
    fn add(&mut self, span: Span, is_usual: bool) {
        if is_usual {
            self.usual = (self.usual.0 + span.share.waited_ns, self.usual.1 + span.share.turns);
        }
        if self.last.len() == SPANS {
            self.last.pop_front();
        }
        self.last.push_back(span);
    }

    /// Returns the owner of the core for at least half of the overrun, if there was one.
    fn explain(&self, overrun: &Overrun) -> Option<Taken> {
        let (from_ns, to_ns) = overrun.held_up_ns;
        // Two intervals overlap if each begins before the other ends.
        let touched = self.last.iter().filter(|span| span.from_ns <= to_ns && from_ns <= span.to_ns);
        let sum = |of: fn(&Share) -> u64| touched.clone().map(|span| of(&span.share)).sum::<u64>();
        let (stolen_ns, waited_ns, turns) = (sum(|s| s.stolen_ns), sum(|s| s.waited_ns), sum(|s| s.turns));
        let half_ns = to_ns.saturating_sub(from_ns) / 2;
        if stolen_ns > 0 && stolen_ns + STEAL_UNIT_NS >= half_ns {
            return Some(Taken::Stolen);
        }
        // Without a span to compare with, no wait is more than usual.
        let usual_ns = match self.usual {
            (_, 0) => waited_ns,
            // In 128 bits, since in a long run the product of nanoseconds and turns can exceed 64.
            (usual_ns, usual_turns) => (u128::from(usual_ns) * u128::from(turns) / u128::from(usual_turns)) as u64,
        };
        (waited_ns.saturating_sub(usual_ns) > half_ns).then_some(Taken::Preempted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn overrun(cause: OverrunCause, missed: u32, held_up_ms: (u64, u64)) -> Overrun {
        let held_up_ns = (held_up_ms.0 * MS, held_up_ms.1 * MS);
        Overrun { sample: 7, cause, missed, held_up_ns, run_start_ns: MS }
    }

    fn span(from_ms: u64, to_ms: u64, stolen_ms: u64, waited_us: u64) -> Span {
        let share = Share { stolen_ns: stolen_ms * MS, waited_ns: waited_us * 1000, turns: 50 };
        Span { from_ns: from_ms * MS, to_ns: to_ms * MS, share }
    }

    #[test]
    fn an_overrun_is_explained_by_the_spans_that_it_touches() {
        let mut spans = Spans::default();
        let woke_late = |held_up_ms| overrun(OverrunCause::WokeLate, 3, held_up_ms);
        // In the first the thread waits for its 50 turns 2 µs each, as usual.
        spans.add(span(0, 50, 0, 100), true);
        spans.add(span(50, 100, 20, 100), false);
        spans.add(span(100, 150, 0, 5_000), false);
        assert_eq!(spans.explain(&woke_late((10, 15))), None);
        assert_eq!(spans.explain(&woke_late((60, 75))), Some(Taken::Stolen));
        assert_eq!(spans.explain(&woke_late((45, 51))), Some(Taken::Stolen));
        assert_eq!(spans.explain(&woke_late((110, 119))), Some(Taken::Preempted));
        assert_eq!(spans.explain(&woke_late((110, 121))), None, "half of it is more than it waited");
        // The host had the core for 20 to 30 ms, which is not half of 70.
        assert_eq!(spans.explain(&woke_late((55, 99))), Some(Taken::Stolen));
        spans.add(span(150, 250, 20, 100), false);
        assert_eq!(spans.explain(&woke_late((160, 230))), None);
    }

    #[test]
    fn without_a_usual_span_nothing_is_more_than_usual() {
        let mut spans = Spans::default();
        spans.add(span(0, 50, 0, 40_000), false);
        assert_eq!(spans.explain(&overrun(OverrunCause::StepLong, 1, (10, 12))), None);
    }

    #[test]
    fn spans_are_forgotten_at_last() {
        let mut spans = Spans::default();
        (0..SPANS as u64 + 5).for_each(|k| spans.add(span(50 * k, 50 * (k + 1), 10, 0), true));
        assert_eq!(spans.last.len(), SPANS);
        assert_eq!(spans.explain(&overrun(OverrunCause::WokeLate, 1, (10, 20))), None);
    }

    #[test]
    fn what_is_found_moves_and_the_sum_stays() {
        let mut found = Found::default();
        found.count(Taken::Stolen, &overrun(OverrunCause::WokeLate, 58, (0, 1)));
        found.count(Taken::Preempted, &overrun(OverrunCause::BusLong, 2, (0, 1)));
        let causes = OverrunCauses { woke_late: 60, step_long: 4, bus_long: 2, ..OverrunCauses::default() };
        let moved = found.moved(causes);
        assert_eq!(moved, OverrunCauses { woke_late: 2, step_long: 4, bus_long: 0, stolen: 58, preempted: 2 });
        assert_eq!(moved.total(), causes.total());
    }

    #[test]
    fn what_is_found_is_recorded_as_an_event() {
        let event = Event { sample: 7, time_ns: 9 * MS, name: "overrun.stolen", value: 3 };
        assert_eq!(Taken::Stolen.record(&overrun(OverrunCause::WokeLate, 3, (5, 10))), Record::Event(event));
    }

    #[test]
    fn a_thread_that_finds_nothing_moves_nothing_and_ends() {
        let mut watch = CoreWatch::start(None, None).unwrap();
        let causes = OverrunCauses { step_long: 1, ..OverrunCauses::default() };
        // Before the run, so that no span touches it.
        watch.report(overrun(OverrunCause::StepLong, 1, (0, 1)));
        assert_eq!(watch.finish(causes), causes);
    }
}
