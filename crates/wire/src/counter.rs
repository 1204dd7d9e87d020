//! Alive counters, which count up by one with every frame, from 0 to one below the number of their values and
//! then from 0 again.

use thiserror::Error;

use crate::layout::{InsertError, Layout, Number};

/// Reason why a signal can't be a counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum CounterError {
    /// The signal is a floating-point number.
    #[error("it is a floating-point number: a counter must be an integer")]
    Float,
    /// The number of values is below two, or more than the bits can represent.
    #[error("it has {got} values: with {bits} bits a counter must have 2 to {most}")]
    Values {
        /// Number of values that was given.
        got: u64,
        /// Width of the signal, bits.
        bits: u8,
        /// Largest number of values.
        most: u64,
    },
}

/// Layout and range of a counter. All values of this type are valid, since the constructor checks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counter {
    layout: Layout,
    values: u64,
}

impl Counter {
    /// Returns a counter from 0 to `values` − 1. Its bits count as an unsigned integer, even if the layout is
    /// signed.
    ///
    /// # Errors
    /// [`CounterError`] if it is no integer, or can't have so many values. At most 2⁶⁴ − 1 are taken.
    pub fn new(layout: Layout, values: u64) -> Result<Counter, CounterError> {
        if layout.number() == Number::Float {
            return Err(CounterError::Float);
        }
        // Saturating: a counter of 64 bits loses one of its 2⁶⁴ values, which no frame rate ever reaches.
        let most = layout.mask().saturating_add(1);
        if !(2..=most).contains(&values) {
            return Err(CounterError::Values { got: values, bits: layout.bits(), most });
        }
        Ok(Counter { layout, values })
    }

    /// Returns the layout of its bits.
    pub const fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Returns the number of its values.
    pub const fn values(&self) -> u64 {
        self.values
    }

    /// Reads the counter of a payload, which may be beyond its values; `None` if the payload ends before it.
    pub fn read(&self, payload: &[u8]) -> Option<u64> {
        self.layout.extract_u64(payload)
    }

    /// Writes the counter into a payload.
    ///
    /// # Errors
    /// [`InsertError`] if it doesn't fit the bits or the payload.
    pub fn write(&self, value: u64, payload: &mut [u8]) -> Result<(), InsertError> {
        self.layout.insert_u64(value, payload)
    }

    /// Returns the counter that follows `value`.
    pub const fn after(&self, value: u64) -> u64 {
        if value >= self.values - 1 { 0 } else { value + 1 }
    }
}

/// Relation of a counter to the previous one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// No counter precedes it.
    First,
    /// The counter is the next one.
    Next,
    /// Frames were lost, or an old one was repeated: the counter can't tell which. The receiver decides how
    /// many lost frames it accepts.
    Lost {
        /// Number of lost frames, if frames were lost: at least 1, at most the number of values less two.
        frames: u64,
    },
}

/// A counter that can't belong to a frame in sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum CounterFault {
    /// The counter equals the previous one: a repeated frame, or a loss of exactly one frame less than there
    /// are values.
    #[error("counter {counter} was repeated")]
    Repeated {
        /// Counter of the frame.
        counter: u64,
    },
    /// The counter is beyond its values.
    #[error("counter {counter} is too large: it must be at most {}", values - 1)]
    Beyond {
        /// Counter of the frame.
        counter: u64,
        /// Number of values of the counter.
        values: u64,
    },
}

/// Checks the sequence of one message's counters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CounterCheck {
    last: Option<u64>,
}

impl CounterCheck {
    /// Returns a check that has seen no counter.
    pub const fn new() -> CounterCheck {
        CounterCheck { last: None }
    }

    /// Returns the last valid counter, if there was one.
    pub const fn last(&self) -> Option<u64> {
        self.last
    }

