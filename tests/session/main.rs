//! What a session is made of: scenarios, and the real-time loop.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking, its helpers too")]

mod c_exciter;
mod closed_loop;
mod cuts;
mod examples;
mod experiment;
mod faults;
mod fmu;
mod gate;
mod limits;
mod lockstep_conformance;
#[path = "../common/no_alloc.rs"]
mod no_alloc;
mod real_time_alloc;
mod scenarios;
mod sensors;
mod shaker_force;
mod soak;
mod test_control;
mod watch_alloc;
mod wire;
mod wire_exciter;
mod wires_alloc;
