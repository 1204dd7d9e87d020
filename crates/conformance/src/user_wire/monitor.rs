//! Monitor of the node under test: every frame explained, checked and counted.

use std::collections::BTreeMap;

use super::protocol::UserWire;
use crate::traffic::Traffic;
use crate::tries::Rejected;
use resonarm_bench::node::mapped::mapping::ProtectionFault;
use resonarm_files::decoder::{Decoded, DecodedMessage, Decoder, Fault, Meaning, Outcome};
use resonarm_protocol::{Frame, Id, Node, NodeState};
use resonarm_scenario::wire::PresetSpec;
use resonarm_wire::canopen::cia402::DriveState;
use resonarm_wire::canopen::listen::Malformed;
use resonarm_wire::counter::CounterFault;

/// A frame of the node under test.
#[derive(Clone, Debug)]
pub(super) struct Heard {
    /// Time at which the frame came, ns of the bus's clock.
    pub at_ns: u64,
    pub id: Id,
    pub message: DecodedMessage,
    /// The state that it says of the plant, by its name in a mapping.
    pub says_state: Option<&'static str>,
    /// The state of the tester's own end once it had taken it.
    pub state: NodeState,
}

impl Heard {
    /// Whether its receiver uses it.
    pub fn is_taken(&self) -> bool {
        matches!(self.message.outcome, Outcome::Taken { .. })
    }

    fn meanings(&self) -> impl Iterator<Item = &Meaning> {
        // A frame that its receiver rejects means nothing, whatever its bits would say.
        let of_signals = self.message.signals.iter().flat_map(|signal| &signal.means);
        of_signals.chain(&self.message.means).filter(|_| self.is_taken())
    }

    /// The parts of a load that it commands: name of its key in a scenario, N or N·m.
    pub fn loads(&self) -> impl Iterator<Item = (&'static str, f64, &'static str)> {
        self.meanings().filter_map(|meaning| match meaning {
            Meaning::Load { name, value, unit } => Some((*name, *value, *unit)),
            _ => None,
        })
    }

    /// Whether it asks for this.
    pub fn asks(&self, wanted: &str) -> bool {
        self.meanings().any(|meaning| matches!(meaning, Meaning::Request { action, .. } if *action == wanted))
    }

    /// Whether it synchronises the samples.
    pub fn is_sync(&self) -> bool {
        self.meanings().any(|meaning| *meaning == Meaning::Sync)
    }

    /// Whether it says that the plant is in fault.
    pub fn is_fault(&self) -> bool {
        self.says_state == Some("fault") || self.reason().is_some_and(|reason| reason != "none")
    }

    fn state_in_it(&self, preset: Option<PresetSpec>) -> Option<&'static str> {
        match preset {
            // CiA 402 has eight states. The tester needs to know only whether the drive follows targets, is in fault,
            // or neither.
            Some(PresetSpec::Cia402) => Some(match DriveState::of(self.signal("Statusword")? as u16)? {
                DriveState::OperationEnabled => "operational",
                state if state.is_fault() => "fault",
                _ => "pre-operational",
            }),
            // Here the mapping has a reading of the state, whose numbers it names.
            Some(PresetSpec::Odrive) | None => self.meanings().find_map(|meaning| match meaning {
                Meaning::State { name } => *name,
                _ => None,
            }),
        }
    }

    /// The reason of a fault that it says; `none` without a fault.
    pub fn reason(&self) -> Option<&'static str> {
        self.meanings().find_map(|meaning| match meaning {
            Meaning::Reason { name } => *name,
            _ => None,
        })
    }

    /// A quantity that it says.
    pub fn quantity(&self, wanted: &str) -> Option<f64> {
        self.meanings().find_map(|meaning| match meaning {
            Meaning::Quantity { name, value, .. } if *name == wanted => Some(*value),
            _ => None,
        })
    }

    /// The value of a signal.
    pub fn signal(&self, wanted: &str) -> Option<f64> {
        self.message.signals.iter().find(|signal| signal.name == wanted)?.value.filter(|_| self.is_taken())
    }
}

/// The counters of one message.
#[derive(Clone, Debug, Default)]
struct Steps {
    frames: u32,
    /// Frames whose counter is not that of the frame before plus 1.
    wrong: u32,
    repeated: u32,
    /// The first wrong one, in words.
    text: String,
    /// Fault that neither lost frames nor a restart of the node explain.
    proof: Option<String>,
    /// Frames that were rejected for a counter after so many lost ones, without a restart of the node.
    after_losses: Option<String>,
    /// The run to which the frame before belongs.
    run: Option<u64>,
}

