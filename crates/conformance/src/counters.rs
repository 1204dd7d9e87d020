//! The counters of a node's messages: each message has its own, from 0 at the boot, which steps by 1.

use resonarm_protocol::e2e::Protection;
use resonarm_protocol::{DecodeError, Frame, Message, MessageKind, Network, NodeState};

/// A frame of a message, with the sample that it carries or answers.
#[derive(Clone, Copy, Debug)]
struct Last {
    counter: u8,
    sample: Option<u16>,
}

/// The steps of one message's counter.
#[derive(Clone, Debug, Default)]
struct Steps {
    last: Option<Last>,
    /// Whether the next frame is the first since the node booted.
    is_first: bool,
    all: u32,
    /// Steps other than 1, which may be due to lost frames.
    wrong: u32,
    /// The first wrong step, in words.
    text: String,
    /// A step that lost frames can't explain.
    proof: Option<String>,
}

/// The counters of a node's messages.
#[derive(Debug, Default)]
pub(super) struct Counters {
    steps: [Steps; MessageKind::COUNT],
}

impl Counters {
    /// Takes a frame of the node, and the receiver's result for it.
    pub fn note(&mut self, network: Network, frame: &Frame, decoded: &Result<Option<Message>, DecodeError>) {
        let (kind, sample) = match decoded {
            // Heartbeats have no counter, but a boot restarts those of all other messages.
            Ok(Some(Message::Heartbeat(heartbeat))) => {
                if heartbeat.state == NodeState::BootUp {
                    self.boot();
                }
                return;
            }
            Ok(Some(message)) => (message.kind(), sample(message)),
            // A frame that is rejected for its counter shows the counter, too.
            Err(DecodeError::Counter { kind, .. }) => (*kind, None),
            Ok(None) | Err(_) => return,
        };
        let data = frame.data();
        let protection = kind.form(network.profile()).and_then(|form| form.protection);
        match protection {
            // Profile 11 has the counter in the lower half of byte 1, profile 5 in byte 2.
            Some(Protection::Profile11) => self.step(kind, Protection::Profile11, data[1] & 0xF, sample),
            Some(Protection::Profile5) => self.step(kind, Protection::Profile5, data[2], sample),
            None => {}
        }
    }

    fn boot(&mut self) {
        for steps in &mut self.steps {
            steps.last = None;
            steps.is_first = true;
        }
    }

    fn step(&mut self, kind: MessageKind, protection: Protection, counter: u8, sample: Option<u16>) {
        let steps = &mut self.steps[kind as usize];
        let is_first = core::mem::take(&mut steps.is_first);
        // The first counter after a boot is known to be 0. A tester that joins a running node knows nothing of the
        // first that it hears.
        let Some(last) = steps.last.replace(Last { counter, sample }) else {
            if is_first && counter != 0 {
                let text = format!("the first {kind} after its boot has the counter {counter}, not 0");
                steps.proof.get_or_insert(text);
            }
            return;
        };
        // Counters wrap, so the step is taken modulo their number; that is added first, since u16 has no negative
        // numbers.
        let counters = u16::from(protection.counter_max()) + 1;
        let step = (u16::from(counter) + counters - u16::from(last.counter)) % counters;
        steps.all += 1;
        if step == 1 {
            return;
        }
        steps.wrong += 1;
        if steps.text.is_empty() {
            steps.text = format!("the counter of {kind} is {counter} after {}, a step of {step}, not 1", last.counter);
        }
        // Each sample has at most one frame of the message: a larger step than that of the samples is no loss.
        let samples = sample.zip(last.sample).map(|(sample, last)| (last, sample, sample.wrapping_sub(last)));
        if let Some((from, to, between)) = samples.filter(|(.., between)| *between < counters && step > *between) {
            let text = format!(
                "the counter of {kind} is {counter} for sample {to} after {} for sample {from}: a step of {step}, not \
                 {between}",
                last.counter
            );
            steps.proof.get_or_insert(text);
        }
    }

    /// The messages with steps, and their steps.
    pub fn counted(&self) -> [u32; 2] {
        let counted = self.steps.iter().filter(|steps| steps.all > 0);
        counted.fold([0, 0], |[kinds, all], steps| [kinds + 1, all + steps.all])
    }

    /// The fault of the counters: more than single lost frames explain.
    pub fn fault(&self) -> Option<String> {
        // A proof goes first: wrong steps alone may be losses, so at least two, and most of all steps, are needed for
        // a fault.
        let proof = self.steps.iter().find_map(|steps| steps.proof.clone());
        proof.or_else(|| {
            let steps = self.steps.iter().find(|steps| steps.wrong >= 2 && 2 * steps.wrong > steps.all)?;
            Some(format!("{}; {} of its {} steps are not 1", steps.text, steps.wrong, steps.all))
        })
    }
}

/// Whether a message is the command of a load.
pub(super) const fn is_command(message: &Message) -> bool {
    matches!(message, Message::Force(_) | Message::Torque(_))
}

/// The sample that a message carries or answers.
pub(super) fn sample(message: &Message) -> Option<u16> {
    match message {
        Message::Head(head) => Some(head.sample),
        Message::AccelerometerB(a) | Message::AccelerometerC(a) => Some(a.sample),
        Message::Sensors(sensors) => Some(sensors.sample),
        Message::Force(command) => Some(command.sample),
        Message::Torque(command) => Some(command.sample),
        _ => None,
    }
}
