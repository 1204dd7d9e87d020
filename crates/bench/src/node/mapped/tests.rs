//! A mapped node in virtual time, driven frame by frame.

mod hostile;
mod lockstep;
mod readings;

use alloc::vec;

use super::mapping::*;
use super::*;
use crate::node::{FrameFault, NodeEvent, PublishError, PublishedSample};
use crate::rig::{ExciterSpec, Measurement, Reading};
use crate::structure::States;
use resonarm_protocol::{Id, OperatorRequest};
use resonarm_wire::checksum::{DataId, Preset};
use resonarm_wire::counter::Counter;
use resonarm_wire::layout::{ByteOrder, Layout, Number};
use resonarm_wire::multiplex::Presence;
use resonarm_wire::signal::Signal;

pub const RATE_HZ: u16 = 1000;
pub const TICK_NS: u64 = 1_000_000;
pub const DRIVE: Id = Id::Standard(0x100);
pub const SECOND: Id = Id::Standard(0x101);
pub const SYNC: Id = Id::Standard(0x80);
pub const MEAS: Id = Id::Standard(0x200);
/// Force of one count of the commands, N.
pub const COUNT_N: f64 = 0.02;

/// Up to 100 N along each axis, and 50 N·m at each joint.
pub fn exciter() -> Exciter {
    Exciter::Ideal(ExciterSpec { force_limit_n: 100.0, torque_limit_nm: 50.0, at: None })
}

pub fn signal(start: u64, bits: u64, number: Number, scale: f64) -> MappedSignal {
    let layout = Layout::new(start, bits, ByteOrder::Intel, number, 8).unwrap();
    MappedSignal { signal: Signal::new(layout, scale, 0.0).unwrap(), presence: Presence::ALWAYS }
}

/// Counter in bits 48 to 51, P1 in byte 7.
pub fn protection(data_id: u32) -> Protection {
    let counter = Layout::new(48, 4, ByteOrder::Intel, Number::Unsigned, 8).unwrap();
    let place = Layout::new(56, 8, ByteOrder::Intel, Number::Unsigned, 8).unwrap();
    let checksum = Preset::AutosarP1.checksum(place, Some(counter), &DataId::One(data_id), 8).unwrap();
    Protection { counter: Some(Counter::new(counter, 15).unwrap()), most_lost: 3, checksum: Some(checksum) }
}

/// A message with a force in bits 0 to 15, enable in bit 16 and reset in bit 17.
pub fn drive(id: Id, drive: usize, input: LoadInput) -> Incoming {
    let event = |bit, actions| EventSignal {
        name: "Bits".into(),
        signal: Some(signal(bit, 1, Number::Unsigned, 1.0)),
        counts: Counts::OnChange,
        actions,
        required: vec![],
    };
    Incoming {
        name: "Drive".into(),
        id,
        format: FrameFormat::Classic,
        length: 8,
        protection: protection(0x123),
        drive,
        commands: vec![CommandSignal {
            signal: signal(0, 16, Number::Signed, COUNT_N),
            scale: 1.0,
            offset: 0.0,
            input,
        }],
        timeout_ns: 20 * TICK_NS,
        events: vec![event(16, vec![(1.0, Action::Arm), (0.0, Action::Disarm)]), event(17, vec![(1.0, Action::Reset)])],
        is_sync: false,
    }
}

pub fn reading(start: u64, bits: u64, scale: f64, source: Source) -> ReadingSignal {
    ReadingSignal { signal: signal(start, bits, Number::Signed, scale), source }
}

/// Acceleration in bits 0 to 15, state in 16 to 23, reason in 24 to 31.
pub fn meas() -> Outgoing {
    let acceleration = Source::Value { value: Value::Reading(4), scale: 1.0, offset: 0.0 };
    let codes = vec![(EmergencyCode::CommandTimeout, 7.0)];
    Outgoing {
        id: MEAS,
        format: FrameFormat::Classic,
        payload: vec![0; 8],
        protection: protection(0x124),
        drive: 0,
        trigger: Trigger::Every(1),
        is_on_request: false,
        signals: vec![
            reading(0, 16, 0.01, acceleration),
            reading(16, 8, 1.0, Source::State([0.0, 1.0, 2.0, 3.0])),
            reading(24, 8, 1.0, Source::Reason { none: 0.0, other: 1.0, codes }),
        ],
    }
}