    /// Checks the counter of a frame.
    ///
    /// δ = (counter − last) mod n with the n values: 1 is the next counter, more means δ − 1 lost frames, 0 is
    /// a repetition. The counter is kept as the last one even if it is repeated.
    ///
    /// # Errors
    /// [`CounterFault`] if it is repeated or beyond the values; the latter leaves the check as it was.
    pub const fn check(&mut self, counter: &Counter, value: u64) -> Result<Step, CounterFault> {
        if value >= counter.values {
            return Err(CounterFault::Beyond { counter: value, values: counter.values });
        }
        let Some(last) = self.last else {
            self.last = Some(value);
            return Ok(Step::First);
        };
        self.last = Some(value);
        // The sum value + n is avoided, as it may exceed u64. The last counter is below n, unless it belongs to
        // another message, hence the remainder.
        let delta = if value >= last { value - last } else { counter.values - last % counter.values + value };
        match delta {
            0 => Err(CounterFault::Repeated { counter: value }),
            1 => Ok(Step::Next),
            more => Ok(Step::Lost { frames: more - 1 }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::ByteOrder;

    fn counter(bits: u64, values: u64) -> Result<Counter, CounterError> {
        Counter::new(Layout::new(4, bits, ByteOrder::Intel, Number::Unsigned, 16).unwrap(), values)
    }

    #[test]
    fn judges_every_pair_of_counters() {
        // The fewest values, those of AUTOSAR's profiles 1 and 11, which leave 15 out, and all of four bits.
        for values in [2, 15, 16] {
            let counter = counter(4, values).unwrap();
            for last in 0..values {
                for value in 0..values {
                    let mut check = CounterCheck::new();
                    assert_eq!(check.check(&counter, last), Ok(Step::First));
                    let expected = match (value + values - last) % values {
                        0 => Err(CounterFault::Repeated { counter: value }),
                        1 => Ok(Step::Next),
                        delta => Ok(Step::Lost { frames: delta - 1 }),
                    };
                    assert_eq!(check.check(&counter, value), expected, "{last} then {value} of {values}");
                    assert_eq!(check.check(&counter, counter.after(value)), Ok(Step::Next));
                }
            }
        }
    }

    #[test]
    fn a_counter_beyond_its_values_is_forgotten() {
        let counter = counter(4, 15).unwrap();
        let mut check = CounterCheck::new();
        assert_eq!(check.check(&counter, 14), Ok(Step::First));
        assert_eq!(check.check(&counter, 15), Err(CounterFault::Beyond { counter: 15, values: 15 }));
        assert_eq!(check.last(), Some(14));
        assert_eq!(check.check(&counter, 0), Ok(Step::Next));
        assert_eq!(
            CounterFault::Beyond { counter: 15, values: 15 }.to_string(),
            "counter 15 is too large: it must be at most 14"
        );
    }

    #[test]
    fn reads_and_writes() {
        let counter = counter(4, 15).unwrap();
        let mut payload = [0xFF; 2];
        counter.write(3, &mut payload).unwrap();
        assert_eq!((payload, counter.read(&payload)), ([0x3F, 0xFF], Some(3)));
        assert_eq!(counter.read(&[]), None);
        assert!(counter.write(16, &mut payload).is_err());
    }

    #[test]
    fn refuses_values_that_the_bits_cannot_say() {
        assert_eq!(counter(4, 17), Err(CounterError::Values { got: 17, bits: 4, most: 16 }));
        assert_eq!(counter(4, 1), Err(CounterError::Values { got: 1, bits: 4, most: 16 }));
        let float = Layout::new(0, 32, ByteOrder::Intel, Number::Float, 8).unwrap();
        assert_eq!(Counter::new(float, 16), Err(CounterError::Float));
        // Here the sum of a counter and the number of values would not fit 64 bits.
        let widest = counter(64, u64::MAX).unwrap();
        let mut check = CounterCheck::new();
        assert_eq!(check.check(&widest, u64::MAX - 1), Ok(Step::First));
        assert_eq!(check.check(&widest, 0), Ok(Step::Next));
    }
}
