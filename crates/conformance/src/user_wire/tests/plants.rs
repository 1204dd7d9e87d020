//! Plants on their own protocols.

use super::devices::{Flaw, NONE, PlantDevice, raw, redone};
use super::*;
use resonarm_bench::node::mapped::mapping::Source;
use resonarm_bench::rig::Load;
use resonarm_protocol::EmergencyCode;

/// The frames of the DBC: the byte of enable, reset and halt, and those of counter and checksum; in the other direction
/// that of state and reason.
const REQUESTS: usize = 4;
const ALIVE: usize = 6;
const STATE: usize = 4;
const CHECKSUM: usize = 7;
/// A heartbeat, an emergency and TPDO 2 of a CANopen drive, and its RPDO 1.
const HEARTBEAT: Id = Id::Standard(0x701);
const EMERGENCY: Id = Id::Standard(0x081);
const MOTION: Id = Id::Standard(0x281);
const TARGET: Id = Id::Standard(0x201);

fn device(on: &UserWire, flaw: Flaw) -> Box<dyn Device> {
    Box::new(PlantDevice::new(on.clone(), flaw))
}

fn fails(on: &UserWire, flaw: Flaw) -> Vec<&'static str> {
    failed(&findings(on, || device(on, flaw)))
}

#[test]
fn the_plant_passes_on_every_wire() {
    for on in On::ALL {
        for mode in on.modes() {
            let wire = on.wire(Node::Plant, *mode);
            let skipped: &[&str] = match on {
                On::Dbc => &["plant-requests"],
                On::Odrive => &[
                    "plant-counters",
                    "plant-wrong-checksum",
                    "plant-repeated-counter",
                    "plant-counter-jump",
                    "plant-too-large",
                ],
                On::Cia402 => &[
                    "plant-rates",
                    "plant-requests",
                    "plant-counters",
                    "plant-wrong-checksum",
                    "plant-repeated-counter",
                    "plant-counter-jump",
                    "plant-not-finite",
                    "plant-too-large",
                    "plant-stop",
                    "lockstep-plant-counters",
                    "lockstep-plant-waits",
                ],
            };
            all_pass(&findings(&wire, || device(&wire, NONE)), skipped);
        }
    }
}

/// The protocol of the DBC, whose plant says these signals in a message of their own, with this period.
fn seldom_said(signals: &[&str], period_s: f64) -> UserWire {
    let mut scenario = On::Dbc.scenario();
    let wire = scenario.wire.as_mut().unwrap();
    let all = &wire.readings[0];
    let [mut often, mut seldom] = [all.clone(), all.clone()];
    often.signals.retain(|name, _| !signals.contains(&name.as_str()));
    seldom.signals.retain(|name, _| signals.contains(&name.as_str()));
    (seldom.message, seldom.every, seldom.period_s) = (String::from("Seldom"), None, Some(period_s));
    wire.readings = vec![often, seldom];
    let dbc = include_str!("bench.dbc");
    let at = dbc.find("BO_ 512").unwrap();
    let end = dbc.find("SIG_VALTYPE_").unwrap();
    let again = dbc[at..end].replace("BO_ 512 Meas", "BO_ 513 Seldom");
    wire.text = Some(format!("{}{again}{}", &dbc[..end], &dbc[end..]));
    UserWire::new(scenario, Node::Plant, Mode::RealTime).unwrap()
}

#[test]
fn what_a_plant_says_is_awaited_for_as_long_as_its_readings_are_apart() {
    let fed = Flaw { spec: |spec| with_timeout(spec, |_| u64::MAX / 4), ..NONE };
    let half = Flaw { holds: |load| Load { force_n: load.force_n * 0.5, torque_nm: load.torque_nm }, ..NONE };
    // The emulated exciter answers readings of quantities, and its commands have to come within 200 ms.
    for (signals, period_s) in [(&["State", "Reason"][..], 0.4), (&["HeadX"], 0.18)] {
        let wire = seldom_said(signals, period_s);
        all_pass(&findings(&wire, || device(&wire, NONE)), &["plant-requests"]);
        let never_stops = Flaw { hears: |on, _, frame| vec![masked(on, &frame, !0x04)], ..NONE };
        assert_eq!(fails(&wire, never_stops), ["plant-stop"], "{signals:?}");
        assert_eq!(fails(&wire, half), ["plant-commands-act"], "{signals:?}");
        assert!(fails(&wire, fed).contains(&"plant-not-finite"), "{signals:?}");
    }
}

