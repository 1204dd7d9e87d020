//! Multiplexed signals: present in a payload only if a switch, another signal of it, has one of some values.
//!
//! A switch may be multiplexed itself (extended multiplexing), so that the presence of a signal is a chain of
//! conditions.

use alloc::vec::Vec;
use core::ops::RangeInclusive;

use thiserror::Error;

use crate::layout::{Layout, Number};

/// Why a signal can't be multiplexed so.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum MultiplexError {
    /// The switch is a floating-point number.
    #[error("its switch is a floating-point number: a switch is an integer")]
    Float,
    /// No values.
    #[error("no value of the switch selects it")]
    NoValues,
    /// A range from a larger to a smaller value.
    #[error("the range {least}-{most} of the switch has no values")]
    Reversed {
        /// The lower end.
        least: u64,
        /// The upper end.
        most: u64,
    },
    /// The switch can't have a value.
    #[error("the switch can't be {got}: it goes up to {most}")]
    Beyond {
        /// The value.
        got: u64,
        /// The largest value of the switch.
        most: u64,
    },
}

/// A switch, and the values of it that select.
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
            Number::Signed => switch.mask() / 2,
        };
        if values.is_empty() {
            return Err(MultiplexError::NoValues);
        }
        for range in &values {
            if range.is_empty() {
                return Err(MultiplexError::Reversed { least: *range.start(), most: *range.end() });
            }
            // Of a range, the part that the switch can't have is never met: only a range of nothing else is a mistake.
            if *range.start() > most {
                return Err(MultiplexError::Beyond { got: *range.start(), most });
            }
        }
        Ok(Condition { switch, values })
    }

    /// The switch.
    pub const fn switch(&self) -> &Layout {
        &self.switch
    }

    /// The values that select, inclusive ranges.
    pub fn values(&self) -> &[RangeInclusive<u64>] {
        &self.values
    }

    /// Whether the payload's switch selects; None if the payload ends before it.
    pub fn holds(&self, payload: &[u8]) -> Option<bool> {
        let raw = match self.switch.number() {
            // A negative number is in no range.
            Number::Signed => u64::try_from(self.switch.extract_i64(payload)?).ok(),
            _ => Some(self.switch.extract_u64(payload)?),
        };
        Some(raw.is_some_and(|raw| self.values.iter().any(|range| range.contains(&raw))))
    }

    /// Whether no payload fulfils both: the same switch, and no value in common.
    fn excludes(&self, other: &Condition) -> bool {
        let apart = |a: &RangeInclusive<u64>, b: &RangeInclusive<u64>| a.end() < b.start() || b.end() < a.start();
        self.switch.is_same_place(&other.switch)
            && self.values.iter().all(|mine| other.values.iter().all(|others| apart(mine, others)))
    }
}

/// In which payloads a signal is present: in those that fulfil every condition.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Presence {
    conditions: Vec<Condition>,
}

impl Presence {
    /// Present in every payload.
    pub const ALWAYS: Presence = Presence { conditions: Vec::new() };

    /// Present if all `conditions` hold, that of the outermost switch first.
    pub const fn new(conditions: Vec<Condition>) -> Presence {
        Presence { conditions }
    }

    /// The conditions, that of the outermost switch first.
    pub fn conditions(&self) -> &[Condition] {
        &self.conditions
    }

    /// Whether the signal is present in a payload. None if the payload ends before a switch that decides: an inner
    /// switch does not if an outer one has said no.
    pub fn is_in(&self, payload: &[u8]) -> Option<bool> {
        for condition in &self.conditions {
            if !condition.holds(payload)? {
                return Some(false);
            }
        }
        Some(true)
    }

    /// Whether no payload has both signals, so that they may share bits.
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