pub fn mapping(incoming: Vec<Incoming>) -> Mapping {
    Mapping { incoming, outgoing: vec![meas()], arming: Arming::Message, lockstep: Lockstep::Command }
}

/// A node with the controller of each of its messages.
pub struct Rig {
    pub node: MappedNode,
    pub now_ns: u64,
    pub sample: u64,
    counters: [u64; 2],
    pub events: Vec<NodeEvent>,
    pub sent: Vec<Frame>,
}

impl Rig {
    pub fn new() -> Rig {
        Rig::of(mapping(vec![drive(DRIVE, 0, LoadInput::ForceX)]), TimeBase::Clock)
    }

    pub fn of(mapping: Mapping, time_base: TimeBase) -> Rig {
        let timing = match time_base {
            TimeBase::Clock => Timing::real_time(RATE_HZ),
            TimeBase::Lockstep => Timing::lockstep(1_000_000_000),
        };
        let limits = GateSpec::default();
        let mut node = MappedNode::new(mapping, (RATE_HZ, time_base), timing, exciter(), limits);
        node.start(0);
        let mut rig = Rig { node, now_ns: 0, sample: 0, counters: [0; 2], events: vec![], sent: vec![] };
        if time_base == TimeBase::Clock {
            rig.publish(0.0);
            rig.sent.clear();
        }
        rig
    }

    /// A frame as a good controller sends it next.
    pub fn frame(&mut self, id: Id, counts: i16, enable: bool, reset: bool) -> Frame {
        let counter = &mut self.counters[usize::from(id == SECOND)];
        *counter = (*counter + 1) % 15;
        let [low, high] = counts.to_le_bytes();
        let bits = u8::from(enable) | u8::from(reset) << 1;
        let mut payload = [low, high, bits, 0, 0, 0, *counter as u8, 0];
        protection(0x123).checksum.unwrap().write(id, &mut payload).unwrap();
        Frame::new(id, FrameFormat::Classic, &payload).unwrap()
    }

    pub fn send(&mut self, id: Id, counts: i16, enable: bool) {
        let frame = self.frame(id, counts, enable, false);
        self.node.handle_frame(self.now_ns, &frame);
    }

    pub fn publish(&mut self, acceleration_m_s2: f64) {
        let reading = Reading { value: acceleration_m_s2, clipped: false };
        let measurement = Measurement {
            sample: self.sample,
            acceleration_c_m_s2: [reading, Reading::default()],
            ..Measurement::default()
        };
        let states = [1e-6, 2e-6, 3e-6, 4e-6];
        let sample =
            PublishedSample { measurement: &measurement, states: &States::new(&states, &[]).unwrap(), travel_m: None };
        self.node.publish(&sample).unwrap();
        self.sample += 1;
        self.transmit();
    }

    pub fn transmit(&mut self) {
        let mut frames = vec![];
        self.node.waiting_frames(16, &mut frames);
        frames.iter().for_each(|_| self.node.frame_sent());
        self.sent.append(&mut frames);
    }

    /// The end of a sample period of real time: judges, holds, publishes. Returns the load that is held.
    pub fn tick(&mut self) -> Load {
        self.now_ns += TICK_NS;
        self.node.handle_deadline(self.now_ns);
        let load = self.node.load();
        self.publish(0.0);
        self.events.extend(core::iter::from_fn(|| self.node.poll_event()));
        load
    }

    pub fn refusals(&self, reason: Refusal) -> u64 {
        self.node.refusals().count(reason)
    }
}

fn force_n(load: Load) -> f64 {
    load.force_n.x
}

#[test]
fn loads_act_while_it_is_armed_and_no_longer() {
    let mut rig = Rig::new();
    rig.send(DRIVE, 500, false);
    assert_eq!((force_n(rig.tick()), rig.refusals(Refusal::NotArmed)), (0.0, 1));
    rig.send(DRIVE, 500, true);
    assert_eq!((force_n(rig.tick()), rig.node.state()), (10.0, NodeState::Operational));
    rig.send(DRIVE, -250, true);
    assert_eq!(force_n(rig.tick()), -5.0);
    assert_eq!(force_n(rig.tick()), -5.0, "held");
    rig.send(DRIVE, 500, false);
    let ramp: Vec<f64> = (0..51).map(|_| force_n(rig.tick())).collect();
    // −5 N over 50 samples, 0.1 N each.
    assert_eq!((ramp[0], ramp[48], ramp[49], ramp[50]), (-4.9, -0.1, 0.0, 0.0));
    assert_eq!(rig.node.state(), NodeState::PreOperational);
}

