//! Periodic motions of a structure, branches of them, and bifurcations: plain data.

use alloc::vec::Vec;

use nalgebra::Complex;
use resonarm_dynamics::structure::Dof;

use super::{Coordinate, Forced};
use crate::continuation::{ContinuationSettings, Work};
use crate::{BifurcationKind, BranchOptions};

/// Whether the stability of motions is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Assess {
    /// The Floquet multipliers of every motion, and from them period doublings and Neimark–Sacker points.
    #[default]
    Multipliers,
    /// Nothing: only folds are found. The cost of a branch then hardly depends on the number of modes.
    Nothing,
}

/// What is computed along a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct TraceOptions {
    /// The interval, accuracy and steps.
    pub branch: BranchOptions,
    /// Where the motion is read.
    pub read: Vec<Dof>,
    /// Whether stability is computed.
    pub assess: Assess,
}

/// The largest truncation error of a structure with a law that isn't smooth, relative to the size of the motion: its
/// series end with a power of the frequency.
const TRUNCATION: f64 = 1e-5;
/// The largest step, relative to the motion's size: a resonance, which is a circle for the continuation, has about 60
/// points.
const LARGEST_STEP: f64 = 0.1;
/// Motions below this fraction of the static deflection count as this large.
const STATE_FLOOR: f64 = 1e-2;

impl TraceOptions {
    /// From one value of a coordinate to another with the usual settings; the motion is read at `read`.
    pub fn new(forced: &Forced, coordinate: Coordinate, [from, to]: [f64; 2], read: Vec<Dof>) -> TraceOptions {
        let mut branch = BranchOptions::new(from, to);
        if !forced.assembly.is_smooth() {
            branch.truncation = TRUNCATION;
            branch.least_harmonics = 9;
        }
        let amplitude = match coordinate {
            Coordinate::FrequencyHz | Coordinate::Parameter(_) => forced.amplitude.abs(),
            Coordinate::Amplitude => from.abs().max(to.abs()),
        };
        let deflection = super::balance::unit_deflection(forced) * amplitude;
        let state_floor = if deflection > 0.0 && deflection.is_finite() { STATE_FLOOR * deflection } else { 1e-6 };
        branch.continuation = ContinuationSettings { largest_step: LARGEST_STEP, state_floor, ..branch.continuation };
        TraceOptions { branch, read, assess: Assess::default() }
    }
}

/// A degree of freedom in a periodic motion; m, or rad at a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The largest displacement from rest, without its sign.
    pub largest: f64,
    /// Mean displacement over the period.
    pub mean: f64,
    /// The component at Ω: Im(harmonic1 · e^{iΩt}) with the drive at sin Ωt, so that its argument is the phase by which
    /// the motion leads the drive.
    pub harmonic1: Complex<f64>,
}

impl Reading {
    /// Its numbers: largest, mean, real and imaginary part of the component at Ω.
    pub fn numbers(&self) -> [f64; 4] {
        [self.largest, self.mean, self.harmonic1.re, self.harmonic1.im]
    }

    /// The reading of [`Reading::numbers`].
    pub fn from_numbers([largest, mean, re, im]: [f64; 4]) -> Reading {
        Reading { largest, mean, harmonic1: Complex::new(re, im) }
    }
}

/// A multiplier is nearer to the unit circle than this if it is on it but for rounding: without damping |μ| is 1 within
/// 1e-10 in motions that tests compute. A damping ratio of 1e-5 makes |μ| smaller by 6e-5 at resonance.
pub(super) const ROUNDING: f64 = 1e-9;

/// The Floquet multipliers of a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Stability {
    /// μ, the largest magnitude first: one for each coordinate, each velocity, and each state of an element that slips.
    pub multipliers: Vec<Complex<f64>>,
}

/// A periodic motion on a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct Orbit {
    /// Value of the coordinate that varies along the branch.
    pub value: f64,
    /// Frequency of the drive, Hz.
    pub frequency_hz: f64,
    /// The peak of the drive, N, or N·m at a joint.
    pub drive: f64,
    /// ν: periods of the drive after which the motion repeats.
    pub period: usize,
    /// The motion at each degree of freedom that is read.
    pub readings: Vec<Reading>,
    /// The multipliers, if they are computed.
    pub stability: Option<Stability>,
    /// Number of harmonics, H.
    pub harmonics: usize,
    /// Fourier coefficients of the unknowns u: those of 1, then of cos kΩt/ν and sin kΩt/ν, k = 1 … H, each of all
    /// unknowns. Of a chain u are its coordinates, rad; of modes the displacements of the elements, m.
    pub coefficients: Vec<f64>,
    /// The arclength from the start, in units of the local size of the motion.
    pub arclength: f64,
}

impl Orbit {
    /// Whether small disturbances die out; `None` if that is not computed, and if the largest |μ| is 1 within 1e-9, as
    /// without damping: the multipliers then say neither.
    pub fn is_stable(&self) -> Option<bool> {
        let largest = self.stability.as_ref()?.multipliers.first()?;
        // |μ| − 1 near the unit circle.
        let beyond = 0.5 * (largest.norm_sqr() - 1.0);
        (beyond.abs() >= ROUNDING || beyond.is_nan()).then_some(beyond < 0.0)
    }
}

/// A bifurcation on a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct Bifurcation {
    /// Kind of the bifurcation.
    pub kind: BifurcationKind,
    /// The periodic motion at the bifurcation.
    pub orbit: Orbit,
    /// The number of points of the branch before it.
    pub index: usize,
}

/// A bifurcation that was detected between two points, by a change of sign, and could not be located.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unlocated {
    /// The kind whose test function changes sign.
    pub kind: BifurcationKind,
    /// The coordinate at the points on both sides, Hz, N or N·m. At a fold the branch reaches beyond both.
    pub between: [f64; 2],
    /// The number of points of the branch before it.
    pub index: usize,
}

/// A branch of periodic motions with what was found on it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Branch {
    /// Its motions in order.
    pub orbits: Vec<Orbit>,
    /// Its bifurcations in order.
    pub bifurcations: Vec<Bifurcation>,
    /// Those that were detected and could not be located, in order.
    pub unlocated: Vec<Unlocated>,
    /// For each degree of freedom that is read, the motion with the largest displacement, located between the points;
    /// an end of the branch if the displacement is largest there.
    pub peaks: Vec<Orbit>,
    /// The work of the continuation, without the location of bifurcations and peaks.
    pub work: Work,
}
