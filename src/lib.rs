//! Resonarm: a real-time vibration simulator of a compliant-joint robot arm, on a CAN bus.
//!
//! The modules in the order in which they stand on each other. The first group is pure: no clock, no thread, no file,
//! no socket, and `no_std` when the feature `std` is off.
#![cfg_attr(not(feature = "std"), no_std)]

extern crate alloc;

pub mod analysis;
pub mod arm;
pub mod ensemble;
pub mod excitation;
pub mod integrate;
pub mod node;
pub mod plant;
pub mod rig;

#[cfg(feature = "std")]
pub mod bus;
#[cfg(feature = "std")]
pub mod paper;
#[cfg(feature = "cli")]
pub mod plot;
#[cfg(feature = "std")]
pub mod realtime;
#[cfg(feature = "std")]
pub mod recording;
#[cfg(feature = "std")]
pub mod replay;
#[cfg(feature = "std")]
pub mod run;
#[cfg(feature = "std")]
pub mod scenario;

#[cfg(feature = "cli")]
pub mod cli;

pub use resonarm_protocol as protocol;
