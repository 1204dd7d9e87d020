//! From two neighbouring points with a change of sign between them to the bifurcation itself.

use super::continuation::{Cut, Point, Settings, System, Walk, between};
use super::extended::{Singularity, SingularResponse};
use super::{AnalysisError, ForcedResponse, Oscillator};

/// The most steps of the search along the branch.
const SEARCH_LIMIT: usize = 60;

/// The point between `ends` where `test` is zero, by regula falsi with the Illinois modification (Dowell & Jarratt 1971): the
/// bracket always holds the zero, and the value at an end that stays is halved. Each test is at a point of the branch.
///
/// Stops when the bracket, as a fraction of the segment, is below `tolerance`, or the test vanishes.
pub(super) fn search<S: System>(
    system: &mut S,
    settings: &Settings,
    ends: [&Point; 2],
    values: [f64; 2],
    tolerance: f64,
    mut test: impl FnMut(&mut S, &Point) -> f64,
) -> Result<Point, AnalysisError> {
    let ([mut a, mut b], [mut fa, mut fb]) = ([0.0, 1.0], values);
    let mut side = 0;
    let mut before = f64::INFINITY;
    for _ in 0..SEARCH_LIMIT {
        let fraction = (a * fb - b * fa) / (fb - fa);
        let point = between(system, settings, ends, fraction, Cut::Chord)?;
        let value = test(system, &point);
        let moved = (fraction - before).abs();
        before = fraction;
        if value == 0.0 || moved < tolerance || (b - a) < tolerance {
            return Ok(point);
        }
        if (value < 0.0) == (fb < 0.0) {
            (b, fb) = (fraction, value);
            fa *= if side == 1 { 0.5 } else { 1.0 };
            side = 1;
        } else {
            (a, fa) = (fraction, value);
            fb *= if side == -1 { 0.5 } else { 1.0 };
            side = -1;
        }
    }
    Err(AnalysisError::NotLocated { lambda: ends[0].lambda, to: ends[1].lambda })
}

/// The solution of the extended system near a point of the branch.
pub(super) struct Located<O: Oscillator> {
    /// X.
    pub x: alloc::vec::Vec<f64>,
    /// λ.
    pub lambda: f64,
    /// The equations, with the null vector.
    pub singular: SingularResponse<O>,
}

/// Newton's method on the extended system of a fold or a period doubling from `guess`.
pub(super) fn polish<O: Oscillator + Clone>(
    response: &ForcedResponse<O>,
    settings: &Settings,
    kind: Singularity,
    guess: &Point,
) -> Result<Located<O>, AnalysisError> {
    let mut balance = response.balance().clone();
    let coordinate = response.coordinate();
    if !balance.set_coordinate(coordinate, guess.lambda) {
        return Err(AnalysisError::NotLocated { lambda: guess.lambda, to: guess.lambda });
    }
    let scale = settings.lambda_scale(guess.lambda) / settings.size(&guess.x);
    let mut singular = SingularResponse::near(balance, kind, coordinate, None, scale, &guess.x)?;
    let start = singular.join(&guess.x, guess.lambda);
    let walk = Walk::start(&mut singular, *settings, &start, 0.0, 1.0)?;
    let (x, lambda) = singular.split(&walk.point().x);
    Ok(Located { x: x.to_vec(), lambda, singular })
}
