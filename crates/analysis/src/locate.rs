//! Locates a bifurcation between two neighbouring points where a test function changes sign.

use alloc::vec::Vec;

use super::adapt::Spectral;
use super::continuation::{Continuation, ContinuationSettings, Cut, Point, Slices, System, Work, not_located};
use super::extended::{SingularResponse, Singularity, crossing};
use super::fourier::zeros;
use super::{AnalysisError, Coordinate, ForcedResponse, HarmonicBalance, Oscillator};

/// Tolerance, as a fraction of a segment, of a search along the branch before an extended system.
pub(super) const COARSE: f64 = 1e-2;
/// Tolerance of a search without an extended system.
pub(super) const FINE: f64 = 1e-12;
/// Near a crossing of branches rounding keeps Newton's method from converging. In a bracket below this fraction of the
/// segment the point is then interpolated: its error is of the order of the square.
const NARROW: f64 = 1e-5;
/// The most steps of the search along the branch, and those after which it only halves the bracket: where the test
/// jumps from a large value to a small one, regula falsi hardly moves.
const SEARCH_LIMIT: usize = 70;
const FALSI_LIMIT: usize = 20;

/// The point between `ends` where `test` is zero, by regula falsi with the Illinois modification (M. Dowell, P.
/// Jarratt, "A modified regula falsi method for computing the root of an equation", BIT 11 (1971)): the bracket always
/// holds the zero, and the value at an end that stays is halved. Each test is at a point of the branch, found from the
/// chord of the bracket, so that the search can come as near as needed to a crossing of branches.
///
/// Stops when the bracket or the last step, as a fraction of the segment's arclength, is below `tolerance`, or the test
/// vanishes. A test that isn't a number ends the search with an error.
pub(super) fn search<S: System>(
    system: &mut S,
    settings: &ContinuationSettings,
    ends: [&Point; 2],
    values: [f64; 2],
    tolerance: f64,
    mut test: impl FnMut(&mut S, &Point) -> f64,
) -> Result<Point, AnalysisError> {
    let mut slices = Slices::new(system.dimension(), settings, ends, Cut::Chord);
    let ([mut a, mut b], [mut fa, mut fb]) = (ends.map(Clone::clone), values);
    let whole = b.arclength - a.arclength;
    let tolerance = tolerance * whole;
    let (mut side, mut before) = (0, f64::INFINITY);
    for step in 0..SEARCH_LIMIT {
        let fraction = if step < FALSI_LIMIT { fa / (fa - fb) } else { 0.5 };
        let point = match slices.solve(system, [&a, &b], fraction) {
            Ok(point) => point,
            Err(_) if b.arclength - a.arclength < NARROW * whole => return Ok(slices.mix([&a, &b], fraction)),
            Err(_) => slices.solve_beside(system, [&a, &b], fraction)?,
        };
        let value = test(system, &point);
        if value.is_nan() {
            break;
        }
        let moved = (point.arclength - before).abs();
        before = point.arclength;
        if value == 0.0 || moved <= tolerance || b.arclength - a.arclength <= tolerance {
            return Ok(point);
        }
        if (value < 0.0) == (fb < 0.0) {
            (b, fb) = (point, value);
            fa *= if side == 1 { 0.5 } else { 1.0 };
            side = 1;
        } else {
            (a, fa) = (point, value);
            fb *= if side == -1 { 0.5 } else { 1.0 };
            side = -1;
        }
    }
    Err(not_located(system, ends))
}

/// The solution of the extended system near a point of the branch.
pub(super) struct Located<O: Oscillator> {
    /// X.
    pub x: Vec<f64>,
    /// λ.
    pub lambda: f64,
    /// The equations, with the null vector.
    pub singular: SingularResponse<O>,
    /// Its work.
    pub work: Work,
}

/// The largest error of a null vector; see [`SingularResponse::null_vector_error`].
const NULL_VECTOR_ERROR: f64 = 1e-7;
/// Harmonics added until a null vector is good enough: how many at once, and how often.
const MORE_HARMONICS: (usize, usize) = (2, 16);

/// Newton's method on the extended system of a fold or a period doubling from `guess`, with as many harmonics as its
/// null vector needs.
pub(super) fn polish<O: Oscillator + Clone>(
    response: &ForcedResponse<O>,
    settings: &ContinuationSettings,
    kind: Singularity,
    guess: &Point,
) -> Result<Located<O>, AnalysisError> {
    let lost = not_located(response, [guess, guess]);
    let mut balance = response.balance().clone();
    let coordinate = response.coordinate();
    if !balance.set_coordinate(coordinate, guess.lambda) {
        return Err(lost);
    }
    let scale = settings.lambda_scale(guess.lambda) / settings.size(&guess.x);
    let mut singular = SingularResponse::near(balance, kind, coordinate, None, scale, &guess.x)?;
    let start = singular.join(guess.lambda, &guess.x);
    let mut continuation = Continuation::start(&mut singular, *settings, &start, 0.0, 1.0).map_err(|_| lost.clone())?;
    for _ in 0..MORE_HARMONICS.1 {
        let (lambda, x) = singular.split(&continuation.point().x);
        if singular.null_vector_error() < NULL_VECTOR_ERROR {
            return Ok(Located { x: x.to_vec(), lambda, singular, work: continuation.work() });
        }
        let harmonics = singular.balance().harmonics() + MORE_HARMONICS.0;
        singular.set_harmonics(harmonics);
        continuation.resize(&mut singular).map_err(|_| lost.clone())?;
    }
    Err(lost)
}

