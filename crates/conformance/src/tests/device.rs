//! Nodes in virtual time, on a wire that steps them.

use std::collections::VecDeque;

use super::super::{BusOff, Stopped, Wire};
use super::flaws::{Flaw, ReceiveState, SendState};
use resonarm_bench::control::OpenLoop;
use resonarm_bench::excitation::{ExcitationSpec, Profile as Excitation, Waveform};
use resonarm_bench::node::{self, ExciterNode, PlantInterface, PlantNode, PublishedSample, Timing};
use resonarm_bench::rig::{Converter, Exciter, ExciterSpec, GateSpec, Load, Measurement, Reading};
use resonarm_bus::BusError;
use resonarm_protocol::timing::LOCKSTEP_TIMEOUT_NS;
use resonarm_protocol::{Frame, Network, SamplesPerFrame, Transmitter};
use resonarm_session::run::Mode;

pub const RATE_HZ: u16 = 1000;
const TICK_NS: u64 = 1_000_000;
/// Travel of the arm under a force, m/N.
const COMPLIANCE_M_N: f64 = 1e-4;

/// The node is stopped for this long at the end of each such time, ns; frames sent meanwhile wait.
#[derive(Clone, Copy)]
pub struct Stops {
    pub for_ns: u64,
    pub every_ns: u64,
    /// End of the stops, ns.
    pub until_ns: u64,
}

fn timing(mode: Mode) -> Timing {
    match mode {
        Mode::Lockstep => Timing::lockstep(LOCKSTEP_TIMEOUT_NS),
        Mode::RealTime | Mode::Free => Timing::real_time(RATE_HZ),
    }
}

/// A node as seen from the bus.
pub trait Device {
    fn handle_frame(&mut self, now_ns: u64, frame: &Frame);
    fn tick(&mut self, now_ns: u64);
    fn poll_transmit(&mut self) -> Option<Frame>;
    /// Puts the node's controller into bus-off.
    fn lose_bus(&mut self, _now_ns: u64) {}
}

/// A bus without a node.
pub struct Nobody;

impl Device for Nobody {
    fn handle_frame(&mut self, _: u64, _: &Frame) {}
    fn tick(&mut self, _: u64) {}
    fn poll_transmit(&mut self) -> Option<Frame> {
        None
    }
}

/// A bus on which frames take no time, with one node on it.
pub struct Virtual {
    now_ns: u64,
    ticked_ns: u64,
    device: Box<dyn Device>,
    frames: VecDeque<Frame>,
    /// The tester is held up at every so many calls.
    pub held_up_every: Option<u64>,
    /// Time for which the tester is held up, ns.
    pub held_up_ns: u64,
    calls: u64,
    pub stops: Option<Stops>,
    waiting: Vec<Frame>,
    /// End of the bus-off of the node's controller, ns.
    off_until_ns: u64,
    /// End of the tester's stop of the node, ns.
    stopped_until_ns: u64,
}

impl Virtual {
    /// Makes a bus on which frames that were sent earlier wait.
    pub fn with_waiting(device: Box<dyn Device>, frames: impl IntoIterator<Item = Frame>) -> Virtual {
        Virtual { frames: frames.into_iter().collect(), ..Virtual::new(device) }
    }

    pub fn new(device: Box<dyn Device>) -> Virtual {
        Virtual {
            now_ns: 0,
            ticked_ns: 0,
            device,
            frames: VecDeque::new(),
            held_up_every: None,
            held_up_ns: 30 * TICK_NS,
            calls: 0,
            stops: None,
            waiting: Vec::new(),
            off_until_ns: 0,
            stopped_until_ns: 0,
        }
    }

    fn is_stopped(&self) -> bool {
        let is_stopped_again = self.stops.is_some_and(|Stops { for_ns, every_ns, until_ns }| {
            self.ticked_ns < until_ns && self.ticked_ns % every_ns >= every_ns - for_ns
        });
        is_stopped_again || self.ticked_ns < self.stopped_until_ns
    }

    fn step(&mut self) {
        self.ticked_ns += TICK_NS;
        if self.is_stopped() {
            return;
        }
        for frame in self.waiting.drain(..) {
            self.device.handle_frame(self.ticked_ns, &frame);
        }
        self.device.tick(self.ticked_ns);
        if self.ticked_ns >= self.off_until_ns {
            self.collect();
        }
    }

    fn collect(&mut self) {
        self.frames.extend(std::iter::from_fn(|| self.device.poll_transmit()));
    }
}

impl Wire for Virtual {
    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if self.now_ns < self.off_until_ns {
            return Ok(());
        }
        if self.is_stopped() {
            self.waiting.push(*frame);
            return Ok(());
        }
        self.device.handle_frame(self.now_ns, frame);
        self.collect();
        Ok(())
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Frame>, BusError> {
        self.calls += 1;
        if self.held_up_every.is_some_and(|every| self.calls.is_multiple_of(every)) {
            self.now_ns += self.held_up_ns;
        }
        while self.frames.is_empty() && self.now_ns < until_ns {
            self.now_ns = until_ns.min(self.ticked_ns + TICK_NS).max(self.now_ns);
            while self.ticked_ns + TICK_NS <= self.now_ns {
                self.step();
            }
        }
        Ok(self.frames.pop_front())
    }