#[test]
fn a_plant_of_a_dbc_that_sends_wrongly_fails_the_cases_for_it() {
    let on = On::Dbc.wire(Node::Plant, Mode::RealTime);
    let sends = |sends| fails(&on, Flaw { sends, ..NONE });
    let one_wrong_checksum = sends(|_, context, frame| {
        let is_wrong = context.sent % 50 == 30;
        vec![raw(&frame, |data| data[CHECKSUM] ^= u8::from(is_wrong))]
    });
    assert!(["plant-frames", "plant-arms"].iter().all(|case| one_wrong_checksum.contains(case)));
    let unknown_state = sends(|on, context, frame| {
        let is_wrong = context.sent % 50 == 30;
        vec![redone(on, &frame, |data| data[STATE] |= if is_wrong { 0x0F } else { 0 })]
    });
    assert_eq!(unknown_state, ["plant-frames"]);
    let counts_by_2 = sends(|on, context, frame| {
        let counter = (2 * context.sent % 15) as u8;
        vec![redone(on, &frame, |data| data[ALIVE] = counter)]
    });
    assert_eq!(counts_by_2, ["plant-counters"]);
    let half_as_often = sends(|on, context, frame| {
        let counter = (context.sent / 2 % 15) as u8;
        if context.sent % 2 == 0 { vec![redone(on, &frame, |data| data[ALIVE] = counter)] } else { vec![] }
    });
    assert_eq!(half_as_often, ["plant-rates"]);
    let never_armed = sends(|on, _, frame| vec![redone(on, &frame, |data| data[STATE] = 1)]);
    assert_eq!(never_armed, ["plant-arms"]);
}

#[test]
fn a_plant_of_a_dbc_that_takes_what_it_must_not_fails_the_cases_for_it() {
    let on = On::Dbc.wire(Node::Plant, Mode::RealTime);
    let hears = |hears| fails(&on, Flaw { hears, ..NONE });
    let ignores_checksums = hears(|on, _, frame| vec![redone_if_whole(on, &frame, |_| {})]);
    assert_eq!(ignores_checksums, ["plant-wrong-checksum"]);
    let ignores_counters = hears(|on, context, frame| {
        let is_right = redone_if_whole(on, &frame, |_| {}) == frame;
        let counter = (context.heard % 15) as u8;
        vec![if is_right { redone_if_whole(on, &frame, |data| data[ALIVE] = counter) } else { frame }]
    });
    assert_eq!(ignores_counters, ["plant-repeated-counter", "plant-counter-jump"]);
    let fills_up = hears(|on, context, frame| {
        let counter = (context.heard % 15) as u8;
        if frame.data().len() == 8 {
            return vec![frame];
        }
        let whole = raw(&frame, |data| data.resize(8, 0));
        vec![redone(on, &whole, |data| data[ALIVE] = counter)]
    });
    assert_eq!(fills_up, ["plant-length"]);
    let zero_for_nan = hears(|on, _, frame| {
        let is_nan = frame.data().len() == 8 && f32::from_le_bytes(frame.data()[..4].try_into().unwrap()).is_nan();
        vec![if is_nan { redone(on, &frame, |data| data[..4].fill(0)) } else { frame }]
    });
    assert_eq!(zero_for_nan, ["plant-not-finite"]);
    let cuts = hears(|on, _, frame| {
        let force_n = f32::from_le_bytes(frame.data()[..4].try_into().unwrap());
        let is_beyond = force_n.abs() > 600.0;
        let cut = force_n.clamp(-600.0, 600.0).to_le_bytes();
        vec![if is_beyond { redone(on, &frame, |data| data[..4].copy_from_slice(&cut)) } else { frame }]
    });
    assert_eq!(cuts, ["plant-too-large"]);
}

