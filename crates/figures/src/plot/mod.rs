//! Figures of journal quality, as SVG and PNG.
//!
//! A [`Figure`] is data: panels, axes, series. It is laid out once into a scene of paths and texts, which is then
//! written as SVG (vector, text stays text) or drawn as PNG (300 dpi), so that both look the same. The same figure
//! produces bit-identical files.

mod axis;
mod caption;
mod cell;
mod clip;
mod error;
mod font;
mod layout;
mod legend;
mod marks;
mod notes;
mod outline;
mod panel;
mod png;
mod rows;
mod scene;
mod style;
mod svg;
mod ticks;

use std::path::{Path, PathBuf};

use resonarm_files::write_whole;

pub use caption::Subtitle;
pub use error::PlotError;
pub use style::{Color, Dash, Marker, Style};

/// A figure: panels under a title.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// The title; broken into lines where it is too long.
    pub title: String,
    /// A line below the title: the conditions of the figure.
    pub subtitle: Subtitle,
    /// The panels, row by row. Panels below each other whose x axes are equal share them: one range, labels on the
    /// lowest.
    pub panels: Vec<Panel>,
    /// The number of panels side by side, at least 1.
    pub columns: usize,
    /// Whether title and subtitle are drawn. Papers have them in their caption; [`Figure::caption`] keeps both.
    pub is_titled: bool,
}

impl Figure {
    /// The endings that [`Figure::write`] appends: SVG, PNG and the caption.
    pub const ENDINGS: [&'static str; 3] = [".svg", ".png", ".txt"];

    /// Makes a figure without panels, of one column.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), subtitle: Subtitle::default(), panels: Vec::new(), columns: 1, is_titled: true }
    }

    /// Returns the figure with this subtitle, below its title.
    #[must_use]
    pub fn subtitle(self, subtitle: impl Into<Subtitle>) -> Self {
        Self { subtitle: subtitle.into(), ..self }
    }

    /// Returns the figure with this panel below the others.
    #[must_use]
    pub fn with(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Returns the figure as an SVG document.
    ///
    /// # Errors
    /// [`PlotError`] if the figure can't be drawn.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        Ok(svg::document(&layout::scene(self)?))
    }

    /// Returns the figure as a PNG image of 300 dpi. A figure whose longer side would have more than 20,000 pixels has fewer
    /// dots per inch, at least 72.
    ///
    /// # Errors
    /// [`PlotError`] if the figure can't be drawn.
    pub fn to_png(&self) -> Result<Vec<u8>, PlotError> {
        png::image(&layout::scene(self)?)
    }

    /// Returns the caption: title, subtitle in full, and its additional lines.
    pub fn caption(&self) -> String {
        let Subtitle { line, more } = &self.subtitle;
        let lines = [&self.title, line].into_iter().chain(more).filter(|line| !line.is_empty());
        lines.fold(String::new(), |text, line| text + line + "\n")
    }

    /// Writes the figure as SVG and PNG, and its caption as text: to `stem` with [`Figure::ENDINGS`] appended, replacing
    /// existing files. Returns these paths.
    ///
    /// # Errors
    /// [`PlotError`] if the figure can't be drawn, or a file can't be written.
    pub fn write(&self, stem: &Path) -> Result<[PathBuf; 3], PlotError> {
        let paths = Self::ENDINGS.map(|ending| beside(stem, ending));
        let [svg, png, caption] = &paths;
        write_file(svg, self.to_svg()?.as_bytes())?;
        write_file(png, &self.to_png()?)?;
        write_file(caption, self.caption().as_bytes())?;
        Ok(paths)
    }
}

/// Returns `stem` with `ending` appended, as `.csv`; text after a dot in `stem` is kept.
pub fn beside(stem: &Path, ending: &str) -> PathBuf {
    let mut path = stem.as_os_str().to_owned();
    path.push(ending);
    PathBuf::from(path)
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), PlotError> {
    write_whole(path, bytes).map_err(|source| PlotError::Write { path: path.to_owned(), source })
}

/// One pair of axes and what is drawn in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// A title, for figures with several panels.
    pub title: Option<String>,
    /// The horizontal axis of all series.
    pub x: Axis,
    /// The vertical axis of all series.
    pub y: Axis,
    /// The series, the last on top.
    pub series: Vec<Series>,
    /// Words near points of the panel; those whose point is outside of the axes are not drawn.
    pub notes: Vec<Note>,
    /// Names of crowded peaks, each list in a separate row above its peaks.
    pub rows: Vec<Vec<Note>>,
    /// The place of the legend.
    pub legend: Legend,
}

impl Panel {
    /// Makes a panel without series between two axes.
    pub fn new(x: Axis, y: Axis) -> Self {
        Self { title: None, x, y, series: Vec::new(), notes: Vec::new(), rows: Vec::new(), legend: Legend::Auto }
    }

    /// Returns the panel with this title.
    #[must_use]
    pub fn title(self, title: impl Into<String>) -> Self {
        Self { title: Some(title.into()), ..self }
    }

    /// Adds a series on top of the others.
    #[must_use]
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Adds a series on top, unless that has no points.
    #[must_use]
    pub fn with_any(self, series: Series) -> Self {
        if series.points.is_empty() { self } else { self.with(series) }
    }

