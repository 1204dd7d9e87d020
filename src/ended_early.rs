//! Walks that end early: what they found is kept, and why they ended is told.

use core::fmt::Debug;

use serde_json::{Value, json};

use super::failure::{Failure, Verdict};
use super::output;
use resonarm::analysis::{AnalysisError, Backbone, Branch, EndedEarly, SingularCurve};

/// Something that a walk finds piece by piece.
pub(super) trait Walked {
    /// How many motions it has.
    fn motions(&self) -> usize;
}

impl Walked for Branch {
    fn motions(&self) -> usize {
        self.orbits.len()
    }
}

impl Walked for SingularCurve {
    fn motions(&self) -> usize {
        self.points.len()
    }
}

impl Walked for Backbone {
    fn motions(&self) -> usize {
        self.points.len()
    }
}

/// Why walks of a command ended early, of which something was found.
#[derive(Debug, Default)]
pub(super) struct Early(Vec<Failure>);

impl Early {
    /// What was walked, whole or in part. `along` names what varied.
    ///
    /// # Errors
    /// [`Failure::Walk`] if there is not even a part.
    pub fn keep<T: Walked + Debug>(
        &mut self,
        along: &'static str,
        walked: Result<T, EndedEarly<T>>,
    ) -> Result<T, Failure> {
        walked.or_else(|EndedEarly { reason, so_far }| {
            let kept = so_far.motions();
            let failure = Failure::Walk { along, source: reason, kept };
            if kept == 0 {
                return Err(failure);
            }
            self.0.push(failure);
            Ok(*so_far)
        })
    }

    /// The same for what is only added to a result: nothing of it is no failure yet, unless it was asked for wrongly.
    ///
    /// # Errors
    /// [`Failure::Walk`] if the interval is none.
    pub fn keep_any<T: Walked + Debug>(
        &mut self,
        along: &'static str,
        walked: Result<T, EndedEarly<T>>,
    ) -> Result<Option<T>, Failure> {
        match self.keep(along, walked) {
            Ok(found) => Ok(Some(found)),
            Err(wrong @ Failure::Walk { source: AnalysisError::Interval { .. }, .. }) => Err(wrong),
            Err(failure) => {
                self.0.push(failure);
                Ok(None)
            }
        }
    }

    /// The reasons, for a document; none if every walk came to its end.
    pub fn document(&self) -> Option<Value> {
        let reasons: Vec<String> = self.0.iter().map(Failure::to_string).collect();
        (!reasons.is_empty()).then(|| json!(reasons))
    }

    /// What the command comes to once its results are out: the last reason, the others being told.
    pub fn verdict(mut self) -> Result<Verdict, Failure> {
        let last = self.0.pop();
        self.0.iter().for_each(output::complain);
        last.map_or(Ok(Verdict::Positive), Err)
    }
}

/// What is left of a walk that ended early, behind its message.
pub(super) fn kept(motions: &usize) -> String {
    match motions {
        0 => String::new(),
        1 => String::from("; the motion before that is in the results"),
        _ => format!("; the {motions} motions before that are in the results"),
    }
}
