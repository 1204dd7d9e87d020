//! Analysis of the arm without stepping through time: what a bench measurement is held against.

pub mod frf;
pub mod modes;
pub mod time_domain;

pub use frf::{Drive, FrequencyResponse, FrfError, Quantity, Response};
pub use modes::{Mode, modes};
