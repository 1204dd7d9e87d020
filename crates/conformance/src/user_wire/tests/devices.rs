//! Nodes on users' own protocols in virtual time, with what a flaw alters of their frames.

use super::*;
use resonarm_bench::control::{Controller, OpenLoop};
use resonarm_bench::excitation::Profile;
use resonarm_bench::node::{ExciterInterface, PlantInterface, PublishedSample};
use resonarm_bench::rig::Load;
use resonarm_bench::rig::{Converter, Exciter, GateSpec, Measurement, Reading};
use resonarm_bench::structure::States;

/// Time for which a controller is away before it is started, and started again, ns.
const AWAY_NS: u64 = 200_000_000;
/// The period of a device's samples, ns.
const PERIOD_NS: u64 = 5_000_000;

/// Alters the frames of a node: those that it hears, and those that it sends. It sees the time, ns, and the number of
/// the frame.
#[derive(Clone, Copy)]
pub struct Flaw {
    pub hears: fn(&UserWire, &mut Context, Frame) -> Vec<Frame>,
    pub sends: fn(&UserWire, &mut Context, Frame) -> Vec<Frame>,
    /// Load that a plant holds for a commanded one.
    pub holds: fn(Load) -> Load,
    /// Changes the scenario of the device against that of the tester.
    pub spec: fn(&mut WireSpec),
}

/// State that a flaw may use.
#[derive(Default)]
pub struct Context {
    pub now_ns: u64,
    pub heard: u64,
    pub sent: u64,
    pub last: Option<Frame>,
    pub has_armed: bool,
}

pub fn as_it_is(_: &UserWire, _: &mut Context, frame: Frame) -> Vec<Frame> {
    vec![frame]
}

/// The frame of a message of the mapping with another payload, and the checksum that belongs to it.
pub fn redone(on: &UserWire, frame: &Frame, change: impl FnOnce(&mut [u8])) -> Frame {
    let mapping = on.mapping().unwrap();
    let incoming = mapping.incoming.iter().map(|message| (message.id, &message.protection));
    let mut all = incoming.chain(mapping.outgoing.iter().map(|message| (message.id, &message.protection)));
    let (_, protection) = all.find(|(id, _)| *id == frame.id()).unwrap();
    let mut payload = frame.data().to_vec();
    change(&mut payload);
    if let Some(checksum) = &protection.checksum {
        checksum.write(frame.id(), &mut payload).unwrap();
    }
    Frame::new(frame.id(), frame.format(), &payload).unwrap()
}

/// The frame with these bytes, as it is.
pub fn raw(frame: &Frame, change: impl FnOnce(&mut Vec<u8>)) -> Frame {
    let mut payload = frame.data().to_vec();
    change(&mut payload);
    Frame::new(frame.id(), frame.format(), &payload).unwrap()
}

pub const NONE: Flaw = Flaw { hears: as_it_is, sends: as_it_is, holds: |load| load, spec: |_| {} };

/// The emulated exciter with the scenario's excitation, started again whenever it ends.
pub struct ControllerDevice {
    on: UserWire,
    node: Box<dyn ExciterInterface>,
    flaw: Flaw,
    context: Context,
    starts_at_ns: u64,
    has_started: bool,
    queue: Vec<Frame>,
}

fn controller(on: &UserWire) -> Box<dyn Controller> {
    let spec = on.scenario().excitation.as_ref().unwrap();
    Box::new(OpenLoop::new(Profile::new(spec, f64::from(on.rate_hz)).unwrap(), Converter::default()))
}

impl ControllerDevice {
    pub fn new(on: UserWire, flaw: Flaw) -> ControllerDevice {
        let node = on.spec.exciter(on.rate(), on.timing, controller(&on)).unwrap();
        let context = Context::default();
        ControllerDevice { on, node, flaw, context, starts_at_ns: AWAY_NS, has_started: false, queue: Vec::new() }
    }

    fn collect(&mut self) {
        while let Some(frame) = self.node.next_frame() {
            self.node.frame_sent();
            self.context.sent += 1;
            let sent = (self.flaw.sends)(&self.on, &mut self.context, frame);
            self.context.last = sent.last().copied().or(self.context.last);
            self.queue.extend(sent);
        }
    }
}

