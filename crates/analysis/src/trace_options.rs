//! What is computed along a branch, and the usual settings for it.

use alloc::vec::Vec;

use core::f64::consts::TAU;

use resonarm_dynamics::structure::{Dof, Element, Law};

use crate::balance::{unit_deflection, unit_state};
use crate::branch_options::BranchOptions;
use crate::continuation::ContinuationSettings;
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
        let deflection = unit_deflection(forced) * amplitude;
        let highest_hz = if coordinate == Coordinate::FrequencyHz { from.max(to) } else { 0.0 };
        let tolerance = |element: &Element| tolerance(&element.law, TAU * highest_hz * deflection);
        // The largest of all: the others' harmonics do not make up for those of one.
        branch.truncation = forced.assembly.elements().iter().map(tolerance).fold(POLYNOMIAL_TOLERANCE, f64::max);
        let state = unit_state(forced) * amplitude;
        let state_floor = if state > 0.0 && state.is_finite() { STATE_FLOOR * state } else { 1e-6 };
        branch.continuation = ContinuationSettings { largest_step: LARGEST_STEP, state_floor, ..branch.continuation };
        TraceOptions { branch, read, assess: Assess::default(), near: None }
    }
}
