//! What is read from files and written to them: scenarios, recordings, and the logs and formats of other tools.

extern crate alloc;

pub mod can_log;
pub mod cut;
pub mod dbc;
pub mod decoder;
pub mod diff;
pub mod drawing;
pub mod drives;
pub mod export;
pub mod import;
mod nearest;
pub mod recording;
pub mod scenario;
mod staged;
pub mod starting_plant;
pub mod statistics;
pub mod text_file;
pub mod toml_error;
