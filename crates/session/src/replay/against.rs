//! Plays a recorded plant to a live controller and compares its commands with the recorded ones: a test of whether a
//! change of the controller's firmware has changed its behaviour.
//!
//! A controller is a function of the frames it receives, and answers samples by their indices. So the plant's frames
//! are sent in their order, and before the next is sent, the controller must have caught up with the recorded one: said
//! hello, made the same requests, answered the same sample. Timing does not matter.
//!
//! On a user protocol, whose commands name no sample, [`wire`] compares commands by their order.

mod wire;

use core::ops::ControlFlow;
use core::time::Duration;

use alloc::collections::{BTreeMap, VecDeque};

use resonarm_protocol::{Emergency, EmergencyCode, Frame, Message, Network, Node, OperatorRequest, Receiver};
use serde::Serialize;
use thiserror::Error;

use super::error::ReplayError;
use super::player::{FRAMES_AT_ONCE, LOOK_NS, RETRY_NS, check_speed, due_ns};
use super::responses::command;
use crate::run::Signals;
use resonarm_bench::node::WireSpec;
use resonarm_bench::rig::Load;
use resonarm_bench::structure::{LOADS, LoadSet};
use resonarm_bus::{Bus, Sent};
use resonarm_files::recording::{Direction, FrameRecord, Recording};
use resonarm_realtime::Clock;
use resonarm_scenario::Scenario;

/// Answers that are kept until the recording has come to their sample: more than a sample's frames on their way.
const ANSWERS: usize = 256;
/// Requests that are kept, until the recording has come to them.
const REQUESTS: usize = 256;

/// Settings of a test of a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regression {
    /// Times the recorded speed, as [`Playback::speed`](super::Playback::speed).
    pub speed: f64,
    /// Largest difference of a commanded force that passes, N.
    pub limit_n: f64,
    /// Largest difference of a commanded torque that passes, N·m.
    pub limit_nm: f64,
    /// Longest wait for the controller to catch up with the recorded one.
    pub patience: Duration,
}

/// Result of the test.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Compared {
    /// Frames of the plant sent.
    pub frames: u64,
    /// Number of commands that were compared.
    pub commands: u64,
    /// The largest difference of a force, N.
    pub largest_force_difference_n: f64,
    /// The largest difference of a torque, N·m.
    pub largest_torque_difference_nm: f64,
    /// The first difference beyond the limits; `None` if the controller passes.
    pub first_difference: Option<Difference>,
}

/// The first difference between the controller and the recorded one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// The sample of the recording.
    pub sample: u64,
    /// Kind of difference, with its values.
    #[serde(flatten)]
    pub kind: DifferenceKind,
}

/// Kind of difference between the live controller and the recorded one.
#[derive(Clone, Debug, PartialEq, Error, Serialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum DifferenceKind {
    /// It commands another load.
    #[error("the controller commands {got}; the recorded command is {expected}")]
    Command {
        /// Command of the recorded controller.
        expected: Load,
        /// Command of the controller under test.
        got: Load,
    },
    /// It does not answer a sample that the recorded controller answered.
    #[error("the controller does not answer the sample; the recorded one did")]
    NoAnswer,
    /// It does not say hello.
    #[error("the controller does not say hello; the recorded one did")]
    NoHello,
    /// It does not make a request that the recorded controller made.
    #[error("the controller does not ask the plant to {expected}; the recorded one did")]
    NoRequest {
        /// Name of the request: `arm`, `disarm`, `reset` or `stop`.
        expected: &'static str,
    },
    /// It has not sent a command that the recorded controller sent, on a protocol whose commands name no sample.
    #[error("the controller sends no further command; the recorded command is {expected}")]
    NoCommand {
        /// The load of the recorded command.
        expected: Load,
    },
    /// It has sent more commands than the recorded controller by then, on a protocol whose commands name no sample.
    #[error("the controller has sent {ahead} more commands than the recorded one had by then")]
    MoreCommands {
        /// Number of commands that it is ahead.
        ahead: usize,
    },
    /// It reports a fault. If the fault is only that the plant has stopped, the difference is the expected action.
    #[error("the controller faults: {cause}; the recorded one continues with: {expected}")]
    Fault {
        /// Cause in its emergency message.
        cause: String,
        /// The next action of the recorded controller: `hello`, `answer`, `arm`, `disarm` or `reset`.
        expected: &'static str,
    },
}

