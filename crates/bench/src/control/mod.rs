//! How an exciter controller answers a sample: the [`Controller`] trait, and the controllers that implement it.
//!
//! [`OpenLoop`] plays a profile and reads the responses; [`ForceControl`] brings the force in the head to its
//! amplitude; [`PhaseWalk`] traces a whole response at constant load, stable or not; [`Steered`] plays a sine that is
//! set while it plays. You can implement the trait yourself; the exciter node runs the controller over the wire, in
//! real time, in lockstep and free alike (`Session::with_controller` of the crate `resonarm-session`).

mod abort;
mod cancellation;
mod force_control;
mod fourier_filter;
mod limits;
pub mod loop_poles;
mod mode_model;
mod open_loop;
#[cfg(test)]
mod phase_tests;
mod phase_walk;
mod response;
mod set_point;
mod spec;
mod steered;

use core::fmt::Debug;

pub use abort::Abort;
pub use cancellation::{CancelHarmonics, CancelHarmonicsError};
pub use force_control::{ForceControl, ForceControlError, ForceControlSpec};
pub use fourier_filter::FourierFilter;
pub use limits::{Limited, LimitsSpec};
pub use mode_model::{Followed, ModeModel, ModeNumber, Modelled, NoSuchMode, SeenMode};
pub use open_loop::OpenLoop;
pub use phase_walk::{PhaseWalk, PhaseWalkError, PhaseWalkSpec, ResponseControlSpec};
pub use response::ResponsePoint;
pub use set_point::SetPoint;
pub use spec::{ControlError, ControlSpec};
pub use steered::Steered;

use crate::rig::Load;
use crate::rig::Measurement;

/// The kind of load that a controller commands: a command on the wire carries one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadKind {
    /// Forces at C.
    Force,
    /// Torques at the joints.
    Torque,
}

/// How long a controller works.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    /// For a number of samples.
    Samples(u64),
    /// Until a number of responses is read.
    Responses(u64),
    /// Not known.
    Unknown,
}

/// A controller's answer to a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// The load to hold up to the next sample.
    Hold(Load),
    /// The work is done: disarm the plant.
    Finished,
    /// The work can't be done: disarm the plant.
    Aborted(Abort),
}

/// A controller: it takes in whole samples, and answers each with the load to hold.
///
/// It has no clock: time is the index of the sample, which jumps where samples were lost. Called in the real-time loop,
/// it neither allocates nor blocks.
pub trait Controller: Debug + Send {
    /// The kind of load that [`Answer::Hold`] carries; the components of the other kind are zero.
    fn load_kind(&self) -> LoadKind;

    /// The readings that it can't do without, in the order of [`OUTPUTS`](crate::structure::OUTPUTS): those on which it
    /// closes a loop. A reading that the wire does not carry is NaN in the samples.
    fn needs(&self) -> [bool; Measurement::CHANNELS] {
        [false; Measurement::CHANNELS]
    }

    /// Restarts, at sample 0.
    fn restart(&mut self);

    /// Answers a sample. `sample.sample` counts from 0, the first sample after the plant was armed; the readings are of
    /// the middle of the sample period before, and the answer is held from the sample to the next.
    fn answer(&mut self, sample: &Measurement) -> Answer;

    /// The next response that was read, if there is one.
    fn poll_response(&mut self) -> Option<ResponsePoint>;

    /// Moves to `set_point` from now on; `false` if it can't, or takes no set-points: then it continues as before.
    fn steer(&mut self, _set_point: &SetPoint) -> bool {
        false
    }

    /// The set-point that it moves to or holds; `None` if it takes none.
    fn set_point(&self) -> Option<SetPoint> {
        None
    }

    /// How long it works, as far as that is known beforehand.
    fn length(&self) -> Length;
}
