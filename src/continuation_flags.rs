//! Flags for the continuation along a branch, shared by `continue` and `backbone`.

use clap::Args;

use crate::failure::Failure;
use resonarm::analysis::BranchOptions;

/// Settings of the continuation along a branch.
#[derive(Clone, Debug, Args)]
pub(crate) struct ContinuationFlags {
    /// Most harmonics that a motion may take.
    #[arg(long, value_name = "N", default_value_t = BranchOptions::MOST_HARMONICS as u16, value_parser = clap::value_parser!(u16).range(3..=1000))]
    most_harmonics: u16,
    /// Most points of a branch.
    #[arg(long, value_name = "N", default_value_t = BranchOptions::MOST_POINTS as u32, value_parser = clap::value_parser!(u32).range(1..))]
    most_points: u32,
    /// Largest step along a branch, as a fraction of the motion's size.
    #[arg(long, value_name = "X", default_value_t = BranchOptions::LARGEST_STEP)]
    largest_step: f64,
}

/// The smallest step accepted, as a fraction.
const SHORTEST_STEP: f64 = 1e-6;

impl ContinuationFlags {
    /// Returns the options with these settings.
    pub fn options(&self, mut options: BranchOptions) -> Result<BranchOptions, Failure> {
        if !(SHORTEST_STEP..=1.0).contains(&self.largest_step) {
            let why = format!("it must be from {SHORTEST_STEP} to 1");
            return Err(Failure::value("--largest-step", self.largest_step, why));
        }
        options.most_harmonics = usize::from(self.most_harmonics);
        options.most_points = self.most_points as usize;
        options.continuation.largest_step = self.largest_step;
        Ok(options)
    }
}
