//! Adapts the number of harmonics to the motion along a continuation.

use super::continuation::{Continuation, System};
use super::orbit::BranchOptions;
use super::{AnalysisError, HarmonicBalance, Oscillator};

/// Below this fraction of the truncation allowed, the last harmonic is dropped.
const DROP_SHARE: f64 = 1e-3;

/// Equations whose last unknowns are the Fourier series of a motion.
pub(super) trait Spectral: System {
    /// The system of the balance.
    type Oscillator: Oscillator;

    /// The balance, set to the point last evaluated.
    fn balance_mut(&mut self) -> &mut HarmonicBalance<Self::Oscillator>;

    /// The number of unknowns before the series.
    fn others(&self) -> usize;

    /// Changes the number of harmonics.
    fn set_harmonics(&mut self, harmonics: usize);
}

/// Adds harmonics until the truncation error is small enough; drops the last if it is negligible.
pub(super) fn adapt<S: Spectral>(
    system: &mut S,
    continuation: &mut Continuation,
    options: &BranchOptions,
) -> Result<(), AnalysisError> {
    loop {
        let point = continuation.point();
        let series = &point.x[system.others()..];
        let size = options.continuation.size(series);
        let last = series[series.len() - 4..].iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        let balance = system.balance_mut();
        balance.linearise(series);
        let (harmonics, subharmonic) = (balance.harmonics(), balance.subharmonic());
        let allowed = options.truncation * size;
        let error = balance.truncation_error_rad();
        if error > allowed {
            if harmonics >= options.most_harmonics * subharmonic {
                return Err(AnalysisError::TooManyHarmonics { at: system.place(point.lambda), harmonics });
            }
            system.set_harmonics(harmonics + 1 + harmonics / 8);
            continuation.resize(system)?;
            continue;
        }
        if harmonics > options.least_harmonics * subharmonic && error.max(last) < DROP_SHARE * allowed {
            system.set_harmonics(harmonics - 1);
            continuation.resize(system)?;
        }
        return Ok(());
    }
}
