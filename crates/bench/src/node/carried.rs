//! A controller inside the exciter's node, which answers the samples that the node receives.

use alloc::boxed::Box;

use resonarm_protocol::node::{self, Answering, Queue, Timing};
use resonarm_protocol::{Capabilities, Network, Node, SamplesPerFrame, SensorValues};

use super::sample;
use super::time_base::TimeBase;
use crate::control::{Abort, Answer, Controller, LoadKind, ResponsePoint};
use crate::rig::{Load, Measurement, Readings};

/// Largest number of responses that wait to be fetched.
const RESPONSES: usize = 16;
/// Largest number of answers that wait to be fetched: those to two samples in one frame.
const ANSWERS: usize = 2;

/// Time between two attempts to arm or disarm the plant on a user protocol, ns. In lockstep it is longer than a
/// busy machine may stop a process: a second command would count as the answer to the first sample.
pub(super) const fn retry_ns(time_base: TimeBase) -> u64 {
    match time_base {
        TimeBase::Clock => 100_000_000,
        TimeBase::Lockstep => 400_000_000,
    }
}

/// The exciter's node of Resonarm's protocol, with a [`Controller`].
pub type ExciterNode = node::ExciterNode<Carried>;

/// Outcome of a controller's work.
pub type ExciterOutcome = node::ExciterOutcome<Abort>;

/// A controller inside the exciter's node, with the responses that it has read.
#[derive(Debug)]
pub struct Carried {
    /// The controller. What it has read and answered is fetched by the methods of this type.
    pub controller: Box<dyn Controller>,
    responses: Queue<ResponsePoint, RESPONSES>,
    answers: Queue<(Measurement, Load), ANSWERS>,
    /// Sample that was last answered by a load, and that load.
    last_answer: Option<(u64, Load)>,
    /// Readings that the protocol does not carry, if the loop that runs both nodes hands them over.
    handed_over: Option<Readings>,
}

impl Carried {
    pub(super) fn new(controller: Box<dyn Controller>) -> Carried {
        Carried { controller, responses: Queue::new(), answers: Queue::new(), last_answer: None, handed_over: None }
    }

    /// Hands over the readings of the next sample that Resonarm's protocol does not carry. It states that plant and
    /// controller are in one loop, which also takes the parts of a load that the protocol does not carry from
    /// [`Carried::last_answer`] to the plant. Without it the node faults at such a load.
    pub fn hand_over(&mut self, more: &Readings) {
        self.handed_over = Some(*more);
    }

    /// Returns the next response that has been read.
    pub fn poll_response(&mut self) -> Option<ResponsePoint> {
        self.responses.pop()
    }

    /// Returns the next answered sample with the load that answers it. Answers that are not fetched in time are
    /// dropped.
    pub fn poll_answer(&mut self) -> Option<(Measurement, Load)> {
        self.answers.pop()
    }

    /// Returns the sample that was last answered by a load, counted from arming, and that load. The node may
    /// have found that it can't command the load.
    pub fn last_answer(&self) -> Option<(u64, Load)> {
        self.last_answer
    }

    /// Lets the controller answer a sample, and queues what it has read.
    pub(super) fn answer_sample(&mut self, measurement: &Measurement) -> Answer {
        let answer = self.controller.answer(measurement);
        // Answers are kept for recordings and the live view, which fetch them between frames.
        if let Answer::Hold(load) = answer {
            self.answers.push((*measurement, load));
            self.last_answer = Some((measurement.sample, load));
        }
        // A controller may have read several responses with one sample.
        while let Some(point) = self.controller.poll_response() {
            self.responses.push(point);
        }
        answer
    }
}

impl Answering for Carried {
    type Abort = Abort;

    fn restart(&mut self) {
        self.controller.restart();
    }

    fn answer(&mut self, sample: u64, values: &SensorValues) -> node::Answer<Abort> {
        let mut measurement = sample::from_values(sample, values);
        if let Some(more) = &self.handed_over {
            measurement.more = *more;
        }
        let answer = self.answer_sample(&measurement);
        match (answer, self.controller.load_kind()) {
            // The protocol has no field for a part of this load, and nothing else takes it to the plant. The node sends
            // no command that is not a number.
            (Answer::Hold(load), _) if self.handed_over.is_none() && !load.is_native() => {
                node::Answer::HoldForce { force_x_n: f64::NAN, force_y_n: f64::NAN }
            }
            (Answer::Hold(load), LoadKind::Force) => {
                node::Answer::HoldForce { force_x_n: load.force_n.x, force_y_n: load.force_n.y }
            }
            (Answer::Hold(load), LoadKind::Torque) => {
                node::Answer::HoldTorque { torque1_nm: load.torque_nm[0], torque2_nm: load.torque_nm[1] }
            }
            (Answer::Finished, _) => node::Answer::Finished,
            (Answer::Aborted(abort), _) => node::Answer::Aborted(abort),
        }
    }
}

/// Returns a node that lets `controller` answer a plant with `rate_hz` samples per second.
pub fn carry(network: Network, rate_hz: u16, timing: Timing, controller: Box<dyn Controller>) -> ExciterNode {
    let (force_limit_n, torque_limit_nm) = match controller.load_kind() {
        // The exciter's own limits are the plant's to check; the controller's node only states the kind of
        // load.
        LoadKind::Force => (f32::MAX.into(), 0.0),
        LoadKind::Torque => (0.0, f32::MAX.into()),
    };
    let capabilities =
        Capabilities { node: Node::Exciter, samples_per_frame: SamplesPerFrame::Two, force_limit_n, torque_limit_nm };
    ExciterNode::new(network, rate_hz, timing, capabilities, Carried::new(controller))
}
