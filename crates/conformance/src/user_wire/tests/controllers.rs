//! Controllers on their own protocols.

use super::devices::{ControllerDevice, Flaw, NONE, raw, redone};
use super::*;

/// The frames of the DBC: the byte of enable, reset and halt, and that of the counter; in the other direction that of
/// state and reason.
const REQUESTS: usize = 4;
const ALIVE: usize = 6;
const STATE: usize = 4;
const CHECKSUM: usize = 7;
/// ODrive's Set_Controller_Mode, and a target torque of a CANopen drive.
const SET_MODE: Id = Id::Standard(3 << 5 | 0x0B);
const TARGET: Id = Id::Standard(0x201);

fn device(on: &UserWire, flaw: Flaw) -> Box<dyn Device> {
    Box::new(ControllerDevice::new(on.clone(), flaw))
}

#[test]
fn the_emulated_exciter_passes_on_every_wire() {
    for on in On::ALL {
        for mode in on.modes() {
            let wire = on.wire(Node::Exciter, *mode);
            let skipped: &[&str] = match on {
                On::Dbc => &[],
                On::Odrive => &["exciter-counters", "exciter-before-arming"],
                On::Cia402 => &["exciter-counters", "lockstep-exciter-counters"],
            };
            all_pass(&findings(&wire, || device(&wire, NONE)), skipped);
        }
    }
}

/// Every frame that it sends is changed like this, without regard to the checksum.
fn sends_raw(on: &UserWire, sends: fn(&UserWire, &mut devices::Context, Frame) -> Vec<Frame>) -> Vec<&'static str> {
    failed(&findings(on, || device(on, Flaw { sends, ..NONE })))
}

/// As `sends_raw`, of what it hears.
fn hears(on: &UserWire, hears: fn(&UserWire, &mut devices::Context, Frame) -> Vec<Frame>) -> Vec<&'static str> {
    failed(&findings(on, || device(on, Flaw { hears, ..NONE })))
}

/// These cases are among those that fail. Whatever frame the tester rejects fails every case in which it comes.
fn among(failed: &[&str], cases: &[&str]) {
    assert!(cases.iter().all(|case| failed.contains(case)), "{failed:?}");
}

#[test]
fn a_controller_of_a_dbc_with_a_flaw_fails_the_cases_for_it() {
    let on = On::Dbc.wire(Node::Exciter, Mode::RealTime);
    let wrong_checksums = sends_raw(&on, |_, _, frame| vec![raw(&frame, |data| data[CHECKSUM] ^= 1)]);
    among(&wrong_checksums, &["exciter-arms", "exciter-frames"]);
    let short = sends_raw(&on, |_, _, frame| vec![raw(&frame, |data| data.truncate(CHECKSUM))]);
    among(&short, &["exciter-arms", "exciter-frames"]);
    let one_wrong_checksum = sends_raw(&on, |_, context, frame| {
        let is_wrong = context.sent % 50 == 30;
        vec![raw(&frame, |data| data[CHECKSUM] ^= u8::from(is_wrong))]
    });
    among(&one_wrong_checksum, &["exciter-frames"]);
    let not_a_number = sends_raw(&on, |on, context, frame| {
        let is_wrong = context.sent % 50 == 30;
        let nan = |data: &mut [u8]| data[..4].copy_from_slice(&f32::NAN.to_le_bytes());
        vec![if is_wrong { redone(on, &frame, nan) } else { frame }]
    });
    among(&not_a_number, &["exciter-frames"]);
    let counts_by_2 = sends_raw(&on, |on, context, frame| {
        let counter = (2 * context.sent % 15) as u8;
        vec![redone(on, &frame, |data| data[ALIVE] = counter)]
    });
    assert_eq!(counts_by_2, ["exciter-counters"]);
    let never_counts = sends_raw(&on, |on, _, frame| vec![redone(on, &frame, |data| data[ALIVE] = 3)]);
    among(&never_counts, &["exciter-counters", "exciter-in-time"]);
    let never_arms = sends_raw(&on, |on, _, frame| vec![redone(on, &frame, |data| data[REQUESTS] = 0)]);
    assert_eq!(never_arms, ["exciter-arms"]);
}

