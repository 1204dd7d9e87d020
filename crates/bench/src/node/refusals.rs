//! Commands that did not reach the arm, by reason.

use crate::rig::Load;
use resonarm_protocol::Refusal;

/// A command that was refused for its load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefusedLoad {
    /// The sample measured last.
    pub sample: u64,
    /// The load.
    pub load: Load,
    /// Why.
    pub refusal: Refusal,
}

/// How many commands were refused, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Refusals {
    counts: [u64; Refusal::ALL.len()],
    last: Option<Refusal>,
    first_load: Option<RefusedLoad>,
}

impl Refusals {
    pub(super) fn add(&mut self, refusal: Refusal) {
        self.counts[refusal as usize - 1] += 1;
        self.last = Some(refusal);
    }

    /// Keeps the first command that is refused for its load.
    pub(super) fn keep_load(&mut self, refused: RefusedLoad) {
        if matches!(refused.refusal, Refusal::OutOfRange | Refusal::RateOfChange | Refusal::Travel) {
            self.first_load.get_or_insert(refused);
        }
    }

    /// The first command that was refused for its load: beyond a limit, too fast a change, or beyond the travel.
    pub fn first_load(&self) -> Option<RefusedLoad> {
        self.first_load
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
