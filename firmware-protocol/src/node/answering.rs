//! The controller's answers to samples, and the outcome of its work.

use core::fmt::Debug;

use crate::message::{Emergency, SensorValues};

/// The answer to a sample; `A` is a controller's reason to give up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer<A> {
    /// Hold this force at the tip until the next sample.
    HoldForce {
        /// Along x of the base frame, N.
        force_x_n: f64,
        /// Along y of the base frame, N.
        force_y_n: f64,
    },
    /// Hold these torques at the joints until the next sample.
    HoldTorque {
        /// Torque at joint 1, N·m.
        torque1_nm: f64,
        /// Torque at joint 2, N·m.
        torque2_nm: f64,
    },
    /// The work is done: disarm the plant.
    Finished,
    /// The work is impossible: disarm the plant.
    Aborted(A),
}

/// A controller that answers the plant's samples.
pub trait Answering {
    /// The reasons to give up.
    type Abort: Copy + Debug + PartialEq;

    /// Starts over, at sample 0.
    fn restart(&mut self);

    /// Answers a whole sample, without delay: the plant waits. `sample` counts from 0, the first sample after the plant
    /// was armed, including lost ones. A load that can't be sent, or is beyond what the node has stated, faults the
    /// node (command out of range).
    fn answer(&mut self, sample: u64, values: &SensorValues) -> Answer<Self::Abort>;
}

/// Outcome of a controller's work; `A` is its reason to give up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExciterOutcome<A> {
    /// The controller finished and the plant is disarmed.
    Finished,
    /// The controller gave up, and the plant is disarmed.
    Aborted(A),
    /// The work was stopped before the end, and the plant is disarmed.
    Stopped,
    /// The plant left the bus before the end, and disarmed itself.
    PlantLeft,
    /// A fault of this node or the plant ended it.
    Faulted(Emergency),
}
