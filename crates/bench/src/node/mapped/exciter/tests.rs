//! A mapped exciter and a mapped plant in virtual time, frame by frame.

mod hostile;
mod lacks;
mod pages;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::*;
use crate::control::{Controller, Length, LoadKind, ResponsePoint};
use crate::node::mapped::MappedNode;
use crate::node::mapped::mapping::*;
use crate::node::mapped::tests::*;
use crate::node::tests::check_that_rejected_frames_hide_no_transition;
use crate::node::{ExciterRemark, FrameCheck, FrameFault, NodeEvent, PlantInterface, PublishedSample, Refusals};
use crate::rig::{GateSpec, Measurement, Reading};
use crate::structure::States;
use resonarm_protocol::{Frame, FrameFormat, Id, Node, OperatorRequest, Refusal};

/// Holds one count more along x at each sample, and ends after some.
#[derive(Debug)]
pub struct Steps {
    pub samples: u64,
    pub needs: [bool; 6],
}

impl Controller for Steps {
    fn load_kind(&self) -> LoadKind {
        LoadKind::Force
    }

    fn needs(&self) -> Vec<NeededReading> {
        NeededReading::marked(self.needs)
    }

    fn restart(&mut self) {}

    fn answer(&mut self, sample: &Measurement) -> Answer {
        let load = Load::force_n(COUNT_N * (sample.sample + 1) as f64, 0.0);
        if sample.sample < self.samples { Answer::Hold(load) } else { Answer::Finished }
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        None
    }

    fn length(&self) -> Length {
        Length::Samples(self.samples)
    }
}

pub fn steps(samples: u64) -> Box<Steps> {
    Box::new(Steps { samples, needs: [false; 6] })
}

/// Both nodes, and the frames between them.
struct Pair {
    plant: MappedNode,
    exciter: MappedExciter,
    now_ns: u64,
    sample: u64,
    /// Changes the frames of the plant on their way; `None` loses a frame.
    damage: fn(u64, Frame) -> Option<Frame>,
    frames: u64,
    /// The frames of the plant.
    sent: Vec<Frame>,
    events: Vec<NodeEvent>,
}

impl Pair {
    fn of(mapping: Mapping, time_base: TimeBase, samples: u64) -> Pair {
        let timing = match time_base {
            TimeBase::Clock => Timing::real_time(RATE_HZ),
            TimeBase::Lockstep => Timing::lockstep(1_000_000_000),
        };
        let rate = (RATE_HZ, time_base);
        let exciter_node = MappedExciter::new(&mapping, rate, timing, steps(samples)).unwrap();
        let plant = MappedNode::new(mapping, rate, timing, exciter(), GateSpec::default());
        let damage = |_, frame| Some(frame);
        let (sent, events) = (vec![], vec![]);
        let mut pair = Pair { plant, exciter: exciter_node, now_ns: 0, sample: 0, damage, frames: 0, sent, events };
        pair.plant.start(0);
        pair.exciter.start(0);
        pair.exchange();
        pair
    }

    fn new(samples: u64) -> Pair {
        Pair::of(mapping(vec![drive(DRIVE, 0, LoadInput::ForceX)]), TimeBase::Clock, samples)
    }

    fn exchange(&mut self) {
        self.plant.handle_deadline(self.now_ns);
        self.exciter.handle_deadline(self.now_ns);
        loop {
            let mut frames = vec![];
            self.plant.waiting_frames(1, &mut frames);
            if let Some(frame) = frames.pop() {
                self.plant.frame_sent();
                self.frames += 1;
                self.sent.push(frame);
                if let Some(frame) = (self.damage)(self.frames, frame) {
                    self.exciter.handle_frame(self.now_ns, &frame);
                }
            } else if let Some(frame) = self.exciter.next_frame() {
                self.exciter.frame_sent();
                self.plant.handle_frame(self.now_ns, &frame);
            } else {
                break;
            }
            self.plant.handle_deadline(self.now_ns);
        }
        self.events.extend(core::iter::from_fn(|| self.exciter.poll_event()));
    }

