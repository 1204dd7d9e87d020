//! What the search for settled motions needs to know of a forced system.

use alloc::vec::Vec;

use nalgebra::{DMatrix, DVector};

use super::TimeDomainError;

/// Difference for the map's derivative, relative to the motion's size: the error of central differences, its square
/// times a sixth of the third derivative, and the rounding, 1e-16 over it, are then both near 1e-11.
const DIFFERENCE: f64 = 3e-5;

/// The size of a motion, the reference of relative distances; the floor is for a system at rest.
pub(super) fn size(point: &DVector<f64>) -> f64 {
    point.norm().max(1e-12)
}

/// A forced system seen once a period of the excitation, always at phase 0.
pub(crate) trait Strobe {
    /// A state of the system.
    type State: Clone;

    /// Time in which the slowest transient of the linear system falls by e, in periods of the excitation.
    fn time_constant_periods(&self) -> f64;

    /// Whether a motion may keep an arbitrary constant for good, as the state of friction that sticks: it is then no
    /// isolated fixed point, and has settled when it returns.
    fn keeps_constants(&self) -> bool;

    /// The state one period later.
    fn next(&self, state: &Self::State) -> Result<Self::State, TimeDomainError>;

    /// The states a number of periods later; one that grows without bound is then not finite.
    fn advance_together(&self, states: &mut [Self::State], periods: u32) -> Result<(), TimeDomainError>;

    /// Whether all numbers of a state are finite.
    fn is_finite(state: &Self::State) -> bool;

    /// The state as a point of the section, rates over Ω: all of the size of the vibration.
    fn to_point(&self, state: &Self::State) -> DVector<f64>;

    /// The state at a point of the section.
    fn to_state(&self, point: &DVector<f64>) -> Self::State;

    /// The point `periods` periods on.
    fn image(&self, point: &DVector<f64>, periods: u32) -> Result<DVector<f64>, TimeDomainError> {
        let state = (0..periods).try_fold(self.to_state(point), |state, _period| self.next(&state))?;
        Ok(self.to_point(&state))
    }

    /// The derivative of [`Strobe::image`] by the point, by central differences; `None` if a motion beside it grows
    /// without bound.
    fn derivative(&self, point: &DVector<f64>, periods: u32) -> Option<DMatrix<f64>> {
        let (n, difference) = (point.len(), DIFFERENCE * size(point));
        // Ahead and behind of each coordinate in turn.
        let moved = |k: usize| {
            let mut moved = point.clone();
            moved[k / 2] += if k.is_multiple_of(2) { difference } else { -difference };
            moved
        };
        let points: Vec<DVector<f64>> = (0..2 * n).map(moved).collect();
        let mut states: Vec<Self::State> = points.iter().map(|point| self.to_state(point)).collect();
        self.advance_together(&mut states, periods).ok()?;
        let mut matrix = DMatrix::zeros(n, n);
        for (column, (ends, images)) in points.chunks_exact(2).zip(states.chunks_exact(2)).enumerate() {
            // The difference actually added, after rounding.
            let width = ends[0][column] - ends[1][column];
            let change = self.to_point(&images[0]) - self.to_point(&images[1]);
            matrix.set_column(column, &(change / width));
        }
        matrix.iter().all(|value| value.is_finite()).then_some(matrix)
    }
}
