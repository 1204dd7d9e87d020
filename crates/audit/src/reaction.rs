//! How a drive ends after a stimulus.

use alloc::vec;
use alloc::vec::Vec;

use crate::case::Measure;
use crate::record::{Record, largest, rms};

/// The end of a drive after a stimulus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reaction {
    /// Time from the stimulus to the last sample with a drive, s; to the end of the record if the drive goes on.
    pub zero_s: f64,
    /// Time of the ramp, s: from the last large drive to the end. A hard stop has nearly none; `None` of a drive that goes on.
    pub ramp_s: Option<f64>,
    /// Largest drive after the stimulus over that before it.
    pub rise: f64,
}

/// Time before the stimulus whose drive is the measure of a large one, s.
const BEFORE_S: f64 = 2.0;
/// Time before the stimulus whose largest drive is compared with that after it, s.
pub(crate) const RISE_S: f64 = 3.0;

impl Reaction {
    /// Returns the figures of the end of a drive by the largest time to it, s, the least ramp of a drive that ends, s, and how much
    /// more drive there may be meanwhile, where that is limited.
    pub fn measures(&self, most_s: f64, least_ramp_s: f64, most_rise: Option<f64>) -> Vec<Measure> {
        let mut measured = vec![Measure::at_most("time to no drive", 1e3 * self.zero_s, "ms", 1e3 * most_s)];
        measured.extend(self.ramp_s.map(|ramp_s| Measure::at_least("ramp", 1e3 * ramp_s, "ms", 1e3 * least_ramp_s)));
        measured.extend(most_rise.map(|most| Measure::at_most("drive over that before", self.rise, "", most)));
        measured
    }

    /// Measures the end of the drive after sample `from`. A drive is large beyond its rms of the 2 s before, which a random
    /// drive exceeds every third sample, and a sine during half of its period.
    pub fn new(record: &Record, from: usize) -> Reaction {
        let from = from.min(record.drive.len());
        let before = |seconds| &record.drive[from.saturating_sub(record.samples(seconds))..from];
        let end = record.drive_end().max(from);
        let large = rms(before(BEFORE_S));
        let after = &record.drive[from..end];
        let last = after.iter().rposition(|drive| drive.abs() > large).map_or(0, |last| last + 1);
        Reaction {
            zero_s: (end - from) as f64 / record.rate_hz,
            ramp_s: record.is_ended().then_some((end - from - last) as f64 / record.rate_hz),
            rise: largest(after) / largest(before(RISE_S)).max(f64::MIN_POSITIVE),
        }
    }
}
