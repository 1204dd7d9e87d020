//! The frames that an exciter sends.

use super::*;
use resonarm_wire::layout::{ByteOrder, Layout, Number};
use resonarm_wire::multiplex::{Condition, Presence};

/// The frames that ask for arming, of a mapping of these messages.
fn arming(incoming: Vec<Incoming>) -> Vec<Frame> {
    let timing = Timing::lockstep(1_000_000_000);
    let mapping = mapping(incoming);
    let mut node = MappedExciter::new(&mapping, (RATE_HZ, TimeBase::Lockstep), timing, steps(9)).unwrap();
    node.start(0);
    core::iter::from_fn(|| {
        let frame = node.next_frame()?;
        node.frame_sent();
        Some(frame)
    })
    .collect()
}

fn event(start: u64, bits: u64, actions: Vec<(f64, Action)>, required: Vec<f64>) -> EventSignal {
    let signal = Some(signal(start, bits, Number::Unsigned, 1.0));
    EventSignal { name: "Event".into(), signal, counts: Counts::InEveryFrame, actions, required }
}

/// A message with events alone.
fn requests(id: u16, events: Vec<EventSignal>) -> Incoming {
    let id = Id::Standard(id);
    let protection = Protection::default();
    Incoming { id, protection, commands: vec![], events, ..drive(DRIVE, 0, LoadInput::ForceX) }
}

fn force() -> Incoming {
    Incoming { events: vec![], protection: Protection::default(), ..drive(DRIVE, 0, LoadInput::ForceX) }
}

#[test]
fn conditions_come_before_what_arms() {
    let arm = requests(0x10, vec![event(0, 8, vec![(8.0, Action::Arm), (1.0, Action::Disarm)], vec![])]);
    let mode = requests(0x20, vec![event(0, 8, vec![], vec![3.0, 4.0]), event(8, 8, vec![], vec![5.0])]);
    let sent = arming(vec![arm, mode, force()]);
    let asked: Vec<_> = sent.iter().map(|frame| (frame.id().raw(), frame.data()[0], frame.data()[1])).collect();
    assert_eq!(asked, [(0x20, 3, 5), (0x10, 8, 0)]);
}

#[test]
fn a_frame_without_signals_asks_by_coming() {
    let on_frame = |action| EventSignal {
        name: "".into(),
        signal: None,
        counts: Counts::InEveryFrame,
        actions: vec![(0.0, action)],
        required: vec![],
    };
    let messages = vec![
        requests(0x10, vec![on_frame(Action::Arm)]),
        requests(0x11, vec![on_frame(Action::Disarm)]),
        requests(0x12, vec![on_frame(Action::Stop)]),
        force(),
    ];
    let ids: Vec<u32> = arming(messages).iter().map(|frame| frame.id().raw()).collect();
    assert_eq!(ids, [0x10]);
}

#[test]
fn a_signal_rests_where_it_asks_for_nothing() {
    let stop = event(16, 2, vec![(0.0, Action::Stop), (1.0, Action::Reset)], vec![]);
    let arm = event(0, 8, vec![(8.0, Action::Arm), (1.0, Action::Disarm)], vec![]);
    let sent = arming(vec![requests(0x10, vec![arm, stop]), force()]);
    assert_eq!(sent[0].data()[..3], [8, 0, 2]);
}

#[test]
fn switches_select_the_signals_of_a_page() {
    let switch = Layout::new(0, 8, ByteOrder::Intel, Number::Unsigned, 8).unwrap();
    let on = |value: u64| Presence::new(vec![Condition::new(switch, vec![value..=value]).unwrap()]);
    let mut message = drive(DRIVE, 0, LoadInput::ForceX);
    message.protection = Protection::default();
    message.commands[0].signal = MappedSignal { presence: on(7), ..signal(8, 16, Number::Signed, COUNT_N) };
    let mut arm = event(8, 8, vec![(1.0, Action::Arm), (0.0, Action::Disarm)], vec![]);
    arm.signal = Some(MappedSignal { presence: on(2), ..signal(8, 8, Number::Unsigned, 1.0) });
    message.events = vec![arm];
    let mut pair = Pair::of(mapping(vec![message.clone()]), TimeBase::Clock, 3);
    assert_eq!(counts(&pair.ticks(4)), [0, 1, 2, 3]);
    assert_eq!(arming(vec![message])[0].data()[..2], [2, 1]);
}

#[test]
fn loads_are_scaled_and_along_a_shaker() {
    let half = libm::sqrt(0.5);
    let mut message = drive(DRIVE, 0, LoadInput::Along([half, half]));
    (message.commands[0].scale, message.commands[0].offset) = (-2.0, 0.1);
    let pages = page::pages(&mapping(vec![message])).unwrap();
    let along = Load::force_n(half * 4.1, half * 4.1);
    assert!(page::can_command(&pages, &along) && !page::can_command(&pages, &Load::force_n(4.1, 0.0)));
    let data = pages[0].frame(Ask::Arm, &along, 3).unwrap();
    // (4.1 − 0.1) / −2 / 0.02 counts, and the counter.
    assert_eq!((i16::from_le_bytes([data.data()[0], data.data()[1]]), data.data()[6]), (-100, 3));
}