impl DifferenceKind {
    /// Returns the name of the recorded controller's action.
    const fn expected(&self) -> &'static str {
        match self {
            DifferenceKind::Command { .. } | DifferenceKind::NoAnswer => "answer",
            DifferenceKind::NoCommand { .. } | DifferenceKind::MoreCommands { .. } => "command",
            DifferenceKind::NoHello => "hello",
            DifferenceKind::NoRequest { expected } | DifferenceKind::Fault { expected, .. } => expected,
        }
    }
}

/// Sends the plant's recorded frames to the controller on the bus, and compares its answers.
///
/// # Errors
/// [`ReplayError::AgainstDrives`] if the recording is of CANopen drives, [`ReplayError::AgainstLoad`] if its load is one
/// that no frame carries, [`ReplayError::NoController`] if no controller is heard, [`ReplayError::Empty`] if the recording
/// has no commands, and [`ReplayError`] if the speed is impossible, or recording or bus fail.
pub fn play_against(
    recording: &Recording,
    bus: &mut dyn Bus,
    clock: &dyn Clock,
    regression: Regression,
    signals: &Signals,
) -> Result<Compared, ReplayError> {
    check_speed(regression.speed)?;
    let scenario = Scenario::from_configuration(recording.configuration())?;
    let compared = Compared::default();
    if let Some(spec) = scenario.wire_spec()? {
        let WireSpec::Mapped(mapping) = spec else { return Err(ReplayError::AgainstDrives) };
        let live = wire::Live::new(&mapping);
        let mut test = Test { bus, clock, regression, signals, live, compared };
        let mut recorded = wire::Recorded::new(&mapping);
        return test.run(recording, |test, record| wire::expect(test, &mut recorded, record));
    }
    if let Some((place, _)) = scenario.amplitude().and_then(|amplitude| LoadSet::NATIVE.lacks(amplitude)) {
        return Err(ReplayError::AgainstLoad { part: LOADS[place].name });
    }
    let network = scenario.network()?;
    let mut test = Test { bus, clock, regression, signals, live: Live::new(network), compared };
    // The patience of this wait is for the start of the controller. Without it the first frame that is compared would
    // report a difference where nobody is on the bus.
    if !test.wait_for(|live| live.is_there)? {
        return if signals.is_stopped() { Ok(test.compared) } else { Err(test.no_controller()) };
    }
    let mut recorded = Receiver::new(network);
    test.run(recording, |test, record| {
        if record.direction == Direction::Received
            && let Ok(Some(message)) = recorded.accept(&record.frame)
        {
            return test.expect(record.sample, message);
        }
        Ok(ControlFlow::Continue(()))
    })
}

/// State of a live controller, gathered from its frames.
trait Controller {
    /// Processes a frame of the controller.
    fn hear(&mut self, frame: &Frame);

    /// Returns the fault that it has reported.
    fn fault(&self) -> Option<String> {
        None
    }
}

/// State of the live controller, gathered from its frames so far.
struct Live {
    receiver: Receiver,
    /// Whether any frame of it has been heard.
    is_there: bool,
    has_said_hello: bool,
    /// Its requests since the last comparison, oldest first, each once however often it was repeated.
    requests: VecDeque<OperatorRequest>,
    /// Its latest answers, by the 16-bit index of their sample in the frames.
    answers: BTreeMap<u16, Load>,
    /// The same indices, in the order of arrival.
    order: VecDeque<u16>,
    fault: Option<Emergency>,
}

impl Live {
    fn new(network: Network) -> Live {
        Live {
            receiver: Receiver::new(network),
            is_there: false,
            has_said_hello: false,
            requests: VecDeque::new(),
            answers: BTreeMap::new(),
            order: VecDeque::new(),
            fault: None,
        }
    }

