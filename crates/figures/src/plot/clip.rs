//! Cuts lines to a rectangle, and leaves out points that are not visible.

use super::scene::{Point, Rect};

/// Consecutive points within a strip of this width are drawn as four; px.
const STRIP: f64 = 0.25;
/// Points nearer than this to the previous one are left out; px.
const NEAR: f64 = 0.05;
/// Beyond this the position of a point no longer matters; px.
const FAR: f64 = 1e7;

/// Says whether a part of the polyline `run` is inside `area`.
pub(super) fn crosses(run: &[Point], area: &Rect) -> bool {
    run.windows(2).any(|pair| segment(pair[0], pair[1], area).is_some())
}

/// Returns the parts of the polyline through `points` inside `area`, each thinned. A NaN breaks the line; a single
/// point between two gaps gives a run of that point twice, which a round pen draws as a dot.
pub(super) fn runs(points: impl Iterator<Item = Point>, area: &Rect) -> Vec<Vec<Point>> {
    let mut runs: Vec<Vec<Point>> = Vec::new();
    let mut current: Vec<Point> = Vec::new();
    let mut before: Option<Point> = None;
    let mut alone = false;
    for point in points {
        let Some(point) = visible(point) else {
            finish(&mut runs, &mut current, before.filter(|_| alone), area);
            before = None;
            continue;
        };
        // A point behind a gap is alone until another follows; `finish` draws it as a dot if none does.
        alone = before.is_none();
        if let Some(start) = before {
            match segment(start, point, area) {
                Some((from, to)) => {
                    // The line has left the area and comes back elsewhere: a new run begins.
                    if current.last() != Some(&from) {
                        finish(&mut runs, &mut current, None, area);
                        current.push(from);
                    }
                    current.push(to);
                }
                None => finish(&mut runs, &mut current, None, area),
            }
        }
        before = Some(point);
    }
    finish(&mut runs, &mut current, before.filter(|_| alone), area);
    runs
}

fn visible([x, y]: Point) -> Option<Point> {
    (!x.is_nan() && !y.is_nan()).then(|| [x.clamp(-FAR, FAR), y.clamp(-FAR, FAR)])
}

fn finish(runs: &mut Vec<Vec<Point>>, current: &mut Vec<Point>, dot: Option<Point>, area: &Rect) {
    if let Some(dot) = dot.filter(|dot| area.contains(*dot)) {
        runs.push(vec![dot, dot]);
    }
    if !current.is_empty() {
        runs.push(thinned(&core::mem::take(current)));
    }
}

