//! Describes how an exciter ended, for all callers that run one.

use serde::Serialize;

use super::report::{ExciterReport, fault_text};
use resonarm_bench::node::ExciterOutcome;

/// The end of an exciter's run, as a part of a document.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ExciterEnd {
    /// The outcome in one word: finished, aborted, faulted, plant-left, stopped or failed.
    pub outcome: &'static str,
    /// The reason for an early end; `None` if it was finished or was stopped.
    pub reason: Option<String>,
}

impl ExciterEnd {
    /// Describes the end of a controller's work; without an outcome it was stopped.
    pub fn of(outcome: Option<&ExciterOutcome>) -> ExciterEnd {
        let (outcome, reason) = match outcome {
            Some(ExciterOutcome::Finished) => ("finished", None),
            Some(ExciterOutcome::Aborted(abort)) => ("aborted", Some(abort.to_string())),
            Some(ExciterOutcome::Faulted(emergency)) => ("faulted", Some(fault_text(emergency, None, None, None))),
            Some(ExciterOutcome::PlantLeft) => {
                ("plant-left", Some(String::from("the plant left the bus before the excitation was over")))
            }
            Some(ExciterOutcome::Stopped) | None => ("stopped", None),
        };
        ExciterEnd { outcome, reason }
    }

    /// Describes the end with the run's knowledge of a fault; an error of the run is left out.
    pub fn of_controller(report: &ExciterReport) -> ExciterEnd {
        let end = ExciterEnd::of(report.outcome.as_ref());
        ExciterEnd { reason: report.fault_text().or(end.reason), ..end }
    }

    /// Says whether it was asked to stop before the controller had finished.
    pub fn is_stopped(&self) -> bool {
        self.outcome == "stopped"
    }

    /// Says whether the controller completed its work.
    pub fn is_finished(&self) -> bool {
        self.outcome == "finished"
    }
}

impl From<&ExciterReport> for ExciterEnd {
    /// An error of the run takes precedence over the controller's outcome.
    fn from(report: &ExciterReport) -> ExciterEnd {
        match &report.error {
            Some(error) => ExciterEnd { outcome: "failed", reason: Some(error.to_string()) },
            None => ExciterEnd::of_controller(report),
        }
    }
}
