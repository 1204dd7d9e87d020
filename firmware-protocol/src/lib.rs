//! The CAN protocol between the Resonarm plant and an exciter controller.
//!
//! `no_std`, no allocation, no dependencies: the same code runs in the simulator and in firmware.
//! `SPEC.md` beside this crate is the specification, `resonarm.dbc` the source of truth for layouts.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod frame;

pub use frame::{Frame, FrameError, FrameFormat, Id};
