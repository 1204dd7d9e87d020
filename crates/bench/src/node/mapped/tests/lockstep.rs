//! Frames that answer a sample.

use super::*;

fn two(lockstep: Lockstep) -> Rig {
    let mut messages = vec![drive(DRIVE, 0, LoadInput::ForceX), drive(SECOND, 0, LoadInput::ForceY)];
    if lockstep == Lockstep::Sync {
        let bare = Incoming { protection: Protection::default(), length: 0, ..drive(SYNC, 0, LoadInput::ForceX) };
        messages.push(Incoming { commands: vec![], events: vec![], is_sync: true, ..bare });
    }
    let mut rig = Rig::of(Mapping { lockstep, ..mapping(messages) }, TimeBase::Lockstep);
    rig.send(DRIVE, 0, true);
    assert!(rig.node.is_armed());
    rig.publish(0.0);
    rig
}

#[test]
fn one_frame_of_each_command_answers() {
    let mut rig = two(Lockstep::Command);
    rig.send(SECOND, 100, true);
    assert!(!rig.node.is_answered());
    rig.send(DRIVE, 50, true);
    assert!(rig.node.is_answered());
    assert_eq!(rig.node.load(), Load::force_n(1.0, 2.0));
    rig.publish(0.0);
    assert!(!rig.node.is_answered());
}

#[test]
fn a_doubled_command_is_a_fault_as_it_shifts_all_later_ones() {
    let mut rig = two(Lockstep::Command);
    rig.send(SECOND, 100, true);
    rig.send(SECOND, 100, true);
    assert_eq!(rig.node.latched_fault().unwrap().code, EmergencyCode::SampleSequence);
    assert_eq!(rig.refusals(Refusal::Repeated), 1);
    let mut rig = two(Lockstep::Command);
    rig.send(SECOND, 100, true);
    // The first of these completes the answer, and the second would answer a sample that is still to come.
    rig.send(DRIVE, 100, true);
    rig.send(DRIVE, 100, true);
    assert_eq!(rig.node.latched_fault().unwrap().code, EmergencyCode::SampleSequence, "after the answer");
}

#[test]
fn the_commands_before_a_sync_act_from_it() {
    let mut rig = two(Lockstep::Sync);
    let sync = Frame::new(SYNC, FrameFormat::Classic, &[]).unwrap();
    rig.send(DRIVE, 50, true);
    assert!(!rig.node.is_answered());
    rig.node.handle_frame(0, &sync);
    assert!(rig.node.is_answered());
    rig.send(DRIVE, 75, true);
    assert_eq!(rig.node.load().force_n.x, 1.0, "what follows the sync waits for the next");
    rig.publish(0.0);
    rig.node.handle_frame(0, &sync);
    assert_eq!(rig.node.load().force_n.x, 1.5);
    rig.node.handle_frame(0, &sync);
    assert_eq!(rig.node.latched_fault().unwrap().code, EmergencyCode::SampleSequence, "no sample between");
}
