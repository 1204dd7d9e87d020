//! The equations of motion of the arm and of other structures, and the one-step methods that integrate them or any
//! other system that implements [`integrate::Dynamics`].
//!
//! `no_std`: no clock, no thread, no file, no socket.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

pub mod arm;
pub mod integrate;
mod real;
pub mod structure;
