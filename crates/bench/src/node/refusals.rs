//! Counts of commands that did not reach the arm, by reason.

use crate::rig::Load;
use resonarm_protocol::Refusal;

/// A command that was rejected because of its load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefusedLoad {
    /// Last measured sample at that time.
    pub sample: u64,
    /// Load of the command.
    pub load: Load,
    /// Reason for the rejection.
    pub refusal: Refusal,
}

/// Counts of rejected commands, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Refusals {
    counts: [u64; Refusal::ALL.len()],
    last: Option<Refusal>,
    first_load: Option<RefusedLoad>,
}

impl Refusals {
    pub(super) fn add(&mut self, refusal: Refusal) {
        // The numbers of reasons begin with 1.
        self.counts[refusal as usize - 1] += 1;
        self.last = Some(refusal);
    }

    /// Keeps the first command that is rejected because of its load.
    pub(super) fn keep_load(&mut self, refused: RefusedLoad) {
        if matches!(refused.refusal, Refusal::OutOfRange | Refusal::RateOfChange | Refusal::Travel) {
            self.first_load.get_or_insert(refused);
        }
    }

    /// Returns the first command rejected because of its load: beyond a limit, too fast a change, or beyond the
    /// travel.
    pub fn first_load(&self) -> Option<RefusedLoad> {
        self.first_load
    }

    /// Returns the number of commands rejected for this reason.
    pub fn count(&self, refusal: Refusal) -> u64 {
        self.counts[refusal as usize - 1]
    }

    /// Returns the numbers for all reasons, in the order of [`Refusal::ALL`].
    pub fn iter(&self) -> impl Iterator<Item = (Refusal, u64)> + '_ {
        Refusal::ALL.into_iter().zip(self.counts)
    }

    /// Returns the number of all rejected commands.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Returns the reason of the last rejection.
    pub fn last(&self) -> Option<Refusal> {
        self.last
    }
}
