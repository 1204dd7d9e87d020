//! The tester: the other side of the node under test, one case at a time.

use super::counters::Counters;
use super::damage::{Damage, Ends};
use super::load::BusLoad;
use super::settings::Settings;
use super::soak::Soak;
use super::source::{Answers, Source};
use super::stop::{Stop, failed, inconclusive, late, slow, wrong};
use super::times::GONE_NS;
use super::traffic::Traffic;
use super::tries::{LOOK_NS, Rejected, Watch};
use super::wire::Wire;
use resonarm_protocol::timing::{HEARTBEAT_PERIOD_NS, HELLO_PERIOD_NS};
use resonarm_protocol::{
    Capabilities, DecodeError, Emergency, EmergencyCode, ForceCommand, Frame, Heartbeat, Hello, Message, MessageKind,
    Network, Node, NodeState, OperatorCommand, OperatorRequest, Profile, Receiver, SamplesPerFrame, Transmitter,
};

/// Number of rejected frames of a kind after which the tester no longer waits for a valid one.
const MOST_REFUSED: u64 = 3;

/// A message of the node under test, with its time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heard {
    pub at_ns: u64,
    pub message: Message,
}

/// The result of checking the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Looked {
    FrameCame,
    NothingCame,
}

pub(super) struct Tester<'w> {
    pub wire: &'w mut dyn Wire,
    pub network: Network,
    pub tested: Node,
    pub settings: Settings,
    pub ends: Ends,
    receiver: Receiver,
    /// The state in the tester's heartbeats.
    pub state: NodeState,
    pub hello: Hello,
    /// Whether heartbeats and hellos are sent periodically.
    pub is_alive: bool,
    heartbeat_at_ns: u64,
    hello_at_ns: u64,
    pub answers: Answers,
    pub soak: Option<Soak>,
    pub load: Option<BusLoad>,
    /// The tester's capability in the FD profile.
    pub samples_per_frame: SamplesPerFrame,
    damaged: u64,
    /// The sample answered last, and how.
    pub answered: Option<u16>,
    /// Time at which that answer was sent, ns.
    pub answered_ns: u64,
    pub heard: Vec<Heard>,
    /// The frames received and rejected.
    pub traffic: Traffic,
    pub counters: Counters,
    pub watch: Watch,
    /// The tester as a plant: its samples.
    pub source: Source,
    pub notes: Vec<String>,
}

