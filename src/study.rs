//! Parameter studies with a progress bar, Ctrl-C, and messages about what is kept.

use std::path::PathBuf;

use serde_json::Value;

use crate::failure::Failure;
use crate::supervise::supervise;
use resonarm::analysis::time_domain::BasinOutcome;
use resonarm::control::Length;
use resonarm::run::Signals;
use resonarm::structure::Dof;
use resonarm::study::{BasinComputation, Basins, Control, StudyError, SweepComputation, Sweeps};

/// Computes the sweeps that the journal lacks. `None` if it was stopped early, which is logged.
pub(crate) fn sweeps(
    name: &'static str,
    sweeps: Sweeps,
    journal: Option<PathBuf>,
    configuration: &Value,
) -> Result<Option<SweepComputation>, Failure> {
    let begun = sweeps.begin(journal.as_deref().map(|path| (path, configuration)))?;
    let done = begun.done();
    let total = begun.total();
    let ended = watch(name, "points", [done, total], move |control| begun.compute_missing(control))?;
    if !ended.is_complete() {
        stopped("points", [ended.done(), total], ended.is_kept());
        return Ok(None);
    }
    Ok(Some(ended))
}

/// Basins with the outcome of each state.
type Ended = (BasinComputation, Vec<BasinOutcome>);

/// Computes the basins that the journal lacks. `None` if it was stopped early, which is logged.
pub(crate) fn basins(
    basins: Basins,
    read: &[Dof],
    journal: Option<PathBuf>,
    configuration: &Value,
) -> Result<Option<Ended>, Failure> {
    let begun = basins.begin(journal.as_deref().map(|path| (path, configuration)))?;
    let done = begun.done();
    let total = begun.total();
    let read = read.to_vec();
    let ended = watch("basins", "states", [done, total], move |control| {
        begun.compute_missing(control)?.settle_undecided(&read, control)
    })?;
    let outcomes = ended.outcomes();
    if outcomes.is_none() {
        stopped("states", [ended.done(), total], ended.is_kept());
    }
    Ok(outcomes.map(|outcomes| (ended, outcomes)))
}

/// Does the work on a separate thread, with a progress bar and Ctrl-C.
fn watch<T: Send + 'static>(
    name: &'static str,
    what: &str,
    [done, total]: [usize; 2],
    work: impl FnOnce(&Control<'_>) -> Result<T, StudyError> + Send + 'static,
) -> Result<T, Failure> {
    if done > 0 {
        tracing::warn!("resuming after {done} of {total} {what}");
    }
    let work = move |signals: &Signals| {
        let (stop, done) = (|| signals.is_stopped(), |points| signals.set_done(points));
        work(&Control { stop: &stop, done: &done })
    };
    Ok(supervise(name, Length::Samples(total as u64), |_, _| {}, work)??)
}

fn stopped(what: &str, [done, total]: [usize; 2], is_kept: bool) {
    let advice = if is_kept {
        "the same command resumes from there"
    } else {
        "with --plot the same command would resume from there"
    };
    tracing::error!("stopped after {done} of {total} {what}; {advice}");
}