    /// A sample; the force that is held from it on.
    fn tick(&mut self) -> f64 {
        let reading = Reading { value: self.sample as f64, clipped: false };
        let measurement = Measurement {
            sample: self.sample,
            acceleration_c_m_s2: [reading, Reading::default()],
            ..Measurement::default()
        };
        let states = [0.0; 4];
        self.plant
            .publish(&PublishedSample {
                measurement: &measurement,
                states: &States::new(&states, &[]).unwrap(),
                travel_m: None,
            })
            .unwrap();
        self.exchange();
        let load = self.plant.load();
        (self.sample, self.now_ns) = (self.sample + 1, self.now_ns + TICK_NS);
        load.force_n.x
    }

    fn ticks(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| self.tick()).collect()
    }

    /// Returns the measurements that the exciter received and the loads that it gave.
    fn answers(&mut self) -> Vec<(Measurement, Load)> {
        core::iter::from_fn(|| self.exciter.carried_mut().poll_answer()).collect()
    }

    fn refused(&self) -> u64 {
        let refusals: &Refusals = self.plant.refusals();
        [Refusal::NotArmed, Refusal::Repeated, Refusal::OutOfRange].iter().map(|of| refusals.count(*of)).sum()
    }

    fn fault(&self) -> Option<(Node, EmergencyCode)> {
        match self.exciter.outcome() {
            Some(ExciterOutcome::Faulted(emergency)) => Some((emergency.node, emergency.code)),
            _ => None,
        }
    }
}

/// Returns the forces in counts.
fn counts(forces: &[f64]) -> Vec<i64> {
    forces.iter().map(|force| libm::round(force / COUNT_N) as i64).collect()
}

#[test]
fn it_arms_answers_every_sample_and_disarms() {
    let mut pair = Pair::new(4);
    // The first sample arms the plant: its answer is no load.
    assert_eq!(counts(&pair.ticks(5)), [0, 1, 2, 3, 4]);
    assert_eq!((pair.refused(), pair.plant.frames().refused, pair.exciter.frames().refused), (0, 0, 0));
    let answers: Vec<_> = pair.answers().iter().map(|(read, load)| (read.sample, load.force_n.x)).collect();
    // Answers not fetched in time are dropped.
    assert_eq!(answers, [(0, COUNT_N), (1, 2.0 * COUNT_N)]);
    pair.ticks(2);
    assert_eq!(pair.exciter.outcome(), Some(ExciterOutcome::Finished));
    assert!(!pair.plant.is_armed() && pair.exciter.is_quiet() && pair.plant.latched_fault().is_none());
    let states: Vec<_> = pair.events.iter().map(|event| matches!(event, NodeEvent::State { .. })).collect();
    assert_eq!(states, [true; 3]);
}

#[test]
fn readings_reach_the_controller_in_si_units_and_what_is_missing_is_no_number() {
    let mut pair = Pair::new(9);
    pair.ticks(2);
    let (read, _) = pair.answers()[0];
    assert_eq!((read.acceleration_c_m_s2[0].value, read.acceleration_c_m_s2[0].clipped), (1.0, false));
    assert!(read.acceleration_c_m_s2[1].value.is_nan() && read.head_force_n[0].value.is_nan());
}

#[test]
fn in_lockstep_the_first_sample_has_the_first_load() {
    let messages = vec![drive(DRIVE, 0, LoadInput::ForceX), drive(SECOND, 0, LoadInput::ForceY)];
    // A sample of two messages: the first is no reason to ask again.
    let part = Outgoing { id: Id::Standard(0x1FF), ..meas() };
    let outgoing = vec![part, meas()];
    let mut pair = Pair::of(Mapping { outgoing, ..mapping(messages) }, TimeBase::Lockstep, 3);
    assert!(pair.plant.is_armed(), "a plant in lockstep says nothing before it is armed");
    let forces: Vec<f64> = (0..3)
        .map(|_| {
            let force_n = pair.tick();
            assert!(pair.plant.is_answered());
            force_n
        })
        .collect();
    assert_eq!(counts(&forces), [1, 2, 3]);
    pair.tick();
    assert!(!pair.plant.is_armed() && pair.plant.latched_fault().is_none());
}