/// The part of the segment from `a` to `b` inside `area` (Y.-D. Liang, B. A. Barsky, "A New Concept and Method for Line
/// Clipping", ACM Trans. Graph. 3 (1984)).
///
/// On a + t (b − a) each side of the rectangle reads p t ≤ q. It bounds t from below where p < 0, from above where p >
/// 0.
pub(super) fn segment(a: Point, b: Point, area: &Rect) -> Option<(Point, Point)> {
    let [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    let sides = [(-dx, a[0] - area.left), (dx, area.right - a[0]), (-dy, a[1] - area.top), (dy, area.bottom - a[1])];
    let mut enter = 0.0_f64;
    let mut leave = 1.0_f64;
    for (p, q) in sides {
        // Parallel to this side: beyond it for all t, or for none.
        if p == 0.0 {
            if q < 0.0 {
                return None;
            }
        } else if p < 0.0 {
            enter = enter.max(q / p);
        } else {
            leave = leave.min(q / p);
        }
    }
    // The ends as they are, without rounding, so that neighbouring segments meet in one point.
    let at = |t: f64| match t {
        0.0 => a,
        1.0 => b,
        t => [a[0] + t * dx, a[1] + t * dy],
    };
    (enter <= leave).then(|| (at(enter), at(leave)))
}

/// Returns the visible ones of `points`. Of consecutive points within a vertical strip the first, the lowest, the
/// highest and
/// the last cover the same ink (U. Jugel, Z. Jerzak, G. Hackenbroich, V. Markl, "M4: A Visualization-Oriented Time
/// Series Data Aggregation", Proc. VLDB Endow. 7 (2014)); of points nearer than [`NEAR`] one is enough.
fn thinned(points: &[Point]) -> Vec<Point> {
    let mut kept: Vec<Point> = Vec::new();
    // Floor and not truncation, or the strip about 0 would be twice as wide.
    let strip = |point: &Point| libm::floor(point[0] / STRIP);
    for group in points.chunk_by(|a, b| strip(a) == strip(b)) {
        let by_y = |a: &usize, b: &usize| group[*a][1].total_cmp(&group[*b][1]);
        let last = group.len() - 1;
        let lowest = (0..=last).min_by(by_y).unwrap_or(0);
        let highest = (0..=last).max_by(by_y).unwrap_or(0);
        // In the order of the line. Repeated indices are dropped below, as points near to the one before.
        let mut chosen = [0, lowest.min(highest), lowest.max(highest), last];
        chosen.sort_unstable();
        for index in chosen {
            let [x, y] = group[index];
            let near = kept.last().is_some_and(|[kx, ky]| (x - kx).abs() < NEAR && (y - ky).abs() < NEAR);
            if !near {
                kept.push([x, y]);
            }
        }
    }
    if let (Some(end), 1) = (points.last(), kept.len()) {
        kept.push(*end); // all in one spot: a dot
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const AREA: Rect = Rect { left: 0.0, top: 0.0, right: 100.0, bottom: 50.0 };
    const GAP: Point = [f64::NAN, 0.0];

    fn cut(points: &[Point]) -> Vec<Vec<Point>> {
        runs(points.iter().copied(), &AREA)
    }

    #[test]
    fn lines_are_cut_at_the_edge_and_reenter() {
        let line = [[-10.0, 25.0], [50.0, 25.0], [50.0, 75.0], [90.0, 75.0], [90.0, 10.0]];
        assert_eq!(cut(&line), [vec![[0.0, 25.0], [50.0, 25.0], [50.0, 50.0]], vec![[90.0, 50.0], [90.0, 10.0]]]);
        assert!(cut(&[[-10.0, 10.0], [10.0, -20.0]]).is_empty(), "passes the corner outside");
    }

    #[test]
    fn a_nan_breaks_the_line_and_a_point_alone_is_a_dot() {
        let line = [[1.0, 1.0], [5.0, 1.0], GAP, [7.0, 7.0], GAP, GAP, [-7.0, 7.0], GAP, [9.0, 1.0], [20.0, 1.0]];
        let expected = [vec![[1.0, 1.0], [5.0, 1.0]], vec![[7.0, 7.0], [7.0, 7.0]], vec![[9.0, 1.0], [20.0, 1.0]]];
        assert_eq!(cut(&line), expected);
    }

    #[test]
    fn many_points_in_a_strip_keep_their_extremes_in_order() {
        let strip: Vec<Point> =
            (0..1000).map(|k| [10.0 + 1e-4 * f64::from(k), 25.0 + 20.0 * libm::sin(f64::from(k))]).collect();
        let runs = cut(&strip);
        assert!(runs.len() == 1 && runs[0].len() <= 4);
        let extremes = |points: &[Point]| {
            points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p[1]), high.max(p[1])))
        };
        assert_eq!(extremes(&runs[0]), extremes(&strip));
        assert_eq!((runs[0][0], runs[0][runs[0].len() - 1]), (strip[0], strip[999]));
    }

    #[test]
    fn points_far_outside_do_not_disturb_the_arithmetic() {
        // Between such ends a product would be infinite, and its difference not a number.
        assert_eq!(cut(&[[50.0, -1e300], [50.0, 1e300]]), [vec![[50.0, 0.0], [50.0, 50.0]]]);
    }

    proptest! {
        #[test]
        fn the_kept_part_is_inside_and_on_the_segment(
            ax in -200.0..300.0_f64, ay in -100.0..150.0_f64, bx in -200.0..300.0_f64, by in -100.0..150.0_f64,
        ) {
            let cut = segment([ax, ay], [bx, by], &AREA);
            // The oracle walks along the segment.
            let inside = (0..=1000).map(|k| f64::from(k) / 1000.0).filter(|t| {
                AREA.contains([ax + t * (bx - ax), ay + t * (by - ay)])
            });
            if let Some((from, to)) = cut {
                for [x, y] in [from, to] {
                    prop_assert!(AREA.grown(1e-9).contains([x, y]));
                    let cross = (x - ax) * (by - ay) - (y - ay) * (bx - ax);
                    prop_assert!(cross.abs() < 1e-6);
                }
            } else {
                prop_assert_eq!(inside.count(), 0);
            }
        }
    }
}
