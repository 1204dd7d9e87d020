//! A scene as a PNG image of 300 dpi.

use tiny_skia::{FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, StrokeDash, Transform};
use ttf_parser::OutlineBuilder;

use super::PlotError;
use super::font::{Fonts, OffsetOutline};
use super::scene::{Anchor, Direction, Point, Rgb, Scene, Shape, Stroke, Text};
use super::style::{Dash, Marker};

/// Pixels of the image per px of the scene: 300 dpi over 96.
const SCALE: f64 = 300.0 / 96.0;
/// The largest side of an image, pixels: 20000 by 20000 take 1.6 GB while they are drawn.
const MAX_SIDE: u32 = 20_000;
const PIXELS_PER_METRE: u32 = 11_811; // 300 dpi

/// Draws the scene as a PNG image.
pub(super) fn image(scene: &Scene) -> Result<Vec<u8>, PlotError> {
    // Rounded up, so that nothing is cut off at the lower and the right edge.
    let [width, height] = [scene.width, scene.height].map(|length| libm::ceil(length * SCALE) as u32);
    let canvas = if width.max(height) > MAX_SIDE { None } else { Pixmap::new(width, height) };
    let mut canvas = canvas.ok_or(PlotError::TooLarge { width, height })?;
    canvas.fill(tiny_skia::Color::WHITE);
    let fonts = Fonts::embedded()?;
    for shape in &scene.shapes {
        draw(&mut canvas, &fonts, shape);
    }
    encode(&canvas)
}

fn draw(canvas: &mut Pixmap, fonts: &Fonts, shape: &Shape) {
    match shape {
        Shape::Rect { area, fill } => {
            let corners =
                [[area.left, area.top], [area.right, area.top], [area.right, area.bottom], [area.left, area.bottom]];
            fill_path(canvas, path(&[corners.to_vec()], Ends::Closed), *fill, to_pixels());
        }
        Shape::Lines { runs, stroke } => stroke_path(canvas, path(runs, Ends::Open), stroke),
        Shape::Markers { at, shape, size, fill, stroke } => {
            // One after the other, so that markers overlap in the order of the points.
            for at in at {
                let outline = marker(*shape, *at, size / 2.0);
                // A cross has no area to fill.
                if *shape != Marker::Cross {
                    fill_path(canvas, outline.clone(), *fill, to_pixels());
                }
                stroke_path(canvas, outline, stroke);
            }
        }
        Shape::Text(text) => draw_text(canvas, fonts, text),
    }
}

fn to_pixels() -> Transform {
    Transform::from_scale(SCALE as f32, SCALE as f32)
}

fn paint([red, green, blue]: Rgb) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(red, green, blue, 255);
    paint
}

/// Without a path there is nothing to draw: a text of spaces, a line without points.
fn fill_path(canvas: &mut Pixmap, path: Option<Path>, color: Rgb, transform: Transform) {
    if let Some(path) = path {
        // Contours of a glyph may overlap; by the even-odd rule the overlap would be a hole.
        canvas.fill_path(&path, &paint(color), FillRule::Winding, transform, None);
    }
}

fn stroke_path(canvas: &mut Pixmap, path: Option<Path>, stroke: &Stroke) {
    let Some(path) = path else { return };
    let dashes = stroke.dash.pattern().iter().map(|length| (length * stroke.width) as f32).collect();
    let pen = tiny_skia::Stroke {
        width: stroke.width as f32,
        // Round ends would close the gaps between dashes.
        line_cap: if stroke.dash == Dash::Solid { LineCap::Round } else { LineCap::Butt },
        line_join: LineJoin::Round,
        dash: StrokeDash::new(dashes, 0.0),
        ..tiny_skia::Stroke::default()
    };
    canvas.stroke_path(&path, &paint(stroke.color), &pen, to_pixels(), None);
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Ends {
    Open,
    Closed,
}

fn path(runs: &[Vec<Point>], ends: Ends) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for run in runs {
        for (index, [x, y]) in run.iter().enumerate() {
            let (x, y) = (*x as f32, *y as f32);
            if index == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
        }
        if ends == Ends::Closed {
            builder.close();
        }
    }
    builder.finish()
}

fn marker(shape: Marker, [x, y]: Point, radius: f64) -> Option<Path> {
    let corners: Vec<Point> =
        shape.corners().iter().map(|corner| [x + radius * corner[0], y + radius * corner[1]]).collect();
    match shape {
        Marker::Circle => PathBuilder::from_circle(x as f32, y as f32, radius as f32),
        Marker::Cross => path(&corners.chunks(2).map(<[Point]>::to_vec).collect::<Vec<_>>(), Ends::Open),
        Marker::Square | Marker::Triangle | Marker::Diamond => path(&[corners], Ends::Closed),
    }
}

/// Glyph outlines, from units of the font with y upwards to pixels.
fn draw_text(canvas: &mut Pixmap, fonts: &Fonts, text: &Text) {
    let mut outline = Outline { builder: PathBuilder::new(), x: 0.0 };
    let units_per_em = fonts.outline(&text.text, text.weight, &mut outline);
    let width = fonts.width(&text.text, text.size, text.weight);
    let start = match text.anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => -width / 2.0,
        Anchor::End => -width,
    };
    let degrees = match text.direction {
        Direction::Rightwards => 0.0,
        Direction::Upwards => -90.0,
    };
    let unit = (text.size / units_per_em) as f32;
    // Each `pre_` acts before those above it: from the font's units, y upwards, to px; to the anchor; turned; to its
    // place; to pixels.
    let transform = to_pixels()
        .pre_translate(text.at[0] as f32, text.at[1] as f32)
        .pre_rotate(degrees)
        .pre_translate(start as f32, 0.0)
        .pre_scale(unit, -unit);
    fill_path(canvas, outline.builder.finish(), text.color, transform);
}

/// Collects glyphs side by side.
struct Outline {
    builder: PathBuilder,
    x: f32,
}

impl OffsetOutline for Outline {
    fn start_at(&mut self, x: f32) {
        self.x = x;
    }
}

impl OutlineBuilder for Outline {
    fn move_to(&mut self, x: f32, y: f32) {
        self.builder.move_to(self.x + x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.builder.line_to(self.x + x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.builder.quad_to(self.x + x1, y1, self.x + x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.builder.cubic_to(self.x + x1, y1, self.x + x2, y2, self.x + x, y);
    }

    fn close(&mut self) {
        self.builder.close();
    }
}

/// The image started as white, so every pixel is opaque, and alpha is not needed.
fn encode(canvas: &Pixmap) -> Result<Vec<u8>, PlotError> {
    let rgb: Vec<u8> = canvas.pixels().iter().flat_map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
    let mut bytes = Vec::new();
    let failed = |error: png::EncodingError| PlotError::Encode { why: error.to_string() };
    let mut encoder = png::Encoder::new(&mut bytes, canvas.width(), canvas.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let density = png::PixelDimensions { xppu: PIXELS_PER_METRE, yppu: PIXELS_PER_METRE, unit: png::Unit::Meter };
    encoder.set_pixel_dims(Some(density));
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&rgb).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}
