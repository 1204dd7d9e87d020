//! Assigns the frames of a user protocol to samples.

use resonarm_wire::counter::Step;

/// Source of the numbers by which a message's frames are assigned to samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Numbering {
    /// A signal with the index of the sample, modulo this.
    Sample(u64),
    /// The alive counter, modulo this: one frame a sample.
    Counter(u64),
    /// Only the time stamps of the frames.
    Time,
}

/// Result of the assignment of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Placed {
    /// The frame belongs to this sample of the recording.
    At(u64),
    /// The frame repeats the one before.
    Repeated,
    /// The frame belongs to a sample before the beginning.
    Before,
}

/// A frame that was placed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Anchor {
    /// Sample of the recording to which the frame belongs.
    pub sample: u64,
    /// Number in the frame: index or counter.
    pub raw: Option<u64>,
    /// Time at which the frame arrived, ns.
    pub time_ns: u64,
    /// The place of its message among those of a sample.
    pub order: usize,
    /// Source of the number.
    pub numbering: Numbering,
}

/// Assigns the frames of one message to samples.
///
/// Index and counter wrap around: the number of wraps follows from the time stamps, as the nearest number of samples to
/// the time since the frame before. A frame whose counter and index are both the next follows the one before, whatever
/// the time.
#[derive(Clone, Debug)]
pub(super) struct FrameIndex {
    order: usize,
    /// Source of the numbers of the frames.
    pub numbering: Numbering,
    rate_hz: f64,
    /// The frame placed last.
    pub last: Option<Anchor>,
}

impl FrameIndex {
    pub const fn new(order: usize, numbering: Numbering, rate_hz: f64) -> FrameIndex {
        FrameIndex { order, numbering, rate_hz, last: None }
    }

    /// Places the next frame: `raw` is its index or counter, `step` how its counter follows, `other` a frame of another
    /// message that was placed before.
    pub fn place(&mut self, raw: Option<u64>, step: Option<Step>, time_ns: u64, other: Option<Anchor>) -> Placed {
        let sample = match (self.last, other) {
            (Some(last), _) => match self.after(last, raw, step, time_ns) {
                // Time stamps alone can't tell a repeated frame from two that came close together, so there it counts
                // for the same sample.
                0 if self.numbering != Numbering::Time => return Placed::Repeated,
                difference => last.sample.checked_add_signed(difference),
            },
            (None, Some(other)) => self.beside(other, raw, time_ns),
            (None, None) => Some(libm::floor(time_ns as f64 * 1e-9 * self.rate_hz) as u64),
        };
        let Some(sample) = sample else { return Placed::Before };
        // An older frame is no place to count from.
        if self.last.is_none_or(|last| sample > last.sample) {
            let FrameIndex { order, numbering, .. } = *self;
            let time_ns = self.followed(sample, time_ns);
            self.last = Some(Anchor { sample, raw, time_ns, order, numbering });
        }
        Placed::At(sample)
    }

    /// Returns the time from which to count. If only time stamps number the frames, it follows them by a part of the
    /// difference, so that neither late frames nor another speed of the log's clock add up.
    fn followed(&self, sample: u64, time_ns: u64) -> u64 {
        // A first-order filter: jitter of the stamps is averaged over some 16 frames, and a drift of the clock is
        // followed.
        const PART: f64 = 1.0 / 16.0;
        match (self.numbering, self.last) {
            (Numbering::Time, Some(last)) => {
                let expected_ns = last.time_ns as f64 + (sample - last.sample) as f64 * 1e9 / self.rate_hz;
                libm::round(expected_ns + PART * (time_ns as f64 - expected_ns)) as u64
            }
            _ => time_ns,
        }
    }

    /// Returns the number of samples since the frame before.
    fn after(&self, last: Anchor, raw: Option<u64>, step: Option<Step>, time_ns: u64) -> i64 {
        let expected = self.samples(last.time_ns, time_ns);
        match (self.numbering, last.raw, raw) {
            (Numbering::Sample(modulus) | Numbering::Counter(modulus), Some(before), Some(raw)) => {
                let difference = (raw + modulus - before % modulus) % modulus;
                // Counter and index agree that no frame was lost, so the time stamps may be as late as they like.
                if difference == 1 && step == Some(Step::Next) { 1 } else { nearest(difference, modulus, expected) }
            }
            _ => libm::rint(expected) as i64,
        }
    }

