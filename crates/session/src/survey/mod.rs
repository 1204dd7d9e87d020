//! Surveys: plans of runs that measure the modes of a structure, and folders with their recordings.
//!
//! A [`SurveyPlan`] has a run for each level of force, each place of the exciter and each group of accelerometers. A [`Survey`]
//! makes the recordings on all cores, and continues where an earlier one was stopped or killed. A [`SurveyIndex`] is the list of
//! recordings in a folder, `index.json`; it can also list recordings of a real structure.

mod error;
mod excitation;
mod index;
mod plan;
mod runs;

pub use error::SurveyError;
pub use excitation::SurveyExcitation;
pub use index::{LeftOut, PlanSummary, RunState, SurveyIndex, SurveyRun};
pub use plan::{MOST_ACCELEROMETERS, PlannedRun, SurveyPlan, SurveyRequest, displacements};
pub use runs::Survey;

#[cfg(test)]
mod tests;
