//! The exciter as the drives' master, both in virtual time.

use alloc::boxed::Box;
use alloc::format;

use super::*;
use crate::control::{Answer, Controller, Length, LoadKind, NeededReading, ResponsePoint};
use crate::node::tests::check_that_rejected_frames_hide_no_transition;
use crate::node::{ExciterInterface, ExciterLack, ExciterOutcome};
use resonarm_protocol::Node;

/// Commands one N·m more at joint 1 with each sample, half of it at joint 2, and ends after some.
#[derive(Debug)]
struct Steps {
    samples: u64,
    needs: [bool; 6],
}

impl Controller for Steps {
    fn load_kind(&self) -> LoadKind {
        LoadKind::Torque
    }

    fn needs(&self) -> Vec<NeededReading> {
        NeededReading::marked(self.needs)
    }

    fn restart(&mut self) {}

    fn answer(&mut self, sample: &Measurement) -> Answer {
        let torque_nm = (sample.sample + 1) as f64;
        if sample.sample < self.samples {
            Answer::Hold(Load::torque_nm(torque_nm, 0.5 * torque_nm))
        } else {
            Answer::Finished
        }
    }

    fn poll_response(&mut self) -> Option<ResponsePoint> {
        None
    }

    fn length(&self) -> Length {
        Length::Samples(self.samples)
    }
}

fn master(drives: usize, time_base: TimeBase, samples: u64) -> Result<Cia402Exciter, ExciterLack> {
    let timing = match time_base {
        TimeBase::Clock => Timing::real_time(RATE_HZ),
        TimeBase::Lockstep => Timing::lockstep(1_000_000_000),
    };
    let controller = Box::new(Steps { samples, needs: [false; 6] });
    Cia402Exciter::new(&spec(drives), (RATE_HZ, time_base), timing, controller)
}

/// Drives and their master.
struct Pair {
    bench: Bench,
    master: Cia402Exciter,
    is_deaf: bool,
}

impl Pair {
    fn new(time_base: TimeBase, samples: u64) -> Pair {
        let mut master = master(2, time_base, samples).unwrap();
        master.start(0);
        Pair { bench: Bench::new(2, time_base), master, is_deaf: false }
    }

    fn exchange(&mut self) {
        let now_ns = self.bench.now_ns;
        self.master.handle_deadline(now_ns);
        loop {
            let frames = self.bench.frames();
            let is_more = !frames.is_empty();
            frames.iter().filter(|_| !self.is_deaf).for_each(|frame| self.master.handle_frame(now_ns, frame));
            let Some(frame) = self.master.next_frame() else { if is_more { continue } else { break } };
            self.master.frame_sent();
            self.bench.node.handle_frame(now_ns, &frame);
        }
    }

    /// Samples; the torques that act from each on.
    fn ticks(&mut self, count: usize) -> Vec<[f64; 2]> {
        let of = |pair: &mut Pair| {
            pair.bench.publish();
            pair.exchange();
            pair.bench.now_ns += TICK_NS;
            pair.bench.node.handle_deadline(pair.bench.now_ns);
            pair.bench.load = pair.bench.node.load();
            pair.bench.torques_nm()
        };
        (0..count).map(|_| of(self)).collect()
    }

    fn fault(&self) -> Option<(Node, EmergencyCode)> {
        match self.master.outcome() {
            Some(ExciterOutcome::Faulted(emergency)) => Some((emergency.node, emergency.code)),
            _ => None,
        }
    }
}

/// Returns the torques from the first one on.
fn played(torques_nm: &[[f64; 2]]) -> &[[f64; 2]] {
    let first = torques_nm.iter().position(|torque_nm| torque_nm[0] != 0.0).unwrap();
    &torques_nm[first..]
}

#[test]
fn it_enables_the_drives_commands_each_sample_and_shuts_them_down() {
    for time_base in [TimeBase::Clock, TimeBase::Lockstep] {
        let mut pair = Pair::new(time_base, 4);
        let torques_nm = pair.ticks(150);
        let expected = [[1.0, 0.5], [2.0, 1.0], [3.0, 1.5], [4.0, 2.0]];
        assert_eq!(played(&torques_nm)[..4], expected, "{time_base:?}");
        assert_eq!(pair.master.outcome(), Some(ExciterOutcome::Finished), "{time_base:?}");
        assert!(pair.bench.node.latched_fault().is_none() && !pair.bench.node.is_armed());
        assert_eq!((pair.master.samples_played(), pair.master.work().missed_samples()), (5, 0));
        assert!(pair.master.is_quiet());
    }
}

