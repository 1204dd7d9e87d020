//! Parameter studies under supervision: a progress bar, Ctrl-C, and words about what is kept.

use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use super::failure::Failure;
use super::supervise::supervise;
use crate::run::Signals;
use crate::study::{Chains, Control, Walk};

/// Walks along the chains, from what the journal holds. `None` if it was stopped before its end, which is told.
pub(super) fn walk(
    name: &'static str,
    chains: Chains,
    journal: Option<(&Path, &Value)>,
) -> Result<Option<Walk>, Failure> {
    let walk = chains.begin(journal)?;
    let total = walk.total();
    if walk.done() > 0 {
        tracing::warn!("going on after {} of {total} points", walk.done());
    }
    let signals = Arc::new(Signals::default());
    let watched = Arc::clone(&signals);
    let work = move || {
        let (stop, done) = (|| watched.is_stopped(), |points| watched.set_done(points));
        walk.go_on(&Control { stop: &stop, done: &done })
    };
    let walk = supervise(name, &signals, Some(total as u64), || {}, work)??;
    if walk.is_complete() {
        return Ok(Some(walk));
    }
    let advice = if walk.is_kept() {
        "the same command goes on from there"
    } else {
        "with --out the same command would go on from there"
    };
    tracing::error!("stopped after {} of {total} points; {advice}", walk.done());
    Ok(None)
}
