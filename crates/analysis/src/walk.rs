//! A continuation that also passes the kinks of branches.
//!
//! Where friction begins to slip, its loss grows with the amplitude at once, so that a branch has a corner there: no
//! step is so short that its tangent turns by little. Beyond the corner the branch leaves in the direction t₂ with R_x
//! dx + R_λ dλ = 0 and t·t₂ > 0, with the derivatives taken a little ahead along the tangent t.

use alloc::vec;
use alloc::vec::Vec;

use super::balance::Balance;
use crate::continuation::{Continuation, ContinuationSettings, Point, System, Work};
use crate::dense::Lu;
use crate::error::AnalysisError;

/// Distances ahead of a corner at which the direction beyond it is sought, relative to the size of the response.
const REACHES: [f64; 4] = [1e-6, 1e-5, 1e-4, 1e-3];

/// A continuation, with the arclength and the work of the ones before it.
#[derive(Clone)]
pub(super) struct Walk {
    pub continuation: Continuation,
    point: Point,
    before: f64,
    work: Work,
}

impl Walk {
    pub fn new(continuation: Continuation) -> Walk {
        let point = continuation.point().clone();
        Walk { continuation, point, before: 0.0, work: Work::default() }
    }

    /// The current point, with the arclength from the start of the branch.
    pub fn point(&mut self) -> &Point {
        self.point.clone_from(self.continuation.point());
        self.point.arclength += self.before;
        &self.point
    }

    /// Returns the work so far, including steps that were undone.
    pub fn work(&self) -> Work {
        let mut work = self.work;
        work += self.continuation.work();
        work
    }

    /// Advances to the next point and returns it.
    ///
    /// # Errors
    /// [`AnalysisError::Stuck`] if the branch can't be followed, past a corner either.
    pub fn advance(&mut self, balance: &mut Balance, settings: &ContinuationSettings) -> Result<(), AnalysisError> {
        let Err(stuck) = self.continuation.advance(balance).map(|_| ()) else { return Ok(()) };
        // Smooth forces make no corners: the continuation is stuck for another reason.
        if balance.forced.assembly().is_smooth() {
            return Err(stuck);
        }
        let corner = self.continuation.point().clone();
        let found = REACHES.iter().find_map(|&reach| {
            let direction = beyond(balance, settings, &corner, reach)?;
            Continuation::start_along(balance, *settings, &corner.x, corner.lambda, &direction, reach).ok()
        });
        let Some(next) = found else { return Err(stuck) };
        self.work += self.continuation.work();
        // The continuation beyond the corner counts its arclength from zero.
        self.before += corner.arclength;
        self.continuation = next;
        Ok(())
    }
}

/// Returns the direction of the branch beyond a corner: dx and dλ.
fn beyond(balance: &mut Balance, settings: &ContinuationSettings, corner: &Point, reach: f64) -> Option<Vec<f64>> {
    let n = corner.x.len();
    let size = settings.size(&corner.x);
    let sigma = size / settings.lambda_scale(corner.lambda);
    let ahead: Vec<f64> = corner.x.iter().zip(&corner.tangent).map(|(x, t)| x + reach * size * t).collect();
    let lambda = corner.lambda + reach * size * corner.tangent[n] / sigma;
    let mut lu = Lu::default();
    let mut residual = vec![0.0; n];
    let matrix = lu.zeroed(n + 1);
    if !balance.evaluate(&ahead, lambda, &mut residual, matrix) {
        return None;
    }
    matrix[n * (n + 1)..].iter_mut().for_each(|by_lambda| *by_lambda /= sigma);
    // The last row demands t·t₂ = 1 > 0: the branch goes on and does not turn back.
    for (column, t) in matrix.chunks_exact_mut(n + 1).zip(&corner.tangent) {
        column[n] = *t;
    }
    lu.factor().ok()?;
    let mut direction = vec![0.0; n + 1];
    direction[n] = 1.0;
    lu.solve(&mut direction);
    direction[n] /= sigma;
    direction.iter().all(|value| value.is_finite()).then_some(direction)
}
