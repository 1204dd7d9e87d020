//! Draws figures as SVG and PNG, and reproduces the paper's figures and statements.

extern crate alloc;

pub mod paper;
pub mod plot;
