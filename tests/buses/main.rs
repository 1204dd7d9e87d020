//! Every kind of bus keeps one contract.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking, its helpers too"
)]

mod contract;
mod memory;
#[path = "../common/no_alloc.rs"]
mod no_alloc;
mod on_vcan;
#[cfg(feature = "python-can")]
mod python_can;
mod whole_tick;

use contract::{Formats, contract};
