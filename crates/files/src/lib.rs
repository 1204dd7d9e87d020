//! Files of the project: recordings in MCAP, CAN logs of other tools, and exports to their formats.

extern crate alloc;

pub mod can_log;
pub mod cut;
pub mod decoder;
pub mod diff;
pub mod drawing;
pub mod drives;
pub mod export;
pub mod import;
pub mod judge;
pub mod modal_file;
pub mod recording;
pub mod responses;
pub mod signals;
mod staged;
pub mod starting_plant;
pub mod statistics;
mod universal;

pub use staged::{same_file, wait_for_reader, write_whole};
