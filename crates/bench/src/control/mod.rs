//! Controllers of the exciter: the [`Controller`] trait, which answers samples with loads, and its
//! implementations.
//!
//! [`OpenLoop`] plays a profile and reads the responses; [`ForceControl`] brings the force in the head to its
//! amplitude; [`PhaseWalk`] traces a whole response at constant load, stable or not; [`Steered`] plays a sine that is
//! set while it plays; [`TestController`] controls random, swept-sine and shock tests by a specification. You can implement the trait yourself; the exciter node runs the controller over the bus, in
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
mod spec;
mod steered;
mod test_control;

use alloc::vec::Vec;
use core::fmt::Debug;

pub use abort::{Abort, InstrumentAxis, ReadingLimit};
pub use cancellation::{CancelHarmonics, CancelHarmonicsError};
pub use force_control::{ForceControl, ForceControlError, ForceControlSpec};
pub use fourier_filter::FourierFilter;
pub use limits::{Limited, LimitsSpec};
pub use mode_model::{Followed, ModeModel, ModeNumber, Modelled, NoSuchMode, SeenMode};
pub use open_loop::OpenLoop;
pub use phase_walk::{PhaseWalk, PhaseWalkError, PhaseWalkPlan, PhaseWalkSpec, ResponseControlSpec};
pub use response::ResponsePoint;
pub use spec::{ControlError, ControlSpec};
pub use steered::Steered;
pub use test_control::{
    ControlSpectrum, OperatorSpec, OperatorWord, SpecificationSource, StopReason, TestControlError, TestControlSpec,
    TestController, TestLaw, TestLine, TestPhase, TestProgress, TestReport,
};

use crate::rig::{Load, Measurement};
use crate::structure::{ChannelName, OUTPUTS};

/// Kind of load that a controller commands. A command of the protocol carries one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadKind {
    /// Forces of the exciter at C.
    Force,
    /// Torques at the joints.
    Torque,
}

/// A target: load, frequency and phase of a sine.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SetPoint {
    /// Amplitude of the load, N or N·m depending on the scenario's kind of load, zero or positive.
    pub load: f64,
    /// Frequency, Hz, positive and below half the sample rate.
    pub frequency_hz: f64,
    /// Phase of the sine, degrees.
    pub phase_deg: f64,
}

/// Duration of a controller's work, as far as it is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    /// The work takes this number of samples.
    Samples(u64),
    /// The work takes until this number of responses has been read.
    Responses(u64),
    /// The duration is not known beforehand.
    Unknown,
}

/// Reading that a controller needs with every sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NeededReading {
    /// Index of the reading, as [`Measurement::reading`] takes it.
    pub place: usize,
    /// Name of its channel.
    pub name: ChannelName,
}

impl NeededReading {
    /// Returns the marked readings of head, B and C, in the order of [`OUTPUTS`].
    pub fn marked(needs: [bool; Measurement::CHANNELS]) -> Vec<NeededReading> {
        let all = OUTPUTS.iter().enumerate().map(|(place, channel)| NeededReading { place, name: channel.name });
        all.filter(|reading| needs[reading.place]).collect()
    }
}

/// Answer of a controller to a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// Hold this load until the next sample.
    Hold(Load),
    /// The work is done, and the plant can be disarmed.
    Finished,
    /// The work can't go on, and the plant must be disarmed.
    Aborted(Abort),
}

/// A controller of the exciter, which receives samples and answers each with the load to hold.
///
/// It has no clock: time is the index of the sample, which jumps where samples were lost. It is called in the
/// real-time loop and must neither allocate nor block.
pub trait Controller: Debug + Send {
    /// Returns the kind of load that [`Answer::Hold`] carries; the components of the other kind are zero.
    fn load_kind(&self) -> LoadKind;

    /// Returns the readings without which it can't work. A run whose protocol does not carry one of them with every
    /// sample is refused. Of the others, those of head, B and C that the protocol does not carry are NaN in the
    /// samples.
    fn needs(&self) -> Vec<NeededReading> {
        Vec::new()
    }

    /// Restarts the work at sample 0.
    fn restart(&mut self);

    /// Answers a sample by a load, or ends the run. `sample.sample` counts from 0, the first sample after the plant was
    /// armed; the readings are of the middle of the sample period before, and the answer is held from the sample to the
    /// next.
    fn answer(&mut self, sample: &Measurement) -> Answer;

    /// Returns the next response that has been read, if there is one.
    fn poll_response(&mut self) -> Option<ResponsePoint>;

    /// Moves to `set_point` from now on. Returns `false`, and continues as before, if it can't or takes no
    /// set-points.
    fn steer(&mut self, _set_point: &SetPoint) -> bool {
        false
    }

    /// Returns the set-point that it approaches or holds; `None` if it takes none.
    fn set_point(&self) -> Option<SetPoint> {
        None
    }

    /// Returns the duration of the work, as far as it is known beforehand.
    fn length(&self) -> Length;

    /// Returns the state of a test; `None` if it controls none.
    fn test_progress(&self) -> Option<TestProgress> {
        None
    }

    /// Returns the reason for which a test is stopped, from the sample on at which it is; `None` if it is not.
    fn test_stop(&self) -> Option<StopReason> {
        None
    }

    /// Returns the spectrum by which a random test is controlled, while one is at a level.
    fn control_spectrum(&self) -> Option<ControlSpectrum<'_>> {
        None
    }
}
