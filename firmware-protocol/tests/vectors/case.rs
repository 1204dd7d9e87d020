//! A case: what is put on the bus, and what a receiver must make of it.

use resonarm_protocol::{Frame, Message, MessageKind, Network, Node, Profile, Receiver, Transmitter};
use serde_json::{Value, json};

use crate::{common, message_to_json, reason};

/// A case for each message that a profile has.
pub fn good(profile: Profile) -> Vec<Case> {
    let kinds = MessageKind::ALL.into_iter().filter(|kind| kind.form(profile).is_some());
    kinds
        .map(|kind| {
            let samples = common::samples().into_iter().filter(|message| message.kind() == kind);
            samples.fold(Case::new(profile, &format!("good: {kind}")), Case::send)
        })
        .collect()
}

/// One sender, one receiver, and what goes between them.
pub struct Case {
    name: String,
    transmitter: Transmitter,
    receiver: Receiver,
    steps: Vec<Value>,
}

impl Case {
    pub fn new(profile: Profile, name: &str) -> Case {
        Case::at(name, common::network(profile))
    }

    pub fn at(name: &str, network: Network) -> Case {
        let (transmitter, receiver) = (Transmitter::new(network), Receiver::new(network));
        Case { name: name.to_string(), transmitter, receiver, steps: Vec::new() }
    }

    /// A valid message goes over the bus.
    pub fn send(mut self, message: Message) -> Case {
        let frame = self.transmitter.frame(&message).unwrap();
        let accepted = self.receiver.accept(&frame).unwrap().unwrap();
        self.steps.push(json!({
            "send": message_to_json(&message), "frame": frame.to_string(),
            "result": "accepted", "accepted": message_to_json(&accepted),
        }));
        self
    }

    /// A frame that must be taken.
    pub fn accept(mut self, frame: Frame) -> Case {
        let accepted = self.receiver.accept(&frame).unwrap().unwrap();
        let accepted = message_to_json(&accepted);
        self.steps.push(json!({ "frame": frame.to_string(), "result": "accepted", "accepted": accepted }));
        self
    }

    /// A valid message is sent and never arrives.
    pub fn lose(mut self, message: Message) -> Case {
        let frame = self.transmitter.frame(&message).unwrap();
        let sent = message_to_json(&message);
        self.steps.push(json!({ "send": sent, "frame": frame.to_string(), "result": "lost" }));
        self
    }

    /// A valid message is sent, and refused for its place in the sequence.
    pub fn send_refused(mut self, message: Message, why: &str) -> Case {
        let frame = self.transmitter.frame(&message).unwrap();
        self = self.refuse(frame, why);
        self.steps.last_mut().unwrap()["send"] = message_to_json(&message);
        self
    }

    /// A frame that must be refused.
    pub fn refuse(mut self, frame: Frame, why: &str) -> Case {
        let refused = self.receiver.accept(&frame).map_err(|error| reason(&error));
        assert_eq!(refused, Err(why), "{}: {frame}", self.name);
        self.steps.push(json!({ "frame": frame.to_string(), "result": "refused", "reason": why }));
        self
    }

    /// A frame that is none of the protocol's.
    pub fn ignore(mut self, frame: Frame) -> Case {
        assert_eq!(self.receiver.accept(&frame), Ok(None), "{}: {frame}", self.name);
        self.steps.push(json!({ "frame": frame.to_string(), "result": "ignored" }));
        self
    }

    pub fn to_json(&self) -> Value {
        let network = self.receiver.network();
        let node_ids = Node::ALL.map(|node| network.node_id(node));
        let lost = self.receiver.lost();
        json!({ "name": self.name, "base": network.base(), "node_ids": node_ids, "lost": lost, "steps": self.steps })
    }
}
