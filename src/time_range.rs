//! A range of simulated time, for the commands on recordings.

use clap::Args;

/// The beginning and the end of the range.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct TimeRange {
    /// From this simulated time on, s [default: the beginning].
    #[arg(long, value_name = "S")]
    pub from_s: Option<f64>,
    /// Up to this simulated time, s [default: the end].
    #[arg(long, value_name = "S")]
    pub to_s: Option<f64>,
}
