//! The embedded font: widths of texts, and outlines of glyphs.

use ttf_parser::Face;

use super::error::PlotError;
use super::outline::Outline;
use super::scene::Weight;

/// Family names for SVG: the embedded font, then common fonts of nearly the same width, then any.
pub(super) const FAMILY: &str = "'DejaVu Sans','Bitstream Vera Sans',Verdana,Helvetica,Arial,sans-serif";

/// Height of a capital letter over the em square, to centre text on a line.
pub(super) const CAP_HEIGHT: f64 = 0.729;

/// DejaVu Sans, regular and bold (see `fonts/README.md`).
pub(super) struct Fonts {
    regular: Face<'static>,
    bold: Face<'static>,
}

impl Fonts {
    pub fn embedded() -> Result<Self, PlotError> {
        let face = |name: &'static str, data: &'static [u8]| {
            Face::parse(data, 0).map_err(|error| PlotError::Font { name, why: error.to_string() })
        };
        Ok(Self {
            regular: face("DejaVu Sans", include_bytes!("fonts/DejaVuSans-subset.ttf"))?,
            bold: face("DejaVu Sans Bold", include_bytes!("fonts/DejaVuSans-Bold-subset.ttf"))?,
        })
    }

    fn face(&self, weight: Weight) -> &Face<'static> {
        match weight {
            Weight::Regular => &self.regular,
            Weight::Bold => &self.bold,
        }
    }

    /// Width of `text`, in px.
    pub fn width(&self, text: &str, size: f64, weight: Weight) -> f64 {
        let face = self.face(weight);
        let units: u32 = text.chars().map(|c| advance(face, c)).sum();
        f64::from(units) * size / f64::from(face.units_per_em())
    }

    /// Draws `text` from the origin along the x axis into `outline`, in units of the font, y upwards; returns the
    /// number of units in an em. A character that the font lacks is drawn as a box.
    pub fn outline(&self, text: &str, weight: Weight, outline: &mut Outline) -> f64 {
        let face = self.face(weight);
        let mut x = 0;
        for c in text.chars() {
            outline.x = x as f32;
            // A glyph without outline, such as a space, draws nothing.
            // Glyph 0 of every font is the box for what it lacks (OpenType, `.notdef`).
            let _ = face.outline_glyph(face.glyph_index(c).unwrap_or_default(), outline);
            x += advance(face, c);
        }
        f64::from(face.units_per_em())
    }

    /// `text` broken at spaces into lines no wider than `width`; a wider word gets its own line.
    pub fn wrap(&self, text: &str, size: f64, weight: Weight, width: f64) -> Vec<String> {
        let mut lines: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            match lines.last_mut() {
                Some(line) if self.width(&format!("{line} {word}"), size, weight) <= width => {
                    line.push(' ');
                    line.push_str(word);
                }
                _ => lines.push(word.to_owned()),
            }
        }
        lines
    }
}

/// A character the font lacks is as wide as the box drawn for it.
fn advance(face: &Face<'_>, c: char) -> u32 {
    face.glyph_hor_advance(face.glyph_index(c).unwrap_or_default()).unwrap_or(0).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fonts_have_every_character_that_figures_use() {
        let fonts = Fonts::embedded().unwrap();
        let used = "Aa09 °·²³−×±≈≤≥√∞∂∑ αβγδεζηθλμνξπρστφψω ΔΦΩ ⁻⁰¹²³⁴⁵⁶⁷⁸⁹ ₀₁₂₃₄₅₆₇₈₉ – — … ’ äöüß éł";
        for weight in [Weight::Regular, Weight::Bold] {
            let face = fonts.face(weight);
            let missing: String = used.chars().filter(|c| face.glyph_index(*c).is_none()).collect();
            assert_eq!(missing, "");
        }
    }

    #[test]
    fn widths_are_those_of_the_font() {
        let fonts = Fonts::embedded().unwrap();
        // Advance widths of DejaVu Sans over 2048 units: M 1767, i 569.
        let expected = 12.0 * (1767.0 + 569.0) / 2048.0;
        assert!((fonts.width("Mi", 12.0, Weight::Regular) - expected).abs() < 1e-12);
        assert!(fonts.width("Mi", 12.0, Weight::Bold) > expected);
    }

    #[test]
    fn long_titles_break_at_spaces() {
        let fonts = Fonts::embedded().unwrap();
        let lines =
            fonts.wrap("one two three  four", 10.0, Weight::Regular, fonts.width("one two ", 10.0, Weight::Regular));
        assert_eq!(lines, ["one two", "three", "four"]);
        assert!(fonts.wrap("", 10.0, Weight::Regular, 100.0).is_empty());
    }
}
