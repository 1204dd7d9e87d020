//! Holds the C code in `c/` to this crate and to the golden frames: every verdict and every value must be equal.
//!
//! The C code is built with the address and undefined-behaviour sanitisers, and driven over pipes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../common/mod.rs"]
mod common;
mod corpus;
mod frames;
mod harness;
mod library;
mod limits;
mod messages;
mod packages;
mod tables;

use harness::{Harness, build};

#[test]
fn the_decoder_stands_random_frames() {
    let program = build("fuzz_decoder");
    let output = std::process::Command::new(program).args(["1", "300000"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn the_mathematics_of_the_controllers_is_that_of_the_compiler() {
    let output = std::process::Command::new(build("maths")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
}
