//! Somebody's FMU as the structure under test: FMI 2 or 3 for co-simulation.
//!
//! ```text
//! file ─► archive (names, sizes, SHA-256) ─► description (XML) ─► mapping (variables, units)
//!                                                                     │
//!                    plant ◄─ structure (samples, holds) ◄─ instance ◄┘ (dlopen, C functions)
//! ```
//!
//! A hold is made of communication steps. With [`ReadAt::Middle`] the outputs are read after each, so that the
//! instruments have those of the middle of the hold, as of every structure; with [`ReadAt::End`] the FMU has sampled
//! its motion itself, as those of `resonarm fmu` do, and its outputs are read at the end.
//!
//! The library of an FMU is native code of somebody else, with the rights of the user and without a bound on its time:
//! it runs in lockstep and free, never in real time. Each instance is loaded from a folder of its own, since two of one
//! path share their global variables.

mod abi;
mod archive;
mod description;
mod error;
mod float_mode;
mod instance;
mod mapping;
mod source;
mod spec;
mod structure;
#[cfg(test)]
mod tests;
mod units;

pub use archive::{Archive, sha256};
pub use error::ImportError;
pub use source::Source;
pub use spec::{Numbers, OutputsOf, ReadAt, Spec};