    fn ask(&mut self, request: OperatorRequest) {
        // A controller repeats a request until the plant's state shows that it was taken. How often depends on time.
        if self.requests.back() != Some(&request) {
            self.requests.push_back(request);
        }
        if self.requests.len() > REQUESTS {
            self.requests.pop_front();
        }
    }

    /// Forgets its requests before this one.
    fn forget_before(&mut self, request: OperatorRequest) {
        let before = self.requests.iter().position(|asked| *asked == request).unwrap_or(0);
        self.requests.drain(..before);
    }

    fn answer(&mut self, message: Message) {
        let Some((index, values)) = command(message) else { return };
        // A plant holds the first command that answers a sample.
        if self.answers.contains_key(&index) {
            return;
        }
        self.answers.insert(index, values);
        self.order.push_back(index);
        if self.order.len() > ANSWERS
            && let Some(oldest) = self.order.pop_front()
        {
            self.answers.remove(&oldest);
        }
    }
}

impl Controller for Live {
    /// A frame that a plant would reject is ignored.
    fn hear(&mut self, frame: &Frame) {
        let Ok(Some(message)) = self.receiver.accept(frame) else { return };
        if message.kind().sender() == Node::Plant {
            return;
        }
        self.is_there = true;
        match message {
            Message::ExciterHello(_) => self.has_said_hello = true,
            Message::Operator(operator) => self.ask(operator.request),
            Message::Emergency(emergency) if emergency.code != EmergencyCode::Leaving => {
                self.fault.get_or_insert(emergency);
            }
            message => self.answer(message),
        }
    }

    fn fault(&self) -> Option<String> {
        self.fault.map(|fault| fault.to_string())
    }
}

/// A test that is running, with what it compares.
struct Test<'a, L> {
    bus: &'a mut dyn Bus,
    clock: &'a dyn Clock,
    regression: Regression,
    signals: &'a Signals,
    live: L,
    compared: Compared,
}

impl Test<'_, Live> {
    /// Waits until the controller has caught up with this message of the recorded one, and compares.
    fn expect(&mut self, sample: u64, message: Message) -> Result<ControlFlow<()>, ReplayError> {
        let (done, missing) = match message {
            Message::ExciterHello(_) => (self.wait_for(|live| live.has_said_hello)?, DifferenceKind::NoHello),
            Message::Operator(operator) => {
                let expected = name(operator.request);
                // A request counts even if later ones followed.
                let done = self.wait_for(|live| live.requests.contains(&operator.request))?;
                // The request itself stays: it may be repeated, and a repetition is no new one.
                self.live.forget_before(operator.request);
                (done, DifferenceKind::NoRequest { expected })
            }
            message => {
                let Some((index, expected)) = command(message) else { return Ok(ControlFlow::Continue(())) };
                // One that disarms the plant has ended.
                let has_ended = |live: &Live| live.requests.back() == Some(&OperatorRequest::Disarm);
                self.wait_for(|live| live.answers.contains_key(&index) || has_ended(live))?;
                let got = self.live.answers.get(&index).copied();
                if let Some(got) = got {
                    self.compare(sample, expected, got);
                }
                (got.is_some(), DifferenceKind::NoAnswer)
            }
        };
        Ok(if done { ControlFlow::Continue(()) } else { self.differs(sample, missing) })
    }
}

