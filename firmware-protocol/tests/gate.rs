//! The gate of a plant: which commands it takes, and why not the others.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use proptest::prelude::*;
use resonarm_protocol::timing::COMMAND_AGE_NS;
use resonarm_protocol::{CommandGate, LoadRange, NodeState, Refusal};

/// Far beyond the modulus of the wire.
const SAMPLE: u64 = 70_000;

fn gate() -> CommandGate {
    CommandGate::new(COMMAND_AGE_NS, 1000)
}

/// A command of this age, which the exciter can produce, to an operational plant.
fn take(gate: &mut CommandGate, age: i64) -> Result<(), Refusal> {
    gate.take(NodeState::Operational, SAMPLE, (SAMPLE as i64 - age) as u16, LoadRange::Within)
}

#[test]
fn only_an_operational_plant_takes_commands() {
    for state in NodeState::ALL {
        let mut gate = gate();
        let taken = gate.take(state, SAMPLE, SAMPLE as u16, LoadRange::Within);
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
    assert_eq!(oldest(COMMAND_AGE_NS, 149), Some(2));
    assert_eq!(oldest(0, u16::MAX), Some(0));
    assert_eq!(oldest(u64::MAX, u16::MAX), Some(u16::MAX));
}

#[test]
fn there_is_no_sample_before_the_first() {
    for (sample, index, wanted) in [(0, 0, Ok(())), (3, 0, Ok(())), (3, 0xFFFF, Err(Refusal::Late))] {
        assert_eq!(
            gate().take(NodeState::Operational, sample, index, LoadRange::Within),
            wanted,
            "{index} at {sample}"
        );
    }
    assert_eq!(gate().take(NodeState::Operational, 0x1_0003, 0xFFFF, LoadRange::Within), Ok(()));
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
    assert_eq!(gate.take(NodeState::Operational, SAMPLE, SAMPLE as u16, LoadRange::Beyond), Err(Refusal::OutOfRange));
    assert_eq!(gate.answered(), None);
    assert_eq!(take(&mut gate, 0), Ok(()));
}

#[test]
fn the_first_reason_is_told() {
    let mut gate = gate();
    assert_eq!(take(&mut gate, 3), Ok(()));
    let mut refused = |state, age: u64| gate.take(state, SAMPLE, (SAMPLE - age) as u16, LoadRange::Beyond).unwrap_err();
    assert_eq!(refused(NodeState::Fault, 21), Refusal::NotArmed);
    assert_eq!(refused(NodeState::Operational, 21), Refusal::Late);
    assert_eq!(refused(NodeState::Operational, 4), Refusal::OutOfOrder);
    assert_eq!(refused(NodeState::Operational, 3), Refusal::Repeated);
    assert_eq!(refused(NodeState::Operational, 2), Refusal::OutOfRange);
}

/// No frame is as short; a receiver refuses it by its length.
#[test]
fn data_without_content_have_the_crc_of_the_data_id() {
    let crc = |data: &[u8]| resonarm_protocol::e2e::profile5::crc(0x520B, data);
    assert_eq!([crc(&[]), crc(&[1])], [crc(&[1, 2]); 2]);
}

proptest! {
    /// Whatever is asked, what is taken is new, of a sample that was sent, and not too old.
    #[test]
    fn what_is_taken_rises_and_is_fresh(
        asked in prop::collection::vec((0_u64..200, any::<u16>(), 0_u16..30, any::<bool>()), 1..200),
    ) {
        let (mut gate, mut sample) = (gate(), 65_000);
        for (later, anywhere, age, is_near) in asked {
            let (before, index) = (gate.answered(), if is_near { (sample as u16).wrapping_sub(age) } else { anywhere });
            let taken = gate.take(NodeState::Operational, sample, index, LoadRange::Within);
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
}
