//! Parameter studies: many motions of the arm, or of a structure, computed over all cores, which can be stopped and
//! resumed.
//!
//! [`Chains`] are motions of which each begins where the one before ended, as in a stepped sweep. What is finished goes
//! into a [`Journal`], so that a study that was stopped, or killed, continues from there and gives the same bits; so do
//! [`Basins`], which say which initial states reach which stable motion. [`on_all_cores`] spreads independent jobs.

mod basins;
mod chains;
mod journal;
mod parallel;
mod structures;

use thiserror::Error;

pub use basins::{BasinComputation, BasinStudy, Basins, StateGrid};
pub use chains::{Chain, ChainComputation, ChainStudy, Chains, Point};
pub use journal::{Journal, JournalError};
pub use parallel::on_all_cores;
pub use structures::{StructureBasins, StructureChains, StructurePoint};

use resonarm_analysis::time_domain::TimeDomainError;

/// How a study is watched, and stopped; both are called from its threads.
#[derive(Clone, Copy)]
pub struct Control<'a> {
    /// Whether to stop; asked now and then.
    pub stop: &'a (dyn Fn() -> bool + Sync),
    /// Called after each point, with the number finished.
    pub done: &'a (dyn Fn(u64) + Sync),
}

/// What ends a study without a result.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A motion can't be computed.
    #[error(transparent)]
    TimeDomain(#[from] TimeDomainError),
    /// The journal can't be used.
    #[error(transparent)]
    Journal(#[from] JournalError),
}