/// The null vector of the nearly singular matrix at a point of the branch.
pub(super) fn null_vector<O: Oscillator + Clone>(
    response: &ForcedResponse<O>,
    settings: &ContinuationSettings,
    kind: Singularity,
    point: &Point,
) -> Result<Vec<f64>, AnalysisError> {
    let mut balance = response.balance().clone();
    if !balance.set_coordinate(response.coordinate(), point.lambda) {
        return Err(not_located(response, [point, point]));
    }
    let scale = settings.lambda_scale(point.lambda);
    let singular = SingularResponse::near(balance, kind, response.coordinate(), None, scale, &point.x)?;
    Ok(singular.null_vector().to_vec())
}

/// The point where a branch of doubled period meets the single one: a period doubling of the single one, located on it
/// from the single-period components of `guess`. The solution is returned as a motion of doubled period.
pub(super) fn rejoin<O: Oscillator + Clone>(
    response: &ForcedResponse<O>,
    settings: &ContinuationSettings,
    guess: &Point,
) -> Result<Point, AnalysisError> {
    let balance = response.balance();
    let harmonics = balance.harmonics() / 2;
    let frequency_hz = balance.coordinate(Coordinate::FrequencyHz);
    let single = HarmonicBalance::new(balance.oscillator().clone(), frequency_hz, 1, harmonics);
    let mut x = guess.x[..2].to_vec();
    for k in 0..harmonics {
        x.extend_from_slice(&guess.x[8 * k + 6..8 * k + 10]);
    }
    let guess = Point { x, ..guess.clone() };
    let single = ForcedResponse::new(single, response.coordinate());
    let located = polish(&single, settings, Singularity::PeriodDoubling, &guess)?;
    Ok(Point { x: doubled(&located.x), lambda: located.lambda, ..guess })
}

/// A motion of the excitation's period on the even harmonics of half its frequency.
pub(super) fn doubled(x: &[f64]) -> Vec<f64> {
    let mut series = zeros(2 * (x.len() / 4));
    series[..2].copy_from_slice(&x[..2]);
    for (k, pair) in x[2..].chunks_exact(4).enumerate() {
        series[8 * k + 6..8 * k + 10].copy_from_slice(pair);
    }
    series
}

/// The branch point between `ends`, where the bordered determinant is zero, by its extended system, or by a fine search
/// if that converges elsewhere; with as many harmonics as the direction of the other branch needs.
pub(super) fn branch_point<O: Oscillator + Clone>(
    response: &ForcedResponse<O>,
    settings: &ContinuationSettings,
    ends: [&Point; 2],
) -> Result<(Point, Work), AnalysisError> {
    let mut response = response.clone();
    let mut work = Work::default();
    for _ in 0..MORE_HARMONICS.1 {
        let mut slices = Slices::new(response.dimension(), settings, ends, Cut::Chord);
        let ends = [slices.solve(&mut response, ends, 0.0)?, slices.solve(&mut response, ends, 1.0)?];
        let reference = ends[0].determinant.log_magnitude;
        let scaled = |point: &Point| point.determinant.sign * libm::exp(point.determinant.log_magnitude - reference);
        let values = [scaled(&ends[0]), scaled(&ends[1])];
        let ends = [&ends[0], &ends[1]];
        let guess = search(&mut response, settings, ends, values, COARSE, |_, point| scaled(point))?;
        let point = match crossing::branch_point(&response, settings, &guess) {
            Ok((point, newton)) if slices.hold(ends, &point) => {
                work += newton;
                point
            }
            _ => search(&mut response, settings, ends, values, FINE, |_, point| scaled(point))?,
        };
        let mut balance = response.balance().clone();
        if !balance.set_coordinate(response.coordinate(), point.lambda) {
            break;
        }
        let scale = settings.lambda_scale(point.lambda) / settings.size(&point.x);
        let nearby = SingularResponse::near(balance, Singularity::Fold, response.coordinate(), None, scale, &point.x);
        if nearby.is_ok_and(|singular| singular.null_vector_error() < NULL_VECTOR_ERROR) {
            return Ok((point, work));
        }
        let harmonics = response.balance().harmonics() + MORE_HARMONICS.0;
        response.set_harmonics(harmonics);
    }
    Err(not_located(&response, ends))
}

#[cfg(test)]
mod tests {
    use super::super::continuation::{Continuation, ContinuationSettings, Point, System};
    use super::{FINE, search};

    /// x = λ.
    struct Line;

    impl System for Line {
        fn dimension(&self) -> usize {
            1
        }

        fn evaluate(&mut self, x: &[f64], lambda: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
            residual[0] = x[0] - lambda;
            (matrix[0], matrix[2]) = (1.0, -1.0);
            true
        }
    }

    /// A test that jumps, from a large value to a small one, is as good as one that passes zero; one that isn't a
    /// number ends the search.
    #[test]
    fn where_a_test_jumps_is_found() {
        let settings = ContinuationSettings::default();
        let [a, b] = [1.0, 2.0].map(|lambda| {
            let point = Continuation::start(&mut Line, settings, &[lambda], lambda, 1.0).unwrap().point().clone();
            Point { arclength: lambda, ..point }
        });
        let find = |test: &dyn Fn(f64) -> f64| {
            search(&mut Line, &settings, [&a, &b], [1.0, -1e-3], FINE, |_, point| test(point.lambda))
        };
        let found = find(&|lambda| if lambda < 1.3 { 1.0 } else { -1e-3 }).unwrap();
        assert!((found.lambda - 1.3).abs() < 1e-9, "{found:?}");
        assert!(find(&|_| f64::NAN).is_err());
    }
}