impl Device for ControllerDevice {
    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        if !self.has_started || self.node.outcome().is_some() {
            return;
        }
        self.context.now_ns = now_ns;
        self.context.heard += 1;
        for frame in (self.flaw.hears)(&self.on, &mut self.context, *frame) {
            self.node.handle_frame(now_ns, &frame);
        }
        self.collect();
    }

    fn tick(&mut self, now_ns: u64) {
        self.context.now_ns = now_ns;
        if !self.has_started && now_ns >= self.starts_at_ns {
            self.node = self.on.spec.exciter(self.on.rate(), self.on.timing, controller(&self.on)).unwrap();
            self.node.start(now_ns);
            self.context.has_armed = false;
            self.has_started = true;
        }
        if self.has_started && self.node.is_quiet() {
            (self.has_started, self.starts_at_ns) = (false, now_ns + AWAY_NS);
        }
        if self.has_started {
            self.node.handle_deadline(now_ns);
            self.collect();
        }
    }

    fn poll_transmit(&mut self) -> Option<Frame> {
        if self.queue.is_empty() { None } else { Some(self.queue.remove(0)) }
    }
}

/// The plant's node with an arm at rest, whose head reads the load held.
pub struct PlantDevice {
    on: UserWire,
    node: Box<dyn PlantInterface>,
    flaw: Flaw,
    context: Context,
    load: Load,
    sample: u64,
    is_awaited: bool,
    due_ns: u64,
    queue: Vec<Frame>,
}

impl PlantDevice {
    pub fn new(on: UserWire, flaw: Flaw) -> PlantDevice {
        let mut spec = on.spec.clone();
        (flaw.spec)(&mut spec);
        let mut node = spec.node(on.rate(), on.timing, Exciter::default(), GateSpec::default());
        node.start(0);
        let (load, context) = (Load::default(), Context::default());
        PlantDevice { on, node, flaw, context, load, sample: 0, is_awaited: false, due_ns: 0, queue: Vec::new() }
    }

    fn waits(&self, now_ns: u64) -> bool {
        match (self.on.mode, self.node.is_armed()) {
            (Mode::Lockstep, true) => self.is_awaited && !self.node.is_answered(),
            (Mode::Lockstep, false) => self.sample == 0 || now_ns < self.due_ns,
            _ => now_ns < self.due_ns,
        }
    }

    fn collect(&mut self) {
        loop {
            let mut frames = Vec::new();
            self.node.waiting_frames(1, &mut frames);
            let Some(frame) = frames.pop() else { return };
            self.node.frame_sent();
            self.context.sent += 1;
            let sent = (self.flaw.sends)(&self.on, &mut self.context, frame);
            self.context.last = sent.last().copied().or(self.context.last);
            self.queue.extend(sent);
        }
    }
}

impl Device for PlantDevice {
    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        self.context.now_ns = now_ns;
        self.context.heard += 1;
        for frame in (self.flaw.hears)(&self.on, &mut self.context, *frame) {
            self.node.handle_frame(now_ns, &frame);
        }
        self.collect();
    }

    fn tick(&mut self, now_ns: u64) {
        if self.on.mode == Mode::Lockstep || now_ns >= self.due_ns {
            self.node.handle_deadline(now_ns);
        }
        if !self.waits(now_ns) {
            self.due_ns = now_ns + PERIOD_NS;
            self.is_awaited = self.node.is_armed();
            if self.sample > 0 {
                let held = self.node.load();
                self.load = (self.flaw.holds)(held);
            }
            let reading = |value| Reading { value, clipped: false };
            let head_force_n = [reading(self.load.force_n.x), reading(self.load.force_n.y)];
            let measurement = Measurement { sample: self.sample, head_force_n, ..Measurement::default() };
            let published = PublishedSample {
                measurement: &measurement,
                states: &States::new(&[0.0; 4], &[]).unwrap(),
                travel_m: None,
            };
            self.node.publish(&published).unwrap();
            self.sample += 1;
        }
        self.collect();
    }

    fn poll_transmit(&mut self) -> Option<Frame> {
        if self.queue.is_empty() { None } else { Some(self.queue.remove(0)) }
    }
}
