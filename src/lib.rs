//! Resonarm: a real-time vibration simulator of a compliant-joint robot arm, on a CAN bus.
//!
//! The modules in the order in which they stand on each other. The first group is pure: no clock, no thread, no file,
//! no socket, and `no_std` when the feature `std` is off.
#![cfg_attr(not(feature = "std"), no_std)]

extern crate alloc;

pub mod analysis;
pub mod arm;
pub mod integrate;

#[cfg(feature = "std")]
pub mod bus;
#[cfg(feature = "std")]
pub mod recording;

pub use resonarm_protocol as protocol;
