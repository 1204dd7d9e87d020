//! Runs: both ends of the bench on a bus, in real time, in lockstep or free; recordings replayed; experiments and studies.

extern crate alloc;

pub mod experiment;
pub mod replay;
pub mod run;
pub mod study;
