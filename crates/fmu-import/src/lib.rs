//! Somebody's FMU as the structure under test: FMI 2 or 3 for co-simulation.
//!
//! ```text
//! file ─► archive (names, sizes, SHA-256) ─► description (XML) ─► mapping (variables, units)
//!                                                                     │
//!                  plant ◄─ structure (samples, holds) ◄─ instance ◄──┘
//!                                                            ║ two pipes
//!              process of its own: loaded (requests) ─► abi (dlopen, C functions)
//! ```
//!
//! A hold is made of communication steps. With [`ReadAt::Middle`] the outputs are read after each, so that the
//! instruments have those of the middle of the hold, as of every structure; with [`ReadAt::End`] the FMU has sampled
//! its motion itself, as those of `resonarm fmu` do, and its outputs are read at the end.
//!
//! The library of an FMU is native code of a third party, with the rights of the user and without a bound on its time: it
//! runs in lockstep and free, never in real time. Each instance runs in a process of its own (module `process`), from a folder
//! of its own. So whatever the library does to its process, such as ending it, writing to its standard output or
//! changing how it rounds, ends the simulation with an error or has no effect on it.

mod abi;
mod alarm;
mod archive;
mod description;
mod error;
mod instance;
mod loaded;
mod mapping;
mod message;
mod process;
mod source;
mod spec;
mod structure;
#[cfg(test)]
mod tests;
mod units;

pub use archive::{Archive, sha256};
pub use error::ImportError;
pub use mapping::NamedChannels;
pub use source::Source;
pub use spec::{Numbers, OutputsOf, ReadAt, Spec};
