//! The tester on a user protocol: its own end, what is altered of that end's frames, and what is heard.

use core::sync::atomic::{AtomicU64, Ordering};
use std::sync::Arc;

use super::constant::Constant;
use super::craft::{Damage, Sent};
use super::end::{End, PlantEnd};
use super::monitor::{Heard, Monitor, Seen, name};
use super::protocol::UserWire;
use crate::settings::Settings;
use crate::stop::{Stop, inconclusive};
use crate::tries::{LOOK_NS, Watch};
use crate::wire::Wire;
use resonarm_protocol::{Frame, Node, NodeState};

/// Alteration of the frames of the tester's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Alter {
    Nothing,
    /// No frame is sent.
    Mute,
    /// The frames with loads are damaged.
    Commands(Damage),
}

pub(super) struct Tester<'w> {
    wire: &'w mut dyn Wire,
    pub on: &'w UserWire,
    pub settings: Settings,
    pub end: End,
    pub alter: Alter,
    pub sent: Sent,
    /// The load of the emulated exciter, N or N·m.
    load: Arc<AtomicU64>,
    pub monitor: Monitor,
    /// Time at which a good frame with loads was sent last, ns.
    pub commanded_ns: u64,
    pub watch: Watch,
    pub notes: Vec<String>,
}

impl<'w> Tester<'w> {
    /// A tester that is the scenario's plant before a controller, and before a plant only listens.
    pub fn new(wire: &'w mut dyn Wire, on: &'w UserWire, settings: Settings) -> Tester<'w> {
        let now_ns = wire.now_ns();
        let end = match on.tested {
            Node::Exciter => End::Plant(Box::new(PlantEnd::new(on, now_ns))),
            Node::Plant => End::Listener,
        };
        Tester {
            wire,
            on,
            settings,
            end,
            alter: Alter::Nothing,
            sent: Sent::default(),
            load: Arc::new(AtomicU64::new(0)),
            monitor: Monitor::new(on),
            commanded_ns: now_ns,
            watch: Watch::new(now_ns),
            notes: Vec::new(),
        }
    }

    pub fn now_ns(&self) -> u64 {
        self.wire.now_ns()
    }

    pub fn note(&mut self, text: String) {
        self.notes.push(text);
    }

    /// The frames of the node under test.
    pub fn heard(&self) -> &[Heard] {
        &self.monitor.heard
    }

    /// Returns the number of frames heard so far: the place where those that come from now on begin.
    pub fn mark(&self) -> usize {
        self.monitor.heard.len()
    }

    /// The tester becomes the emulated exciter, which arms the plant and commands zero.
    pub fn join(&mut self) -> Result<(), Stop> {
        let (constant, load) = Constant::new(self.on.input());
        match self.on.spec.exciter(self.on.rate(), self.on.timing, Box::new(constant)) {
            Ok(mut node) => {
                node.start(self.now_ns());
                self.end = End::Exciter(node);
                self.load = load;
                self.send_waiting()
            }
            Err(lack) => inconclusive(format!("{lack}")),
        }
    }

    /// The load that the emulated exciter commands from now on, N or N·m.
    pub fn command(&mut self, load: f64) {
        self.load.store(load.to_bits(), Ordering::Relaxed);
    }

    /// Whether the user protocol can command this load, N or N·m.
    pub fn can_command(&self, load: f64) -> bool {
        let load = self.on.input().load(load);
        matches!(&self.end, End::Exciter(node) if node.check_load(&load).is_ok())
    }

    /// The plant that the tester is.
    ///
    /// # Errors
    /// [`Stop::Inconclusive`] if it is none: a case of the other node.
    pub fn plant(&mut self) -> Result<&mut PlantEnd, Stop> {
        match &mut self.end {
            End::Plant(plant) => Ok(plant),
            End::Listener | End::Exciter(_) => inconclusive("the tester is no plant"),
        }
    }

    /// Sends a frame that is no one of the tester's end.
    pub fn send(&mut self, frame: &Frame) -> Result<(), Stop> {
        self.monitor.sent(frame);
        Ok(self.wire.send(frame)?)
    }

    /// Sends what the tester's end has to send, altered.
    pub fn send_waiting(&mut self) -> Result<(), Stop> {
        // The end's frames are taken even where none is sent: to the end they are sent, and it goes on with its
        // counters and times.
        while let Some(frame) = self.end.poll_transmit() {
            let altered = match self.alter {
                Alter::Mute => None,
                Alter::Nothing => Some(self.sent.pass(&frame)),
                Alter::Commands(damage) => Some(self.sent.damage(self.on, &frame, damage)),
            };
            let Some(altered) = altered else { continue };
            self.send(&altered)?;
            // A damaged command must not act, so the time of the node's last command stays.
            if self.alter == Alter::Nothing && self.on.is_command(&altered) {
                self.commanded_ns = self.now_ns();
            }
        }
        Ok(())
    }

    /// Lets time pass, and does the work that is due.
    pub fn run_ns(&mut self, duration_ns: u64) -> Result<(), Stop> {
        self.until(duration_ns, |_| false).map(drop)
    }

    /// Does the work that is due until something holds, or a time has passed. Returns whether it holds. Frames that
    /// wait on the bus at the end of the time count as in time: the tester may have been stopped.
    pub fn until(&mut self, within_ns: u64, mut holds: impl FnMut(&Tester) -> bool) -> Result<bool, Stop> {
        let end_ns = self.now_ns().saturating_add(within_ns);
        loop {
            if holds(self) {
                return Ok(true);
            }
            let is_over = self.now_ns() >= end_ns;
            if !self.look(end_ns)? && is_over {
                return Ok(holds(self));
            }
        }
    }

    /// Does the work that is due until a frame of the node under test does, from number `from` on.
    pub fn wait_for(
        &mut self,
        from: usize,
        within_ns: u64,
        holds: impl Fn(&Heard) -> bool,
    ) -> Result<Option<Heard>, Stop> {
        let mut seen = from;
        let mut found = None;
        self.until(within_ns, |t| {
            // `until` asks after every frame, so that only new frames are looked at.
            found = t.monitor.heard[seen..].iter().position(&holds).map(|place| place + seen);
            seen = t.monitor.heard.len();
            found.is_some()
        })?;
        Ok(found.map(|place| self.monitor.heard[place].clone()))
    }

    /// Does the work that is due, and takes at most one frame, at the latest at `until_ns`. Returns whether one came.
    fn look(&mut self, until_ns: u64) -> Result<bool, Stop> {
        let now_ns = self.now_ns();
        self.end.work(now_ns)?;
        self.send_waiting()?;
        let next_ns = until_ns.min(now_ns + LOOK_NS).min(self.end.next_ns());
        let frame = self.wire.receive(next_ns)?;
        let now_ns = self.now_ns();
        self.watch.look(now_ns);
        match frame {
            Some(frame) => self.take(now_ns, &frame).map(|()| true),
            None => Ok(false),
        }
    }

    fn take(&mut self, at_ns: u64, frame: &Frame) -> Result<(), Stop> {
        match self.monitor.take(self.on, at_ns, frame, self.end.state()) {
            Seen::Other => return Ok(()),
            Seen::Double(message) => {
                let partner = name(self.on.tested.partner());
                return inconclusive(format!(
                    "another node sends {message}, as the tester does: check whether a {partner} is still on this bus"
                ));
            }
            Seen::Tested => {}
        }
        self.watch.hear(at_ns);
        self.end.handle_frame(at_ns, frame);
        self.monitor.note_effect(self.end.state());
        self.send_waiting()
    }

    /// Ends a case that has heard nothing of the node under test, which is called `whom`.
    pub fn heard_nothing<T>(&self, whom: &str, hint: &str) -> Result<T, Stop> {
        let instead = self.monitor.in_words();
        inconclusive(format!(
            "no frame of a {whom} was received: check that it is on this bus{hint}. Received instead: {instead}"
        ))
    }

    /// Whether the tester's end is armed.
    pub fn is_armed(&self) -> bool {
        self.end.state() == NodeState::Operational
    }
}
