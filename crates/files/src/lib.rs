//! What is read from files and written to them: recordings, and the logs and formats of other tools.

extern crate alloc;

pub mod can_log;
pub mod cut;
pub mod decoder;
pub mod diff;
pub mod drawing;
pub mod drives;
pub mod export;
pub mod import;
pub mod recording;
mod staged;
pub mod starting_plant;
pub mod statistics;

pub use staged::{same_file, wait_for_reader, write_whole};
