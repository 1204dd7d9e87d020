//! The states of models, which an importer may hold and return to.

use std::sync::Arc;

use crate::fault::Fault;
use crate::tape::Mark;
use crate::terminal::Terminal;
use resonarm_bench::plant::Plant;
use resonarm_bench::rig::{Load, Measurement};
use resonarm_session::run::HostedPlant;

/// A state that the importer holds, without what all models have.
#[derive(Clone, Debug)]
pub(crate) enum Saved {
    Signals(Box<SavedSignals>),
    Node(Box<SavedNode>),
}

/// The plant at a sample, measured.
#[derive(Clone, Debug)]
pub(crate) struct Measured {
    pub plant: Plant,
    pub measurement: Measurement,
    /// The load from the sample to the next, once a step has begun.
    pub held: Option<Load>,
}

/// A state of the plant by its signals.
#[derive(Clone, Debug)]
pub(crate) struct SavedSignals {
    pub now: Measured,
    /// Mark of a state that was not read from bytes, while something is recorded.
    pub mark: Option<Arc<Mark>>,
}

/// Error counters of the node's controller, counted from what the bus reports of its frames (ISO 11898-1, as
/// [`resonarm_bus::timed::ErrorCounters`]).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Controller {
    pub transmit_errors: u16,
    /// Time at which the node has recovered from bus-off, ns.
    pub recovers_ns: Option<u64>,
}

/// A state of the plant's node.
#[derive(Clone, Debug)]
pub(crate) struct SavedNode {
    pub plant: Box<HostedPlant>,
    pub terminal: Terminal,
    pub controller: Controller,
    pub now_ns: u64,
    pub samples: bool,
    pub mark: Option<Arc<Mark>>,
}

/// The error of a state that another kind of model has saved.
pub(crate) fn of_other_interface() -> Fault {
    Fault::Saved("it belongs to an FMU with another interface")
}
