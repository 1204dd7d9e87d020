//! Specifications after public standards.

/// A specification after a public standard, as the text of a TOML file. It is a starting point: the standard that applies, and
/// how it is tailored, is for the engineer to say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset {
    /// Name, in lower case with hyphens.
    pub name: &'static str,
    /// Text of the TOML file.
    pub text: &'static str,
}

// A macro, since `include_str!` takes literals only.
macro_rules! presets {
    ($($name:literal),* $(,)?) => {
        [$(Preset { name: $name, text: include_str!(concat!("presets/", $name, ".toml")) }),*]
    };
}

/// The presets. `sources` of each name the standard with its edition and paragraph, and mark the preset as normative (the
/// figures are those of the text), approximate (they follow it in part) or indicative (they show what such a test asks).
pub const PRESETS: [Preset; 10] = presets![
    "navmat-p-9492",
    "nasa-std-7001",
    "mil-std-202-214-i-b",
    "mil-std-810-514-minimum",
    "ecss-random-10kg",
    "iec-60945",
    "un-38.3-t3",
    "iec-60068-2-6",
    "iec-60068-2-27",
    "mil-std-810-516-functional",
];