/// The checks of all frames of the node under test.
#[derive(Debug)]
pub(super) struct Monitor {
    decoder: Decoder,
    steps: BTreeMap<String, Steps>,
    pub heard: Vec<Heard>,
    pub traffic: Traffic,
    /// Number of times that the tester's end has left the state operational. A controller under test begins anew at the
    /// earliest then, and with it its counters.
    runs: u64,
    was_armed: bool,
}

/// Kind of a frame on the bus.
pub(super) enum Seen {
    /// A frame of the node under test that belongs to the protocol.
    Tested,
    /// One that only the tester sends.
    Double(String),
    /// A frame of another protocol.
    Other,
}

/// Number of times that a counter may be repeated by chance: once for each start of a controller, and more is a habit.
const REPEATED: u32 = 3;

impl Monitor {
    pub fn new(on: &UserWire) -> Monitor {
        Monitor {
            decoder: on.decoder.clone(),
            steps: BTreeMap::new(),
            heard: Vec::new(),
            traffic: Traffic::default(),
            runs: 0,
            was_armed: false,
        }
    }

    /// Takes in a frame that the tester has sent: what it says of the meaning of later ones counts.
    pub fn sent(&mut self, frame: &Frame) {
        let _of_own = self.decoder.decode(frame);
    }

    /// Takes in a frame from the bus, which comes while the tester's end is in this state.
    pub fn take(&mut self, on: &UserWire, at_ns: u64, frame: &Frame, state: NodeState) -> Seen {
        let is_armed = state == NodeState::Operational;
        // The state is that before the frame, so that a frame by which the plant is disarmed still belongs to the
        // run.
        self.runs += u64::from(self.was_armed && !is_armed);
        self.was_armed = is_armed;
        let sender = on.sender(frame);
        let decoded = self.decoder.decode(frame);
        let message = match decoded {
            Decoded::Message(message) if !matches!(message.outcome, Outcome::Unmapped) => message,
            Decoded::Request { message, .. } if sender == Some(on.tested) => {
                *self.traffic.user_taken.entry(message).or_default() += 1;
                return Seen::Tested;
            }
            _ => {
                self.traffic.note_other(frame.id());
                return Seen::Other;
            }
        };
        if sender != Some(on.tested) {
            return Seen::Double(message.message);
        }
        let run = match on.tested {
            // It doesn't begin anew within a case.
            Node::Plant => Some(0),
            Node::Exciter => is_armed.then_some(self.runs),
        };
        self.count(frame, &message, run);
        let mut heard = Heard { at_ns, id: frame.id(), message, says_state: None, state: NodeState::BootUp };
        heard.says_state = heard.state_in_it(on.preset);
        self.heard.push(heard);
        Seen::Tested
    }

    /// Counts a frame, and checks its counter. `run` is the run of the node to which it belongs; `None` while a
    /// controller may have been started anew.
    fn count(&mut self, frame: &Frame, message: &DecodedMessage, run: Option<u64>) {
        let name = &message.message;
        match &message.outcome {
            Outcome::Refused(fault) => self.traffic.note_user_refused(name, fault, frame),
            _ => *self.traffic.user_taken.entry(name.clone()).or_default() += 1,
        }
        let has_counter = message.signals.iter().any(|signal| signal.means.contains(&Meaning::Counter));
        let is_counter = matches!(&message.outcome, Outcome::Refused(fault) if fault.kind() == "counter");
        if !has_counter && !is_counter {
            return;
        }
        let steps = self.steps.entry(name.clone()).or_default();
        steps.frames += 1;
        // Two frames can be compared strictly only within one run: between runs a controller may have been started
        // anew, with any counter.
        let run_before = core::mem::replace(&mut steps.run, run);
        let is_in_run = run.is_some() && run_before == run;
        let text = match &message.outcome {
            Outcome::Taken { lost } if *lost > 0 => format!("{name} comes after {lost} that were not sent or are lost"),
            Outcome::Refused(fault) if is_counter => format!("{name}: {fault}: {frame}"),
            _ => return,
        };
        steps.wrong += 1;
        match &message.outcome {
            Outcome::Refused(Fault::Protection(ProtectionFault::Counter(fault))) => {
                let is_repeated = matches!(fault, CounterFault::Repeated { .. });
                steps.repeated += u32::from(is_repeated);
                // A controller that is started anew may repeat a counter by chance; within one run it may not.
                if !is_repeated || is_in_run {
                    steps.proof.get_or_insert_with(|| text.clone());
                }
            }
            Outcome::Refused(_) if is_in_run => {
                steps.after_losses.get_or_insert_with(|| text.clone());
            }
            _ => {}
        }
        if steps.text.is_empty() {
            steps.text = text;
        }
    }

