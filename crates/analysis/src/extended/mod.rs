//! Bifurcations by extended systems: equations that are regular where those of the branch are not, so that Newton's
//! method finds the point itself.
//!
//! | | |
//! | --- | --- |
//! | [`singular`] | folds and period doublings, and their curves in two coordinates |
//! | [`crossing`] | Neimark–Sacker points, where multipliers cross the unit circle, branch points, where branches do |

pub(super) mod crossing;
mod singular;

pub use singular::{SingularResponse, Singularity};