#[test]
fn rejected_frames_hide_no_transition() {
    let frame = |node: u16, data: &[u8]| Frame::classic(Id::Standard(0x180 + node), data).unwrap();
    let enabled = [1, 2].map(|node| frame(node, &[0x27, 0, TORQUE_MODE as u8]));
    let mut master = master(2, TimeBase::Clock, 100).unwrap();
    check_that_rejected_frames_hide_no_transition(&mut master, &frame(1, &[0x27]), &enabled);
}

#[test]
fn the_emergency_names_a_fault_which_is_reset_before_it_arms_again() {
    let mut pair = Pair::new(TimeBase::Clock, 1000);
    pair.ticks(100);
    assert!(pair.bench.node.is_armed());
    pair.bench.node.fault(pair.bench.now_ns, EmergencyCode::ExciterTripped, 0);
    pair.ticks(1);
    assert_eq!(pair.fault(), Some((Node::Plant, EmergencyCode::ExciterTripped)));
    assert!(pair.master.rearm(pair.bench.now_ns));
    let torques_nm = pair.ticks(400);
    assert!(pair.bench.node.is_armed());
    assert_eq!(played(&torques_nm)[..2], [[1.0, 0.5], [2.0, 1.0]]);
}

#[test]
fn silence_and_a_second_master_are_faults() {
    let mut pair = Pair::new(TimeBase::Clock, 1000);
    pair.ticks(100);
    pair.is_deaf = true;
    pair.ticks(400);
    assert_eq!(pair.fault(), Some((Node::Exciter, EmergencyCode::SensorTimeout)));
    let mut pair = Pair::new(TimeBase::Clock, 1000);
    pair.ticks(100);
    pair.master.handle_frame(pair.bench.now_ns, &Frame::classic(Id::Standard(0x202), &[0x0F, 0, 1, 0]).unwrap());
    assert_eq!(pair.fault(), Some((Node::Exciter, EmergencyCode::SecondSender)));
    pair.ticks(1);
    assert!(!pair.bench.node.is_armed());
}

#[test]
fn a_drive_that_somebody_switches_off_ends_the_work() {
    let mut pair = Pair::new(TimeBase::Clock, 1000);
    pair.ticks(100);
    pair.bench.node.execute(pair.bench.now_ns, OperatorRequest::Disarm);
    pair.ticks(40);
    assert_eq!(pair.master.outcome(), Some(ExciterOutcome::Stopped));
}

#[test]
fn what_drives_can_not_do_is_refused() {
    let both = master(2, TimeBase::Clock, 9).unwrap();
    let one = master(1, TimeBase::Clock, 9).unwrap();
    let says = |master: &Cia402Exciter, load| format!("{}", master.check_load(&load).unwrap_err());
    assert_eq!(both.check_load(&Load::torque_nm(100.0, -100.0)), Ok(()));
    insta::assert_snapshot!(says(&one, Load::torque_nm(1.0, 1.0)), @"the exciter's load has more torque2_nm than any drive of wire.drives can exert: change the excitation");
    insta::assert_snapshot!(says(&both, Load::torque_nm(3300.0, 0.0)), @"the exciter's load has more torque1_nm than any drive of wire.drives can exert: change the excitation");
    insta::assert_snapshot!(says(&both, Load::force_n(1.0, 0.0)), @"the exciter's load has more force_x_n than any drive of wire.drives can exert: change the excitation");
    let needs = [false, false, true, true, false, false];
    let controller = Box::new(Steps { samples: 9, needs });
    let rate = (RATE_HZ, TimeBase::Clock);
    let lack = Cia402Exciter::new(&spec(2), rate, Timing::real_time(RATE_HZ), controller).unwrap_err();
    insta::assert_snapshot!(lack, @"the controller reads acceleration_b_x_m_s2, acceleration_b_y_m_s2, but CANopen drives report only angles and torques: give an [excitation], without [limits.sensors]");
}
