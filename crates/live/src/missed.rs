//! Missed deadlines by cause, combined from ticks and events.
//!
//! A tick states how many deadlines were missed before it, and the cause as far as the loop knows. If another thread or
//! the host had the core, an event of the same sample says so, a little later, or in a recording earlier: it replaces
//! the loop's cause, so that the sum over the causes stays the same.

use std::collections::BTreeMap;

use resonarm_files::recording::TickRecord;
use resonarm_realtime::{OverrunCause, OverrunCauses};

/// Samples for which a tick or event waits for its counterpart: at 10 kHz those of 100 ms, each a tick late. Events
/// come within 50 ms.
const HALVES_KEPT: usize = 1024;

/// Counts missed deadlines by their cause.
#[derive(Debug, Default)]
pub struct Missed {
    /// Number of deadlines that were missed.
    pub deadlines: u64,
    causes: OverrunCauses,
    /// Ticks without an event so far, by sample: cause and count.
    ticks: BTreeMap<u64, (OverrunCause, u64)>,
    /// Events without a tick so far, by sample.
    events: BTreeMap<u64, Taken>,
}

/// The count of the cause that an event names.
type Taken = fn(&mut OverrunCauses) -> &mut u64;

impl Missed {
    /// Adds the deadlines that a tick reports as missed.
    pub fn tick(&mut self, tick: &TickRecord) {
        let missed = u64::from(tick.overruns);
        self.deadlines += missed;
        // Recordings from before there were causes have missed deadlines without one: they count, and have no cause.
        let Some(cause) = tick.cause.filter(|_| missed > 0) else { return };
        match self.events.remove(&tick.sample) {
            Some(taken) => *taken(&mut self.causes) += missed,
            None => {
                self.causes.count(cause, missed);
                keep(&mut self.ticks, tick.sample, (cause, missed));
            }
        }
    }

    /// Takes an event, which may be one of these.
    pub fn event(&mut self, sample: u64, name: &str) {
        let taken: Taken = match name {
            "overrun.stolen" => |causes| &mut causes.stolen,
            "overrun.preempted" => |causes| &mut causes.preempted,
            _ => return,
        };
        match self.ticks.remove(&sample) {
            Some((cause, missed)) => {
                // The tick has counted them for the cause that the loop knew.
                *self.causes.of(cause) -= missed;
                *taken(&mut self.causes) += missed;
            }
            None => keep(&mut self.events, sample, taken),
        }
    }

    /// The causes in words, each with its count.
    pub fn in_words(&self) -> Vec<(&'static str, u64)> {
        self.causes.in_words().into_iter().filter(|(_, missed)| *missed > 0).collect()
    }
}

fn keep<T>(halves: &mut BTreeMap<u64, T>, sample: u64, half: T) {
    halves.insert(sample, half);
    // Many ticks never get an event, so the oldest halves are dropped.
    if halves.len() > HALVES_KEPT {
        halves.pop_first();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick(sample: u64, overruns: u32, cause: Option<OverrunCause>) -> TickRecord {
        TickRecord { sample, wakeup_ns: 0, exec_ns: 0, overruns, cause }
    }

    #[test]
    fn an_event_replaces_the_cause_of_its_sample_in_any_order() {
        let mut missed = Missed::default();
        missed.tick(&tick(1, 0, None));
        missed.tick(&tick(5, 2, Some(OverrunCause::WokeLate)));
        missed.tick(&tick(6, 3, Some(OverrunCause::StepLong)));
        missed.tick(&tick(7, 1, Some(OverrunCause::BusLong)));
        assert_eq!(missed.in_words(), [("woke late", 2), ("step long", 3), ("bus long", 1)]);
        missed.event(6, "overrun.stolen");
        // Events with other names change nothing.
        missed.event(6, "state.fault");
        missed.event(9, "overrun.preempted");
        assert_eq!(missed.in_words(), [("while the host had the core", 3), ("woke late", 2), ("bus long", 1)]);
        missed.tick(&tick(9, 4, Some(OverrunCause::WokeLate)));
        // Older recordings have no causes.
        missed.tick(&tick(10, 5, None));
        let all = [
            ("while the host had the core", 3),
            ("while other threads had the core", 4),
            ("woke late", 2),
            ("bus long", 1),
        ];
        assert_eq!((missed.in_words().as_slice(), missed.deadlines), (&all[..], 15));
    }

    #[test]
    fn halves_without_a_counterpart_are_forgotten() {
        let mut missed = Missed::default();
        let most = HALVES_KEPT as u64;
        (0..=most).for_each(|sample| missed.tick(&tick(sample, 1, Some(OverrunCause::WokeLate))));
        (0..=most).for_each(|sample| missed.event(2 * most + sample, "overrun.stolen"));
        assert_eq!((missed.ticks.len(), missed.events.len()), (HALVES_KEPT, HALVES_KEPT));
        missed.event(0, "overrun.stolen");
        assert_eq!(missed.in_words(), [("woke late", most + 1)]);
    }
}
