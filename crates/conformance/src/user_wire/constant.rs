//! A controller with a constant load.

use core::sync::atomic::{AtomicU64, Ordering};
use std::sync::Arc;

use resonarm_bench::control::{Answer, Controller, Length, LoadKind, ResponsePoint};
use resonarm_bench::node::mapped::mapping::LoadInput;
use resonarm_bench::rig::Measurement;

/// A controller that commands the same load until it is given another.
#[derive(Debug)]
pub(super) struct Constant {
    input: LoadInput,
    /// The bits of the load, N or N·m.
    load: Arc<AtomicU64>,
}

impl Constant {
    /// A controller of this load, zero, and the number by which it is changed, N or N·m.
    pub fn new(input: LoadInput) -> (Constant, Arc<AtomicU64>) {
        // There is no atomic float, so the bits are shared. The load must change while the node owns the controller.
        let load = Arc::new(AtomicU64::new(0.0_f64.to_bits()));
        (Constant { input, load: Arc::clone(&load) }, load)
    }
}

impl Controller for Constant {
    fn load_kind(&self) -> LoadKind {
        match self.input {
            LoadInput::Torque(_) => LoadKind::Torque,
            LoadInput::ForceX | LoadInput::ForceY | LoadInput::ForceZ | LoadInput::Along(_) => LoadKind::Force,
        }
    }

    fn restart(&mut self) {}

    fn answer(&mut self, _sample: &Measurement) -> Answer {
        Answer::Hold(self.input.load(f64::from_bits(self.load.load(Ordering::Relaxed))))
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        None
    }

    fn length(&self) -> Length {
        Length::Unknown
    }
}
