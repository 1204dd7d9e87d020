//! The test rig: the arm with its exciter and instruments, its excitation and controllers, identification from
//! its readings, and both nodes of the CAN bus without IO.
//!
//! `no_std`: no clock, no thread, no file, no socket; time is an argument.
#![cfg_attr(not(test), no_std)]

extern crate alloc;

pub mod control;
pub mod excitation;
pub mod identify;
pub mod node;
pub mod plant;
pub mod rig;
pub mod structure;