impl<'w> Tester<'w> {
    pub fn new(wire: &'w mut dyn Wire, network: Network, tested: Node, settings: Settings) -> Tester<'w> {
        let now_ns = wire.now_ns();
        Tester {
            wire,
            network,
            tested,
            settings,
            ends: Ends::new(network),
            receiver: Receiver::new(network),
            state: NodeState::BootUp,
            // A rate to begin with: as soon as the node under test has said hello, the tester states that node's own.
            hello: Hello::new(network.profile(), 1000),
            is_alive: false,
            heartbeat_at_ns: 0,
            hello_at_ns: 0,
            answers: Answers::None,
            soak: None,
            load: None,
            samples_per_frame: SamplesPerFrame::One,
            // The number of the first damaged frame chooses its bit, so that the seed alone decides which bits are
            // tried.
            damaged: settings.seed,
            answered: None,
            answered_ns: 0,
            heard: Vec::new(),
            traffic: Traffic::default(),
            counters: Counters::default(),
            watch: Watch::new(now_ns),
            source: Source::default(),
            notes: Vec::new(),
        }
    }

    pub fn now_ns(&self) -> u64 {
        self.wire.now_ns()
    }

    pub fn note(&mut self, text: String) {
        self.notes.push(text);
    }

    /// Sends a message, protected.
    pub fn send(&mut self, message: &Message) -> Result<(), Stop> {
        match self.ends.transmitter.frame(message) {
            Ok(frame) => self.send_frame(&frame),
            Err(error) => inconclusive(format!("the tester can't send this: {error}")),
        }
    }

    pub fn send_frame(&mut self, frame: &Frame) -> Result<(), Stop> {
        if let Some(load) = &mut self.load {
            load.count(frame);
        }
        Ok(self.wire.send(frame)?)
    }

    /// Sends a message as one of a network with another base.
    pub fn send_at_other_base(&mut self, message: &Message) -> Result<(), Stop> {
        match Damage::Base.apply(&mut self.ends, 0, |transmitter| transmitter.frame(message).ok()) {
            Some(frame) => self.send_frame(&frame),
            None => inconclusive("the tester can't send this"),
        }
    }

    pub fn request(&mut self, request: OperatorRequest) -> Result<(), Stop> {
        self.send(&Message::Operator(OperatorCommand { request, target: self.tested }))
    }

    pub fn send_state(&mut self, state: NodeState) -> Result<(), Stop> {
        self.state = state;
        // Twice as often as demanded, so that one that is late is no silence of the tester.
        self.heartbeat_at_ns = self.now_ns() + HEARTBEAT_PERIOD_NS / 2;
        self.send(&Message::Heartbeat(Heartbeat { node: self.tested.partner(), state }))
    }

    pub fn send_hello(&mut self) -> Result<(), Stop> {
        // Twice as often as demanded, like heartbeats: one that is late still keeps the period.
        self.hello_at_ns = self.now_ns() + HELLO_PERIOD_NS / 2;
        self.send(&match self.tested {
            Node::Plant => Message::ExciterHello(self.hello),
            Node::Exciter => Message::PlantHello(self.hello),
        })?;
        if self.network.profile() != Profile::Fd {
            return Ok(());
        }
        let node = self.tested.partner();
        // The largest number that the message can carry: limits of the tester must not bound what the node under test
        // does.
        let limit = f32::MAX.into();
        self.send(&Message::Capabilities(Capabilities {
            node,
            samples_per_frame: self.samples_per_frame,
            force_limit_n: limit,
            torque_limit_nm: limit,
        }))
    }

    pub fn send_emergency(&mut self, code: EmergencyCode, detail: u16) -> Result<(), Stop> {
        let sample = self.answered.unwrap_or(0);
        self.send(&Message::Emergency(Emergency { node: self.tested.partner(), code, detail, sample }))
    }

    /// Sends the boot-up heartbeat; counters restart at 0.
    pub fn boot(&mut self) -> Result<(), Stop> {
        self.ends = Ends::new(self.network);
        self.send_state(NodeState::BootUp)?;
        self.send_state(NodeState::PreOperational)?;
        self.is_alive = true;
        // Hellos are repeated from the first that the case sends on.
        self.hello_at_ns = u64::MAX;
        Ok(())
    }

    /// Lets time pass, and does the work that is due.
    pub fn run_ns(&mut self, duration_ns: u64) -> Result<(), Stop> {
        self.wait_for(duration_ns, |_| false).map(|_| ())
    }

    /// The first message from now on that matches, within a time. Frames still waiting on the bus at the end of the
    /// time count as in time: the tester may have been stopped.
    pub fn wait_for(&mut self, within_ns: u64, holds: impl Fn(&Message) -> bool) -> Result<Option<Heard>, Stop> {
        let end_ns = self.now_ns() + within_ns;
        // Only messages from now on count. One heard before is no answer to what the case has just sent.
        let mut seen = self.heard.len();
        loop {
            if let Some(heard) = self.heard[seen..].iter().find(|heard| holds(&heard.message)) {
                return Ok(Some(*heard));
            }
            seen = self.heard.len();
            // Read before the look, so that frames that already wait at the end are still taken: the loop ends only
            // with a look that finds none.
            let is_over = self.now_ns() >= end_ns;
            if self.look(end_ns)? == Looked::NothingCame && is_over {
                return Ok(None);
            }
        }
    }

    /// Like [`Tester::wait_for`], for the heartbeat of a state.
    pub fn wait_for_state(&mut self, within_ns: u64, state: NodeState) -> Result<Option<Heard>, Stop> {
        self.wait_for(within_ns, |message| is_state(message, state))
    }

    /// Like [`Tester::wait_for`], for an emergency other than that a schedule has slipped.
    pub fn wait_for_emergency(&mut self, within_ns: u64) -> Result<Option<(Heard, Emergency)>, Stop> {
        let heard = self.wait_for(within_ns, |message| emergency(message).is_some())?;
        Ok(heard.and_then(|heard| Some((heard, emergency(&heard.message)?))))
    }

    /// Requires an emergency within a time. It may have another code, for the case to judge; if there is none the node
    /// is late, with this text, or slow if this code comes after all.
    pub fn expect_emergency(
        &mut self,
        within_ns: u64,
        code: EmergencyCode,
        text: impl Into<String>,
    ) -> Result<(Heard, Emergency), Stop> {
        let end_ns = self.now_ns() + within_ns;
        if let Some(word) = self.wait_for_emergency(within_ns)? {
            return Ok(word);
        }
        // A node that answers late and one that never answers get different verdicts, so the tester waits on.
        match self.wait_for_emergency(GONE_NS)? {
            Some((heard, e)) if e.code == code => slow(text, heard.at_ns - end_ns),
            _ => late(text),
        }
    }

    /// Requires the heartbeat of a state within a time: otherwise the node is late, with this text, or slow if it comes
    /// later.
    pub fn expect_state(&mut self, within_ns: u64, state: NodeState, text: impl Into<String>) -> Result<(), Stop> {
        let end_ns = self.now_ns() + within_ns;
        if self.wait_for_state(within_ns, state)?.is_some() {
            return Ok(());
        }
        match self.wait_for_state(GONE_NS, state)? {
            Some(heard) => slow(text, heard.at_ns - end_ns),
            None => late(text),
        }
    }

    /// Does the work that is due, and takes at most one frame, at the latest at `until_ns`.
    fn look(&mut self, until_ns: u64) -> Result<Looked, Stop> {
        let now_ns = self.now_ns();
        if self.is_alive && now_ns >= self.heartbeat_at_ns {
            self.send_state(self.state)?;
        }
        if self.is_alive && now_ns >= self.hello_at_ns {
            self.send_hello()?;
        }
        self.send_sample(now_ns)?;
        self.send_load(now_ns)?;
        let load_ns = self.load.as_ref().map_or(u64::MAX, BusLoad::next_ns);
        // The wait ends at the tester's own next duty, so that its samples and its bus load keep their times.
        let next_ns = until_ns.min(now_ns + LOOK_NS).min(self.source.next_ns()).min(load_ns);
        let frame = self.wire.receive(next_ns)?;
        let now_ns = self.now_ns();
        self.watch.look(now_ns);
        match frame {
            Some(frame) => self.take(now_ns, &frame).map(|()| Looked::FrameCame),
            None => Ok(Looked::NothingCame),
        }
    }

    fn take(&mut self, at_ns: u64, frame: &Frame) -> Result<(), Stop> {
        if let Some(load) = &mut self.load {
            load.count(frame);
        }
        let decoded = self.receiver.accept(frame);
        // These two see rejected frames as well: a frame that the receiver drops may be the very fault that the case
        // looks for.
        self.traffic.note(self.network, frame, &decoded);
        self.counters.note(self.network, frame, &decoded);
        let message = match decoded {
            Ok(Some(message)) if message.kind().sender() == self.tested => message,
            Ok(_) | Err(_) => return Ok(()),
        };
        self.watch.hear(at_ns);
        self.heard.push(Heard { at_ns, message });
        match message {
            Message::AccelerometerC(c) => self.answer(c.sample),
            Message::Sensors(sensors) => self.answer(sensors.sample),
            // A pair carries the samples n and n + 1; the command answers the newer one.
            Message::SensorPair(pair) => self.answer(pair.sample.wrapping_add(1)),
            Message::Force(command) => self.commanded(command.sample),
            Message::Torque(command) => self.commanded(command.sample),
            Message::Operator(OperatorCommand { request, target: Node::Plant }) => self.follow(request),
            _ => Ok(()),
        }
    }

    /// Answers a sample of the plant.
    fn answer(&mut self, sample: u16) -> Result<(), Stop> {
        let Answers::Soak(force_n, limit) = self.answers else { return self.answer_with(self.answers, sample) };
        let profile = self.network.profile();
        let drawn = self.soak.as_mut().map_or_else(Vec::new, |soak| soak.answers(force_n, limit, profile));
        drawn.into_iter().try_for_each(|answers| self.answer_with(answers, sample))
    }

    pub fn answer_with(&mut self, answers: Answers, sample: u16) -> Result<(), Stop> {
        let (force_x_n, sample) = match answers {
            Answers::None | Answers::Soak(..) => return Ok(()),
            Answers::Force(force_n) | Answers::Damaged(force_n, _) => (force_n, sample),
            Answers::Shifted(force_n, by) => (force_n, sample.wrapping_add_signed(by)),
            Answers::Always(force_n, sample) => (force_n, sample),
        };
        let message = Message::Force(ForceCommand { force_x_n, force_y_n: 0.0, sample });
        let frame = match answers {
            Answers::Damaged(_, damage) => {
                let n = self.damaged;
                // Each damaged frame has another bit inverted, beginning with the seed, so that a run can be
                // repeated.
                self.damaged = n.wrapping_add(1);
                damage.apply(&mut self.ends, n, |transmitter| transmitter.frame(&message).ok())
            }
            _ => {
                // `Damage::Repeated` sends with this state, which repeats the counter of the last good command.
                self.ends.before = self.ends.transmitter.clone();
                self.ends.transmitter.frame(&message).ok()
            }
        };
        // Only an undamaged command for the sample itself is one that the plant must take.
        if matches!(answers, Answers::Force(_)) {
            (self.answered, self.answered_ns) = (Some(sample), self.now_ns());
        }
        match frame {
            Some(frame) => self.send_frame(&frame),
            None => inconclusive(format!("the tester can't command {force_x_n} N")),
        }
    }

    /// Whether the profile can carry a force, N.
    pub fn can_command(&self, force_x_n: f64) -> bool {
        Message::Force(ForceCommand { force_x_n, force_y_n: 0.0, sample: 0 }).check(self.network).is_ok()
    }

    /// A node that is not ready can't be judged. On a loaded bus, though, this is what the case tests.
    pub fn unready<T>(&self, text: impl Into<String>) -> Result<T, Stop> {
        if self.load.is_some() { late(text) } else { inconclusive(text) }
    }

    /// A transmitter of another node than the tester.
    pub fn stranger(&self) -> Transmitter {
        Transmitter::new(self.network)
    }

    /// The frames of the node under test that the protocol rejects, if there are any.
    pub fn rejected_frames(&self) -> Option<Rejected> {
        let refused = || self.traffic.refused_of(|kind| kind.sender() == self.tested);
        let first = refused().next()?;
        let count: u64 = refused().map(|refused| refused.count).sum();
        let demand = match first.error {
            DecodeError::Counter { .. } => " (R-2.1)",
            DecodeError::OtherProfile { .. } => " (R-1.2)",
            _ => "",
        };
        Some(Rejected {
            text: format!("{count} of its frames {} rejected{demand}: {first}", if count == 1 { "is" } else { "are" }),
            // Lost frames show as a wrong counter. Every other refusal is due to the node itself.
            may_be_lost: refused().all(|refused| matches!(refused.error, DecodeError::Counter { .. })),
        })
    }

    /// Fails if the protocol rejected frames of the node.
    pub fn check_frames(&self) -> Result<(), Stop> {
        match self.rejected_frames() {
            None => Ok(()),
            Some(Rejected { text, may_be_lost: true }) => failed(text),
            Some(Rejected { text, .. }) => wrong(text),
        }
    }

    /// Fills the bus up to its share.
    fn send_load(&mut self, now_ns: u64) -> Result<(), Stop> {
        while let Some(frame) = self.load.as_mut().and_then(|load| load.due(now_ns)) {
            match frame {
                Ok(frame) => self.send_frame(&frame)?,
                Err(error) => return Err(Stop::Inconclusive(error.to_string())),
            }
        }
        Ok(())
    }

    /// Whether several frames of this kind were received, and all were rejected.
    pub fn refuses(&self, kind: MessageKind) -> bool {
        let refused: u64 = self.traffic.refused_of(|refused| refused == kind).map(|refused| refused.count).sum();
        refused >= MOST_REFUSED && !self.traffic.taken.contains_key(&kind)
    }

    /// The state in the last heartbeat of the node under test.
    pub fn last_state(&self) -> Option<NodeState> {
        self.heard.iter().rev().find_map(|heard| state_said(&heard.message))
    }

    /// The capabilities received last. A node may state others later: these count.
    pub fn last_capabilities(&self) -> Option<Capabilities> {
        self.heard.iter().rev().find_map(|heard| match heard.message {
            Message::Capabilities(capabilities) => Some(capabilities),
            _ => None,
        })
    }

    /// The hello received last.
    pub fn last_hello(&self) -> Option<Hello> {
        self.heard.iter().rev().find_map(|heard| match heard.message {
            Message::PlantHello(hello) | Message::ExciterHello(hello) => Some(hello),
            _ => None,
        })
    }
}

/// The emergency in a message, other than that a schedule has slipped.
pub(super) fn emergency(message: &Message) -> Option<Emergency> {
    match message {
        Message::Emergency(emergency) if emergency.code != EmergencyCode::ScheduleSlipped => Some(*emergency),
        _ => None,
    }
}

/// The state in a heartbeat.
pub(super) fn state_said(message: &Message) -> Option<NodeState> {
    match message {
        Message::Heartbeat(heartbeat) => Some(heartbeat.state),
        _ => None,
    }
}

/// Whether a message is the heartbeat of a state.
pub(super) fn is_state(message: &Message, state: NodeState) -> bool {
    state_said(message) == Some(state)
}
