//! Frequency responses as curves and as a table.

use resonarm_figures::plot::{Color, Dash, Style};

/// Returns the style of a response by its number: neighbours differ in their dashes as well, so that they differ in
/// black and white.
pub(crate) const fn style(number: usize) -> Style {
    const COLORS: [Color; 4] = [Color::Black, Color::Blue, Color::Vermillion, Color::Orange];
    const DASHES: [Dash; 3] = [Dash::Solid, Dash::Dashed, Dash::Chain];
    Style::Line { color: COLORS[number % COLORS.len()], width: 1.6, dash: DASHES[number % DASHES.len()] }
}

/// Returns the CSV: frequency, then modulus and phase of each response of this name, unit and complex values.
pub(crate) fn csv(frequency_hz: &[f64], responses: &[(String, String, Vec<[f64; 2]>)]) -> String {
    let mut text = String::from("frequency_hz");
    for (name, unit, _) in responses {
        let unit = unit.replace(' ', "_").replace("/s²", "_s2").replace("/s", "_s");
        let unit = unit.replace("N·m", "nm").replace('N', "n");
        text += &format!(",{name}_modulus_{unit},{name}_phase_deg");
    }
    text.push('\n');
    for (k, hz) in frequency_hz.iter().enumerate() {
        text += &format!("{hz}");
        for (_, _, value) in responses {
            let [re, im] = value[k];
            text += &format!(",{:e},{}", libm::hypot(re, im), libm::atan2(im, re).to_degrees());
        }
        text.push('\n');
    }
    text
}

/// Returns phases in degrees, with a gap wherever they jump from one end of the circle to the other. The line goes on
/// to ±180° on both sides of it, so that a point alone on one side is seen, too.
pub(crate) fn broken_at_wraps(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut broken: Vec<(f64, f64)> = Vec::with_capacity(points.len());
    for (x, phase) in points {
        if let Some(&(before_x, before)) = broken.last()
            && (phase - before).abs() > 270.0
        {
            // Unwrapped, the phase goes from `before` past the edge to phase + 2·edge. `share` is how far along that
            // way the edge is; the way is 0 if one point is at +180° and the other at −180°.
            let edge = if phase < before { 180.0 } else { -180.0 };
            let way = phase + 2.0 * edge - before;
            let share = if way == 0.0 { 0.5 } else { (edge - before) / way };
            let at = before_x + share * (x - before_x);
            broken.extend([(at, edge), (at, f64::NAN), (at, -edge)]);
        }
        broken.push((x, phase));
    }
    broken
}

#[cfg(test)]
mod tests {
    use super::broken_at_wraps;

    #[test]
    fn a_phase_that_wraps_goes_on_to_both_ends_of_the_circle() {
        let found = broken_at_wraps(vec![(1.0, 170.0), (2.0, -170.0), (4.0, 160.0), (5.0, f64::NAN), (6.0, 180.0)]);
        let expected = [
            (1.0, 170.0),
            (1.5, 180.0),
            (1.5, f64::NAN),
            (1.5, -180.0),
            (2.0, -170.0),
            (2.0 + 2.0 / 3.0, -180.0),
            (2.0 + 2.0 / 3.0, f64::NAN),
            (2.0 + 2.0 / 3.0, 180.0),
            (4.0, 160.0),
            (5.0, f64::NAN),
            (6.0, 180.0),
        ];
        assert_eq!(format!("{found:?}"), format!("{expected:?}"));
        let flat = broken_at_wraps(vec![(1.0, 180.0), (2.0, -180.0)]);
        assert_eq!((flat.len(), flat[1], flat[3]), (5, (1.5, 180.0), (1.5, -180.0)));
    }
}