    /// Adds names in a row above these points, side by side in the order of the points, each with a line down to its
    /// point. This is for peaks too near to each other for [`Panel::notes`]. A name whose point is outside of the axes
    /// isn't drawn.
    #[must_use]
    pub fn row(mut self, names: Vec<Note>) -> Self {
        self.rows.push(names);
        self
    }

    /// Sets the place of the legend.
    #[must_use]
    pub fn legend(self, legend: Legend) -> Self {
        Self { legend, ..self }
    }
}

/// Words near a point of a panel, for example the name of a curve at its peak. They keep clear of the lines and of each
/// other, if there is room.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// The point (x, y).
    pub at: (f64, f64),
    /// Words of the note.
    pub text: String,
}

/// The place of a panel's legend.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Legend {
    /// In the corner of the panel where it covers no data; if there is none, below the panel.
    #[default]
    Auto,
    /// Below its own panel.
    Below,
    /// Below all panels, across the width of the figure: for a legend that holds for several panels.
    Bottom,
    /// Nowhere: the panel has no legend.
    None,
}

/// An axis with its label, scale and range.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The quantity with its unit, for example `frequency (Hz)`.
    pub label: String,
    /// The scale of its values.
    pub scale: Scale,
    /// Its range; `None` fits the data.
    pub range: Option<(f64, f64)>,
    /// Names at 1, 2, … in place of numbers; empty for an axis of numbers.
    pub names: Vec<String>,
}

impl Axis {
    fn of(label: impl Into<String>, scale: Scale) -> Self {
        Self { label: label.into(), scale, range: None, names: Vec::new() }
    }

    /// Makes an axis with these names at 1, 2, … in place of numbers, for the tiles of a table.
    pub fn names(label: impl Into<String>, names: Vec<String>) -> Self {
        let last = names.len() as f64;
        Self { names, ..Self::linear(label) }.range(0.5, last + 0.5)
    }

    /// Makes a linear axis that spans the data.
    pub fn linear(label: impl Into<String>) -> Self {
        Self::of(label, Scale::Linear)
    }

    /// Makes a linear axis for angles in degrees, that spans the data.
    pub fn degrees(label: impl Into<String>) -> Self {
        Self::of(label, Scale::Degrees)
    }

    /// Makes a logarithmic axis that spans the data.
    pub fn log(label: impl Into<String>) -> Self {
        Self::of(label, Scale::Log)
    }

    /// Limits the axis to the range from `low` to `high`; data beyond are cut off.
    #[must_use]
    pub fn range(self, low: f64, high: f64) -> Self {
        Self { range: Some((low, high)), ..self }
    }
}

/// The scale of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Evenly, with ticks at 1, 2 or 5 times a power of ten.
    Linear,
    /// Evenly, with ticks at fractions of a turn: multiples of 15, 30, 45, 90 or 180, where these are dense enough.
    Degrees,
    /// Logarithmic, with ticks at powers of ten; values must be positive.
    Log,
}

/// Points drawn in one style.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name in the legend; `None` leaves it out.
    pub label: Option<String>,
    /// The points (x, y). One with a NaN isn't drawn, and breaks a line.
    pub points: Vec<(f64, f64)>,
    /// The style in which the points are drawn.
    pub style: Style,
}

impl Series {
    /// Makes a solid line of the usual width.
    pub fn line(label: impl Into<String>, color: Color, points: Vec<(f64, f64)>) -> Self {
        Self { label: Some(label.into()), points, style: Style::Line { color, width: 1.6, dash: Dash::Solid } }
    }

    /// Makes a solid blue line for the stable periodic responses of a branch.
    pub fn stable(points: Vec<(f64, f64)>) -> Self {
        Self::line("stable", Color::Stable, points)
    }

    /// Makes a dashed red line for the unstable periodic responses of a branch, distinct from a stable one without
    /// colours.
    pub fn unstable(points: Vec<(f64, f64)>) -> Self {
        let style = Style::Line { color: Color::Unstable, width: 1.6, dash: Dash::Dashed };
        Self::line("unstable", Color::Unstable, points).style(style)
    }

    /// Makes markers of the usual size.
    pub fn markers(label: impl Into<String>, color: Color, shape: Marker, points: Vec<(f64, f64)>) -> Self {
        Self { label: Some(label.into()), points, style: Style::Markers { color, shape, size: 6.0, filled: true } }
    }

    /// Makes a rectangle around each point, in units of the axes: cells of a grid.
    pub fn tiles(label: impl Into<String>, color: Color, [width, height]: [f64; 2], points: Vec<(f64, f64)>) -> Self {
        Self { label: Some(label.into()), points, style: Style::Tiles { color, width, height } }
    }

    /// Sets another size of the markers, px, which are open unless they are `filled`; a line stays as it is.
    #[must_use]
    pub fn marked(mut self, new_size: f64, is_filled: bool) -> Self {
        if let Style::Markers { size, filled, .. } = &mut self.style {
            *size = new_size;
            *filled = is_filled;
        }
        self
    }

    /// Returns the series in this style.
    #[must_use]
    pub fn style(self, style: Style) -> Self {
        Self { style, ..self }
    }

    /// Removes the series' entry in the legend.
    #[must_use]
    pub fn unlabelled(self) -> Self {
        Self { label: None, ..self }
    }
}

#[cfg(test)]
mod tests;