#[test]
fn a_load_just_before_it_is_armed_is_counted_as_refused() {
    let mut rig = Rig::new();
    rig.send(DRIVE, 500, false);
    rig.node.execute(0, OperatorRequest::Arm);
    assert_eq!((force_n(rig.tick()), rig.refusals(Refusal::NotArmed)), (0.0, 1));
}

#[test]
fn what_the_exciter_cannot_produce_is_refused_and_counted() {
    let mut rig = Rig::new();
    rig.send(DRIVE, 500, true);
    rig.tick();
    rig.send(DRIVE, i16::MAX, true);
    assert_eq!((force_n(rig.tick()), rig.refusals(Refusal::OutOfRange)), (10.0, 1));
}

#[test]
fn silence_is_a_fault_and_only_a_new_request_arms_again() {
    let mut rig = Rig::new();
    rig.send(DRIVE, 500, true);
    let loads: Vec<f64> = (0..100).map(|_| force_n(rig.tick())).collect();
    // The message is valid for 20 ms: sample 19 still has the whole load, and sample 99 is long behind the ramp.
    assert_eq!((loads[19], loads[99]), (10.0, 0.0));
    let fault = rig.node.latched_fault().unwrap();
    assert_eq!((fault.code, rig.sent.last().unwrap().data()[3]), (EmergencyCode::CommandTimeout, 7));
    for _ in 0..5 {
        rig.send(DRIVE, 500, true);
        assert_eq!(force_n(rig.tick()), 0.0);
    }
    let reset = rig.frame(DRIVE, 500, true, true);
    rig.node.handle_frame(rig.now_ns, &reset);
    for _ in 0..5 {
        rig.send(DRIVE, 500, true);
        assert_eq!((force_n(rig.tick()), rig.node.state()), (0.0, NodeState::PreOperational), "enable is held");
    }
    // The enable has to leave its value before it can arm again.
    rig.send(DRIVE, 500, false);
    rig.send(DRIVE, 500, true);
    assert_eq!((force_n(rig.tick()), rig.node.state()), (10.0, NodeState::Operational));
}

#[test]
fn a_refused_load_does_not_keep_the_plant_alive() {
    let mut rig = Rig::new();
    rig.send(DRIVE, 500, true);
    for _ in 0..30 {
        rig.tick();
        // 655 N, where the exciter has 100 N: the frame is good, its load is not.
        rig.send(DRIVE, i16::MAX, true);
    }
    let fault = rig.node.latched_fault().unwrap();
    assert_eq!(Refusal::from_detail(fault.detail).1, Some(Refusal::OutOfRange));
}

#[test]
fn of_two_frames_in_a_sample_the_newest_acts() {
    let mut rig = Rig::new();
    rig.send(DRIVE, 500, true);
    rig.send(DRIVE, 250, true);
    assert_eq!(force_n(rig.tick()), 5.0);
    // The frame that was replaced is counted, since no load of it ever acts.
    assert_eq!(rig.node.frames().overwritten, 1);
}

/// An adapter that was held up hands out what it has all at once, and swaps two frames.
#[test]
fn of_a_burst_the_newest_acts_and_a_swapped_frame_is_refused() {
    let mut rig = Rig::new();
    rig.send(DRIVE, 0, true);
    rig.tick();
    let burst: Vec<Frame> = (1..=20).map(|counts| rig.frame(DRIVE, counts, true, false)).collect();
    burst.iter().for_each(|frame| rig.node.handle_frame(rig.now_ns, frame));
    assert_eq!(force_n(rig.tick()), 20.0 * COUNT_N);
    assert_eq!((rig.node.frames().overwritten, rig.node.frames().refused), (19, 0));
    let [one, other] = [30, 40].map(|counts| rig.frame(DRIVE, counts, true, false));
    [other, one].iter().for_each(|frame| rig.node.handle_frame(rig.now_ns, frame));
    assert_eq!((force_n(rig.tick()), rig.node.frames().refused), (40.0 * COUNT_N, 1));
    // Frames that are lost on the way are no fault, and commands count again as soon as the counter steps by one.
    // Made and never sent: nine lost frames are more than the three that the protection allows.
    for _ in 0..9 {
        rig.frame(DRIVE, 0, true, false);
    }
    let frames = [50, 60].map(|counts| rig.frame(DRIVE, counts, true, false));
    frames.iter().for_each(|frame| rig.node.handle_frame(rig.now_ns, frame));
    assert_eq!((force_n(rig.tick()), rig.node.is_armed()), (60.0 * COUNT_N, true));
    assert_eq!(rig.node.frames().refused, 2, "the first behind the gap");
}

