//! Audit of controllers of vibration and shock tests: numbered cases that judge the record of a run.
//!
//! A controller runs a [`Specification`](resonarm_specification::Specification) on a plant whose faults are known. A [`Case`]
//! names the [`Stimulus`], what the plant does meanwhile, and judges the [`Record`]: the force that the controller commanded,
//! and what its channels read. A first run without a stimulus, the [`Base`], is judged by the cases about accuracy, and says
//! when the test is at its level and how much drive it takes; the other cases have a run each.
//!
//! A case is *failed* if a measured figure is beyond its limit, and *inconclusive* where the stimulus never acted, as on a
//! controller that did not reach its level.
//!
//! The crate is pure and `no_std`: no clock, no thread, no file, no bus. Transcendental functions are from `libm`, so that a
//! record is judged the same on every machine.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

mod case;
mod cases;
mod random;
mod reaction;
mod record;
mod shock;
mod sine;
mod spectrum;

pub use case::{BACK_S, Base, Case, Context, Finding, Measure, RESTART_S, Stimulus, Verdict};
pub use cases::cases;
pub use record::Record;

/// The loops of the tests are those of an example, which names this crate.
#[cfg(test)]
extern crate self as resonarm_audit;

#[cfg(test)]
mod tests;
