//! Continuations that end early: their results are kept, and the reason is reported.

use core::fmt::Debug;

use serde_json::{Value, json};

use crate::failure::{Failure, Verdict};
use crate::output;
use resonarm::analysis::{AnalysisError, Branch, EndedEarly};

/// Counts the responses of a branch.
pub(crate) fn of_branch(branch: &Branch) -> usize {
    branch.orbits.len()
}

/// The reasons why a command's continuations ended early.
#[derive(Debug, Default)]
pub(crate) struct Early(Vec<Failure>);

impl Early {
    /// Returns the result of a continuation, complete or not. `along` names the quantity that varied, and `responses`
    /// counts the responses in the result.
    ///
    /// # Errors
    /// [`Failure::BranchEndedEarly`] if it holds no response.
    pub fn keep<T: Debug>(
        &mut self,
        along: &str,
        traced: Result<T, EndedEarly<T>>,
        responses: fn(&T) -> usize,
    ) -> Result<T, Failure> {
        traced.or_else(|EndedEarly { reason, so_far }| {
            let kept = responses(&so_far);
            let failure = Failure::BranchEndedEarly { along: along.to_owned(), source: reason, kept };
            if kept == 0 {
                return Err(failure);
            }
            self.0.push(failure);
            Ok(*so_far)
        })
    }

    /// Returns the result of a continuation that adds to another: finding nothing is no failure, unless the request was
    /// wrong.
    ///
    /// # Errors
    /// [`Failure::BranchEndedEarly`] if the interval is invalid.
    pub fn keep_any<T: Debug>(
        &mut self,
        along: &str,
        traced: Result<T, EndedEarly<T>>,
        responses: fn(&T) -> usize,
    ) -> Result<Option<T>, Failure> {
        match self.keep(along, traced, responses) {
            Ok(found) => Ok(Some(found)),
            Err(wrong @ Failure::BranchEndedEarly { source: AnalysisError::Interval { .. }, .. }) => Err(wrong),
            Err(failure) => {
                self.0.push(failure);
                Ok(None)
            }
        }
    }

    /// Returns the reasons, for a document; `None` if every continuation was completed.
    pub fn document(&self) -> Option<Value> {
        let reasons: Vec<String> = self.0.iter().map(Failure::to_string).collect();
        (!reasons.is_empty()).then(|| json!(reasons))
    }

    /// Returns the command's verdict once its results are out: fails with the last reason and reports the others.
    pub fn verdict(mut self) -> Result<Verdict, Failure> {
        // A command fails with one error, which `main` prints. The others are printed here, before it.
        let last = self.0.pop();
        self.0.iter().for_each(output::complain);
        last.map_or(Ok(Verdict::Positive), Err)
    }
}
