//! Adapts the number of harmonics to the periodic response along a continuation.

use super::balance::Balance;
use crate::branch_options::BranchOptions;
use crate::continuation::{Continuation, System};
use crate::error::AnalysisError;

/// Below this fraction of the truncation allowed, the last harmonic is dropped.
const DROP_SHARE: f64 = 1e-3;

/// Equations whose last unknowns are the Fourier series of a periodic response.
pub(super) trait Spectral: System {
    /// Returns the balance of the response, or of one with a multiple of its period.
    fn balance(&self) -> &Balance;

    /// Returns the number of unknowns before the series.
    fn others(&self) -> usize;

    /// Returns the number of harmonics H of the series.
    fn harmonics(&self) -> usize {
        self.balance().harmonics()
    }

    /// Returns ν, the period of the series in periods of the drive.
    fn period(&self) -> usize {
        self.balance().period()
    }

    /// Changes the number of harmonics H of the series.
    fn set_harmonics(&mut self, harmonics: usize);

    /// Evaluates the response of these unknowns and returns whether it exists.
    #[must_use]
    fn evaluate_orbit(&mut self, z: &[f64], lambda: f64) -> bool;
}

impl Spectral for Balance {
    fn balance(&self) -> &Balance {
        self
    }

    fn others(&self) -> usize {
        0
    }

    fn set_harmonics(&mut self, harmonics: usize) {
        Balance::set_harmonics(self, harmonics);
    }

    fn evaluate_orbit(&mut self, z: &[f64], lambda: f64) -> bool {
        let exists = self.set_value(lambda);
        if exists {
            Balance::evaluate_orbit(self, z);
        }
        exists
    }
}

/// Adds harmonics until the truncation error is small enough, or as many as are allowed. Drops the last harmonic if it
/// is negligible.
///
/// # Errors
/// [`AnalysisError::NoSolution`] if the response is not found with another number of harmonics;
/// [`AnalysisError::TooManyHarmonics`] if it needs more than are allowed and the branch is to end there.
pub(super) fn adapt<S: Spectral>(
    system: &mut S,
    continuation: &mut Continuation,
    branch: &BranchOptions,
) -> Result<(), AnalysisError> {
    let [least, most] = [branch.least_harmonics, branch.most_harmonics].map(|harmonics| harmonics * system.period());
    loop {
        let z = &continuation.point().x;
        let lambda = continuation.point().lambda;
        if !system.evaluate_orbit(z, lambda) {
            return Ok(());
        }
        let series = &z[system.others()..];
        let balance = system.balance();
        let size = branch.continuation.size(series);
        let m = balance.unknowns.count();
        // The coefficients that dropping the last harmonic would take away: they count like the truncation error.
        let last = series[series.len() - 2 * m..].iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        let error = balance.truncation_error();
        let allowed = branch.truncation * size;
        let harmonics = system.harmonics();
        if error > allowed {
            if harmonics < most {
                // More by an eighth and one: each change costs a solution, and single harmonics would take many at a
                // large H.
                system.set_harmonics((harmonics + 1 + harmonics / 8).min(most));
                continuation.resize(system)?;
                continue;
            }
            if branch.ends_if_truncated {
                return Err(AnalysisError::TooManyHarmonics { at: system.place(lambda), harmonics });
            }
            // The branch goes on with the most that are allowed, and its points state their error.
        } else if harmonics > least && error.max(last) < DROP_SHARE * allowed {
            system.set_harmonics(harmonics - 1);
            continuation.resize(system)?;
        }
        return Ok(());
    }
}

/// Starts near a response at `branch.from`, with as many harmonics as it needs.
pub(super) fn begin(balance: &mut Balance, branch: &BranchOptions, x: &[f64]) -> Result<Continuation, AnalysisError> {
    let direction = branch.to - branch.from;
    let mut continuation = Continuation::start(balance, branch.continuation, x, branch.from, direction)?;
    adapt(balance, &mut continuation, branch)?;
    Ok(continuation)
}
