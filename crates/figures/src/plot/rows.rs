//! Names of crowded peaks: side by side in a row above them, each with a line down to its peak.

use super::Note;
use super::cell::Cell;
use super::font::{CAP_HEIGHT, Fonts};
use super::notes::{GAP, LEADER, SIZE, words};
use super::scene::{Point, Rect, Shape, Weight};

/// Gap between adjacent names.
const SPACE: f64 = 7.0;
/// Height from the highest peak of a row to the bend of its lines, and from there to the names.
const KNEE: f64 = 5.0;
const RISE: f64 = 17.0;

/// A name, the position of its point on the page, and its row.
struct Entry<'a> {
    note: &'a Note,
    at: Point,
    row: usize,
    width: f64,
}

/// Draws the rows of names and returns the areas they cover. Names of different rows do not overlap.
pub(super) fn draw(shapes: &mut Vec<Shape>, fonts: &Fonts, cell: &Cell<'_>) -> Vec<Rect> {
    let mut entries: Vec<Entry<'_>> = Vec::new();
    for (row, notes) in cell.draft.panel.rows.iter().enumerate() {
        for note in notes {
            let at = [cell.x.px(note.at.0), cell.y.px(note.at.1)];
            if cell.plot.contains(at) {
                entries.push(Entry { note, at, row, width: fonts.width(&note.text, SIZE, Weight::Regular) });
            }
        }
    }
    entries.sort_by(|a, b| a.at[0].total_cmp(&b.at[0]));
    let (wanted, widths): (Vec<f64>, Vec<f64>) = entries.iter().map(|entry| (entry.at[0], entry.width)).unzip();
    let centres = spread(&wanted, &widths, sides(cell));
    let mut taken = Vec::new();
    for (entry, centre) in entries.iter().zip(centres) {
        // One height for the whole row, so that its names are on one line.
        let of_row = entries.iter().filter(|other| other.row == entry.row);
        let knee = of_row.fold(f64::INFINITY, |top, other| top.min(other.at[1])) - KNEE;
        let height = SIZE * CAP_HEIGHT + GAP;
        // The names of the highest peaks stay inside the plot.
        let bottom = (knee - RISE).max(cell.plot.top + GAP + height);
        let left = centre - entry.width / 2.0;
        let right = centre + entry.width / 2.0;
        let area = Rect { left, right, top: bottom - height, bottom };
        let line = vec![[entry.at[0], entry.at[1] - GAP], [entry.at[0], knee.min(entry.at[1])], [centre, bottom]];
        shapes.push(Shape::Lines { runs: vec![line], stroke: LEADER });
        shapes.push(words(entry.note, &area));
        taken.push(area);
    }
    taken
}

/// The horizontal range for names: inside of the plot, and beside the legend.
fn sides(cell: &Cell<'_>) -> (f64, f64) {
    let mut left = cell.plot.left + GAP;
    let mut right = cell.plot.right - GAP;
    if let Some(legend) = cell.legend_area() {
        let middle = (cell.plot.left + cell.plot.right) / 2.0;
        if legend.left > middle {
            right = right.min(legend.left - GAP);
        } else if legend.right < middle {
            left = left.max(legend.right + GAP);
        }
    }
    (left, right)
}

/// The centres of names of these widths, in order and without overlap, nearest to the wanted positions.
///
/// Centres c must satisfy c(i+1) − c(i) ≥ s(i+1) − s(i), with s the centres of the names packed side by side. So u = c
/// − s must ascend, and Σ (c − wanted)² is least for the isotonic regression of wanted − s: neighbours that descend are
/// pooled to their mean (M. Ayer, H. D. Brunk, G. M. Ewing, W. T. Reid, E. Silverman, "An Empirical Distribution
/// Function for Sampling with Incomplete Information", Ann. Math. Statist. 26 (1955)). The bounds clamp the result.
fn spread(wanted: &[f64], widths: &[f64], (left, right): (f64, f64)) -> Vec<f64> {
    let mut packed = Vec::with_capacity(widths.len());
    let mut end = 0.0;
    for width in widths {
        packed.push(end + width / 2.0);
        end += width + SPACE;
    }
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for (wanted, packed) in wanted.iter().zip(&packed) {
        let mut pool = (wanted - packed, 1);
        while let Some(last) = pools.pop_if(|last| last.0 > pool.0) {
            let count = last.1 + pool.1;
            pool = ((last.0 * last.1 as f64 + pool.0 * pool.1 as f64) / count as f64, count);
        }
        pools.push(pool);
    }
    let shifts = pools.into_iter().flat_map(|(mean, count)| core::iter::repeat_n(mean, count));
    // `end` has a space behind the last name, which may reach beyond the range. Names that are too wide together
    // begin at its left.
    shifts.zip(&packed).map(|(shift, packed)| shift.min(right - end + SPACE).max(left) + packed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_as_near_as_possible_to_the_wanted_positions() {
        let widths = [20.0, 20.0, 20.0];
        assert_eq!(spread(&[50.0, 100.0, 150.0], &widths, (0.0, 200.0)), [50.0, 100.0, 150.0]);
        // Three with the same wanted position are centred on it, a space apart.
        // 20 px wide and 7 px apart, their centres are 27 px from each other.
        assert_eq!(spread(&[100.0; 3], &widths, (0.0, 200.0)), [73.0, 100.0, 127.0]);
        // At a side they are moved inside, and keep their order.
        assert_eq!(spread(&[0.0, 5.0, 190.0], &widths, (0.0, 200.0)), [10.0, 37.0, 190.0]);
        assert_eq!(spread(&[195.0; 3], &widths, (0.0, 200.0)), [136.0, 163.0, 190.0]);
        assert!(spread(&[], &[], (0.0, 200.0)).is_empty());
    }
}
