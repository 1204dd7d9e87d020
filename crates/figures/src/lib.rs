//! Figures as SVG and PNG, and those of the paper with its statements.

extern crate alloc;

pub mod paper;
pub mod plot;
