//! Figures and tables of several commands.

pub mod branches;
pub mod captions;
pub mod latency_figure;
pub mod response_curves;
pub mod singular_curves;
