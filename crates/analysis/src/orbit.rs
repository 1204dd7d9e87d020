//! Periodic responses of a structure, branches of them, and bifurcations: plain data.

use alloc::vec::Vec;

use core::f64::consts::TAU;

use nalgebra::Complex;
use resonarm_dynamics::structure::{Dof, Element, Law};

use crate::branch_options::{BifurcationKind, BranchOptions};
use crate::continuation::{ContinuationSettings, Work};
use crate::forced::{Coordinate, Forced};

/// Whether the stability of the responses is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Assess {
    /// Computes the Floquet multipliers of every response, and from them period doublings and Neimark–Sacker points.
    #[default]
    Multipliers,
    /// Computes no stability: only folds are found. The cost of a branch then hardly depends on the number of modes.
    Nothing,
}

/// Options of [`trace`](super::trace): what is computed along a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct TraceOptions {
    /// The interval, accuracy and steps.
    pub branch: BranchOptions,
    /// Degrees of freedom at which the response is read.
    pub read: Vec<Dof>,
    /// Whether stability is computed.
    pub assess: Assess,
    /// A state at phase 0 of the drive, at `branch.from`, near which the branch starts: coordinates, rates, and possibly
    /// the states of the elements. The response may repeat after several periods of the drive. Without it the first
    /// response is found from rest.
    pub near: Option<Vec<f64>>,
}

/// The largest truncation errors, relative to the size of the response, by the law of the forces. The series of
/// polynomials fall exponentially with the frequency, so that a small error costs few harmonics. Those of laws with kinks
/// fall with a power of it, and so do those of tanh until its steps are resolved. With a tolerance of 1e-4 the branch of a
/// contact can have folds that it does not have with more harmonics.
const POLYNOMIAL_TOLERANCE: f64 = 1e-9;
const TANH_TOLERANCE: f64 = 1e-6;
const KINK_TOLERANCE: f64 = 1e-5;
/// Below this fraction of the velocity the v0 of tanh is so steep that its series falls as that of friction.
const STEEP: f64 = 0.05;
/// The largest step, relative to the response's size: a resonance, which is a circle for the continuation, has about 60
/// points.
const LARGEST_STEP: f64 = 0.1;
/// Responses below this fraction of the static deflection count as this large.
const STATE_FLOOR: f64 = 1e-2;

/// Returns the usual tolerance for a law whose displacement has velocities of this order, m/s.
fn tolerance(law: &Law, velocity: f64) -> f64 {
    match *law {
        Law::Cubic { .. } | Law::Linear { .. } => POLYNOMIAL_TOLERANCE,
        Law::Tanh { velocity: scale, .. } if scale >= STEEP * velocity => TANH_TOLERANCE,
        Law::Tanh { .. }
        | Law::Friction { .. }
        | Law::Lugre { .. }
        | Law::Gap { .. }
        | Law::KelvinVoigt { .. }
        | Law::HuntCrossley { .. } => KINK_TOLERANCE,
    }
}

impl TraceOptions {
    /// The usual settings for a branch from one value of a coordinate to another; the response is read at `read`.
    pub fn new(forced: &Forced, coordinate: Coordinate, [from, to]: [f64; 2], read: Vec<Dof>) -> TraceOptions {
        let mut branch = BranchOptions::new(from, to);
        if !forced.assembly.is_smooth() {
            branch.least_harmonics = 9;
        }
        branch.least_harmonics = branch.least_harmonics.max(forced.highest_order());
        let amplitude = match coordinate {
            Coordinate::FrequencyHz | Coordinate::Parameter(_) => forced.amplitude.abs(),
            Coordinate::Amplitude => from.abs().max(to.abs()),
        };
        let deflection = super::balance::unit_deflection(forced) * amplitude;
        let highest_hz = if coordinate == Coordinate::FrequencyHz { from.max(to) } else { 0.0 };
        let tolerance = |element: &Element| tolerance(&element.law, TAU * highest_hz * deflection);
        // The largest of all: the others' harmonics do not make up for those of one.
        branch.truncation = forced.assembly.elements().iter().map(tolerance).fold(POLYNOMIAL_TOLERANCE, f64::max);
        let state = super::balance::unit_state(forced) * amplitude;
        let state_floor = if state > 0.0 && state.is_finite() { STATE_FLOOR * state } else { 1e-6 };
        branch.continuation = ContinuationSettings { largest_step: LARGEST_STEP, state_floor, ..branch.continuation };
        TraceOptions { branch, read, assess: Assess::default(), near: None }
    }
}

