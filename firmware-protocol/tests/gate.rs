//! The gate of a plant: which commands it accepts, and why it rejects the others.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use proptest::prelude::*;
use resonarm_protocol::timing::COMMAND_AGE_NS;
use resonarm_protocol::{CommandCheck, CommandGate, Limit, NodeState, Refusal};

/// Far beyond the modulus of the wire.
// Its index on the wire is 4464, so that a gate that counts modulo 2¹⁶ would be found out.
const SAMPLE: u64 = 70_000;

/// A command that the exciter can produce, to a plant without other limits.
const FREE: CommandCheck = CommandCheck { range: Limit::Within, change_periods: 0.0, travel: Limit::Within };
/// One beyond every limit.
const BEYOND: CommandCheck =
    CommandCheck { range: Limit::Beyond, change_periods: f64::INFINITY, travel: Limit::Within };

fn gate() -> CommandGate {
    CommandGate::new(COMMAND_AGE_NS, 1000)
}

/// A command of this age to an operational plant.
fn take(gate: &mut CommandGate, age: i64) -> Result<(), Refusal> {
    judge(gate, age, &FREE)
}

fn judge(gate: &mut CommandGate, age: i64, check: &CommandCheck) -> Result<(), Refusal> {
    gate.take(NodeState::Operational, SAMPLE, (SAMPLE as i64 - age) as u16, check)
}

/// One of this age that changes the load by what takes so many sample periods.
fn change(gate: &mut CommandGate, age: i64, change_periods: f64) -> Result<(), Refusal> {
    judge(gate, age, &CommandCheck { change_periods, ..FREE })
}

#[test]
fn only_an_operational_plant_takes_commands() {
    for state in NodeState::ALL {
        let mut gate = gate();
        let taken = gate.take(state, SAMPLE, SAMPLE as u16, &FREE);
        let (wanted, answered) = match state {
            NodeState::Operational => (Ok(()), Some(SAMPLE)),
            _ => (Err(Refusal::NotArmed), None),
        };
        assert_eq!((taken, gate.answered()), (wanted, answered), "{state:?}");
    }
}

#[test]
fn the_age_has_both_ends() {
    for (age, wanted) in [(0, Ok(())), (20, Ok(())), (21, Err(Refusal::Late)), (-1, Err(Refusal::Late))] {
        assert_eq!(take(&mut gate(), age), wanted, "{age}");
    }
}

#[test]
fn the_limit_of_the_age_is_rounded_down_and_never_overflows() {
    let oldest = |age_ns, rate_hz| {
        (0..=u16::MAX).rev().find(|age| take(&mut CommandGate::new(age_ns, rate_hz), i64::from(*age)).is_ok())
    };
    assert_eq!(oldest(COMMAND_AGE_NS, 1000), Some(20));
    // 20 ms are 2.98 periods at 149 Hz.
    assert_eq!(oldest(COMMAND_AGE_NS, 149), Some(2));
    assert_eq!(oldest(0, u16::MAX), Some(0));
    assert_eq!(oldest(u64::MAX, u16::MAX), Some(u16::MAX));
}

#[test]
fn there_is_no_sample_before_the_first() {
    for (sample, index, wanted) in [(0, 0, Ok(())), (3, 0, Ok(())), (3, 0xFFFF, Err(Refusal::Late))] {
        assert_eq!(gate().take(NodeState::Operational, sample, index, &FREE), wanted, "{index} at {sample}");
    }
    // Here the same index is that of a sample that exists: FFFFh, four before 10003h.
    assert_eq!(gate().take(NodeState::Operational, 0x1_0003, 0xFFFF, &FREE), Ok(()));
}

#[test]
fn a_sample_is_answered_once_and_none_before_it_afterwards() {
    let mut gate = gate();
    assert_eq!(take(&mut gate, 3), Ok(()));
    assert_eq!(take(&mut gate, 4), Err(Refusal::OutOfOrder));
    assert_eq!(take(&mut gate, 3), Err(Refusal::Repeated));
    assert_eq!(gate.answered(), Some(SAMPLE - 3));
    assert_eq!(take(&mut gate, 2), Ok(()));
    assert_eq!(gate.answered(), Some(SAMPLE - 2));
    gate.arm();
    assert_eq!(gate.answered(), None);
    assert_eq!(take(&mut gate, 4), Ok(()), "before the last of the arming before");
}

#[test]
fn what_the_exciter_cannot_produce_leaves_the_sample_unanswered() {
    let mut gate = gate();
    assert_eq!(judge(&mut gate, 0, &CommandCheck { range: Limit::Beyond, ..FREE }), Err(Refusal::OutOfRange));
    assert_eq!(gate.answered(), None);
    assert_eq!(take(&mut gate, 0), Ok(()));
}

#[test]
fn the_first_reason_is_reported() {
    let mut gate = gate();
    assert_eq!(take(&mut gate, 3), Ok(()));
    let mut refused =
        |state, age: u64, check: CommandCheck| gate.take(state, SAMPLE, (SAMPLE - age) as u16, &check).unwrap_err();
    let operational = NodeState::Operational;
    let moved = CommandCheck { travel: Limit::Beyond, ..BEYOND };
    assert_eq!(refused(NodeState::Fault, 21, moved), Refusal::NotArmed);
    assert_eq!(refused(operational, 21, moved), Refusal::Travel);
    assert_eq!(refused(operational, 21, BEYOND), Refusal::Late);
    assert_eq!(refused(operational, 4, BEYOND), Refusal::OutOfOrder);
    assert_eq!(refused(operational, 3, BEYOND), Refusal::Repeated);
    assert_eq!(refused(operational, 2, BEYOND), Refusal::OutOfRange);
    assert_eq!(refused(operational, 2, CommandCheck { range: Limit::Within, ..BEYOND }), Refusal::RateOfChange);
}

