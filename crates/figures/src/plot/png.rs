//! A scene as a PNG image of 300 dpi, or of fewer if it is long.

use tiny_skia::{FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, StrokeDash, Transform};

use super::error::PlotError;
use super::font::Fonts;
use super::outline::Outline;
use super::scene::{Anchor, Direction, Point, Rgb, Scene, Shape, Stroke, Text};
use super::style::{Dash, Marker};

/// Dots per inch of the scene.
const SCENE_DPI: f64 = 96.0;
/// Dots per inch of an image, and the least number at which its texts can be read.
const DPI: f64 = 300.0;
const LEAST_DPI: f64 = 72.0;
/// The largest side of an image, pixels: 20000 by 20000 take 1.6 GB while they are drawn.
const MAX_SIDE: f64 = 20_000.0;
const INCH_M: f64 = 0.0254;
/// Part of a pixel by which rounding may lengthen a side.
const ROUNDING: f64 = 1e-6;

/// An image that is drawn.
struct Canvas {
    pixmap: Pixmap,
    dpi: f64,
}

impl Canvas {
    /// Returns a white image for a scene. It has fewer than [`DPI`] dots per inch if its longer side would be longer than
    /// [`MAX_SIDE`].
    fn new(scene: &Scene) -> Result<Canvas, PlotError> {
        // A long figure gets fewer dots and not a scaled scene, so that its lines and texts keep their sizes.
        let dpi = DPI.min(MAX_SIDE / scene.width.max(scene.height) * SCENE_DPI).max(LEAST_DPI);
        // Rounded up, so that nothing is cut off at the lower and the right edge.
        let size = [scene.width, scene.height].map(|length| libm::ceil(length * dpi / SCENE_DPI - ROUNDING));
        let [width, height] = size.map(|side| side as u32);
        let fits = size.iter().all(|side| *side <= MAX_SIDE);
        let pixmap = if fits { Pixmap::new(width, height) } else { None };
        let mut pixmap = pixmap.ok_or(PlotError::TooLarge { width, height })?;
        pixmap.fill(tiny_skia::Color::WHITE);
        Ok(Canvas { pixmap, dpi })
    }

    fn to_pixels(&self) -> Transform {
        let scale = (self.dpi / SCENE_DPI) as f32;
        Transform::from_scale(scale, scale)
    }
}

/// Draws the scene as a PNG image.
pub(super) fn image(scene: &Scene) -> Result<Vec<u8>, PlotError> {
    let mut canvas = Canvas::new(scene)?;
    let fonts = Fonts::embedded()?;
    for shape in &scene.shapes {
        draw(&mut canvas, &fonts, shape);
    }
    encode(&canvas)
}

fn draw(canvas: &mut Canvas, fonts: &Fonts, shape: &Shape) {
    match shape {
        Shape::Rect { area, fill } => {
            let corners =
                [[area.left, area.top], [area.right, area.top], [area.right, area.bottom], [area.left, area.bottom]];
            fill_path(canvas, path(&[corners.to_vec()], Ends::Closed), *fill, canvas.to_pixels());
        }
        Shape::Lines { runs, stroke } => stroke_path(canvas, path(runs, Ends::Open), stroke),
        Shape::Markers { at, shape, size, fill, stroke } => {
            // One after the other, so that markers overlap in the order of the points.
            for at in at {
                let outline = marker(*shape, *at, size / 2.0);
                // A cross has no area to fill.
                if *shape != Marker::Cross {
                    fill_path(canvas, outline.clone(), *fill, canvas.to_pixels());
                }
                stroke_path(canvas, outline, stroke);
            }
        }
        Shape::Text(text) => draw_text(canvas, fonts, text),
    }
}

fn paint([red, green, blue]: Rgb) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(red, green, blue, 255);
    paint
}

/// Without a path there is nothing to draw: a text of spaces, a line without points.
fn fill_path(canvas: &mut Canvas, path: Option<Path>, color: Rgb, transform: Transform) {
    if let Some(path) = path {
        // Contours of a glyph may overlap; by the even-odd rule the overlap would be a hole.
        canvas.pixmap.fill_path(&path, &paint(color), FillRule::Winding, transform, None);
    }
}

fn stroke_path(canvas: &mut Canvas, path: Option<Path>, stroke: &Stroke) {
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
    canvas.pixmap.stroke_path(&path, &paint(stroke.color), &pen, canvas.to_pixels(), None);
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
            let x = *x as f32;
            let y = *y as f32;
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
fn draw_text(canvas: &mut Canvas, fonts: &Fonts, text: &Text) {
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
    let transform = canvas
        .to_pixels()
        .pre_translate(text.at[0] as f32, text.at[1] as f32)
        .pre_rotate(degrees)
        .pre_translate(start as f32, 0.0)
        .pre_scale(unit, -unit);
    fill_path(canvas, outline.builder.finish(), text.color, transform);
}

/// The image started as white, so every pixel is opaque, and alpha is not needed.
fn encode(canvas: &Canvas) -> Result<Vec<u8>, PlotError> {
    let rgb: Vec<u8> =
        canvas.pixmap.pixels().iter().flat_map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
    let mut bytes = Vec::new();
    let failed = |error: png::EncodingError| PlotError::Encode { why: error.to_string() };
    let mut encoder = png::Encoder::new(&mut bytes, canvas.pixmap.width(), canvas.pixmap.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let per_metre = libm::round(canvas.dpi / INCH_M) as u32;
    let density = png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit: png::Unit::Meter };
    encoder.set_pixel_dims(Some(density));
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&rgb).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}