/// Displacement of a degree of freedom in a periodic response; m, or rad at a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The largest displacement from rest, without its sign.
    pub largest: f64,
    /// Mean displacement over the period.
    pub mean: f64,
    /// The component at Ω: Im(harmonic1 · e^{iΩt}) with the drive at sin Ωt, so that its argument is the phase by which
    /// the response leads the drive.
    pub harmonic1: Complex<f64>,
}

impl Reading {
    /// Returns its numbers: largest, mean, real and imaginary part of the component at Ω.
    pub fn numbers(&self) -> [f64; 4] {
        [self.largest, self.mean, self.harmonic1.re, self.harmonic1.im]
    }

    /// Makes the reading of which these are the [`Reading::numbers`].
    pub fn from_numbers([largest, mean, re, im]: [f64; 4]) -> Reading {
        Reading { largest, mean, harmonic1: Complex::new(re, im) }
    }
}

/// A multiplier is nearer to the unit circle than this if it is on it but for rounding: without damping |μ| is 1 within
/// 1e-10 in the responses that tests compute. A damping ratio of 1e-5 makes |μ| smaller by 6e-5 at resonance.
pub(super) const ROUNDING: f64 = 1e-9;

/// The Floquet multipliers of a periodic response.
#[derive(Clone, Debug, PartialEq)]
pub struct Stability {
    /// μ, the largest magnitude first: one for each coordinate, each velocity, and each state of an element that slips.
    pub multipliers: Vec<Complex<f64>>,
    /// How far the largest |μ| is from that of a coarser method: by the steps of the flow, or 1e-8 where other methods are
    /// used.
    pub accuracy: f64,
    /// Whether the structure conserves energy.
    pub conservative: bool,
}

/// What the multipliers say about small disturbances of a response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// `stable`: they die out.
    Stable,
    /// `unstable`: at least one disturbance grows.
    Unstable,
    /// `undecided`: the largest |μ| is 1 within its accuracy.
    Undecided,
    /// `conservative`: they neither die out nor grow, since nothing dissipates energy.
    Conservative,
}

impl Verdict {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            Verdict::Stable => "stable",
            Verdict::Unstable => "unstable",
            Verdict::Undecided => "undecided",
            Verdict::Conservative => "conservative",
        }
    }
}

/// Three times the distance between two methods bounds the error of the better one.
const ACCURACIES: f64 = 3.0;

impl Stability {
    /// Decides by the largest |μ| and its accuracy.
    pub fn verdict(&self) -> Verdict {
        // |μ| − 1 near the unit circle.
        let beyond = self.multipliers.first().map_or(f64::NAN, |largest| 0.5 * (largest.norm_sqr() - 1.0));
        if beyond.abs() < ROUNDING.max(ACCURACIES * self.accuracy) {
            return if self.conservative { Verdict::Conservative } else { Verdict::Undecided };
        }
        if beyond < 0.0 { Verdict::Stable } else { Verdict::Unstable }
    }
}

/// A periodic response on a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct Orbit {
    /// Value of the coordinate that varies along the branch.
    pub value: f64,
    /// Frequency of the drive, Hz.
    pub frequency_hz: f64,
    /// The peak of the drive, N, or N·m at a joint.
    pub drive: f64,
    /// ν: periods of the drive after which the response repeats.
    pub period: usize,
    /// The response at each degree of freedom that is read.
    pub readings: Vec<Reading>,
    /// The multipliers, if they are computed.
    pub stability: Option<Stability>,
    /// Number of harmonics, H.
    pub harmonics: usize,
    /// Estimate of what the harmonics that are left out change, relative to the size of the response.
    pub truncation_error: f64,
    /// Fourier coefficients of the unknowns u: those of 1, then of cos kΩt/ν and sin kΩt/ν, k = 1 … H, each of all
    /// unknowns. For a chain u are its coordinates, rad; for modes they are the displacements of the elements, m.
    pub coefficients: Vec<f64>,
    /// The arclength from the start, in units of the local size of the response.
    pub arclength: f64,
}

impl Orbit {
    /// Says whether small disturbances die out; `None` if that is not computed, and if the multipliers say neither: see
    /// [`Verdict`].
    pub fn is_stable(&self) -> Option<bool> {
        match self.stability.as_ref()?.verdict() {
            Verdict::Stable => Some(true),
            Verdict::Unstable => Some(false),
            Verdict::Undecided | Verdict::Conservative => None,
        }
    }
}