/// A third-party plant is not silent after it was armed, and reports the arming only after its first sample. The exciter
/// takes the last sample as the first one of the armed plant: after longer than our own plant is silent, and within the
/// second for which such a plant waits for a command.
#[test]
fn in_lockstep_a_plant_that_says_late_that_it_is_armed_is_answered_within_a_second() {
    let bare = Outgoing { protection: Protection::default(), signals: meas().signals[..1].to_vec(), ..meas() };
    let state = vec![reading(0, 8, 1.0, Source::State([0.0, 1.0, 2.0, 3.0]))];
    let status = Outgoing { id: SECOND, trigger: Trigger::Period(100 * TICK_NS), signals: state, ..bare.clone() };
    let mapping = Mapping { outgoing: vec![bare, status], ..mapping(vec![drive(DRIVE, 0, LoadInput::ForceX)]) };
    let timing = Timing::lockstep(10_000 * TICK_NS);
    let mut exciter = MappedExciter::new(&mapping, (RATE_HZ, TimeBase::Lockstep), timing, steps(3)).unwrap();
    exciter.expect_unarmed_readings();
    exciter.start(0);
    let frame = |id, byte| Frame::new(id, FrameFormat::Classic, &[byte, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    let is_loaded = |exciter: &mut MappedExciter| {
        let mut is_loaded = false;
        while let Some(frame) = exciter.next_frame() {
            exciter.frame_sent();
            is_loaded |= frame.data()[0] != 0;
        }
        is_loaded
    };
    let (mut answered_ms, first_ms) = (None, 40);
    for ms in 0..2000 {
        let now_ns = ms * TICK_NS;
        exciter.handle_deadline(now_ns);
        if ms % 100 == 0 {
            exciter.handle_frame(now_ns, &frame(SECOND, if ms > first_ms { 2 } else { 1 }));
        }
        if ms <= first_ms && ms % 4 == 0 {
            exciter.handle_frame(now_ns, &frame(MEAS, 0));
        }
        if is_loaded(&mut exciter) {
            answered_ms.get_or_insert(ms - first_ms);
        }
    }
    assert!(answered_ms.is_some_and(|ms| (650..900).contains(&ms)), "{answered_ms:?}");
}

#[test]
fn the_message_that_synchronises_answers() {
    let bare = Incoming { protection: Protection::default(), length: 0, ..drive(SYNC, 0, LoadInput::ForceX) };
    let sync = Incoming { commands: vec![], events: vec![], is_sync: true, ..bare };
    let messages = vec![sync, drive(DRIVE, 0, LoadInput::ForceX)];
    let by_sync = Mapping { lockstep: Lockstep::Sync, ..mapping(messages) };
    let mut pair = Pair::of(by_sync.clone(), TimeBase::Lockstep, 3);
    assert_eq!(counts(&pair.ticks(3)), [1, 2, 3]);
    assert_eq!(pair.plant.latched_fault(), None);
    // In real time readings come on it, once a sample.
    let outgoing = vec![Outgoing { trigger: Trigger::Sync, ..meas() }];
    let mut pair = Pair::of(Mapping { outgoing, ..by_sync }, TimeBase::Clock, 100);
    assert_eq!(counts(&pair.ticks(5)), [0, 1, 2, 3, 4]);
}

#[test]
fn lost_readings_are_counted_and_the_index_goes_on() {
    let mut pair = Pair::new(100);
    pair.damage = |number, frame| (!(10..12).contains(&number)).then_some(frame);
    assert_eq!(counts(&pair.ticks(14)[7..]), [7, 8, 8, 8, 11, 12, 13]);
    assert_eq!((pair.exciter.work().missed_samples(), pair.exciter.samples_played()), (2, 13));
}

#[test]
fn damaged_readings_are_refused() {
    let mut pair = Pair::new(100);
    pair.damage = |number, frame| {
        let mut data = frame.data().to_vec();
        data[0] ^= u8::from(number == 6);
        Frame::new(frame.id(), frame.format(), &data).ok()
    };
    assert_eq!(counts(&pair.ticks(8)), [0, 1, 2, 3, 4, 4, 6, 7]);
    let refused = NodeEvent::Frame(FrameFault::Mapped { id: MEAS, check: FrameCheck::Checksum });
    assert!(pair.events.contains(&refused) && pair.exciter.frames().refused == 1);
}

#[test]
fn silence_is_a_fault_and_the_plant_is_asked_to_disarm() {
    let mut pair = Pair::new(1000);
    pair.ticks(5);
    pair.damage = |_, _| None;
    // The message is valid for 20 ms in real time: the plant faults first.
    pair.ticks(400);
    assert_eq!(pair.fault(), Some((Node::Exciter, EmergencyCode::SensorTimeout)));
    assert!(pair.exciter.is_quiet());
}

#[test]
fn the_plant_says_why_it_has_faulted_and_is_armed_again() {
    let mut pair = Pair::new(1000);
    pair.ticks(5);
    pair.plant.fault(pair.now_ns, EmergencyCode::CommandTimeout, 0);
    pair.tick();
    assert_eq!(pair.fault(), Some((Node::Plant, EmergencyCode::CommandTimeout)));
    assert!(pair.exciter.rearm(pair.now_ns));
    let forces = pair.ticks(200);
    assert!(pair.plant.is_armed() && pair.exciter.state() == NodeState::Operational);
    let first = forces.iter().rposition(|force| *force == 0.0).unwrap();
    assert_eq!(counts(&forces[first + 1..first + 4]), [1, 2, 3], "it begins anew");
    // A fault that has no number here.
    pair.plant.fault(pair.now_ns, EmergencyCode::Overrun, 3);
    pair.tick();
    assert_eq!(pair.fault(), Some((Node::Exciter, EmergencyCode::PartnerFault)));
}

#[test]
fn a_plant_that_somebody_disarms_ends_the_work() {
    let mut pair = Pair::new(1000);
    pair.ticks(5);
    pair.plant.execute(pair.now_ns, OperatorRequest::Disarm);
    pair.ticks(2);
    assert_eq!(pair.exciter.outcome(), Some(ExciterOutcome::Stopped));
}

/// A frame with the enable, of a controller that has gone.
fn enable_by_another(pair: &mut Pair) {
    let mut payload = [0, 0, 1, 0, 0, 0, 14, 0];
    protection(0x123).checksum.unwrap().write(DRIVE, &mut payload).unwrap();
    pair.plant.handle_frame(0, &Frame::new(DRIVE, FrameFormat::Classic, &payload).unwrap());
    assert!(pair.plant.is_armed());
}

#[test]
fn enable_that_is_held_goes_back_to_rest_before_it_arms_again() {
    let mut pair = Pair::new(1000);
    enable_by_another(&mut pair);
    pair.plant.execute(0, OperatorRequest::Disarm);
    pair.ticks(200);
    assert!(pair.plant.is_armed() && pair.exciter.samples_played() > 50);
}

#[test]
fn another_controller_is_a_fault() {
    let mut pair = Pair::new(1000);
    pair.ticks(5);
    let frame = Frame::new(DRIVE, FrameFormat::Classic, &[0; 8]).unwrap();
    pair.exciter.handle_frame(pair.now_ns, &frame);
    assert_eq!(pair.fault(), Some((Node::Exciter, EmergencyCode::SecondSender)));
    assert_eq!(pair.exciter.frames().other_sender, 1);
}

#[test]
fn it_leaves_in_order_and_ends_beside_a_plant_that_has_ended() {
    let mut pair = Pair::new(1000);
    pair.ticks(5);
    pair.exciter.leave(pair.now_ns);
    pair.ticks(2);
    assert_eq!(pair.exciter.outcome(), Some(ExciterOutcome::Stopped));
    assert!(!pair.plant.is_armed() && !pair.exciter.rearm(pair.now_ns));
    let mut pair = Pair::new(1000);
    pair.ticks(5);
    pair.exciter.plant_ended(pair.now_ns);
    assert_eq!(pair.exciter.outcome(), Some(ExciterOutcome::PlantLeft));
}

#[test]
fn a_plant_that_is_silent_after_the_end_was_asked_three_times() {
    let mut pair = Pair::new(4);
    pair.ticks(5);
    pair.damage = |_, _| None;
    let mut asked = vec![];
    // The last sample.
    pair.exciter.leave(pair.now_ns);
    for _ in 0..400 {
        pair.exciter.handle_deadline(pair.now_ns);
        while let Some(frame) = pair.exciter.next_frame() {
            pair.exciter.frame_sent();
            asked.push(frame);
        }
        pair.now_ns += TICK_NS;
    }
    assert_eq!(pair.exciter.outcome(), Some(ExciterOutcome::Stopped));
    assert_eq!(asked.len(), 3);
    assert!(asked.iter().all(|frame| frame.data()[..3] == [0, 0, 0]));
}

#[test]
fn a_plant_without_a_word_of_its_state_counts_as_armed_once_it_was_asked() {
    let mut silent = mapping(vec![drive(DRIVE, 0, LoadInput::ForceX)]);
    silent.outgoing[0].signals.truncate(1);
    let mut pair = Pair::of(silent.clone(), TimeBase::Clock, 3);
    assert!(pair.exciter.remarks().contains(&ExciterRemark::State));
    assert_eq!(counts(&pair.ticks(4)), [0, 1, 2, 3]);
    pair.tick();
    assert_eq!((pair.exciter.outcome(), pair.plant.is_armed()), (Some(ExciterOutcome::Finished), false));
    let mut pair = Pair::of(silent.clone(), TimeBase::Lockstep, 3);
    assert_eq!(counts(&pair.ticks(3)), [1, 2, 3]);
    // The enable of another controller is still set, and the plant is in fault.
    let mut pair = Pair::of(silent, TimeBase::Clock, 3);
    enable_by_another(&mut pair);
    pair.plant.fault(0, EmergencyCode::CommandTimeout, 0);
    pair.ticks(3);
    assert!(pair.plant.is_armed());
}

#[test]
fn first_commands_of_zero_arm_where_nothing_else_does() {
    let mut message = drive(DRIVE, 0, LoadInput::ForceX);
    message.events[0].actions.retain(|(_, action)| *action == Action::Disarm);
    let by_zero = Mapping { arming: Arming::ZeroCommand, ..mapping(vec![message]) };
    let mut pair = Pair::of(by_zero, TimeBase::Clock, 3);
    assert_eq!(counts(&pair.ticks(5)), [0, 1, 2, 3, 3]);
}

#[test]
fn a_load_beyond_its_signal_is_a_fault_and_nothing_is_sent_of_it() {
    let mut pair = Pair::new(100_000);
    let MappedExciter { work, core, .. } = &mut pair.exciter;
    work.next_sample(core, 1, 1);
    work.next_sample(core, 40_000, 1);
    pair.ticks(3);
    assert_eq!(pair.fault(), Some((Node::Exciter, EmergencyCode::CommandOutOfRange)));
    assert!(!pair.plant.is_armed() && pair.plant.latched_fault().is_none());
}

#[test]
fn rejected_frames_hide_no_transition() {
    let mut pair = Pair::new(100);
    pair.ticks(3);
    assert!(pair.plant.is_armed());
    let rejected = Frame::classic(MEAS, &[0; 8]).unwrap();
    let mut exciter = Pair::new(100).exciter;
    check_that_rejected_frames_hide_no_transition(&mut exciter, &rejected, &pair.sent);
}

#[test]
fn a_jammed_bus_is_a_fault() {
    let mut pair = Pair::new(1000);
    pair.ticks(5);
    for _ in 0..200 {
        pair.now_ns += TICK_NS;
        pair.exciter.samples.is_whole = true;
        pair.exciter.answer_if_whole(pair.now_ns);
        pair.exciter.handle_deadline(pair.now_ns);
    }
    assert_eq!(pair.fault(), Some((Node::Exciter, EmergencyCode::BusLoss)));
    assert!(pair.exciter.frames().unsent > 10);
}
