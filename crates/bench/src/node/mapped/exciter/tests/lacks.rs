//! Features that a mapping lacks for an exciter, in words.

use super::*;
use resonarm_wire::layout::{ByteOrder, Layout, Number};
use resonarm_wire::multiplex::{Condition, Presence};

fn lack(mapping: &Mapping, needs: [bool; 6]) -> ExciterLack {
    let (rate, timing) = ((RATE_HZ, TimeBase::Clock), Timing::real_time(RATE_HZ));
    MappedExciter::new(mapping, rate, timing, Box::new(Steps { samples: 9, needs })).unwrap_err()
}

fn of_message(change: impl Fn(&mut Incoming)) -> Mapping {
    let mut message = drive(DRIVE, 0, LoadInput::ForceX);
    change(&mut message);
    mapping(vec![message])
}

#[test]
fn what_it_can_t_do_without_is_named_with_the_key_to_add() {
    let nothing = [false; 6];
    let operator = Mapping { arming: Arming::Operator, ..of_message(|_| {}) };
    insta::assert_snapshot!(lack(&operator, nothing), @r#"[wire] `arm = "operator"`: no message arms the plant, so the emulated exciter can't arm it; give an event with `arm`, or `arm = "zero-command"`"#);
    let armless = of_message(|message| message.events[0].actions.retain(|(_, action)| *action != Action::Arm));
    insta::assert_snapshot!(lack(&armless, nothing), @"[wire] has no event that arms drive 0, which takes commands: give one with `arm` and `drive = 0`");
    let endless = of_message(|message| message.events[0].actions.retain(|(_, action)| *action != Action::Disarm));
    insta::assert_snapshot!(lack(&endless, nothing), @"[wire] has no event that disarms drive 0: the emulated exciter could end only by silence, a fault; give one with `disarm` and `drive = 0`");
    let asked = vec![Outgoing { trigger: Trigger::Request, ..meas() }];
    insta::assert_snapshot!(lack(&Mapping { outgoing: asked, ..of_message(|_| {}) }, nothing), @r#"[wire] has no readings that are sent periodically, so the emulated exciter has nothing to answer: give a [[wire.readings]] with `every`, `period_s` or `on = "sync"`"#);
    let whole = of_message(|_| {});
    insta::assert_snapshot!(lack(&whole, [true, true, false, false, true, false]), @"the controller reads head_force_x_n, head_force_y_n, but no message of every sample carries them: give a [[wire.readings]] with `every = 1` and that `quantity`");
    let sparse = vec![Outgoing { trigger: Trigger::Every(2), ..meas() }];
    insta::assert_snapshot!(lack(&Mapping { outgoing: sparse, ..whole.clone() }, [false, false, false, false, true, false]), @"the controller reads acceleration_c_x_m_s2, but no message of every sample carries it: give a [[wire.readings]] with `every = 1` and that `quantity`");
    let restless = of_message(|message| {
        let one = signal(16, 1, Number::Unsigned, 1.0);
        let event = EventSignal { signal: Some(one), ..message.events[0].clone() };
        message.events[0] = EventSignal { actions: vec![(0.0, Action::Stop), (1.0, Action::Stop)], ..event };
    });
    insta::assert_snapshot!(lack(&restless, nothing), @"message 0x100: every value of a signal in [[wire.events]] is a request: leave at least one value out of `arm`, `disarm` and `reset`");
    let beyond = of_message(|message| {
        message.events[0].signal = Some(signal(16, 2, Number::Unsigned, 1.0));
        message.events[0].actions = vec![(9.0, Action::Arm), (0.0, Action::Disarm)];
    });
    insta::assert_snapshot!(lack(&beyond, nothing), @"message 0x100: a signal in [[wire.events]] can't represent 9, one of the values given for it: give one that it can represent, or widen the signal");
    let apart = of_message(|message| {
        let switch = Layout::new(32, 8, ByteOrder::Intel, Number::Unsigned, 8).unwrap();
        let on = |value: u64| Presence::new(vec![Condition::new(switch, vec![value..=value]).unwrap()]);
        message.commands.push(CommandSignal { input: LoadInput::ForceY, ..message.commands[0].clone() });
        message.commands[0].signal.presence = on(1);
        message.commands[1].signal.presence = on(2);
    });
    insta::assert_snapshot!(lack(&apart, nothing), @"message 0x100: its loads are multiplexed apart, so no payload has all of them: map them in one");
}

#[test]
fn a_load_that_no_signal_commands_is_named() {
    let pair = Pair::new(9);
    let check = |load| pair.exciter.check_load(&load).map_err(|lack| alloc::format!("{lack}"));
    assert_eq!(check(Load::force_n(3.0, 0.0)), Ok(()));
    insta::assert_snapshot!(check(Load::force_n(3.0, 1.0)).unwrap_err(), @"the exciter's load has more force_y_n than any signal of [[wire.commands]] can command: map it there, or change the excitation");
    insta::assert_snapshot!(check(Load::force_n(700.0, 0.0)).unwrap_err(), @"the exciter's load has more force_x_n than any signal of [[wire.commands]] can command: map it there, or change the excitation");
}

#[test]
fn what_it_can_t_know_is_said() {
    let mut sparse = of_message(|_| {});
    sparse.outgoing[0].trigger = Trigger::Period(10_000_000);
    sparse.outgoing[0].protection = Protection::default();
    sparse.outgoing[0].signals.truncate(1);
    let (rate, timing) = ((RATE_HZ, TimeBase::Clock), Timing::real_time(RATE_HZ));
    let node = MappedExciter::new(&sparse, rate, timing, steps(9)).unwrap();
    let remarks: Vec<alloc::string::String> = node.remarks().iter().map(|remark| alloc::format!("{remark}")).collect();
    insta::assert_snapshot!(remarks.join("\n"), @"
    no message of every answered sample carries head_force_x_n, head_force_y_n, acceleration_b_x_m_s2, acceleration_b_y_m_s2, acceleration_c_y_m_s2: the exciter reads NaN for it
    readings are sent every 10 samples, so the exciter answers only that often
    no reading carries the plant's `state`: the exciter takes the plant as armed once it has requested it, and notices a fault only as silence
    readings have neither `sample` nor a counter: the exciter does not notice lost samples
    ");
}