    fn take_off(&mut self, for_ns: u64) -> BusOff {
        self.device.lose_bus(self.now_ns);
        self.off_until_ns = self.now_ns + for_ns;
        BusOff::Done
    }

    fn stop_node(&mut self, for_ns: u64) -> Stopped {
        self.stopped_until_ns = self.now_ns + for_ns;
        Stopped::Done
    }
}

/// The plant's node with an arm at rest: the head reads the load held.
pub struct PlantDevice {
    pub network: Network,
    pub mode: Mode,
    pub node: PlantNode,
    pub flaw: Option<Flaw>,
    pub load: Load,
    pub unarmed_load: Load,
    /// The next sample to be measured.
    pub sample: u64,
    /// Whether the sample measured last is to be answered, in lockstep.
    is_awaited: bool,
    pub counters: [u8; 16],
    /// Makes the frames that the node believes it heard.
    pub transmitter: Transmitter,
    pub receive_state: ReceiveState,
    pub send_state: SendState,
}

impl PlantDevice {
    pub fn new(network: Network) -> PlantDevice {
        PlantDevice::with(network, None)
    }

    pub fn with(network: Network, flaw: Option<Flaw>) -> PlantDevice {
        PlantDevice::in_mode(Mode::RealTime, network, flaw)
    }

    pub fn in_mode(mode: Mode, network: Network, flaw: Option<Flaw>) -> PlantDevice {
        let mut timing = timing(mode);
        match flaw {
            Some(Flaw::NoTimeout) => timing.command_timeout_ns = u64::MAX / 2,
            Some(Flaw::CountsWallClock) => timing.look_period_ns = u64::MAX / 2,
            _ => {}
        }
        let mut node = PlantNode::new(network, RATE_HZ, timing, exciter(flaw))
            .with_limits(limits(flaw))
            .with_samples_per_frame(SamplesPerFrame::Two);
        node.start(0);
        PlantDevice {
            network,
            mode,
            node,
            flaw,
            load: Load::default(),
            unarmed_load: Load::default(),
            sample: 0,
            is_awaited: false,
            counters: [0; 16],
            transmitter: Transmitter::new(network),
            receive_state: ReceiveState::default(),
            send_state: SendState::default(),
        }
    }
}

impl PlantDevice {
    /// Whether the next sample has to wait, in lockstep.
    fn waits(&self) -> bool {
        match self.node.is_armed() {
            true => self.is_awaited && !self.node.is_answered() && self.flaw != Some(Flaw::RunsOn),
            false => self.sample == 0,
        }
    }

    /// The accelerometer at B reads a value along x beyond its range.
    fn measure(&mut self) {
        let reading = |value| Reading { value, clipped: false };
        let head_force_n = [reading(self.load.force_n.x), reading(self.load.force_n.y)];
        let acceleration_b_m_s2 = [Reading { value: 2000.0, clipped: true }, reading(0.0)];
        let sample = self.sample;
        let measurement = Measurement { sample, head_force_n, acceleration_b_m_s2, ..Measurement::default() };
        let travel_m = Some(self.load.force_n.x.abs() * COMPLIANCE_M_N);
        self.node.publish(&PublishedSample { travel_m, ..PublishedSample::of(&measurement) }).unwrap();
        self.sample += 1;
    }

    fn hold(&mut self) {
        let load = self.node.load();
        self.load = self.alter_load(load);
    }
}

/// An exciter with the default limits, or with none if that is the flaw.
fn exciter(flaw: Option<Flaw>) -> Exciter {
    match flaw {
        Some(Flaw::ForgetsLimits) => Exciter::Ideal(ExciterSpec { force_limit_n: 1e9, ..ExciterSpec::default() }),
        _ => Exciter::default(),
    }
}

/// A change of 20 N in a sample period, and the travel under 100 N; none that would hide the flaw.
fn limits(flaw: Option<Flaw>) -> GateSpec {
    let all = GateSpec {
        force_rate_limit_n_per_s: Some(20e3),
        torque_rate_limit_nm_per_s: None,
        travel_limit_m: Some(100.0 * COMPLIANCE_M_N),
    };
    match flaw {
        Some(Flaw::Jumps) => GateSpec { force_rate_limit_n_per_s: None, ..all },
        Some(Flaw::Strays) => GateSpec { travel_limit_m: None, ..all },
        Some(Flaw::Cuts | Flaw::ForgetsLimits) => GateSpec::default(),
        _ => all,
    }
}