/// Once it has heard that the plant is armed, it hears no other state.
fn deaf(on: &UserWire, context: &mut devices::Context, frame: Frame) -> Vec<Frame> {
    context.has_armed |= frame.data()[STATE] & 0xF == 2;
    let says = if context.has_armed { 2 } else { frame.data()[STATE] };
    vec![redone(on, &frame, |data| data[STATE] = says)]
}

/// Half of each second.
fn is_away(context: &devices::Context) -> bool {
    context.now_ns % 1_000_000_000 > 500_000_000
}

#[test]
fn a_controller_of_a_dbc_that_works_wrongly_fails_the_cases_for_it() {
    let on = On::Dbc.wire(Node::Exciter, Mode::RealTime);
    let begins_too_early = sends_raw(&on, |on, context, frame| {
        let is_early = context.now_ns < 600_000_000;
        vec![redone(on, &frame, |data| {
            if is_early {
                data[..4].copy_from_slice(&20.0_f32.to_le_bytes());
                data[REQUESTS] = 0;
            }
        })]
    });
    assert_eq!(begins_too_early, ["exciter-before-arming"]);
    let pauses = sends_raw(&on, |_, context, frame| if is_away(context) { vec![] } else { vec![frame] });
    assert_eq!(pauses, ["exciter-in-time"]);
    let too_large = sends_raw(&on, |on, context, frame| {
        let force_n = if context.sent % 40 == 39 { 1000.0_f32 } else { 0.1 };
        vec![redone(on, &frame, |data| data[..4].copy_from_slice(&force_n.to_le_bytes()))]
    });
    among(&too_large, &["exciter-limits", "exciter-frames"]);
    assert_eq!(hears(&on, deaf), ["exciter-plant-faults", "exciter-plant-disarmed"]);
}

/// What lasts for longer than the reaction and the hold-ups together is certain.
#[test]
fn a_controller_that_is_deaf_fails_though_the_tester_is_held_up() {
    let on = On::Dbc.wire(Node::Exciter, Mode::RealTime);
    let cases = wire_cases(&on).into_iter().filter(|case| case.id.starts_with("exciter-plant-"));
    let verdicts = cases.map(|case| {
        let mut bus = Virtual::new(device(&on, Flaw { hears: deaf, ..NONE }));
        (bus.held_up_every, bus.held_up_ns) = (Some(50), 180_000_000);
        run_on_wire(&case, &mut bus, &on, settings()).unwrap()
    });
    let verdicts: Vec<Finding> = verdicts.collect();
    assert_eq!(verdicts.len(), 2);
    for Finding { verdict, held_up_ns, .. } in verdicts {
        assert!(matches!(verdict, Verdict::Failed(_)) && held_up_ns >= 150_000_000, "{verdict:?}, {held_up_ns}");
    }
}

#[test]
fn a_controller_of_drives_with_a_flaw_fails_the_cases_for_it() {
    let on = On::Odrive.wire(Node::Exciter, Mode::RealTime);
    let no_mode = sends_raw(&on, |_, _, frame| if frame.id() == SET_MODE { vec![] } else { vec![frame] });
    assert_eq!(no_mode, ["exciter-in-time", "exciter-acts"]);
    let on = On::Cia402.wire(Node::Exciter, Mode::RealTime);
    let halts = sends_raw(&on, |_, _, frame| {
        let is_target = frame.id() == TARGET;
        vec![raw(&frame, |data| {
            if is_target {
                data[1] |= 1
            }
        })]
    });
    assert_eq!(halts, ["exciter-acts"]);
    let switches_on_only = sends_raw(&on, |_, _, frame| {
        let enables = frame.id() == TARGET && frame.data()[0] == 0x0F;
        vec![raw(&frame, |data| {
            if enables {
                data[0] = 0x07
            }
        })]
    });
    assert_eq!(switches_on_only, ["exciter-arms"]);
    let short = sends_raw(&on, |_, context, frame| {
        let is_short = frame.id() == TARGET && context.sent % 49 == 30;
        vec![raw(&frame, |data| data.truncate(if is_short { 3 } else { 8 }))]
    });
    among(&short, &["exciter-frames"]);
    // A block transfer, and node guarding: other drives have them.
    let guards = sends_raw(&on, |_, context, frame| {
        let guard = Frame::new(Id::Standard(0x701), FrameFormat::Remote, &[]).unwrap();
        let block = Frame::classic(Id::Standard(0x601), &[0xA0, 0, 0x10, 0, 0x7F, 0, 0, 0]).unwrap();
        if context.sent % 50 == 30 { vec![frame, guard, block] } else { vec![frame] }
    });
    assert_eq!(guards, [""; 0]);
    let no_targets =
        sends_raw(&on, |_, context, frame| if is_away(context) && frame.id() == TARGET { vec![] } else { vec![frame] });
    assert_eq!(no_targets, ["exciter-in-time"]);
}