    /// Notes the state of the tester's end after the frame heard last, and its loads for the ranges of the report.
    pub fn note_effect(&mut self, state: NodeState) {
        let Some(heard) = self.heard.last_mut() else { return };
        heard.state = state;
        for (name, value, _) in heard.loads() {
            self.traffic.commands.note_part(name, value);
        }
    }

    /// The counters that were followed: frames of so many messages.
    pub fn counted(&self) -> (u32, usize) {
        (self.steps.values().map(|steps| steps.frames).sum(), self.steps.len())
    }

    /// Describes what is wrong with the counters: more than single lost frames explain.
    pub fn counter_fault(&self) -> Option<String> {
        let proof = self.steps.values().find_map(|steps| steps.proof.clone());
        // A bus that works loses single frames. Repeats that chance does not explain, or more wrong steps than right
        // ones, are a habit of the node.
        let is_habit =
            |steps: &&Steps| steps.repeated >= REPEATED || (steps.wrong >= 2 && 2 * steps.wrong > steps.frames);
        proof.or_else(|| {
            let steps = self.steps.values().find(is_habit)?;
            Some(format!(
                "{}; of its {} frames {} have another counter than the next",
                steps.text, steps.frames, steps.wrong
            ))
        })
    }

    /// Describes the frames of the node that were rejected for another reason than the counter.
    pub fn refused(&self) -> Option<String> {
        let of_form = || self.traffic.user_refused.iter().filter(|refused| breaks_rules(&refused.fault));
        let first = of_form().next()?;
        let count: u64 = of_form().map(|refused| refused.count).sum();
        Some(format!("{count} of its frames are rejected: {first}"))
    }

    /// The frames of the node that were rejected, if there are any. Not counted are rejected counters of a controller
    /// that has just been started: it begins with any.
    pub fn rejected(&self) -> Option<Rejected> {
        let is_refused = |steps: &Steps| steps.proof.is_some() || steps.repeated >= REPEATED;
        let by_counter = || {
            let (message, _) = self.steps.iter().find(|(_, steps)| is_refused(steps))?;
            let refused = self.traffic.user_refused.iter();
            let first = refused.into_iter().find(|r| r.message == *message && r.fault.kind() == "counter")?;
            Some(format!("frames of it are rejected: {first}"))
        };
        if let Some(text) = self.refused().or_else(by_counter) {
            return Some(Rejected { text, may_be_lost: false });
        }
        let text = self.steps.values().find_map(|steps| steps.after_losses.clone())?;
        Some(Rejected { text, may_be_lost: true })
    }

    /// The frame that was rejected last since a time, and why.
    pub fn refused_since(&self, since_ns: u64) -> Option<String> {
        // The list is in the order of time, so that the search from its end stops at the first older frame.
        let since = self.heard.iter().rev().take_while(|heard| heard.at_ns >= since_ns);
        since.into_iter().find_map(|Heard { message, .. }| match &message.outcome {
            Outcome::Refused(fault) => Some(format!("{}: {fault}", message.message)),
            Outcome::Taken { .. } | Outcome::Unmapped => None,
        })
    }

    /// Describes in words what was received.
    pub fn in_words(&self) -> String {
        let counted = |(message, count): (&String, &u64)| format!("{count} {message}");
        let taken: Vec<String> = self.traffic.user_taken.iter().map(counted).collect();
        let refused = self.traffic.user_refused.first().map(|refused| format!("{refused}"));
        let others = self.traffic.others_text();
        match (taken.is_empty(), refused, others.is_empty()) {
            (true, None, true) => String::from("nothing"),
            (true, None, false) => format!("frames with other identifiers only: {others}"),
            (true, Some(refused), _) => refused,
            (false, None, _) => taken.join(", "),
            (false, Some(refused), _) => format!("{}, and {refused}", taken.join(", ")),
        }
    }
}

/// Whether a frame with this fault breaks the rules of its protocol by itself. Counters are judged by many frames;
/// block transfers and node guarding are rules of CANopen that the drives of this program leave out.
pub(super) fn breaks_rules(fault: &Fault) -> bool {
    let is_left_out = matches!(fault, Fault::CanOpen(Malformed::SdoCommand { .. } | Malformed::Remote));
    !is_left_out && fault.kind() != "counter"
}

/// The node in words.
pub(super) const fn name(node: Node) -> &'static str {
    match node {
        Node::Plant => "plant",
        Node::Exciter => "controller",
    }
}
