//! Why a figure can't be drawn or written.

use std::io;
use std::path::PathBuf;

use resonarm_numeric::number::short;
use thiserror::Error;

/// Why a figure can't be drawn or written. Panels, series and points are counted from 0.
#[derive(Debug, Error)]
pub enum PlotError {
    /// The figure has no panel, or no column to put them in.
    #[error("the figure `{title}` has {panels} panels in {columns} columns; it needs at least one of each")]
    NoPanels {
        /// Title of the figure.
        title: String,
        /// How many panels it has.
        panels: usize,
        /// How many columns it has.
        columns: usize,
    },
    /// A panel has no point to draw.
    #[error("panel {panel} of the figure `{title}` has no point to draw")]
    NoPoints {
        /// Title of the figure.
        title: String,
        /// Which panel.
        panel: usize,
    },
    /// A coordinate is infinite.
    #[error(
        "point {point} of series {series} in panel {panel} is at ({x}, {y}); coordinates must be finite, or NaN for a gap", x = short(.x), y = short(.y))]
    NotFinite {
        /// Which panel.
        panel: usize,
        /// Which series in it.
        series: usize,
        /// Which point of that.
        point: usize,
        /// Its x coordinate.
        x: f64,
        /// Its y coordinate.
        y: f64,
    },
    /// A value on a logarithmic axis isn't positive.
    #[error(
        "point {point} of series {series} in panel {panel} is at {value} on the logarithmic axis `{axis}`; values must be \
         positive there: leave the point out, put NaN for a gap, or take a linear axis", value = short(.value))]
    NotPositive {
        /// Which panel.
        panel: usize,
        /// Which series in it.
        series: usize,
        /// Which point of that.
        point: usize,
        /// Label of the axis.
        axis: String,
        /// The value.
        value: f64,
    },
    /// An axis can't have this range.
    #[error(
        "the axis `{axis}` can't go from {low} to {high}; both must be finite, ascending, and positive on a logarithmic axis", low = short(.low), high = short(.high))]
    Range {
        /// Label of the axis.
        axis: String,
        /// The requested beginning.
        low: f64,
        /// The requested end.
        high: f64,
    },
    /// The image would be too large.
    #[error("an image of {width} x {height} pixels can't be drawn; give the figure fewer panels, or write it as SVG")]
    TooLarge {
        /// Its width, pixels.
        width: u32,
        /// Its height, pixels.
        height: u32,
    },
    /// A font of the figures can't be read.
    #[error("the embedded font {name} can't be read: {why}")]
    Font {
        /// Name of the font.
        name: &'static str,
        /// The font reader's message.
        why: String,
    },
    /// The image can't be encoded.
    #[error("the PNG image can't be encoded: {why}")]
    Encode {
        /// The encoder's message.
        why: String,
    },
    /// The file can't be written.
    #[error("can't write {}: {source}; check that the folder exists and that you may write there", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}
