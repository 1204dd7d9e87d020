//! Colours, lines and markers.

/// Colours that people with any colour vision can distinguish: the eight of M. Okabe, K. Ito, "Color Universal Design",
/// 2008, grey, and, for stable and unstable branches, two of the vibrant scheme of P. Tol, "Colour Schemes", 2021.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Color {
    /// Blue, for stable branches.
    Stable,
    /// Red, for unstable branches.
    Unstable,
    /// Black of Okabe and Ito.
    Black,
    /// Grey, for elements behind the data.
    Grey,
    /// Blue of Okabe and Ito.
    Blue,
    /// Orange of Okabe and Ito.
    Orange,
    /// Bluish green of Okabe and Ito.
    Green,
    /// Vermillion of Okabe and Ito.
    Vermillion,
    /// Sky blue of Okabe and Ito.
    SkyBlue,
    /// Reddish purple of Okabe and Ito.
    Purple,
    /// Yellow of Okabe and Ito; faint on white, for areas rather than lines.
    Yellow,
    /// A level of a map from 0, dark, to 9, light, of the scale viridis (S. van der Walt, N. Smith, 2015).
    Level(u8),
}

/// The scale viridis in ten levels.
const VIRIDIS: [[u8; 3]; 10] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x28, 0x78],
    [0x3E, 0x49, 0x89],
    [0x31, 0x68, 0x8E],
    [0x26, 0x82, 0x8E],
    [0x1F, 0x9E, 0x89],
    [0x35, 0xB7, 0x79],
    [0x6E, 0xCE, 0x58],
    [0xB5, 0xDE, 0x2B],
    [0xFD, 0xE7, 0x25],
];

impl Color {
    /// Red, green and blue, sRGB.
    pub fn rgb(self) -> [u8; 3] {
        match self {
            Self::Stable => [0x00, 0x77, 0xBB],
            Self::Unstable => [0xCC, 0x33, 0x11],
            Self::Black => [0x00, 0x00, 0x00],
            Self::Grey => [0x80, 0x80, 0x80],
            Self::Blue => [0x00, 0x72, 0xB2],
            Self::Orange => [0xE6, 0x9F, 0x00],
            Self::Green => [0x00, 0x9E, 0x73],
            Self::Vermillion => [0xD5, 0x5E, 0x00],
            Self::SkyBlue => [0x56, 0xB4, 0xE9],
            Self::Purple => [0xCC, 0x79, 0xA7],
            Self::Yellow => [0xF0, 0xE4, 0x42],
            Self::Level(level) => VIRIDIS[usize::from(level).min(VIRIDIS.len() - 1)],
        }
    }
}

/// The style in which the points of a series are drawn. Lengths are in px of 1/96 inch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Style {
    /// Joined by a line.
    Line {
        /// Colour of the line.
        color: Color,
        /// Width of the line, px.
        width: f64,
        /// Dashes of the line.
        dash: Dash,
    },
    /// Each as a marker.
    Markers {
        /// Colour of the markers.
        color: Color,
        /// Shape of the markers.
        shape: Marker,
        /// Width of the markers, px.
        size: f64,
        /// Filled with their colour, or with white inside an outline.
        filled: bool,
    },
    /// Each the centre of a rectangle; rectangles beside each other leave no gap.
    Tiles {
        /// Colour of the rectangles.
        color: Color,
        /// Their width, in units of the x axis.
        width: f64,
        /// Their height, in units of the y axis.
        height: f64,
    },
}

/// The dashes of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dash {
    /// A solid line, without dashes.
    Solid,
    /// Long dashes with short gaps.
    Dashed,
    /// A dash, a dot: the chain line of technical drawings.
    Chain,
}

impl Dash {
    /// Lengths of dash, gap, dash, gap …, in widths of the line; empty for a solid one.
    pub(super) fn pattern(self) -> &'static [f64] {
        match self {
            Self::Solid => &[],
            Self::Dashed => &[4.0, 2.5],
            Self::Chain => &[5.0, 2.0, 1.0, 2.0],
        }
    }
}

/// The shape of a marker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    /// A circle as wide as the marker.
    Circle,
    /// A square with its corners on that circle.
    Square,
    /// A triangle, point up.
    Triangle,
    /// A square on its corner.
    Diamond,
    /// Two strokes, as in the letter x; never filled.
    Cross,
}

impl Marker {
    /// Corners on the unit circle about the marker's centre, y downwards; empty for a circle, two strokes for a cross.
    pub(super) fn corners(self) -> &'static [[f64; 2]] {
        const H: f64 = core::f64::consts::FRAC_1_SQRT_2;
        // cos 30°, for the lower corners of the triangle, 120° from its point.
        const C30: f64 = 0.866_025_403_784_438_6;
        match self {
            Self::Circle => &[],
            Self::Square => &[[-H, -H], [H, -H], [H, H], [-H, H]],
            Self::Triangle => &[[0.0, -1.0], [C30, 0.5], [-C30, 0.5]],
            Self::Diamond => &[[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]],
            Self::Cross => &[[-H, -H], [H, H], [H, -H], [-H, H]],
        }
    }
}
