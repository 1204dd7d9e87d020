//! Commands that did not reach the arm, by reason.

use resonarm_protocol::Refusal;

/// How many commands were refused, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Refusals {
    counts: [u64; Refusal::ALL.len()],
    last: Option<Refusal>,
}

impl Refusals {
    pub(super) fn add(&mut self, refusal: Refusal) {
        self.counts[refusal as usize - 1] += 1;
        self.last = Some(refusal);
    }

    /// The number for this reason.
    pub fn count(&self, refusal: Refusal) -> u64 {
        self.counts[refusal as usize - 1]
    }

    /// The numbers for every reason, in the order of [`Refusal::ALL`].
    pub fn iter(&self) -> impl Iterator<Item = (Refusal, u64)> + '_ {
        Refusal::ALL.into_iter().zip(self.counts)
    }

    /// The total.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// The last reason.
    pub fn last(&self) -> Option<Refusal> {
        self.last
    }
}
