//! The ensemble over the cores.

use std::num::NonZeroUsize;
use std::thread;

use super::lanes::WIDEST;
use super::{Ensemble, EnsembleError, same_count};

use crate::integrate::Excitation;

impl Ensemble {
    /// As [`Ensemble::advance`], with the arms divided over `threads` threads; the states are the same bit for bit.
    ///
    /// # Errors
    /// As [`Ensemble::advance`].
    pub fn advance_on<E: Excitation + Sync>(
        &mut self,
        threads: NonZeroUsize,
        steps: u32,
        excitations: &[E],
    ) -> Result<(), EnsembleError> {
        same_count(self.arms.len(), "excitations", excitations.len())?;
        let stretch = self.stretch(steps);
        // Whole groups of the widest kind, so that no thread leaves lanes empty that another could fill.
        let share = self.arms.len().div_ceil(threads.get()).next_multiple_of(WIDEST);
        thread::scope(|scope| {
            let parts = self.arms.chunks(share).zip(self.motions.chunks_mut(share)).zip(excitations.chunks(share));
            for ((arms, motions), excitations) in parts {
                scope.spawn(move || stretch.advance(arms, motions, excitations));
            }
        });
        self.finish(steps)
    }
}
