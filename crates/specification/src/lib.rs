//! Specifications of vibration and shock tests, and verdicts on what was measured.
//!
//! A [`Specification`] states a random test ([`RandomTest`]), a swept sine ([`SineTest`]), a classical shock ([`ShockTest`]) or a
//! shock by its response spectrum ([`SrsTest`]), with tolerances and limits. It is made of a [`SpecificationFile`], the layout
//! of a TOML file, and says what the test asks of exciter and structure. [`PRESETS`] are specifications after public standards.
//!
//! [`verdict`] judges records against a specification. A verdict is *in*, *out* or *undecided*: an estimate from a record of
//! finite length has an interval of confidence, and where this lies across the end of a tolerance, the record can't decide.
//!
//! Units are SI; files may state densities in g²/Hz. `no_std`: no clock, no thread, no file, no socket. Transcendental functions
//! are from `libm`, so that results are bit-identical on every machine.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

pub mod csv;
mod error;
mod file;
mod presets;
mod profile;
mod random;
mod shock;
mod sine;
mod specification;
mod srs;
mod tolerance;
pub mod verdict;

pub use error::{Place, SpecificationError, VerdictError};
pub use file::{AccelerationUnit, Average, Control, DensityUnit, Measure, SpecificationFile};
pub use presets::{PRESETS, Preset};
pub use profile::Profile;
pub use random::{RandomFigures, RandomTest, Schedule, ScheduleStep, hann_degrees_of_freedom, perfect_db};
pub use shock::{PulseShape, ShockFigures, ShockTest, Shots};
pub use sine::{Dwell, SineFigures, SineLevel, SineSegment, SineTest, SweepRate};
pub use specification::{Limits, ResponseLimit, Specification, Test};
pub use srs::{SrsFigures, SrsTest};
pub use tolerance::{Tolerance, ToleranceBand};

/// Standard acceleration of gravity, m/s² (3rd CGPM, 1901).
pub const GRAVITY_M_S2: f64 = 9.80665;

#[cfg(test)]
mod tests;
