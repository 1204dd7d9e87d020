//! Basins of attraction: which initial states reach which stable motion.

use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::f64::consts::TAU;
use core::str::FromStr;

use nalgebra::Vector4;
use serde::Serialize;
use thiserror::Error;

use super::fates::{Attractor, BasinOutcome, fates};
use super::fixed_point::FixedPoint;
use super::map::Strobe;
use super::measure::measure;
use super::{StroboscopicMap, TimeDomainError};
use crate::orbit::{Branch, Orbit};
use crate::{BranchOptions, Coordinate, EndedEarly, ForcedArm, forced_response, trace_doublings};
use resonarm_dynamics::arm::{Arm, Sine, State};

/// The branch is traced between these multiples of the frequency to find the motions at it.
pub(crate) const WINDOW: [f64; 2] = [0.75, 4.0 / 3.0];

/// A coordinate of the arm's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum StateCoordinate {
    /// `alpha1_rad`: α1, rad.
    #[serde(rename = "alpha1_rad")]
    Alpha1,
    /// `alpha2_rad`: α2, rad.
    #[serde(rename = "alpha2_rad")]
    Alpha2,
    /// `alpha1_dot_rad_s`: α̇1, rad/s.
    #[serde(rename = "alpha1_dot_rad_s")]
    AlphaDot1,
    /// `alpha2_dot_rad_s`: α̇2, rad/s.
    #[serde(rename = "alpha2_dot_rad_s")]
    AlphaDot2,
}

/// No coordinate of the state has this name.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("there is no coordinate `{0}`: the coordinates are alpha1_rad, alpha2_rad, alpha1_dot_rad_s, alpha2_dot_rad_s")]
pub struct UnknownStateCoordinate(pub String);

impl StateCoordinate {
    /// All of them, in the order of a state.
    pub const ALL: [StateCoordinate; 4] = [Self::Alpha1, Self::Alpha2, Self::AlphaDot1, Self::AlphaDot2];

    /// The name, which carries the unit.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Alpha1 => "alpha1_rad",
            Self::Alpha2 => "alpha2_rad",
            Self::AlphaDot1 => "alpha1_dot_rad_s",
            Self::AlphaDot2 => "alpha2_dot_rad_s",
        }
    }

    /// The symbol with its unit, for figures.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Alpha1 => "α₁ (rad)",
            Self::Alpha2 => "α₂ (rad)",
            Self::AlphaDot1 => "dα₁/dt (rad/s)",
            Self::AlphaDot2 => "dα₂/dt (rad/s)",
        }
    }

    /// The joint, 0 or 1, and whether it is its rate.
    pub const fn joint(self) -> (usize, bool) {
        match self {
            Self::Alpha1 => (0, false),
            Self::Alpha2 => (1, false),
            Self::AlphaDot1 => (0, true),
            Self::AlphaDot2 => (1, true),
        }
    }

    /// Its value in a state.
    pub fn of(self, state: &State) -> f64 {
        let (joint, rate) = self.joint();
        if rate { state.alpha_dot_rad_s[joint] } else { state.alpha_rad[joint] }
    }

    /// Sets it in a state.
    pub fn set(self, state: &mut State, value: f64) {
        let (joint, rate) = self.joint();
        if rate {
            state.alpha_dot_rad_s[joint] = value;
        } else {
            state.alpha_rad[joint] = value;
        }
    }
}

impl FromStr for StateCoordinate {
    type Err = UnknownStateCoordinate;

    fn from_str(name: &str) -> Result<StateCoordinate, UnknownStateCoordinate> {
        let found = StateCoordinate::ALL.into_iter().find(|coordinate| coordinate.name() == name);
        found.ok_or_else(|| UnknownStateCoordinate(name.to_string()))
    }
}

/// A stable periodic motion of the forced arm.
#[derive(Clone, Debug, PartialEq)]
pub struct StableMotion {
    /// Periods of the excitation after which it repeats.
    pub period: u32,
    /// Largest magnitude of its Floquet multipliers, over its own period.
    pub largest_multiplier: f64,
    /// max |αᵢ(t)|, rad.
    pub amplitude_rad: [f64; 2],
    /// The states at phase 0 of the excitation.
    pub section: Vec<State>,
    attractor: Attractor,
}

/// A grid of initial states reaches this many times as far as the largest stable motion.
pub(crate) const REACH: f64 = 1.5;

/// How far a grid of initial states goes in a coordinate to show what surrounds the motions under an excitation of this
/// frequency.
pub fn reach(motions: &[StableMotion], coordinate: StateCoordinate, frequency_hz: f64) -> f64 {
    let (joint, rate) = coordinate.joint();
    let largest = motions.iter().fold(0.0_f64, |largest, motion| largest.max(motion.amplitude_rad[joint]));
    REACH * largest * if rate { TAU * frequency_hz } else { 1.0 }
}

