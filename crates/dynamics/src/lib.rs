//! The equations of motion of structures, and the one-step methods that integrate them or any
//! other system that implements [`integrate::Dynamics`].
//!
//! `no_std`: no clock, no thread, no file, no socket.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

pub mod integrate;
mod real;
pub mod structure;
