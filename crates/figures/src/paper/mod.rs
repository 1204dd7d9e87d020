//! The figures and statements of Gierlak & Warmiński (2023), computed anew.
//!
//! [`Settings`] hold what the paper states and what it leaves open. [`Figure`] makes the data of its figures by
//! continuation, [`claims`] holds its statements against them, for both presets. Drawing and writing are the command
//! line's.

mod branch;
pub mod claims;
mod error;
mod figure;
mod measure;
mod measured;
mod settings;
mod subject;
mod table;

pub use branch::{Drive, ForcedBranch, Motion};
pub use error::PaperError;
pub use figure::{Abscissa, Curve, Curves, Figure, NaturalFrequencies, Panel, Plan, natural_frequencies};
pub use measured::{MeasuredError, MeasuredPoint, MeasuredZone, MeasuredZones, Way};
pub use settings::{Settings, SettingsError};
pub use subject::Subject;

#[cfg(test)]
mod tests;