    /// Returns the sample of the first frame, beside one of another message: the same sample if that message comes
    /// before it in each sample and less than a period ago, or the sample that the indices of both give.
    fn beside(&self, other: Anchor, raw: Option<u64>, time_ns: u64) -> Option<u64> {
        let since = self.samples(other.time_ns, time_ns);
        // Messages of one sample come in their order. If this one comes before the other in each sample, the next
        // sample has begun.
        let guess = libm::floor(since) as i64 + i64::from(self.order < other.order);
        let difference = match (self.numbering, other.numbering, raw, other.raw) {
            (Numbering::Sample(modulus), Numbering::Sample(of_other), Some(raw), Some(before))
                if of_other.is_multiple_of(modulus) =>
            {
                nearest((raw + modulus - before % modulus) % modulus, modulus, guess as f64)
            }
            _ => guess,
        };
        other.sample.checked_add_signed(difference)
    }

    fn samples(&self, from_ns: u64, to_ns: u64) -> f64 {
        (to_ns as f64 - from_ns as f64) * 1e-9 * self.rate_hz
    }
}

/// Returns the number that is `difference` modulo `modulus` and nearest to `expected`.
fn nearest(difference: u64, modulus: u64, expected: f64) -> i64 {
    let difference = difference as f64;
    let modulus = modulus as f64;
    // difference + k·modulus for the whole k that is nearest to (expected − difference)/modulus.
    (difference + modulus * libm::rint((expected - difference) / modulus)) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn placed(numbering: Numbering, frames: &[(u64, u64)]) -> Vec<Placed> {
        let mut index = FrameIndex::new(0, numbering, 1000.0);
        frames.iter().map(|(raw, ms)| index.place(Some(*raw), None, ms * MS, None)).collect()
    }

    #[test]
    fn an_index_is_unwrapped_by_the_time() {
        use Placed::{At, Repeated};
        let frames = [(250, 5), (251, 6), (251, 6), (3, 14), (4, 1039), (2, 1037)];
        assert_eq!(placed(Numbering::Sample(256), &frames), [At(5), At(6), Repeated, At(14), At(1039), At(1037)]);
    }

    #[test]
    fn a_counter_counts_frames_and_time_alone_rounds() {
        use Placed::At;
        assert_eq!(placed(Numbering::Counter(15), &[(13, 0), (14, 1), (0, 2), (3, 5)]), [At(0), At(1), At(2), At(5)]);
        let mut index = FrameIndex::new(0, Numbering::Time, 1000.0);
        let at = |us: u64| us * 1000;
        let found = [0, 1200, 1700, 4100].map(|us| index.place(None, None, at(us), None));
        assert_eq!(found, [At(0), At(1), At(2), At(4)]);
        // A clock that is 0.1 % fast, and frames that are late by up to 0.3 ms.
        let mut index = FrameIndex::new(0, Numbering::Time, 1000.0);
        for sample in 0..5000 {
            let time_ns = sample * 1_001_000 + sample * 7919 % 300 * 1000;
            assert_eq!(index.place(None, None, time_ns, None), At(sample), "{time_ns}");
        }
    }

    /// In lockstep a sample may take any time.
    #[test]
    fn a_next_counter_is_the_next_sample_whatever_the_time() {
        let mut index = FrameIndex::new(0, Numbering::Sample(256), 1000.0);
        assert_eq!(index.place(Some(7), Some(Step::First), 0, None), Placed::At(0));
        assert_eq!(index.place(Some(8), Some(Step::Next), 700 * MS, None), Placed::At(1));
    }

    #[test]
    fn messages_of_one_sample_are_beside_each_other() {
        let mut first = FrameIndex::new(0, Numbering::Counter(16), 1000.0);
        let mut second = FrameIndex::new(1, Numbering::Counter(16), 1000.0);
        assert_eq!(first.place(Some(3), None, 2_100_000, None), Placed::At(2));
        assert_eq!(second.place(Some(9), None, 3_000_000, first.last), Placed::At(2));
        // A log that begins within a sample.
        let mut first = FrameIndex::new(0, Numbering::Counter(16), 1000.0);
        assert_eq!(first.place(Some(3), None, 3_100_000, second.last), Placed::At(3));
        // Indices tell it whatever the order.
        let mut indexed = FrameIndex::new(0, Numbering::Sample(256), 1000.0);
        let mut short = FrameIndex::new(1, Numbering::Sample(16), 1000.0);
        assert_eq!(indexed.place(Some(0x35), None, 5 * MS, None), Placed::At(5));
        assert_eq!(short.place(Some(4), None, 5_700_000, indexed.last), Placed::At(4));
    }
}
