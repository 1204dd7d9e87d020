//! User protocols on CAN: the place of a signal in a payload and its physical value, alive counters, checksums,
//! CANopen.
//!
//! `no_std`: no clock, no thread, no file, no socket. Memory is allocated only where something is constructed;
//! decoding, encoding and checking allocate nothing. A payload may be shorter or longer than its message, since
//! only the bits of the requested signal are read.
//!
//! | | |
//! | --- | --- |
//! | [`layout`] | the bits of a signal, in the numbering of DBC files |
//! | [`signal`] | a layout with scale and offset: physical values |
//! | [`multiplex`] | in which payloads a signal is present |
//! | [`counter`] | alive counters |
//! | [`checksum`] | CRCs and sums in one parametric form, and the profiles of AUTOSAR in it |
//! | [`canopen`] | a CANopen node without IO, and the state machine of drives |
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod canopen;
pub mod checksum;
pub mod counter;
pub mod layout;
pub mod multiplex;
pub mod signal;

/// Longest payload of a frame, bytes: that of CAN FD (ISO 11898-1).
pub const PAYLOAD_MAX_BYTES: usize = 64;