#[test]
fn a_controller_with_a_flaw_in_lockstep_fails_the_cases_for_it() {
    let on = On::Dbc.wire(Node::Exciter, Mode::Lockstep);
    let answers_twice = sends_raw(&on, |on, context, frame| {
        let counted = |count: u64| redone(on, &frame, |data| data[ALIVE] = (count % 15) as u8);
        vec![counted(2 * context.sent), counted(2 * context.sent + 1)]
    });
    assert_eq!(answers_twice, ["lockstep-exciter-answers", "lockstep-exciter-waits"]);
    let stops_answering = sends_raw(&on, |_, context, frame| if context.sent % 40 < 30 { vec![frame] } else { vec![] });
    assert_eq!(stops_answering, ["lockstep-exciter-answers"]);
    // Every 40th counter comes again: the tester's plant refuses that frame, and so the sample has no answer.
    let repeats: fn(&UserWire, &mut devices::Context, Frame) -> Vec<Frame> = |on, context, frame| {
        let counter = ((context.sent - context.sent / 40) % 15) as u8;
        vec![redone(on, &frame, |data| data[ALIVE] = counter)]
    };
    let failing = ["lockstep-exciter-frames", "lockstep-exciter-counters", "lockstep-exciter-answers"];
    assert_eq!(sends_raw(&on, repeats), failing);
    let reason = |id| report(&on, id, Flaw { sends: repeats, ..NONE });
    insta::assert_snapshot!(reason("lockstep-exciter-counters"), @r#"Failed("Drive: counter 9 was repeated: 100#58C5C5C001000972")"#);
    insta::assert_snapshot!(reason("lockstep-exciter-answers"), @r#"Failed("the answer to sample 38 is rejected: Drive: counter 9 was repeated")"#);
    let on = On::Cia402.wire(Node::Exciter, Mode::Lockstep);
    let syncs_twice = sends_raw(&on, |_, _, frame| {
        let count = if frame.id() == Id::Standard(SYNC_ID) { 2 } else { 1 };
        vec![frame; count]
    });
    assert_eq!(syncs_twice, ["lockstep-exciter-answers", "lockstep-exciter-waits"]);
}

/// The report on a flawed controller by the case for it.
fn report(on: &UserWire, id: &str, flaw: Flaw) -> String {
    let case = wire_cases(on).into_iter().find(|case| case.id == id).unwrap();
    let finding = run_on_wire(&case, &mut Virtual::new(device(on, flaw)), on, settings()).unwrap();
    format!("{:?}", finding.verdict)
}

#[test]
fn the_reasons_say_what_it_does_instead() {
    let on = On::Dbc.wire(Node::Exciter, Mode::RealTime);
    let wrong_checksum = Flaw { sends: |_, _, frame| vec![raw(&frame, |data| data[CHECKSUM] ^= 1)], ..NONE };
    insta::assert_snapshot!(report(&on, "exciter-frames", wrong_checksum), @r#"Failed("21 of its frames are rejected: Drive rejected: the checksum is 0x42, expected 0x43: 100#0000000001000042 (21 times)")"#);
    insta::assert_snapshot!(report(&on, "exciter-arms", wrong_checksum), @r#"Failed("it doesn't arm the plant within 1500 ms: 0 requests to arm and 0 to reset came; heard: Drive rejected: the checksum is 0x42, expected 0x43: 100#0000000001000042 (31 times)")"#);
    let deaf = Flaw { hears: deaf, ..NONE };
    insta::assert_snapshot!(report(&on, "exciter-plant-faults", deaf), @r#"Failed("Drive commands force_x_n -19.754 N, and the plant is in fault for 1010 ms")"#);
    let pauses = Flaw { sends: |_, context, frame| if is_away(context) { vec![] } else { vec![frame] }, ..NONE };
    insta::assert_snapshot!(report(&on, "exciter-in-time", pauses), @r#"Failed("no command came in time, and 150 ms more; Drive at the longest 360 ms apart")"#);
}
