//! Latency histograms of fixed size.

use hdrhistogram::Histogram;
use serde::Serialize;
use thiserror::Error;

/// Latencies up to here, 10 s, keep their place in a [`LatencyHistogram`]; longer ones only count, and the longest is
/// kept.
pub const HISTOGRAM_BOUND_NS: u64 = 10_000_000_000;
const SIGNIFICANT_DIGITS: u8 = 3;

/// A high dynamic range histogram of latencies: exact to three digits up to [`HISTOGRAM_BOUND_NS`].
///
/// All memory (about 200 kB) is taken by [`LatencyHistogram::new`]; recording takes none.
#[derive(Clone, Debug)]
pub struct LatencyHistogram {
    within: Histogram<u64>,
    /// Number of latencies longer than the bound.
    beyond: u64,
    max_ns: u64,
}

impl LatencyHistogram {
    /// Makes an empty histogram.
    ///
    /// # Errors
    /// [`HistogramError`] if the histogram can't be built.
    pub fn new() -> Result<Self, HistogramError> {
        let within = Histogram::new_with_bounds(1, HISTOGRAM_BOUND_NS, SIGNIFICANT_DIGITS)
            .map_err(|source| HistogramError { why: source.to_string() })?;
        Ok(Self { within, beyond: 0, max_ns: 0 })
    }

    /// Adds one latency to the histogram, ns.
    pub fn record(&mut self, latency_ns: u64) {
        self.max_ns = self.max_ns.max(latency_ns);
        // The histogram itself also takes values somewhat beyond its bound, up to the end of its last bucket.
        if latency_ns > HISTOGRAM_BOUND_NS || self.within.record(latency_ns).is_err() {
            self.beyond += 1;
        }
    }

    /// Returns the number of latencies counted.
    pub fn count(&self) -> u64 {
        self.within.len() + self.beyond
    }

    /// The latencies counted, each with how often, in ns: exact to three digits. Of those longer than
    /// [`HISTOGRAM_BOUND_NS`] all count as the longest.
    pub fn counts(&self) -> impl Iterator<Item = (u64, u64)> + '_ {
        let within = self.within.iter_recorded().map(|bucket| (bucket.value_iterated_to(), bucket.count_at_value()));
        within.chain((self.beyond > 0).then_some((self.max_ns, self.beyond)))
    }

    /// The percentiles that matter for a periodic loop; `None` if nothing was counted.
    pub fn percentiles(&self) -> Option<Percentiles> {
        (self.count() > 0).then(|| Percentiles {
            p50: self.quantile_us(5_000),
            p99: self.quantile_us(9_900),
            p99_9: self.quantile_us(9_990),
            p99_99: self.quantile_us(9_999),
            max: self.max_ns as f64 / 1e3,
        })
    }

    /// The smallest latency that at least `per_10_000` of 10000 latencies don't exceed (nearest-rank percentile), µs.
    fn quantile_us(&self, per_10_000: u64) -> f64 {
        let rank = (self.count() * per_10_000).div_ceil(10_000);
        let mut below = 0;
        for bucket in self.within.iter_recorded() {
            below += bucket.count_at_value();
            if below >= rank {
                // A bucket stands for a range. Its upper end never understates a latency, and the longest is
                // known exactly.
                return self.within.highest_equivalent(bucket.value_iterated_to()).min(self.max_ns) as f64 / 1e3;
            }
        }
        self.max_ns as f64 / 1e3 // the rank is beyond the bound, where only the longest is known
    }
}

/// Percentiles of a latency, µs. The field names are those of the program's JSON.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Percentiles {
    /// Half of all are at most this.
    pub p50: f64,
    /// 99 % of all are at most this.
    pub p99: f64,
    /// 99.9 % of all are at most this.
    pub p99_9: f64,
    /// 99.99 % of all are at most this.
    pub p99_99: f64,
    /// The longest, to the nanosecond.
    pub max: f64,
}

/// A histogram that could not be built.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("no latency histogram up to {HISTOGRAM_BOUND_NS} ns: {why}")]
pub struct HistogramError {
    /// Reason that the histogram library gave.
    pub why: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_has_no_percentiles() {
        assert_eq!(LatencyHistogram::new().unwrap().percentiles(), None);
    }

    #[test]
    fn percentiles_are_nearest_rank_to_three_digits() {
        let mut histogram = LatencyHistogram::new().unwrap();
        for us in (1..=10_000_u64).rev() {
            histogram.record(us * 1000);
        }
        let p = histogram.percentiles().unwrap();
        for (got, exact) in [(p.p50, 5_000.0), (p.p99, 9_900.0), (p.p99_9, 9_990.0), (p.p99_99, 9_999.0)] {
            assert!((got / exact - 1.0).abs() < 1e-3, "{got} is not {exact} to three digits");
        }
        assert_eq!(p.max, 10_000.0);
    }

    #[test]
    fn one_slow_tick_in_a_thousand_shows_where_it_should() {
        let mut histogram = LatencyHistogram::new().unwrap();
        // Ten of 10 000 ticks are slow. By nearest rank the percentile of 99.9 % is tick 9990, the last of the fast
        // ones, so only that of 99.99 % may show them.
        for index in 0..10_000 {
            histogram.record(if index % 1000 == 500 { 900_000 } else { 40 });
        }
        let p = histogram.percentiles().unwrap();
        assert_eq!((p.p50, p.p99, p.p99_9), (0.04, 0.04, 0.04));
        assert_eq!((p.p99_99, p.max), (900.0, 900.0));
    }

    #[test]
    fn values_beyond_the_bound_are_counted_and_the_longest_is_exact() {
        let mut histogram = LatencyHistogram::new().unwrap();
        histogram.record(HISTOGRAM_BOUND_NS);
        assert_eq!(histogram.beyond, 0);
        histogram.record(HISTOGRAM_BOUND_NS + 1);
        histogram.record(12_345_678_901_234);
        assert_eq!((histogram.count(), histogram.beyond), (3, 2));
        let p = histogram.percentiles().unwrap();
        assert_eq!((p.p50, p.max), (12_345_678_901.234, 12_345_678_901.234));
    }

    #[test]
    fn every_latency_is_in_the_counts() {
        let mut histogram = LatencyHistogram::new().unwrap();
        [5, 7, 5, HISTOGRAM_BOUND_NS + 1, HISTOGRAM_BOUND_NS + 2].iter().for_each(|ns| histogram.record(*ns));
        assert_eq!(histogram.counts().collect::<Vec<_>>(), [(5, 2), (7, 1), (HISTOGRAM_BOUND_NS + 2, 2)]);
    }

    #[test]
    fn a_latency_of_zero_counts() {
        let mut histogram = LatencyHistogram::new().unwrap();
        histogram.record(0);
        assert_eq!((histogram.count(), histogram.percentiles().unwrap().max), (1, 0.0));
    }

    #[test]
    fn the_json_keys_are_fixed() {
        let p = Percentiles { p50: 1.0, p99: 2.0, p99_9: 3.0, p99_99: 4.0, max: 5.5 };
        let json = serde_json::to_string(&p).unwrap();
        insta::assert_snapshot!(json, @r#"{"p50":1.0,"p99":2.0,"p99_9":3.0,"p99_99":4.0,"max":5.5}"#);
    }
}