/// The stable motions of an arm under a sine: those of the branch over the frequency, and of the doubled branches that
/// leave it, at this frequency, in order of max |α1|. The branch is traced from ¾ to 4/3 of the frequency; branches
/// that end early are returned too, and motions beyond their ends are missing.
///
/// If two neighbours on a branch are on both sides of the frequency, Newton's method leads from the motion between them
/// to a fixed point of the stroboscopic map.
///
/// # Errors
/// As [`StroboscopicMap::new`]; [`TimeDomainError::Integrate`] if a motion can't be followed.
pub fn stable_motions(arm: &Arm, sine: &Sine) -> Result<(Vec<StableMotion>, Vec<EndedEarly<Branch>>), TimeDomainError> {
    let map = StroboscopicMap::new(arm, *sine)?;
    let hz = sine.frequency_hz;
    let mut early = Vec::new();
    let mut keep = |traced: Result<Branch, EndedEarly<Branch>>| {
        traced.unwrap_or_else(|ended| {
            early.push(ended.clone());
            *ended.so_far
        })
    };
    let window = WINDOW.map(|part| part * hz);
    let branch = keep(forced_response(arm, &sine.amplitude, window));
    let (forced, options) =
        (ForcedArm::new(arm.clone(), sine.amplitude, 1.0), BranchOptions::new(window[0], window[1]));
    let doubled = trace_doublings(&forced, &branch, Coordinate::FrequencyHz, &options).into_iter().map(&mut keep);
    let mut starts = states_at(&branch, hz, 1);
    for branch in doubled.collect::<Vec<_>>() {
        starts.extend(states_at(&branch, hz, 2));
    }
    let mut motions: Vec<StableMotion> = Vec::new();
    for (start, period) in starts {
        let Some(found) = FixedPoint::shoot(&map, &map.to_point(&start), period) else { continue };
        if !motions.iter().any(|motion| motion.attractor.holds(&found.point)) {
            motions.push(StableMotion::new(&map, &found)?);
        }
    }
    motions.sort_by(|a, b| a.amplitude_rad[0].total_cmp(&b.amplitude_rad[0]));
    Ok((motions, early))
}

/// The states at phase 0 of the motions of a branch at a frequency, each interpolated between its neighbours.
fn states_at(branch: &Branch, hz: f64, subharmonic: u32) -> Vec<(State, u32)> {
    let crosses = |pair: &&[Orbit]| (pair[0].frequency_hz - hz) * (pair[1].frequency_hz - hz) <= 0.0;
    let between = |pair: &[Orbit]| {
        let part = (hz - pair[0].frequency_hz) / (pair[1].frequency_hz - pair[0].frequency_hz);
        let [a, b] = [0, 1].map(|end| phase_zero(&pair[end].coefficients, hz / f64::from(subharmonic)));
        let mixed = a + (b - a) * part;
        (State::new([mixed.x, mixed.y], [mixed.z, mixed.w]), subharmonic)
    };
    branch.orbits.windows(2).filter(crosses).map(between).collect()
}

/// α and α̇ at t = 0 of a series of base frequency `base_hz`: c₀ + Σ aₖ and Σ kΩ bₖ.
fn phase_zero(coefficients: &[f64], base_hz: f64) -> Vector4<f64> {
    let mut state = Vector4::new(coefficients[0], coefficients[1], 0.0, 0.0);
    for (k, pair) in coefficients[2..].chunks_exact(4).enumerate() {
        let rate_rad_s = (k + 1) as f64 * TAU * base_hz;
        state += Vector4::new(pair[0], pair[1], rate_rad_s * pair[2], rate_rad_s * pair[3]);
    }
    state
}

impl StableMotion {
    fn new(map: &StroboscopicMap, found: &FixedPoint) -> Result<StableMotion, TimeDomainError> {
        let measured = measure(map, &map.to_state(&found.point), found.period)?;
        let attractor = Attractor::new(map, found, &measured.section);
        Ok(StableMotion {
            period: found.period,
            largest_multiplier: found.largest_multiplier,
            amplitude_rad: measured.amplitude_rad,
            section: measured.section,
            attractor,
        })
    }
}

/// The fate of each initial state, given at phase 0, within `time_constants` of the arm's slowest mode.
///
/// All are integrated side by side. After every quarter of a time constant a motion counts as having reached a stable
/// one if it is within 1e-9 of it, relative to its size, or if it is in its linear neighbourhood: if over that quarter
/// it approached as the linearisation at the stable motion predicts, but for a remainder of at most a quarter of the
/// decay; from then on the remainder, of second order, falls faster than the deviation itself. Motions for which
/// neither holds by the end of the wait are undecided.
///
/// # Errors
/// [`TimeDomainError::Option`] if the wait is no positive number, [`TimeDomainError::Stopped`] if `stop` said so.
pub fn outcomes(
    map: &StroboscopicMap,
    motions: &[StableMotion],
    starts: &[State],
    time_constants: f64,
    stop: &dyn Fn() -> bool,
) -> Result<Vec<BasinOutcome>, TimeDomainError> {
    let attractors: Vec<&Attractor> = motions.iter().map(|motion| &motion.attractor).collect();
    fates(map, &attractors, starts, time_constants, stop)
}
