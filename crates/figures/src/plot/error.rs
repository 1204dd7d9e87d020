//! Errors of drawing and writing a figure.

use std::io;
use std::path::PathBuf;

use resonarm_numeric::number::short;
use thiserror::Error;

/// Error of a figure that can't be drawn or written. Panels, series and points are counted from 0.
#[derive(Debug, Error)]
pub enum PlotError {
    /// The figure has no panel, or no column to put them in.
    #[error("the figure `{title}` has {panels} panels in {columns} columns; it needs at least one of each")]
    NoPanels {
        /// Title of the figure.
        title: String,
        /// The number of panels.
        panels: usize,
        /// The number of columns.
        columns: usize,
    },
    /// A panel has no point to draw.
    #[error("panel {panel} of the figure `{title}` has no point to draw")]
    NoPoints {
        /// Title of the figure.
        title: String,
        /// Number of the panel.
        panel: usize,
    },
    /// A coordinate is infinite.
    #[error(
        "point {point} of series {series} in panel {panel} is at ({x}, {y}); coordinates must be finite, or NaN for a gap", x = short(.x), y = short(.y))]
    NotFinite {
        /// Number of the panel.
        panel: usize,
        /// Number of the series in the panel.
        series: usize,
        /// Number of the point in the series.
        point: usize,
        /// x coordinate of the point.
        x: f64,
        /// y coordinate of the point.
        y: f64,
    },
    /// A value on a logarithmic axis isn't positive.
    #[error(
        "point {point} of series {series} in panel {panel} is at {value} on the logarithmic axis `{axis}`; values must be \
         positive there: leave the point out, put NaN for a gap, or use a linear axis", value = short(.value))]
    NotPositive {
        /// Number of the panel.
        panel: usize,
        /// Number of the series in the panel.
        series: usize,
        /// Number of the point in the series.
        point: usize,
        /// Label of the axis.
        axis: String,
        /// Value of the point there.
        value: f64,
    },
    /// An axis can't have this range.
    #[error(
        "the axis `{axis}` can't go from {low} to {high}; both must be finite, ascending, and positive on a logarithmic axis", low = short(.low), high = short(.high))]
    Range {
        /// Label of the axis.
        axis: String,
        /// Requested beginning of the axis.
        low: f64,
        /// Requested end of the axis.
        high: f64,
    },
    /// The image would be too large.
    #[error("an image of {width} x {height} pixels can't be drawn; give the figure fewer panels, or write it as SVG")]
    TooLarge {
        /// Width of the image, pixels.
        width: u32,
        /// Height of the image, pixels.
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
        /// Message of the PNG encoder.
        why: String,
    },
    /// The file can't be written.
    #[error("can't write {}: {source}; check that the folder exists and that you may write there", path.display())]
    Write {
        /// File that was to be written.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}