#[test]
fn beyond_the_travel_nothing_is_taken_and_nothing_remembered() {
    let mut gate = gate();
    let moved = CommandCheck { travel: Limit::Beyond, ..FREE };
    assert_eq!(judge(&mut gate, 20, &moved), Err(Refusal::Travel));
    assert_eq!(gate.answered(), None);
    assert_eq!(change(&mut gate, 0, 1.5), Err(Refusal::RateOfChange), "the first in sequence has one period");
}

#[test]
fn a_change_has_the_samples_since_the_last_command_in_sequence() {
    let mut gate = gate();
    assert_eq!(change(&mut gate, 20, 1.0), Ok(()), "the first");
    assert_eq!(change(&mut gate, 19, 1.01), Err(Refusal::RateOfChange));
    assert_eq!(gate.answered(), Some(SAMPLE - 20));
    assert_eq!(change(&mut gate, 18, 1.01), Err(Refusal::RateOfChange), "a repeated jump is rejected again");
    assert_eq!(change(&mut gate, 17, 1.0), Ok(()), "what one sample period allows");
    assert_eq!(change(&mut gate, 14, 3.01), Err(Refusal::RateOfChange));
    assert_eq!(change(&mut gate, 11, 3.0), Ok(()), "after two commands that were lost");
    assert_eq!(change(&mut gate, 9, f64::NAN), Err(Refusal::RateOfChange));
}

#[test]
fn a_command_that_is_out_of_sequence_gives_and_takes_no_time() {
    let mut gate = gate();
    assert_eq!(change(&mut gate, 10, 0.0), Ok(()));
    assert_eq!(change(&mut gate, 10, 0.0), Err(Refusal::Repeated));
    assert_eq!(change(&mut gate, 12, 0.0), Err(Refusal::OutOfOrder));
    assert_eq!(change(&mut gate, -1, 0.0), Err(Refusal::Late));
    assert_eq!(change(&mut gate, 6, 4.0), Ok(()));
    let out_of_range = CommandCheck { range: Limit::Beyond, ..FREE };
    assert_eq!(judge(&mut gate, 3, &out_of_range), Err(Refusal::OutOfRange));
    assert_eq!(change(&mut gate, 2, 1.01), Err(Refusal::RateOfChange), "since the one that is out of range");
    assert_eq!(change(&mut gate, 5, 1.0), Ok(()), "a sample before the rejected ones has its own period");
    gate.arm();
    assert_eq!(change(&mut gate, 0, 1.01), Err(Refusal::RateOfChange), "the first since arming");
}

#[test]
fn rounding_is_no_change() {
    for (allowed, change_periods) in [(true, 1.0 + 0.9e-9), (false, 1.0 + 1.2e-9)] {
        assert_eq!(change(&mut gate(), 0, change_periods).is_ok(), allowed, "{change_periods}");
    }
    let mut gate = gate();
    assert_eq!(change(&mut gate, 20, 0.0), Ok(()));
    assert_eq!(change(&mut gate, 0, 20.0 * (1.0 + 0.9e-9)), Ok(()), "relative to the change");
}

/// No frame is as short; a receiver rejects it by its length.
#[test]
fn data_without_content_have_the_crc_of_the_data_id() {
    let crc = |data: &[u8]| resonarm_protocol::e2e::profile5::crc(0x520B, data);
    assert_eq!([crc(&[]), crc(&[1])], [crc(&[1, 2]); 2]);
}

proptest! {
    /// Every accepted command answers a sample that is new, was sent, and is not too old.
    #[test]
    fn accepted_commands_answer_rising_recent_samples(
        asked in prop::collection::vec((0_u64..200, any::<u16>(), 0_u16..30, any::<bool>()), 1..200),
    ) {
        let (mut gate, mut sample) = (gate(), 65_000);
        for (later, anywhere, age, is_near) in asked {
            let (before, index) = (gate.answered(), if is_near { (sample as u16).wrapping_sub(age) } else { anywhere });
            let taken = gate.take(NodeState::Operational, sample, index, &FREE);
            match (taken, gate.answered()) {
                (Ok(()), Some(now)) => {
                    prop_assert!(now <= sample && sample - now <= 20 && before.is_none_or(|before| before < now));
                    prop_assert_eq!(now as u16, index);
                }
                (_, now) => prop_assert_eq!(now, before),
            }
            sample += later;
        }
    }

    /// For any commands, the accepted load changes no faster than the limit allows over the samples answered: from one
    /// command taken to the next, and from zero before the first command in sequence.
    #[test]
    fn the_load_follows_at_the_largest_rate_at_most(
        commands in prop::collection::vec((0_u64..3, 0_u64..25, -8_i64..8), 1..200),
    ) {
        // In units of what the load may change by in a sample period, so that the sums are exact.
        let (mut gate, mut sample, mut held, mut first) = (gate(), 1000, 0_i64, u64::MAX);
        for (later, age, load) in commands {
            sample += later;
            let (before, now) = (gate.answered(), sample - age);
            let check = CommandCheck { change_periods: (load - held).abs() as f64, ..FREE };
            let taken = gate.take(NodeState::Operational, sample, now as u16, &check);
            if matches!(taken, Ok(()) | Err(Refusal::RateOfChange)) {
                first = first.min(now);
            }
            if taken.is_ok() {
                prop_assert!((load - held).unsigned_abs() <= now - before.unwrap_or(first - 1));
                prop_assert!(load.unsigned_abs() <= now + 1 - first);
                held = load;
            }
        }
    }
}