impl<L: Controller> Test<'_, L> {
    /// Sends the plant's frames in their order, and lets `expect` wait at each frame of the recorded controller.
    fn run(
        &mut self,
        recording: &Recording,
        mut expect: impl FnMut(&mut Self, &FrameRecord) -> Result<ControlFlow<()>, ReplayError>,
    ) -> Result<Compared, ReplayError> {
        // Times count from the first frame: a recording may begin in the middle of a run.
        let start_ns = self.clock.now_ns();
        let mut first_ns = None;
        for record in recording.frames()? {
            let record = record?;
            let time_ns = recording.origin().frame_time_ns(&record);
            let recorded_ns = time_ns.saturating_sub(*first_ns.get_or_insert(time_ns));
            let mut flow = ControlFlow::Continue(());
            if record.direction == Direction::Sent {
                flow = self.send(&record.frame, due_ns(start_ns, recorded_ns, self.regression.speed))?;
            }
            if flow.is_break() || expect(self, &record)?.is_break() {
                break;
            }
        }
        let compared = core::mem::take(&mut self.compared);
        let has_ended = compared.first_difference.is_some() || self.signals.is_stopped();
        if compared.commands == 0 && !has_ended { Err(ReplayError::Empty { what: "commands" }) } else { Ok(compared) }
    }

    /// Makes the error of a test without a controller.
    fn no_controller(&self) -> ReplayError {
        ReplayError::NoController { waited_s: self.regression.patience.as_secs_f64() }
    }

    /// Sends a frame of the plant when it is due.
    fn send(&mut self, frame: &Frame, due_ns: u64) -> Result<ControlFlow<()>, ReplayError> {
        loop {
            self.take_in()?;
            if self.signals.is_stopped() {
                return Ok(ControlFlow::Break(()));
            }
            let left_ns = due_ns.saturating_sub(self.clock.now_ns());
            if left_ns > 0 {
                self.bus.wait(Duration::from_nanos(left_ns.min(LOOK_NS)))?;
            } else if self.bus.send(frame)? == Sent::QueueFull {
                self.clock.sleep_until_ns(self.clock.now_ns().saturating_add(RETRY_NS));
            } else {
                self.compared.frames += 1;
                return Ok(ControlFlow::Continue(()));
            }
        }
    }

    /// Records the first difference and ends the test.
    fn differs(&mut self, sample: u64, missing: DifferenceKind) -> ControlFlow<()> {
        if !self.signals.is_stopped() {
            let kind = match self.live.fault() {
                Some(cause) => DifferenceKind::Fault { cause, expected: missing.expected() },
                None => missing,
            };
            self.compared.first_difference.get_or_insert(Difference { sample, kind });
        }
        ControlFlow::Break(())
    }

    fn compare(&mut self, sample: u64, expected: Load, got: Load) {
        let apart = got - expected;
        let force_n = apart.force_n.amax();
        let torque_nm = apart.torque_nm.amax();
        let compared = &mut self.compared;
        compared.commands += 1;
        compared.largest_force_difference_n = compared.largest_force_difference_n.max(force_n);
        compared.largest_torque_difference_nm = compared.largest_torque_difference_nm.max(torque_nm);
        if force_n > self.regression.limit_n || torque_nm > self.regression.limit_nm {
            let kind = DifferenceKind::Command { expected, got };
            compared.first_difference.get_or_insert(Difference { sample, kind });
        }
    }

    /// Waits until a condition holds for the controller; `false` if it has faulted, the patience has run out, or the
    /// test was stopped.
    fn wait_for(&mut self, holds: impl Fn(&L) -> bool) -> Result<bool, ReplayError> {
        let patience_ns = u64::try_from(self.regression.patience.as_nanos()).unwrap_or(u64::MAX);
        let end_ns = self.clock.now_ns().saturating_add(patience_ns);
        loop {
            self.take_in()?;
            if holds(&self.live) {
                return Ok(true);
            }
            let left_ns = end_ns.saturating_sub(self.clock.now_ns());
            // A controller that has faulted does nothing more, so waiting on would only cost the patience.
            if left_ns == 0 || self.live.fault().is_some() || self.signals.is_stopped() {
                return Ok(false);
            }
            self.bus.wait(Duration::from_nanos(left_ns.min(LOOK_NS)))?;
        }
    }

    fn take_in(&mut self) -> Result<(), ReplayError> {
        for _ in 0..FRAMES_AT_ONCE {
            match self.bus.receive()? {
                Some(received) => self.live.hear(&received.frame),
                None => break,
            }
        }
        Ok(())
    }
}

fn name(request: OperatorRequest) -> &'static str {
    match request {
        OperatorRequest::Arm => "arm",
        OperatorRequest::Disarm => "disarm",
        OperatorRequest::Reset => "reset",
    }
}