/// A bifurcation on a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct Bifurcation {
    /// Kind of the bifurcation.
    pub kind: BifurcationKind,
    /// The periodic response at the bifurcation.
    pub orbit: Orbit,
    /// The number of points of the branch before it.
    pub index: usize,
}

/// The vibration that begins at a Neimark–Sacker point: a second frequency beside that of the response, as a beat of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beat {
    /// The rotation number ρ = arg μ/2π of the pair of multipliers on the unit circle, from 0 to ½: the part of a turn
    /// that the beat advances in a period of the response.
    pub rotation_number: f64,
    /// The second frequency ρΩ/2πν, Hz, up to multiples of that of the response.
    pub frequency_hz: f64,
}

impl Bifurcation {
    /// Returns the beat that begins at a Neimark–Sacker point; `None` at other bifurcations.
    pub fn beat(&self) -> Option<Beat> {
        if self.kind != BifurcationKind::NeimarkSacker {
            return None;
        }
        let pairs = self.orbit.stability.iter().flat_map(|stability| &stability.multipliers).filter(|mu| mu.im > 0.0);
        let off = |mu: &Complex<f64>| (mu.norm_sqr() - 1.0).abs();
        let mu = pairs.min_by(|a, b| off(a).total_cmp(&off(b)))?;
        let rotation_number = libm::atan2(mu.im, mu.re) / TAU;
        let base_hz = self.orbit.frequency_hz / self.orbit.period as f64;
        Some(Beat { rotation_number, frequency_hz: rotation_number * base_hz })
    }
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

/// How a branch ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BranchEnd {
    /// `early`: it could not be followed further.
    #[default]
    Early,
    /// `at-end`: at the end of the interval.
    AtEnd,
    /// `at-start`: it turned back and left the interval at its start.
    AtStart,
    /// `rejoined`: it met a branch of the kind that it leaves. Beyond are its responses again: mirrored, or shifted by periods
    /// of the drive.
    Rejoined,
    /// `closed`: it came back to its first response.
    Closed,
}

impl BranchEnd {
    /// The name in results.
    pub const fn name(self) -> &'static str {
        match self {
            BranchEnd::Early => "early",
            BranchEnd::AtEnd => "at-end",
            BranchEnd::AtStart => "at-start",
            BranchEnd::Rejoined => "rejoined",
            BranchEnd::Closed => "closed",
        }
    }
}

/// A branch of periodic responses with its bifurcations and peaks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Branch {
    /// Its periodic responses in order.
    pub orbits: Vec<Orbit>,
    /// The end of the branch, and whether it is the end of the interval.
    pub end: BranchEnd,
    /// Its bifurcations in order.
    pub bifurcations: Vec<Bifurcation>,
    /// Bifurcations that were detected and could not be located, in order.
    pub unlocated: Vec<Unlocated>,
    /// For each degree of freedom that is read, the response with the largest displacement, located between the points;
    /// an end of the branch if the displacement is largest there.
    pub peaks: Vec<Orbit>,
    /// The work of the continuation, without the location of bifurcations and peaks.
    pub work: Work,
}

impl Branch {
    /// The period of its responses, in periods of the drive; `None` if it has none.
    pub fn period(&self) -> Option<usize> {
        self.orbits.first().map(|orbit| orbit.period)
    }

    /// Makes a row of each response, and of the bifurcations in their places.
    pub fn with_bifurcations<'a, T>(&'a self, row: impl Fn(&'a Orbit, Option<BifurcationKind>) -> T) -> Vec<T> {
        let mut found = self.bifurcations.iter().peekable();
        let mut rows = Vec::with_capacity(self.orbits.len() + self.bifurcations.len());
        for (index, orbit) in self.orbits.iter().enumerate() {
            // A bifurcation with the index i was located between the responses i − 1 and i.
            while let Some(bifurcation) = found.next_if(|found| found.index <= index) {
                rows.push(row(&bifurcation.orbit, Some(bifurcation.kind)));
            }
            rows.push(row(orbit, None));
        }
        // Those behind the last response, where a branch ended before it came to the next one.
        rows.extend(found.map(|found| row(&found.orbit, Some(found.kind))));
        rows
    }
}