/// Does as `redone`, for a frame that has its length.
fn redone_if_whole(on: &UserWire, frame: &Frame, change: impl FnOnce(&mut [u8])) -> Frame {
    if frame.data().len() == 8 { redone(on, frame, change) } else { *frame }
}

/// Changes the timeouts of the mapping.
fn with_timeout(spec: &mut WireSpec, change: impl Fn(u64) -> u64) {
    match spec {
        WireSpec::Mapped(mapping) => {
            mapping.incoming.iter_mut().for_each(|message| message.timeout_ns = change(message.timeout_ns));
        }
        WireSpec::Cia402(spec) => spec.timeout_ns = change(spec.timeout_ns),
    }
}

#[test]
fn a_plant_of_a_dbc_that_works_wrongly_fails_the_cases_for_it() {
    let on = On::Dbc.wire(Node::Plant, Mode::RealTime);
    let fed = [
        "plant-wrong-checksum",
        "plant-repeated-counter",
        "plant-counter-jump",
        "plant-length",
        "plant-not-finite",
        "plant-command-timeout",
    ];
    assert_eq!(fails(&on, Flaw { spec: |spec| with_timeout(spec, |_| u64::MAX / 4), ..NONE }), fed);
    assert_eq!(fails(&on, Flaw { spec: |spec| with_timeout(spec, |ns| ns / 2), ..NONE }), ["plant-command-timeout"]);
    let another_reason = Flaw {
        spec: |spec| {
            let WireSpec::Mapped(mapping) = spec else { return };
            for signal in mapping.outgoing.iter_mut().flat_map(|message| &mut message.signals) {
                if let Source::Reason { codes, .. } = &mut signal.source {
                    codes.retain(|(code, _)| *code != EmergencyCode::CommandTimeout);
                }
            }
        },
        ..NONE
    };
    assert_eq!(fails(&on, another_reason), ["plant-command-timeout"]);
    let half = Flaw { holds: |load| Load { force_n: load.force_n * 0.5, torque_nm: load.torque_nm }, ..NONE };
    assert_eq!(fails(&on, half), ["plant-commands-act"]);
    let stays =
        Flaw { holds: |load| Load { force_n: load.force_n.map(|n| if n == 0.0 { 5.0 } else { n }), ..load }, ..NONE };
    assert_eq!(fails(&on, stays), ["plant-command-timeout", "plant-disarm", "plant-stop"]);
    let hears = |hears| fails(&on, Flaw { hears, ..NONE });
    let never_reset = hears(|on, _, frame| vec![masked(on, &frame, !0x02)]);
    assert_eq!(never_reset, ["plant-reset"]);
    let never_stops = hears(|on, _, frame| vec![masked(on, &frame, !0x04)]);
    assert_eq!(never_stops, ["plant-stop"]);
    let never_disarms = hears(|_, context, frame| {
        let requests = frame.data().get(REQUESTS).copied().unwrap_or(1);
        context.has_armed |= requests == 1;
        if context.has_armed && requests == 0 { vec![] } else { vec![frame] }
    });
    assert_eq!(never_disarms, ["plant-disarm"]);
}

/// A whole frame with other requests; one with a wrong checksum stays so.
fn masked(on: &UserWire, frame: &Frame, mask: u8) -> Frame {
    let is_right = redone_if_whole(on, frame, |_| {}) == *frame;
    if is_right { redone_if_whole(on, frame, |data| data[REQUESTS] &= mask) } else { *frame }
}

