//! The options with which a branch is traced, and the kinds of bifurcation on it.

use super::continuation::ContinuationSettings;

/// The interval and accuracy of a branch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BranchOptions {
    /// The coordinate at the start.
    pub from: f64,
    /// The coordinate at the end.
    pub to: f64,
    /// The least harmonics of the excitation, 1 or more.
    pub least_harmonics: usize,
    /// The most harmonics of the excitation.
    pub most_harmonics: usize,
    /// The largest truncation error of H harmonics, relative to the size of the response.
    pub truncation: f64,
    /// Whether the branch ends at a response that needs more than `most_harmonics`. Otherwise it goes on, and its
    /// responses state their error.
    pub ends_if_truncated: bool,
    /// Largest number of points; a branch that needs more ends early.
    pub most_points: usize,
    /// The settings of the continuation.
    pub continuation: ContinuationSettings,
}

impl BranchOptions {
    /// The usual most harmonics of the excitation.
    pub const MOST_HARMONICS: usize = 64;
    /// The usual most points.
    pub const MOST_POINTS: usize = 20_000;
    /// The usual largest step, relative to the response's size.
    pub const LARGEST_STEP: f64 = 0.25;

    /// The usual settings for a branch from one value to another.
    pub fn new(from: f64, to: f64) -> BranchOptions {
        let floor = 0.05 * (to - from).abs();
        let parameter_floor = floor.max(f64::MIN_POSITIVE);
        let continuation = ContinuationSettings {
            parameter_floor,
            largest_step: Self::LARGEST_STEP,
            ..ContinuationSettings::default()
        };
        BranchOptions {
            from,
            to,
            least_harmonics: 3,
            most_harmonics: Self::MOST_HARMONICS,
            truncation: 1e-9,
            ends_if_truncated: false,
            most_points: Self::MOST_POINTS,
            continuation,
        }
    }

    /// These options for another interval, with the scale of the coordinate taken from that interval.
    pub fn between(&self, from: f64, to: f64) -> BranchOptions {
        let mut options = BranchOptions { from, to, ..*self };
        options.continuation.parameter_floor = BranchOptions::new(from, to).continuation.parameter_floor;
        options
    }

    /// Returns the end of the interval beyond which a value lies, if any.
    pub(crate) fn left_at(&self, value: f64) -> Option<f64> {
        let low = self.from.min(self.to);
        let high = self.from.max(self.to);
        if value < low {
            Some(low)
        } else if value > high {
            Some(high)
        } else {
            None
        }
    }
}

/// Kinds of bifurcation of periodic responses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BifurcationKind {
    /// `fold`: a multiplier passes 1 and the branch turns back (saddle-node, limit point).
    Fold,
    /// `period-doubling`: a multiplier passes −1 (flip).
    PeriodDoubling,
    /// `neimark-sacker`: a complex pair passes the unit circle (torus).
    NeimarkSacker,
    /// `branch-point`: two branches cross.
    BranchPoint,
}

impl BifurcationKind {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            BifurcationKind::Fold => "fold",
            BifurcationKind::PeriodDoubling => "period-doubling",
            BifurcationKind::NeimarkSacker => "neimark-sacker",
            BifurcationKind::BranchPoint => "branch-point",
        }
    }
}
