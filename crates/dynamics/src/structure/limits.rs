//! The largest sizes of structures.

/// The most links of a chain.
pub const MOST_LINKS: usize = 8;
/// The most modes of a modal structure.
pub const MOST_MODES: usize = 32;
/// The most elements of a structure.
pub const MOST_ELEMENTS: usize = 16;
/// The most coordinates of a structure.
pub const MOST_COORDINATES: usize = if MOST_LINKS > MOST_MODES { MOST_LINKS } else { MOST_MODES };
