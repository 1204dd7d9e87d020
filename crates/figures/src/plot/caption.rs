//! The line below a figure's title, cut to its width, and the additional lines of the caption.

use super::font::Fonts;
use super::scene::Weight;

/// The conditions of a figure.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Subtitle {
    /// The line below the title, the most important first. If its parts, separated by `, `, do not all fit, the last
    /// are replaced by `…`; the caption has them all.
    pub line: String,
    /// Additional lines of the caption.
    pub more: Vec<String>,
}

impl From<String> for Subtitle {
    fn from(line: String) -> Subtitle {
        Subtitle { line, more: Vec::new() }
    }
}

impl From<&str> for Subtitle {
    fn from(line: &str) -> Subtitle {
        Subtitle::from(line.to_owned())
    }
}

impl Subtitle {
    /// Returns the subtitle with `part` appended to its line; an empty one adds nothing.
    #[must_use]
    pub fn and(mut self, part: impl AsRef<str>) -> Subtitle {
        let part = part.as_ref();
        if !part.is_empty() {
            let separator = if self.line.is_empty() { "" } else { ", " };
            self.line = format!("{}{separator}{part}", self.line);
        }
        self
    }

    /// Returns as many parts of the line, from its beginning, as fit in `width`; the first in any case.
    pub(super) fn fitting(&self, fonts: &Fonts, size: f64, width: f64) -> String {
        let fits = |text: &str| fonts.width(text, size, Weight::Regular) <= width;
        if fits(&self.line) {
            return self.line.clone();
        }
        // From the shortest text on, until one no longer fits.
        let ends = self.line.match_indices(", ").map(|(end, _)| format!("{}, …", &self.line[..end]));
        let mut fitting = ends.enumerate().take_while(|(index, text)| *index == 0 || fits(text));
        fitting.by_ref().last().map_or_else(|| self.line.clone(), |(_, text)| text)
    }
}