#[test]
fn two_drives_add_and_a_fault_of_one_stops_both() {
    let messages = vec![drive(DRIVE, 0, LoadInput::Torque(0)), drive(SECOND, 1, LoadInput::Torque(1))];
    let mut rig = Rig::of(mapping(messages), TimeBase::Clock);
    rig.send(DRIVE, 50, true);
    rig.send(SECOND, 100, false);
    assert_eq!(rig.tick(), Load::torque_nm(1.0, 0.0), "the second is not armed");
    assert_eq!(rig.refusals(Refusal::NotArmed), 1, "what it was sent is counted");
    rig.send(SECOND, 100, true);
    assert_eq!(rig.tick(), Load::torque_nm(1.0, 2.0));
    for _ in 0..10 {
        rig.send(DRIVE, 50, true);
        rig.send(SECOND, 100, true);
        rig.tick();
    }
    rig.send(SECOND, 100, false);
    rig.send(DRIVE, 50, true);
    assert_eq!(rig.tick(), Load::torque_nm(1.0, 0.0), "a drive beside another is dropped");
    rig.send(SECOND, 100, true);
    for _ in 0..100 {
        rig.send(DRIVE, 50, true);
        rig.tick();
    }
    assert_eq!(rig.node.state(), NodeState::Fault, "the second is silent");
    assert_eq!(rig.tick(), Load::torque_nm(0.0, 0.0));
}

#[test]
fn commands_near_zero_arm_once_where_nothing_else_does() {
    let mut message = drive(DRIVE, 0, LoadInput::ForceX);
    message.events.clear();
    let mut rig = Rig::of(Mapping { arming: Arming::ZeroCommand, ..mapping(vec![message]) }, TimeBase::Clock);
    rig.send(DRIVE, 500, false);
    rig.tick();
    assert_eq!(rig.node.state(), NodeState::PreOperational, "10 N is not near zero");
    // 0.02 N, below a hundredth of the exciter's 100 N: it arms, and does not act.
    rig.send(DRIVE, 1, false);
    rig.tick();
    rig.send(DRIVE, 500, false);
    assert_eq!(force_n(rig.tick()), 10.0);
    for _ in 0..100 {
        rig.tick();
    }
    rig.node.execute(rig.now_ns, OperatorRequest::Reset);
    rig.send(DRIVE, 0, false);
    rig.tick();
    assert_eq!(rig.node.state(), NodeState::PreOperational, "never by itself after a fault");
}

#[test]
fn a_condition_has_to_hold_before_loads_count() {
    let mut message = drive(DRIVE, 0, LoadInput::ForceX);
    let mode = Some(signal(24, 8, Number::Unsigned, 1.0));
    let condition = EventSignal {
        name: "Mode".into(),
        signal: mode,
        counts: Counts::InEveryFrame,
        actions: vec![],
        required: vec![1.0],
    };
    message.events.push(condition);
    message.protection = Protection::default();
    let mut rig = Rig::of(mapping(vec![message]), TimeBase::Clock);
    let frame = |mode| Frame::new(DRIVE, FrameFormat::Classic, &[100, 0, 1, mode]).unwrap();
    rig.node.handle_frame(0, &frame(2));
    assert_eq!((force_n(rig.tick()), rig.refusals(Refusal::NotArmed)), (0.0, 1));
    rig.node.handle_frame(0, &frame(1));
    assert_eq!(force_n(rig.tick()), 2.0);
}

#[test]
fn it_leaves_and_loses_the_bus_with_a_ramp() {
    for leave in [true, false] {
        let mut rig = Rig::new();
        rig.send(DRIVE, 500, true);
        rig.tick();
        if leave {
            rig.node.leave(rig.now_ns)
        } else {
            rig.node.bus_lost(rig.now_ns)
        }
        assert!(rig.node.is_ramping() && !rig.node.is_armed());
        for _ in 0..50 {
            rig.tick();
        }
        assert!(!rig.node.is_ramping());
        rig.send(DRIVE, 500, false);
        rig.send(DRIVE, 500, true);
        assert_eq!(force_n(rig.tick()), 0.0, "{leave}");
    }
}
