//! The first motion of a branch.

use super::adapt::{Spectral, adapt};
use super::continuation::{Continuation, System, at_parameter};
use super::fourier::zeros;
use super::orbit::BranchOptions;
use super::{AnalysisError, Coordinate, ForcedResponse, Oscillator};

/// Multiples of the frequency at which to start if Newton's method finds no motion from rest: away from the nearby
/// resonance.
const DETOURS: [f64; 2] = [0.7, 1.4];

/// Starts a continuation at `options.from`: from rest, or, if that is too far, from the end of one in frequency that
/// starts away from the resonance, on the side that it comes from.
pub(super) fn enter<O: Oscillator + Clone>(
    response: &mut ForcedResponse<O>,
    options: &BranchOptions,
) -> Result<Continuation, AnalysisError> {
    let direction = options.to - options.from;
    let rest = zeros(response.balance().harmonics());
    let first = match Continuation::start(response, options.continuation, &rest, options.from, direction) {
        Ok(continuation) => return Ok(continuation),
        Err(error) => error,
    };
    let mut detours = DETOURS;
    if response.coordinate() == Coordinate::FrequencyHz && direction < 0.0 {
        detours.reverse();
    }
    for detour in detours {
        if let Ok(continuation) = approach(response, options, detour) {
            return Ok(continuation);
        }
    }
    Err(first)
}

/// Continues in frequency from `detour` times the wanted frequency to it, and starts there.
fn approach<O: Oscillator + Clone>(
    response: &mut ForcedResponse<O>,
    options: &BranchOptions,
    detour: f64,
) -> Result<Continuation, AnalysisError> {
    let coordinate = response.coordinate();
    let mut balance = response.balance().clone();
    balance.set_harmonics(options.least_harmonics);
    let domain = "what the system allows";
    if !balance.set_coordinate(coordinate, options.from) {
        let unit = response.unit();
        return Err(AnalysisError::Interval { from: options.from, to: options.to, unit, domain });
    }
    let wanted_hz = balance.coordinate(Coordinate::FrequencyHz);
    let mut swept = ForcedResponse::new(balance, Coordinate::FrequencyHz);
    let there = BranchOptions { from: detour * wanted_hz, to: wanted_hz, ..*options };
    let mut continuation = Continuation::start(
        &mut swept,
        options.continuation,
        &zeros(options.least_harmonics),
        there.from,
        1.0 - detour,
    )?;
    for _ in 0..options.most_points {
        adapt(&mut swept, &mut continuation, &there)?;
        let before = continuation.point().clone();
        let after = continuation.advance(&mut swept)?;
        if (before.lambda - wanted_hz) * (after.lambda - wanted_hz) <= 0.0 {
            let point = at_parameter(&mut swept, &options.continuation, [&before, after], wanted_hz)?;
            response.set_harmonics(swept.balance().harmonics());
            return Continuation::start(
                response,
                options.continuation,
                &point.x,
                options.from,
                options.to - options.from,
            );
        }
    }
    Err(AnalysisError::TooManyPoints { points: options.most_points, at: swept.place(continuation.point().lambda) })
}
