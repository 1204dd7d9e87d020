//! Plant, exciter controller and bus as FMUs: FMI 3.0 for co-simulation, the CAN nodes on FMI-LS-BUS 1.0.
//!
//! One shared library serves every FMU: what an FMU is stands in its `resources`, and its `instantiationToken` is a
//! hash of them ([`content`]). [`export`] packs an FMU; [`abi`] is the library's C interface, and [`instance`] the
//! states of FMI behind it, on one `model`.
//!
//! ```text
//! importer ─► abi (C, pointers) ─► instance (states, times, values) ─► model: plant by signals, CAN node, bus
//! ```
//!
//! Nothing is shared between instances: they may run in parallel threads.

pub mod abi;
mod archive;
mod bus;
mod construction;
pub mod content;
mod description;
mod documentation;
pub mod export;
mod fault;
pub mod instance;
mod model;
mod model_state;
mod node;
mod operation;
mod signals;
mod state;
mod tape;
mod terminal;
mod terminals;
mod units;
mod variables;

pub use fault::{Fault, WrongCall};
pub use state::State;