impl Device for PlantDevice {
    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        for frame in self.alter_heard(frame) {
            self.node.handle_frame(now_ns, &frame);
        }
    }

    fn tick(&mut self, now_ns: u64) {
        self.receive_state = self.receive_state.rested();
        self.send_state.now_ns = now_ns;
        self.node.handle_deadline(now_ns);
        match self.mode {
            Mode::Lockstep if self.waits() => {}
            Mode::Lockstep => {
                if self.sample > 0 {
                    self.hold();
                }
                self.is_awaited = self.node.is_armed();
                self.measure();
            }
            Mode::RealTime | Mode::Free => {
                self.measure();
                self.hold();
            }
        }
    }

    fn lose_bus(&mut self, now_ns: u64) {
        self.node.bus_lost(now_ns);
    }

    fn poll_transmit(&mut self) -> Option<Frame> {
        loop {
            let Some(frame) = self.node.poll_transmit() else { return self.send_state.due() };
            if let Some(frame) = self.alter_sent(frame) {
                return Some(frame);
            }
        }
    }
}

/// The exciter's node with a long dwell.
pub struct ExciterDevice {
    pub network: Network,
    pub node: ExciterNode,
    pub flaw: Option<Flaw>,
    pub is_dead: bool,
    /// Makes the frames that the node believes it heard.
    pub transmitter: Transmitter,
    pub receive_state: ReceiveState,
    pub send_state: SendState,
}

impl ExciterDevice {
    pub fn new(network: Network) -> ExciterDevice {
        ExciterDevice::with(network, None)
    }

    pub fn with(network: Network, flaw: Option<Flaw>) -> ExciterDevice {
        ExciterDevice::in_mode(Mode::RealTime, network, flaw)
    }

    pub fn in_mode(mode: Mode, network: Network, flaw: Option<Flaw>) -> ExciterDevice {
        let amplitude = Load::force_n(20.0, 0.0);
        let frequency_hz = match flaw {
            Some(Flaw::FastBy(ppm)) => 15.0 * (1.0 + 1e-6 * f64::from(ppm)),
            _ => 15.0,
        };
        let profile = Waveform::Dwell { frequency_hz, duration_s: 60.0, settle_s: 0.1 };
        let spec = ExcitationSpec { amplitude, ramp_s: 0.05, profile };
        let profile = Excitation::new(&spec, f64::from(RATE_HZ)).unwrap();
        let controller = Box::new(OpenLoop::new(profile, Converter::default()));
        let mut timing = timing(if flaw == Some(Flaw::Impatient) { Mode::RealTime } else { mode });
        match flaw {
            Some(Flaw::NoTimeout) => timing.partner_timeout_ns = u64::MAX / 2,
            Some(Flaw::SlowTimeout) => timing.partner_timeout_ns *= 2,
            _ => {}
        }
        let mut node = node::carry(network, RATE_HZ, timing, controller);
        node.start(0);
        ExciterDevice {
            network,
            node,
            flaw,
            is_dead: false,
            transmitter: Transmitter::new(network),
            receive_state: ReceiveState::default(),
            send_state: SendState::default(),
        }
    }

    /// Leaves the bus when its work is over, as the program does.
    fn leave(&mut self, now_ns: u64) {
        if self.node.outcome().is_some() {
            self.node.leave(now_ns);
        }
    }
}

impl Device for ExciterDevice {
    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        for frame in self.alter_heard(frame) {
            self.node.handle_frame(now_ns, &frame);
        }
        self.leave(now_ns);
    }

    fn tick(&mut self, now_ns: u64) {
        self.receive_state = self.receive_state.rested();
        self.send_state.now_ns = now_ns;
        if !self.node.is_quiet() {
            self.node.handle_deadline(now_ns);
            self.leave(now_ns);
        }
    }

    fn lose_bus(&mut self, now_ns: u64) {
        self.node.bus_lost(now_ns);
    }

    fn poll_transmit(&mut self) -> Option<Frame> {
        loop {
            let Some(frame) = self.node.poll_transmit() else { return self.send_state.due() };
            if let Some(frame) = self.alter_sent(frame) {
                return Some(frame);
            }
        }
    }
}

/// An exciter that hears nothing until a time, and is restarted whenever it has ended.
pub struct StartedAgain {
    exciter: ExciterDevice,
    listens_from_ns: u64,
    waiting: Vec<Frame>,
}

impl StartedAgain {
    pub fn new(exciter: ExciterDevice, listens_from_ns: u64) -> StartedAgain {
        StartedAgain { exciter, listens_from_ns, waiting: Vec::new() }
    }
}

impl Device for StartedAgain {
    fn handle_frame(&mut self, now_ns: u64, frame: &Frame) {
        match now_ns < self.listens_from_ns {
            true => self.waiting.push(*frame),
            false => self.exciter.handle_frame(now_ns, frame),
        }
    }

    fn tick(&mut self, now_ns: u64) {
        if now_ns >= self.listens_from_ns {
            for frame in self.waiting.drain(..) {
                self.exciter.handle_frame(now_ns, &frame);
            }
        }
        if self.exciter.node.is_quiet() && self.exciter.send_state.is_empty() {
            self.exciter = ExciterDevice::with(self.exciter.network, self.exciter.flaw);
        }
        self.exciter.tick(now_ns);
    }

    fn poll_transmit(&mut self) -> Option<Frame> {
        self.exciter.poll_transmit()
    }

    fn lose_bus(&mut self, now_ns: u64) {
        self.exciter.lose_bus(now_ns);
    }
}
