//! Flags for the continuation along a branch, shared by `continue` and `backbone`.

use clap::Args;

use crate::failure::Failure;
use crate::help::heading;
use crate::numbers;
use resonarm::analysis::BranchOptions;

/// Settings of the continuation along a branch.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::COMPUTATION)]
pub(crate) struct ContinuationFlags {
    /// Most harmonics of a motion, from 3 to 1000.
    #[arg(long, value_name = "N", default_value_t = BranchOptions::MOST_HARMONICS as u16, value_parser = numbers::integer(3..=1000_u16))]
    most_harmonics: u16,
    /// Most points of a branch.
    #[arg(long, value_name = "N", default_value_t = BranchOptions::MOST_POINTS as u32, value_parser = numbers::integer(1..=u32::MAX))]
    most_points: u32,
    /// Largest step along a branch, over the motion's size.
    ///
    /// It is a fraction from 1e-6 to 1.
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
