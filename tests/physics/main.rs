//! Tests of physics and analysis against independently computed numbers, and against each other.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking, its helpers too")]

mod continuation;
mod identified_modes;
mod integrators;
#[path = "../common/no_alloc.rs"]
mod no_alloc;
mod oracles;
mod phase_walk;
mod sweeps_and_branches;
