//! Stretches of equal stability along a branch.

use alloc::vec::Vec;

/// Neighbours in pairs, and whether the responses between them are stable, `stable` being `None` at a bifurcation.
/// Between two bifurcations they are taken to be unstable.
pub fn segments<T>(rows: &[T], stable: impl Fn(&T) -> Option<bool>) -> impl Iterator<Item = (&T, &T, bool)> {
    rows.windows(2).map(move |pair| {
        let has = |wanted| pair.iter().any(|row| stable(row) == Some(wanted));
        (&pair[0], &pair[1], has(true) && !has(false))
    })
}

/// Returns the stretches of equal stability as one curve, with NaN points between them. They end at the bifurcations
/// themselves, not at the responses next to them.
pub fn stretches<T>(
    rows: &[T],
    stable: impl Fn(&T) -> Option<bool>,
    wanted: bool,
    at: impl Fn(&T) -> (f64, f64),
) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (a, b, _) in segments(rows, stable).filter(|(.., is_stable)| *is_stable == wanted) {
        if points.last() != Some(&at(a)) {
            points.extend([(f64::NAN, f64::NAN), at(a)]);
        }
        points.push(at(b));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_end_at_the_bifurcations() {
        // Stable to a fold at 2, unstable back to a fold at 1, stable on; a segment from fold to fold is unstable.
        let rows = [
            (0.0, Some(true)),
            (2.0, None),
            (1.5, Some(false)),
            (1.0, None),
            (3.0, Some(true)),
            (4.0, None),
            (3.5, None),
        ];
        let drawn = |wanted| {
            let curve = stretches(&rows, |row| row.1, wanted, |row| (row.0, 0.0));
            curve.iter().map(|point| if point.0.is_nan() { -1.0 } else { point.0 }).collect::<Vec<_>>()
        };
        assert_eq!(drawn(true), [-1.0, 0.0, 2.0, -1.0, 1.0, 3.0, 4.0]);
        assert_eq!(drawn(false), [-1.0, 2.0, 1.5, 1.0, -1.0, 4.0, 3.5]);
    }
}
