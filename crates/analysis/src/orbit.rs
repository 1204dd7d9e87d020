//! Periodic motions, branches of them, and bifurcations.

use alloc::vec::Vec;

use nalgebra::Complex;

use super::HarmonicBalance;
use super::continuation::{ContinuationSettings, Work};
use super::floquet::{Floquet, Stability, StabilityWork};
use super::{Coordinate, Oscillator};

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
    /// The largest truncation error of H harmonics, relative to the size of the motion.
    pub truncation: f64,
    /// The most points.
    pub most_points: usize,
    /// The settings of the continuation.
    pub continuation: ContinuationSettings,
}

impl BranchOptions {
    /// The usual most harmonics of the excitation.
    pub const MOST_HARMONICS: usize = 64;
    /// The usual most points.
    pub const MOST_POINTS: usize = 20_000;
    /// The usual largest step, relative to the motion's size.
    pub const LARGEST_STEP: f64 = 0.25;

    /// From one value to another with the usual settings.
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
            most_points: Self::MOST_POINTS,
            continuation,
        }
    }

    /// The same between other values, with the scale of the coordinate from their interval.
    pub fn between(&self, from: f64, to: f64) -> BranchOptions {
        let mut options = BranchOptions { from, to, ..*self };
        options.continuation.parameter_floor = BranchOptions::new(from, to).continuation.parameter_floor;
        options
    }

    /// The end of the interval beyond which a value is, if any.
    pub(super) fn left_at(&self, value: f64) -> Option<f64> {
        let (low, high) = (self.from.min(self.to), self.from.max(self.to));
        if value < low {
            Some(low)
        } else if value > high {
            Some(high)
        } else {
            None
        }
    }
}

/// A periodic motion on a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct Orbit {
    /// The coordinate.
    pub value: f64,
    /// Ω/2π, Hz.
    pub frequency_hz: f64,
    /// ν: periods of the excitation after which the motion repeats.
    pub period: usize,
    /// The largest |α1| and |α2| over the period, rad.
    pub amplitude_rad: [f64; 2],
    /// √(a² + b²) of the component at Ω of α1 and α2, rad.
    pub harmonic1_rad: [f64; 2],
    /// Floquet multipliers, the largest first.
    pub stability: Stability,
    /// Fourier coefficients, rad: c₀ of α1 and α2, then aₖ of both, bₖ of both, k = 1 … H, of cos kΩt/ν and sin kΩt/ν.
    pub coefficients: Vec<f64>,
    /// The arclength from the start, in units of the local size of the motion.
    pub arclength: f64,
}

impl Orbit {
    /// Whether small disturbances die out.
    pub fn is_stable(&self) -> bool {
        self.stability.is_stable()
    }

    /// The Floquet multipliers.
    pub fn multipliers(&self) -> &[Complex<f64>; 4] {
        &self.stability.multipliers
    }

    /// H.
    pub fn harmonics(&self) -> usize {
        self.coefficients.len() / 4
    }
}

/// Kinds of bifurcation of periodic motions.
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

/// A bifurcation on a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct Bifurcation {
    /// Its kind.
    pub kind: BifurcationKind,
    /// The motion there.
    pub orbit: Orbit,
    /// The number of points of the branch before it.
    pub index: usize,
    /// The direction of the new motion: for a period doubling the series of frequencies ½, 1½, … that has the
    /// multiplier −1, for a fold the null vector; empty otherwise.
    pub null_vector: Vec<f64>,
}

/// A branch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Branch {
    /// Its motions in order.
    pub orbits: Vec<Orbit>,
    /// Its bifurcations in order.
    pub bifurcations: Vec<Bifurcation>,
    /// The work of the continuation, without the location of bifurcations.
    pub work: Work,
    /// The work of the extended systems of its folds and period doublings.
    pub location_work: Work,
    /// The work of the stability of its motions, and of those evaluated between them.
    pub stability_work: StabilityWork,
}

impl Orbit {
    /// All results for the motion X of a balance, at the coordinate value set in the balance.
    pub(super) fn of<O: Oscillator>(
        balance: &mut HarmonicBalance<O>,
        floquet: &mut Floquet,
        x: &[f64],
        value: f64,
        arclength: f64,
    ) -> Orbit {
        let row = 4 * balance.subharmonic() - 2;
        let harmonic1_rad = [0, 1].map(|dof| {
            let (a, b) = (x[row + dof], x[row + 2 + dof]);
            libm::sqrt(a * a + b * b)
        });
        Orbit {
            value,
            frequency_hz: balance.coordinate(Coordinate::FrequencyHz),
            period: balance.subharmonic(),
            amplitude_rad: balance.largest_rad(x),
            harmonic1_rad,
            stability: floquet.stability(balance, x),
            coefficients: x.to_vec(),
            arclength,
        }
    }
}
