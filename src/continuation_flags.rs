//! Flags for the continuation along a branch, shared by `continue` and `backbone`.

use core::ops::RangeInclusive;

use clap::Args;

use crate::failure::Failure;
use crate::help::heading;
use crate::numbers;
use resonarm::analysis::BranchOptions;

/// Settings of the continuation along a branch.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = heading::COMPUTATION)]
pub(crate) struct ContinuationFlags {
    /// Largest number of harmonics of a response, from 3 to 1000.
    #[arg(long, value_name = "N", default_value_t = BranchOptions::MOST_HARMONICS as u16, value_parser = numbers::integer(3..=1000_u16))]
    most_harmonics: u16,
    /// Largest error from the neglected harmonics, relative to the response.
    ///
    /// Harmonics are added until the error is below it, from 1e-14 to 0.1. By default it depends on the elements: 1e-9 for
    /// linear ones, cubic ones and polynomials, and for the links of a chain, 1e-6 for tanh, and 1e-5 for steep tanh, friction, gaps and
    /// contacts. With several kinds of elements the largest of these applies.
    #[arg(long, value_name = "X")]
    tolerance: Option<f64>,
    /// Most points of a branch.
    #[arg(long, value_name = "N", default_value_t = BranchOptions::MOST_POINTS as u32, value_parser = numbers::integer(1..=u32::MAX))]
    most_points: u32,
    /// Largest step along the branch, relative to the response.
    ///
    /// It is a fraction from 1e-6 to 1.
    #[arg(long, value_name = "X", default_value_t = BranchOptions::LARGEST_STEP)]
    largest_step: f64,
}

/// Tolerances that rounding allows, and that still describe a response.
const TOLERANCES: RangeInclusive<f64> = 1e-14..=0.1;
/// The smallest step accepted, as a fraction.
const SHORTEST_STEP: f64 = 1e-6;

impl ContinuationFlags {
    /// Returns the options with these settings.
    pub fn options(&self, mut options: BranchOptions) -> Result<BranchOptions, Failure> {
        if !(SHORTEST_STEP..=1.0).contains(&self.largest_step) {
            let why = format!("it must be from {SHORTEST_STEP} to 1");
            return Err(Failure::value("--largest-step", self.largest_step, why));
        }
        if let Some(tolerance) = self.tolerance {
            if !TOLERANCES.contains(&tolerance) {
                let why = format!("it must be from {:e} to {}", TOLERANCES.start(), TOLERANCES.end());
                return Err(Failure::value("--tolerance", tolerance, why));
            }
            options.truncation = tolerance;
        }
        options.most_harmonics = usize::from(self.most_harmonics);
        options.most_points = self.most_points as usize;
        options.continuation.largest_step = self.largest_step;
        Ok(options)
    }
}
