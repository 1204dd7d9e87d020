//! Parameter studies: many responses of a structure, computed on all cores, which can be stopped and resumed.
//!
//! In [`Sweeps`] each response starts where the one before ended; [`Basins`] say which initial states reach which
//! stable response. Finished points go into a [`Journal`], so that a study that was stopped, or killed, continues from
//! there and produces bit-identical results. [`on_all_cores`] spreads independent jobs.

mod basins;
mod journal;
mod parallel;
mod sweeps;

use thiserror::Error;

pub use basins::{BasinComputation, Basins, StateGrid};
pub(crate) use journal::difference;
pub use journal::{Journal, JournalError};
pub use parallel::on_all_cores;
pub use sweeps::{SweepComputation, SweepPoint, Sweeps};

use resonarm_analysis::time_domain::TimeDomainError;

/// Callbacks that watch and stop a study; both are called from its threads.
#[derive(Clone, Copy)]
pub struct Control<'a> {
    /// Whether to stop; called regularly.
    pub stop: &'a (dyn Fn() -> bool + Sync),
    /// Called after each point, with the number finished.
    pub done: &'a (dyn Fn(u64) + Sync),
}

/// Error of a study that ends without a result.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A response can't be computed.
    #[error(transparent)]
    TimeDomain(#[from] TimeDomainError),
    /// The journal can't be used.
    #[error(transparent)]
    Journal(#[from] JournalError),
}

#[cfg(test)]
mod tests {
    use super::Control;
    use resonarm_analysis::{Coordinate, Forced, TraceOptions, trace};
    use resonarm_dynamics::structure::{
        Assembly, Axis, BodySpec, Dof, ElementSpec, Law, ModalSpec, ModeSpec, Place, ShapeSpec, StructureSpec,
    };

    pub(super) const QUIET: Control<'static> = Control { stop: &|| false, done: &|_done| () };

    /// An oscillator that hardens so that its resonance folds over.
    pub(super) fn hardening() -> (Forced, Dof) {
        let tip = Place::Dof { point: "tip".into(), axis: Axis::X };
        let body = ModalSpec {
            modes: vec![ModeSpec { frequency_hz: 10.0, damping_ratio: 0.02 }],
            shapes: vec![ShapeSpec { point: "tip".into(), axis: Axis::X, by_mode: vec![1.0] }],
        };
        let law = Law::Cubic { stiffness3: 4e6, stiffness5: 0.0 };
        let elements = vec![ElementSpec::Point { at: tip, to: None, law }];
        let assembly = Assembly::new(&StructureSpec { body: BodySpec::Modal(body), elements }).unwrap();
        let dof = assembly.dof("tip.x").unwrap();
        (Forced::new(assembly, dof, 2.0), dof)
    }

    /// Returns the frequencies of its folds, Hz.
    pub(super) fn folds_hz(forced: &Forced, dof: Dof) -> Vec<f64> {
        let options = TraceOptions::new(forced, Coordinate::FrequencyHz, [8.0, 20.0], vec![dof]);
        let branch = trace(forced, 8.0, Coordinate::FrequencyHz, &options).unwrap();
        branch.bifurcations.iter().map(|found| found.orbit.frequency_hz).collect()
    }
}
