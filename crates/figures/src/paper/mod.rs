//! Reproduces the figures and statements of Gierlak & Warmiński (2023).
//!
//! [`Settings`] hold the values that the paper states and choices for those it does not. [`Figure`] computes the data
//! of its figures by continuation, [`claims`] checks its statements, for both presets. The command line draws and
//! writes them.

mod branch;
pub mod claims;
mod error;
mod figure;
mod measure;
mod measured;
mod settings;
mod subject;
mod table;

pub use branch::{Drive, ForcedBranch, PaperOrbit, Read, Size};
pub use error::PaperError;
pub use figure::{Abscissa, Figure, FigureCurves, LabelledCurve, NaturalFrequencies, Panel, Plan, natural_frequencies};
pub use measured::{MeasuredError, MeasuredPoint, MeasuredZone, MeasuredZones, Way};
pub use settings::{Settings, SettingsError};
pub use subject::Subject;

#[cfg(test)]
mod tests;
