//! Runs of both ends of the bench on a bus, in real time, in lockstep or free; replay of recordings and identification
//! from them; experiments, studies and surveys.

extern crate alloc;

pub mod experiment;
pub mod identification;
pub mod replay;
pub mod run;
pub mod study;
pub mod survey;
