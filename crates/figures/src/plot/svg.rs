//! A scene as an SVG document: text stays text, a series is one path.

use core::fmt::Write;

use super::font::FAMILY;
use super::scene::{Anchor, Direction, Point, Rgb, Scene, Shape, Stroke, Text, Weight};
use super::style::{Dash, Marker};

/// Writes the scene as an SVG document.
pub(super) fn document(scene: &Scene) -> String {
    let width = number(scene.width);
    let height = number(scene.height);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         role=\"img\" font-family=\"{FAMILY}\">\n<title>{}</title>\n",
        escaped(&scene.title)
    );
    for shape in &scene.shapes {
        out.push_str(&element(shape));
        out.push('\n');
    }
    out.push_str("</svg>\n");
    out
}

fn element(shape: &Shape) -> String {
    match shape {
        Shape::Rect { area, fill } => format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{}\"/>",
            number(area.left),
            number(area.top),
            number(area.right - area.left),
            number(area.bottom - area.top),
            color(*fill)
        ),
        Shape::Lines { runs, stroke } => {
            let path: String = runs.iter().map(|run| polyline(run)).collect();
            format!("<path fill=\"none\" {} d=\"{path}\"/>", pen(stroke))
        }
        Shape::Markers { at, shape, size, fill, stroke } => {
            let path: String = at.iter().map(|at| marker(*shape, *at, *size / 2.0)).collect();
            format!("<path fill=\"{}\" {} d=\"{path}\"/>", color(*fill), pen(stroke))
        }
        Shape::Text(text) => text_element(text),
    }
}

fn text_element(text: &Text) -> String {
    let [x, y] = text.at;
    let anchor = match text.anchor {
        Anchor::Start => "",
        Anchor::Middle => " text-anchor=\"middle\"",
        Anchor::End => " text-anchor=\"end\"",
    };
    let weight = if text.weight == Weight::Bold { " font-weight=\"bold\"" } else { "" };
    let place = match text.direction {
        Direction::Rightwards => format!("x=\"{}\" y=\"{}\"", number(x), number(y)),
        Direction::Upwards => format!("transform=\"translate({} {}) rotate(-90)\"", number(x), number(y)),
    };
    let size = number(text.size);
    let fill = color(text.color);
    let content = escaped(&text.text);
    format!("<text {place} font-size=\"{size}\"{weight}{anchor} fill=\"{fill}\">{content}</text>")
}

/// Returns the attributes of a pen. Ends are round, so that a dot is visible, except for dashes, which would merge.
fn pen(stroke: &Stroke) -> String {
    let line = color(stroke.color);
    let width = number(stroke.width);
    if stroke.dash == Dash::Solid {
        return format!(
            "stroke=\"{line}\" stroke-width=\"{width}\" stroke-linecap=\"round\" stroke-linejoin=\"round\""
        );
    }
    let lengths = stroke.dash.pattern().iter().map(|length| number(length * stroke.width));
    let dashes = lengths.collect::<Vec<_>>().join(" ");
    format!("stroke=\"{line}\" stroke-width=\"{width}\" stroke-dasharray=\"{dashes}\" stroke-linejoin=\"round\"")
}

/// Returns path commands for a polyline: the first point absolute, the others relative to the one before, in whole
/// hundredths, so that rounding doesn't add up.
fn polyline(points: &[Point]) -> String {
    let mut out = String::new();
    let mut before = [0_i64, 0];
    for (index, point) in points.iter().enumerate() {
        let at = point.map(hundredths);
        // `M` begins the line, `l` is relative to the point before, and each further pair of numbers repeats it.
        let command = match index {
            0 => "M",
            1 => "l",
            _ => " ",
        };
        let [dx, dy] = [at[0] - before[0], at[1] - before[1]];
        // A minus sign separates two numbers by itself.
        let separator = if dy < 0 { "" } else { " " };
        // Writing to a string can't fail.
        let _ = write!(out, "{command}{}{separator}{}", decimal(dx), decimal(dy));
        before = at;
    }
    out
}

fn marker(shape: Marker, [x, y]: Point, radius: f64) -> String {
    let corners: Vec<Point> =
        shape.corners().iter().map(|corner| [x + radius * corner[0], y + radius * corner[1]]).collect();
    match shape {
        Marker::Circle => {
            let r = number(radius);
            let left = number(x - radius);
            let y = number(y);
            let diameter = number(2.0 * radius);
            // Two half circles: an arc from a point to itself is not drawn.
            format!("M{left} {y}a{r} {r} 0 1 0 {diameter} 0a{r} {r} 0 1 0-{diameter} 0z")
        }
        Marker::Cross => corners.chunks(2).map(polyline).collect(),
        Marker::Square | Marker::Triangle | Marker::Diamond => polyline(&corners) + "z",
    }
}

fn color([red, green, blue]: Rgb) -> String {
    format!("#{red:02X}{green:02X}{blue:02X}")
}

/// Formats a length or a position, to hundredths of a px.
fn number(value: f64) -> String {
    decimal(hundredths(value))
}

fn hundredths(value: f64) -> i64 {
    libm::round(value * 100.0) as i64
}

/// Formats a number of hundredths without trailing zeros.
fn decimal(hundredths: i64) -> String {
    let sign = if hundredths < 0 { "-" } else { "" };
    let whole = hundredths.unsigned_abs() / 100;
    let part = hundredths.unsigned_abs() % 100;
    match (whole, part) {
        (_, 0) => format!("{sign}{whole}"),
        // SVG needs no zero before the point, which makes long paths shorter.
        (0, _) => format!("{sign}.{}", format!("{part:02}").trim_end_matches('0')),
        _ => format!("{sign}{whole}.{}", format!("{part:02}").trim_end_matches('0')),
    }
}

/// Escapes text for XML 1.0: markup characters escaped, forbidden ones replaced.
fn escaped(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '&' => out.push_str("&amp;"),
            '"' => out.push_str("&quot;"),
            '\t' | '\n' | '\r' => out.push(' '),
            // XML 1.0 can't contain these characters, not even escaped.
            '\0'..='\x1f' | '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let numbers = [0.0, -0.001, 1.0, -1.5, 0.25, -0.05, 100.0, 12.345, 10.1].map(number);
        assert_eq!(numbers, ["0", "0", "1", "-1.5", ".25", "-.05", "100", "12.35", "10.1"]);
    }

    #[test]
    fn polylines_are_relative_and_do_not_drift() {
        insta::assert_snapshot!(polyline(&[[1.0, 2.0], [1.5, 1.0], [1.5, 3.0], [0.0, 3.0]]), @"M1 2l.5-1 0 2 -1.5 0");
        // A thousand steps of a third of a hundredth: each alone would round to nothing.
        let fine: Vec<Point> = (0..=1000).map(|k| [f64::from(k) / 300.0, 0.0]).collect();
        let path = polyline(&fine).replace(['M', 'l'], " ");
        let end: f64 = path.split_whitespace().step_by(2).map(|dx| dx.parse::<f64>().unwrap()).sum();
        assert!((end - 1000.0 / 300.0).abs() < 0.005 + 1e-9, "{end}");
    }

    #[test]
    fn markup_and_forbidden_characters_are_escaped() {
        assert_eq!(escaped("a<b & \"c\">\u{1}d\ne"), "a&lt;b &amp; &quot;c&quot;&gt;\u{fffd}d e");
    }
}
