//! Locates a bifurcation between two neighbouring points where a test function changes sign.

use super::continuation::{ContinuationSettings, Cut, Point, Slices, System, not_located};
use crate::error::AnalysisError;

/// Tolerance of a search, as a fraction of a segment.
pub(crate) const FINE: f64 = 1e-12;
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
pub(crate) fn search<S: System>(
    system: &mut S,
    settings: &ContinuationSettings,
    ends: [&Point; 2],
    values: [f64; 2],
    tolerance: f64,
    mut test: impl FnMut(&mut S, &Point) -> f64,
) -> Result<Point, AnalysisError> {
    let mut slices = Slices::new(system.dimension(), settings, ends, Cut::Chord);
    let [mut a, mut b] = ends.map(Clone::clone);
    let [mut fa, mut fb] = values;
    let whole = b.arclength - a.arclength;
    let tolerance = tolerance * whole;
    let mut side = 0;
    let mut before = f64::INFINITY;
    for step in 0..SEARCH_LIMIT {
        let fraction = if step < FALSI_LIMIT { fa / (fa - fb) } else { 0.5 };
        let point = match slices.solve(system, [&a, &b], fraction) {
            Ok(point) => point,
            // Interpolation is only exact enough in a narrow bracket. In a wide one a plane beside this one may still
            // have a solution.
            Err(_) if b.arclength - a.arclength < NARROW * whole => return Ok(slices.mix([&a, &b], fraction)),
            Err(_) => slices.solve_beside(system, [&a, &b], fraction)?,
        };
        let value = test(system, &point);
        if value.is_nan() {
            break;
        }
        // The step counts as well as the bracket, since in regula falsi one end may stay far away while the other
        // converges.
        let moved = (point.arclength - before).abs();
        before = point.arclength;
        if value == 0.0 || moved <= tolerance || b.arclength - a.arclength <= tolerance {
            return Ok(point);
        }
        if (value < 0.0) == (fb < 0.0) {
            b = point;
            fb = value;
            // The second time in a row on this side the value at the other end is halved, which draws the next point
            // towards that end.
            fa *= if side == 1 { 0.5 } else { 1.0 };
            side = 1;
        } else {
            a = point;
            fa = value;
            fb *= if side == -1 { 0.5 } else { 1.0 };
            side = -1;
        }
    }
    Err(not_located(system, ends))
}

#[cfg(test)]
mod tests {
    use super::super::continuation::{Continuation, ContinuationSettings, Point, System};
    use super::{FINE, search};

    /// A system whose branch is the line x = λ.
    struct Line;

    impl System for Line {
        fn dimension(&self) -> usize {
            1
        }

        fn evaluate(&mut self, x: &[f64], lambda: f64, residual: &mut [f64], matrix: &mut [f64]) -> bool {
            residual[0] = x[0] - lambda;
            matrix[0] = 1.0;
            matrix[2] = -1.0;
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