#[test]
fn an_axis_with_a_flaw_fails_the_cases_for_it() {
    let on = On::Odrive.wire(Node::Plant, Mode::RealTime);
    let hears = |hears| fails(&on, Flaw { hears, ..NONE });
    let ignores_requests = hears(|on, _, frame| {
        let asks = on.mapping().unwrap().outgoing.iter().any(|message| message.id == frame.id());
        if asks { vec![] } else { vec![frame] }
    });
    assert_eq!(ignores_requests, ["plant-requests"]);
    // The command 2 of CANSimple is Estop.
    let never_stops = hears(|_, _, frame| if frame.id() == Id::Standard(3 << 5 | 2) { vec![] } else { vec![frame] });
    assert_eq!(never_stops, ["plant-stop"]);
}

#[test]
fn a_drive_with_a_flaw_fails_the_cases_for_it() {
    let on = On::Cia402.wire(Node::Plant, Mode::RealTime);
    let drive = |change: fn(&mut resonarm_bench::node::cia402::DriveSpec)| {
        let mut other = on.spec.clone();
        if let WireSpec::Cia402(spec) = &mut other {
            spec.drives.iter_mut().for_each(change);
        }
        let other = UserWire { spec: other, ..on.clone() };
        failed(&findings(&on, || device(&other, NONE)))
    };
    assert_eq!(drive(|drive| drive.encoder_counts_per_turn = 4096), ["plant-objects"]);
    assert_eq!(drive(|drive| drive.rated_torque_mnm = 2000), ["plant-objects"]);
    let sends = |sends| fails(&on, Flaw { sends, ..NONE });
    assert_eq!(sends(|_, _, frame| if frame.id() == HEARTBEAT { vec![] } else { vec![frame] }), ["plant-heartbeats"]);
    assert_eq!(sends(|_, _, frame| vec![frame; if frame.id() == HEARTBEAT { 31 } else { 1 }]), ["plant-heartbeats"]);
    assert_eq!(sends(|_, _, frame| if frame.id() == EMERGENCY { vec![] } else { vec![frame] }), ["plant-emergencies"]);
    let fewer_positions =
        sends(|_, context, frame| if frame.id() == MOTION && context.sent % 7 == 0 { vec![] } else { vec![frame] });
    assert_eq!(fewer_positions, ["plant-positions"]);
    let hears = |hears| fails(&on, Flaw { hears, ..NONE });
    let enables_at_once = hears(|_, _, frame| {
        let switches_on = frame.id() == TARGET && frame.data()[0] == 0x07;
        vec![raw(&frame, |data| {
            if switches_on {
                data[0] = 0x0F
            }
        })]
    });
    assert_eq!(enables_at_once, ["plant-not-enabled"]);
    let aborts_nothing = sends(|_, _, frame| {
        let is_abort = frame.id() == Id::Standard(0x581) && frame.data()[0] == 0x80;
        vec![raw(&frame, |data| {
            if is_abort {
                data[0] = 0x60
            }
        })]
    });
    assert_eq!(aborts_nothing, ["plant-aborts"]);
}

#[test]
fn a_plant_with_a_flaw_in_lockstep_fails_the_cases_for_it() {
    let on = On::Dbc.wire(Node::Plant, Mode::Lockstep);
    let never_faults = Flaw {
        sends: |on, _, frame| {
            vec![redone(on, &frame, |data| {
                if data[STATE] & 3 == 3 {
                    data[STATE] = 2
                }
            })]
        },
        ..NONE
    };
    assert_eq!(fails(&on, never_faults), ["lockstep-plant-timeout"]);
    let runs_on = Flaw {
        sends: |on, context, frame| {
            let counter = (context.sent % 15) as u8;
            vec![redone(on, &frame, |data| data[ALIVE] = counter)]
        },
        ..NONE
    };
    let other = UserWire { mode: Mode::RealTime, ..on.clone() };
    let found = failed(&findings(&on, || device(&other, runs_on)));
    assert!(found.contains(&"lockstep-plant-waits"), "{found:?}");
}
