//! The figures and statements of Gierlak & Warmiński (2023), computed anew.
//!
//! [`Settings`] hold what the paper states and what it leaves open. [`Figure`] makes the data of its figures by
//! continuation, [`claims`] holds its statements against them, for both presets. Drawing and writing are the command line's.

mod branch;
pub mod claims;
mod error;
mod figure;
mod measure;
mod settings;
mod subject;
mod table;

pub use branch::{Drive, Event, ForcedBranch, Motion, Stability};
pub use error::PaperError;
pub use figure::{Abscissa, Curve, Curves, Figure, NaturalFrequencies, Panel, Plan, natural_frequencies};
pub use measure::Maximum;
pub use settings::{Figure4, Figure5, Figure7, Figure9, Line, PerPreset, Pulse, Scan, Settings, SettingsError};
pub use subject::Subject;
