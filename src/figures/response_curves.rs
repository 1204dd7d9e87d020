//! Frequency responses as curves and as a table.

use resonarm::analysis::Response;
use resonarm_figures::plot::{Color, Dash, Style};

/// A colour each; responses along y and of the second angle are dashed, so that they differ in black and white.
pub(crate) const fn style(response: Response) -> Style {
    let (color, dash) = match response {
        Response::Alpha1 => (Color::Blue, Dash::Solid),
        Response::Alpha2 => (Color::Vermillion, Dash::Dashed),
        Response::BX => (Color::Orange, Dash::Solid),
        Response::BY => (Color::Orange, Dash::Dashed),
        Response::CX => (Color::Black, Dash::Solid),
        Response::CY => (Color::Black, Dash::Dashed),
    };
    Style::Line { color, width: 1.6, dash }
}

/// CSV: frequency, then modulus and phase of each response of this name, unit and complex values.
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

/// Phases in degrees with a gap wherever they jump from one end of the circle to the other.
pub(crate) fn broken_at_wraps(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut broken = Vec::with_capacity(points.len());
    for point in points {
        if broken.last().is_some_and(|before: &(f64, f64)| (point.1 - before.1).abs() > 270.0) {
            broken.push((point.0, f64::NAN));
        }
        broken.push(point);
    }
    broken
}
