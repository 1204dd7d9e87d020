//! Round trips: the time from the sending of a sample to the command that echoes its index.
//!
//! ```text
//!     round trip(k) = kernel's stamp of the first valid command with index k − clock before sample k was sent
//! ```
//!
//! The stamp is of the UNIX epoch, and so is the clock read at the sending. That clock may be set at any moment, while
//! the loop's clock may not: a time that is negative, or longer than the command took on the loop's clock until it was
//! processed, is no round trip, and is left out.

use resonarm_realtime::{HistogramError, LatencyHistogram, Percentiles};

/// Samples that may wait for their command; a later command has no round trip. It divides 65536, so that the index of a
/// sample in its frames tells its place.
const KEPT: usize = 1024;

/// Time at which a sample was given to the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Departure {
    sample: u64,
    /// On the loop's clock, ns.
    run_ns: u64,
    /// The time since the UNIX epoch, ns.
    unix_ns: u64,
}

/// The round trips of a run.
#[derive(Debug)]
pub(super) struct RoundTrips {
    departures: Vec<Option<Departure>>,
    /// The first sample that has not departed yet.
    next: u64,
    times: LatencyHistogram,
}

impl RoundTrips {
    /// Makes an empty table. All memory is allocated here.
    pub fn new() -> Result<RoundTrips, HistogramError> {
        Ok(RoundTrips { departures: vec![None; KEPT], next: 0, times: LatencyHistogram::new()? })
    }

    /// Notes that the samples up to `end`, exclusive, that were not noted before were given to the bus when the loop's
    /// clock read `run_ns` and the UNIX time was `unix_ns`.
    pub fn depart(&mut self, end: u64, run_ns: u64, unix_ns: u64) {
        // Of a burst longer than the table only the newest samples fit.
        for sample in self.next.max(end.saturating_sub(KEPT as u64))..end {
            self.departures[sample as usize % KEPT] = Some(Departure { sample, run_ns, unix_ns });
        }
        self.next = self.next.max(end);
    }

    /// Notes that a command with `index` was processed when the loop's clock read `run_ns`. The kernel received it at
    /// `stamp_ns` of the UNIX epoch; without a stamp its arrival time is unknown.
    pub fn arrive(&mut self, index: u16, run_ns: u64, stamp_ns: Option<u64>) {
        let departure = &mut self.departures[usize::from(index) % KEPT];
        // The entry is taken, so that only the first command with this index counts.
        let Some(Departure { run_ns: since_ns, unix_ns, .. }) = departure.take_if(|left| left.sample as u16 == index)
        else {
            return;
        };
        let passed_ns = run_ns.saturating_sub(since_ns);
        // `checked_sub` leaves out a stamp before the departure, which shows that the UNIX clock was set back
        // meanwhile.
        let time_ns = stamp_ns.and_then(|stamp_ns| stamp_ns.checked_sub(unix_ns));
        if let Some(time_ns) = time_ns.filter(|time_ns| *time_ns <= passed_ns) {
            self.times.record(time_ns);
        }
    }

    /// Returns the durations of the round trips, µs; `None` if there was none.
    pub fn percentiles(&self) -> Option<Percentiles> {
        self.times.percentiles()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIX_NS: u64 = 1_700_000_000_000_000_000;

    /// Sample 0 to `end` − 1, one a millisecond.
    fn departed(end: u64) -> RoundTrips {
        let mut trips = RoundTrips::new().unwrap();
        (0..end).for_each(|k| trips.depart(k + 1, k * 1_000_000, UNIX_NS + k * 1_000_000));
        trips
    }

    /// Number of round trips, and the longest, µs.
    fn summary(trips: &RoundTrips) -> (u64, f64) {
        (trips.times.count(), trips.percentiles().map_or(0.0, |times| times.max))
    }

    #[test]
    fn a_round_trip_ends_with_the_stamp_of_the_first_command_of_its_index() {
        let mut trips = departed(3);
        trips.arrive(1, 3_000_000, Some(UNIX_NS + 1_000_000 + 250_000));
        assert_eq!(summary(&trips), (1, 250.0));
        // The same again, one that no sample had, and one without a stamp.
        trips.arrive(1, 3_000_000, Some(UNIX_NS + 1_900_000));
        trips.arrive(7, 3_000_000, Some(UNIX_NS + 1_900_000));
        trips.arrive(0, 3_000_000, None);
        assert_eq!(summary(&trips), (1, 250.0));
        trips.arrive(2, 4_000_000, Some(UNIX_NS + 2_000_000 + 750_000));
        assert_eq!(summary(&trips), (2, 750.0));
    }

    #[test]
    fn indices_go_round_and_only_the_last_samples_are_kept() {
        let mut trips = departed(65536 + 5);
        let stamp_ns = UNIX_NS + 65538 * 1_000_000 + 40_000;
        trips.arrive(2, 65_540_000_000, Some(stamp_ns));
        assert_eq!(summary(&trips), (1, 40.0));
        trips.arrive(65530, 65_540_000_000, Some(stamp_ns));
        assert_eq!(summary(&trips), (2, 8040.0));
        trips.arrive((65536 + 4 - KEPT as u64) as u16, 65_540_000_000, Some(stamp_ns));
        assert_eq!(summary(&trips), (2, 8040.0), "too long ago");
    }

    #[test]
    fn samples_that_leave_together_leave_at_the_same_time() {
        let mut trips = RoundTrips::new().unwrap();
        trips.depart(2, 1_000_000, UNIX_NS);
        trips.arrive(0, 2_000_000, Some(UNIX_NS + 100_000));
        trips.arrive(1, 2_000_000, Some(UNIX_NS + 100_000));
        assert_eq!(summary(&trips), (2, 100.0));
    }

    #[test]
    fn what_a_clock_that_was_set_makes_of_it_is_no_round_trip() {
        let mut trips = departed(3);
        trips.arrive(0, 3_000_000, Some(UNIX_NS - 1));
        trips.arrive(1, 3_000_000, Some(UNIX_NS + 1_000_000 + 2_000_001));
        trips.arrive(2, 3_000_000, Some(UNIX_NS + 2_000_000 + 1_000_000));
        assert_eq!(summary(&trips), (1, 1000.0));
    }
}
