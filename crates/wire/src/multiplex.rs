//! Multiplexed signals, which a payload contains only if a switch, another of its signals, has one of certain
//! values.
//!
//! A switch may itself be multiplexed (extended multiplexing), so that the presence of a signal is a sequence
//! of conditions.

use alloc::vec::Vec;
use core::ops::RangeInclusive;

use thiserror::Error;

use crate::layout::{Layout, Number};

/// Reason why a signal can't be multiplexed by a switch.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum MultiplexError {
    /// The switch is a floating-point number.
    #[error("its switch is a floating-point number: a switch must be an integer")]
    Float,
    /// No value of the switch is given.
    #[error("no value of the switch selects it: give at least one")]
    NoValues,
    /// A range ends below its start.
    #[error("the range {least}-{most} of the switch is empty: it must not end below its start")]
    Reversed {
        /// Start of the range.
        least: u64,
        /// End of the range.
        most: u64,
    },
    /// The switch can't represent the value.
    #[error("the switch can't be {got}: it must be at most {most}")]
    Beyond {
        /// Value that was given.
        got: u64,
        /// Largest value of the switch.
        most: u64,
    },
}

/// A switch, and its values that select a signal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Condition {
    switch: Layout,
    values: Vec<RangeInclusive<u64>>,
}

impl Condition {
    /// The condition that the raw number of `switch` is in one of `values`.
    ///
    /// # Errors
    /// [`MultiplexError`] if the switch is no integer, can't have a value, or there are no values.
    pub fn new(switch: Layout, values: Vec<RangeInclusive<u64>>) -> Result<Condition, MultiplexError> {
        let most = match switch.number() {
            Number::Float => return Err(MultiplexError::Float),
            Number::Unsigned => switch.mask(),
            // Selecting values are unsigned, so a signed switch can match up to its largest positive number.
            Number::Signed => switch.mask() / 2,
        };
        if values.is_empty() {
            return Err(MultiplexError::NoValues);
        }
        for range in &values {
            if range.is_empty() {
                return Err(MultiplexError::Reversed { least: *range.start(), most: *range.end() });
            }
            // The part of a range that the switch can't represent is simply never met. Only a range that lies
            // wholly beyond is a mistake.
            if *range.start() > most {
                return Err(MultiplexError::Beyond { got: *range.start(), most });
            }
        }
        Ok(Condition { switch, values })
    }

    /// Returns the layout of the switch.
    pub const fn switch(&self) -> &Layout {
        &self.switch
    }

    /// Returns the values that select, as inclusive ranges.
    pub fn values(&self) -> &[RangeInclusive<u64>] {
        &self.values
    }

    /// Returns whether the switch in a payload selects; `None` if the payload ends before it.
    pub fn holds(&self, payload: &[u8]) -> Option<bool> {
        let raw = match self.switch.number() {
            // A negative switch value lies in no range of unsigned values.
            Number::Signed => u64::try_from(self.switch.extract_i64(payload)?).ok(),
            _ => Some(self.switch.extract_u64(payload)?),
        };
        Some(raw.is_some_and(|raw| self.values.iter().any(|range| range.contains(&raw))))
    }

    /// Returns whether no payload fulfils both conditions: the same switch, and no value in common.
    fn excludes(&self, other: &Condition) -> bool {
        let apart = |a: &RangeInclusive<u64>, b: &RangeInclusive<u64>| a.end() < b.start() || b.end() < a.start();
        // Conditions on different switches never exclude each other: a payload can have any two values in them.
        self.switch.is_same_place(&other.switch)
            && self.values.iter().all(|mine| other.values.iter().all(|others| apart(mine, others)))
    }
}

/// Payloads that contain a signal: those that fulfil every condition.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Presence {
    conditions: Vec<Condition>,
}

impl Presence {
    /// The presence of a signal that is in every payload.
    pub const ALWAYS: Presence = Presence { conditions: Vec::new() };

    /// Returns the presence if all `conditions` hold, the outermost switch first.
    pub const fn new(conditions: Vec<Condition>) -> Presence {
        Presence { conditions }
    }

    /// Returns the conditions, the outermost switch first.
    pub fn conditions(&self) -> &[Condition] {
        &self.conditions
    }

    /// Returns whether a payload contains the signal; `None` if it ends before a switch that decides. An inner
    /// switch does not decide if an outer one excludes the signal.
    pub fn is_in(&self, payload: &[u8]) -> Option<bool> {
        for condition in &self.conditions {
            if !condition.holds(payload)? {
                return Some(false);
            }
        }
        Some(true)
    }

    /// Returns whether no payload contains both signals, so that they may share bits.
    pub fn excludes(&self, other: &Presence) -> bool {
        self.conditions.iter().any(|mine| other.conditions.iter().any(|others| mine.excludes(others)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::ByteOrder;

    fn switch(byte: u64, number: Number) -> Layout {
        Layout::new(8 * byte, 8, ByteOrder::Intel, number, 8).unwrap()
    }

    fn condition(byte: u64, values: &[RangeInclusive<u64>]) -> Condition {
        Condition::new(switch(byte, Number::Unsigned), values.to_vec()).unwrap()
    }

    #[test]
    fn a_signal_is_present_if_every_switch_selects_it() {
        assert_eq!(Presence::ALWAYS.is_in(&[]), Some(true));
        let nested = Presence::new(vec![condition(0, &[1..=1]), condition(1, &[3..=5, 8..=8])]);
        for (payload, expected) in [
            (&[1, 3][..], Some(true)),
            (&[1, 8], Some(true)),
            (&[1, 6], Some(false)),
            (&[2, 3], Some(false)),
            (&[2], Some(false)),
            (&[1], None),
            (&[], None),
        ] {
            assert_eq!(nested.is_in(payload), expected, "{payload:?}");
        }
    }

    #[test]
    fn a_negative_switch_selects_nothing() {
        let signed = Condition::new(switch(0, Number::Signed), vec![0..=127]).unwrap();
        assert_eq!((signed.holds(&[127]), signed.holds(&[128])), (Some(true), Some(false)));
    }

    #[test]
    fn knows_which_signals_are_never_together() {
        let of = |values: &[RangeInclusive<u64>]| Presence::new(vec![condition(0, values)]);
        assert!(of(&[0..=3]).excludes(&of(&[4..=4, 9..=10])));
        assert!(!of(&[0..=4]).excludes(&of(&[4..=4])));
        assert!(!of(&[0..=4]).excludes(&Presence::ALWAYS));
        let inner = Presence::new(vec![condition(0, &[1..=1]), condition(1, &[1..=1])]);
        assert!(inner.excludes(&of(&[2..=2])) && !inner.excludes(&of(&[1..=1])));
    }

    #[test]
    #[expect(clippy::reversed_empty_ranges)]
    fn refuses_impossible_conditions() {
        let new = |number, values| Condition::new(switch(0, number), values).unwrap_err();
        assert_eq!(new(Number::Unsigned, vec![]), MultiplexError::NoValues);
        assert_eq!(new(Number::Unsigned, vec![3..=2]), MultiplexError::Reversed { least: 3, most: 2 });
        assert_eq!(new(Number::Unsigned, vec![256..=300]), MultiplexError::Beyond { got: 256, most: 255 });
        assert_eq!(new(Number::Signed, vec![128..=128]), MultiplexError::Beyond { got: 128, most: 127 });
        let float = Layout::new(0, 32, ByteOrder::Intel, Number::Float, 8).unwrap();
        assert_eq!(Condition::new(float, vec![0..=1]), Err(MultiplexError::Float));
    }
}
