//! Flags for the continuation along a branch, shared by `continue` and `backbone`, and hints which of them help if one
//! ends early.

use clap::Args;

use crate::failure::Failure;
use resonarm::analysis::{AnalysisError, BranchOptions};
use resonarm_numeric::number::short;

/// Settings of the continuation along a branch.
#[derive(Clone, Debug, Args)]
pub(crate) struct ContinuationFlags {
    /// Most harmonics that a motion may take.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u16).range(3..=1000))]
    most_harmonics: u16,
    /// Most points of a branch.
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1..))]
    most_points: u32,
    /// Largest step along a branch, as a fraction of the motion's size.
    #[arg(long, value_name = "X", default_value_t = 0.25, allow_hyphen_values = true)]
    largest_step: f64,
}

/// The smallest fraction accepted.
const SHORTEST_STEP: f64 = 1e-6;

impl ContinuationFlags {
    /// The options of a continuation from one value to another.
    pub fn options(&self, from: f64, to: f64) -> Result<BranchOptions, Failure> {
        if !(SHORTEST_STEP..=1.0).contains(&self.largest_step) {
            return Err(Failure::Usage(format!(
                "--largest-step is {}: it must be from {SHORTEST_STEP} to 1",
                short(&self.largest_step)
            )));
        }
        let mut options = BranchOptions::new(from, to);
        options.most_harmonics = usize::from(self.most_harmonics);
        options.most_points = self.most_points as usize;
        options.continuation.largest_step = self.largest_step;
        Ok(options)
    }
}

/// The flags that help, in brackets after the message.
pub(crate) fn hint(error: &AnalysisError) -> &'static str {
    match error {
        AnalysisError::TooManyHarmonics { .. } => " (--most-harmonics)",
        AnalysisError::TooManyPoints { .. } => " (--most-points, --largest-step)",
        AnalysisError::Stuck { .. } | AnalysisError::NotLocated { .. } => " (--largest-step, --most-harmonics)",
        _ => "",
    }
}
