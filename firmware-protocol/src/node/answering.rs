//! What the exciter's node asks at each sample, and how the work ends.

use core::fmt::Debug;

use crate::{Emergency, SensorValues};

/// What to do at a sample; `A` says why a controller gives up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer<A> {
    /// Hold this force at the tip up to the next sample.
    HoldForce {
        /// Along x of the base frame, N.
        force_x_n: f64,
        /// Along y of the base frame, N.
        force_y_n: f64,
    },
    /// Hold these torques at the joints up to the next sample.
    HoldTorque {
        /// At joint 1, N·m.
        torque1_nm: f64,
        /// At joint 2, N·m.
        torque2_nm: f64,
    },
    /// The work is done: disarm the plant.
    Finished,
    /// The work can't be done: disarm the plant.
    Aborted(A),
}

/// What answers the plant's samples.
pub trait Answering {
    /// Why it may give up.
    type Abort: Copy + Debug + PartialEq;

    /// Begins anew, at sample 0.
    fn restart(&mut self);

    /// Answers a whole sample, at once: the plant waits. `sample` counts from 0, the first sample after the plant was
    /// armed, those lost on the way included. A load that can't be sent faults the node (command out of range).
    fn answer(&mut self, sample: u64, values: &SensorValues) -> Answer<Self::Abort>;
}

/// How a controller's work ended; `A` says why it gave up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome<A> {
    /// The controller has finished and the plant is disarmed.
    Finished,
    /// The controller has given up, and the plant is disarmed.
    Aborted(A),
    /// It was stopped before the end, and the plant disarmed.
    Stopped,
    /// The plant left the bus before the end, and disarmed itself.
    PlantLeft,
    /// A fault ended it: this node's own or the plant's.
    Faulted(Emergency),
}
