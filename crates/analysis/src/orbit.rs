//! Periodic responses of a structure, branches of them, and bifurcations: plain data.

use alloc::vec::Vec;

use core::f64::consts::TAU;

use nalgebra::Complex;

use crate::branch_options::BifurcationKind;
use crate::continuation::Work;

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
