//! The messages that a node has yet to send.
//!
//! A message gets its counter only when it is sent, so that dropped messages leave no gap. Emergencies, heartbeats,
//! hellos and requests wait in a short queue and are sent first; of commands (of force or torque) and of each sensor
//! message only the latest waits, so that after a jam the bus gets new data.

use super::queue::Queue;
use crate::content::Content;
use crate::error::EncodeError;
use crate::kind::MessageKind;
use crate::message::{Capabilities, Emergency, Heartbeat, Hello, Message, OperatorCommand};
use crate::network::{Network, Node};

/// Most messages in the queue. None waits twice in a row, so this is many changes of state.
const CONTROL: usize = 32;

/// The messages of which only the latest waits, in the order of sending. A command sets the whole load, so a command
/// of either kind replaces the other.
const LATEST: [&[MessageKind]; 6] = [
    &[MessageKind::Force, MessageKind::Torque],
    &[MessageKind::Head],
    &[MessageKind::AccelerometerB],
    &[MessageKind::AccelerometerC],
    &[MessageKind::Sensors],
    &[MessageKind::SensorPair],
];

/// The index of commands in [`LATEST`].
const COMMAND: usize = 0;

/// A message that waits in the queue. A [`Message`] and a [`Content`] are larger, for two samples in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Control {
    Operator(OperatorCommand),
    Hello(Node, Hello),
    Heartbeat(Heartbeat),
    Emergency(Emergency),
    Capabilities(Capabilities),
}

impl Control {
    /// A message that can wait in the queue.
    fn new(message: &Message) -> Option<Control> {
        match *message {
            Message::Operator(command) => Some(Control::Operator(command)),
            Message::PlantHello(hello) => Some(Control::Hello(Node::Plant, hello)),
            Message::ExciterHello(hello) => Some(Control::Hello(Node::Exciter, hello)),
            Message::Heartbeat(heartbeat) => Some(Control::Heartbeat(heartbeat)),
            Message::Emergency(emergency) => Some(Control::Emergency(emergency)),
            Message::Capabilities(capabilities) => Some(Control::Capabilities(capabilities)),
            Message::Force(_) | Message::Torque(_) | Message::Head(_) | Message::AccelerometerB(_) => None,
            Message::AccelerometerC(_) | Message::Sensors(_) | Message::SensorPair(_) => None,
        }
    }

    fn message(&self) -> Message {
        match *self {
            Control::Operator(command) => Message::Operator(command),
            Control::Hello(Node::Plant, hello) => Message::PlantHello(hello),
            Control::Hello(Node::Exciter, hello) => Message::ExciterHello(hello),
            Control::Heartbeat(heartbeat) => Message::Heartbeat(heartbeat),
            Control::Emergency(emergency) => Message::Emergency(emergency),
            Control::Capabilities(capabilities) => Message::Capabilities(capabilities),
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Outbox {
    network: Network,
    control: Queue<Control, CONTROL>,
    latest: [Option<Content>; LATEST.len()],
    replaced: u64,
}

impl Outbox {
    pub fn new(network: Network) -> Outbox {
        Outbox { network, control: Queue::new(), latest: [None; LATEST.len()], replaced: 0 }
    }

    /// Queues a message for sending. A command or sensor message replaces the one before it, if that still waits.
    ///
    /// # Errors
    /// [`EncodeError`] if the protocol can't encode it.
    pub fn push(&mut self, message: &Message) -> Result<(), EncodeError> {
        let content = Content::new(self.network, message)?;
        let kind = content.kind();
        if let Some(control) = Control::new(message) {
            // A message equal to the newest of its kind that still waits says nothing new.
            if self.control.latest(|waiting| waiting.message().kind() == kind) != Some(&control) {
                self.control.push(control);
            }
        } else if let Some(place) = LATEST.iter().position(|kinds| kinds.contains(&kind)) {
            self.replaced += u64::from(self.latest[place].replace(content).is_some());
        }
        Ok(())
    }

    /// The messages to send, in their order.
    pub fn contents(&self) -> impl Iterator<Item = Content> {
        // `push` has encoded each of them once, so none is left out.
        let control = self.control.iter().filter_map(|control| Content::new(self.network, &control.message()).ok());
        control.chain(self.latest.iter().flatten().copied())
    }

    /// Removes the first message to send; returns its kind.
    pub fn pop(&mut self) -> Option<MessageKind> {
        // The same order as in `contents`: what was sent is the first of those.
        match self.control.pop() {
            Some(control) => Some(control.message().kind()),
            None => self.latest.iter_mut().find_map(Option::take).map(|content| content.kind()),
        }
    }

    /// Drops the waiting command.
    pub fn clear_command(&mut self) {
        self.latest[COMMAND] = None;
    }

    /// The number of waiting messages.
    pub fn waiting(&self) -> usize {
        self.control.len() + self.latest.iter().flatten().count()
    }

    /// Messages that will never be sent: replaced by newer ones, or beyond the queue.
    pub fn unsent(&self) -> u64 {
        self.replaced + self.control.lost()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ForceCommand, TorqueCommand, Transmitter};

    #[test]
    fn of_commands_of_force_and_torque_only_the_latest_waits() {
        let force = |sample| Message::Force(ForceCommand { force_x_n: 1.0, force_y_n: 0.0, sample });
        let torque = |sample| Message::Torque(TorqueCommand { torque1_nm: 1.0, torque2_nm: 0.0, sample });
        for commands in [[force(1), torque(2), force(3)], [torque(1), force(2), torque(3)]] {
            let network = Network::default();
            let mut outbox = Outbox::new(network);
            commands.iter().for_each(|command| outbox.push(command).unwrap());
            assert_eq!((outbox.waiting(), outbox.unsent()), (1, 2));
            let last = Transmitter::new(network).frame(&commands[2]).unwrap();
            assert_eq!(outbox.contents().next().map(|content| content.frame(0)), Some(last));
            assert_eq!((outbox.pop(), outbox.pop()), (Some(commands[2].kind()), None));
        }
    }
}
