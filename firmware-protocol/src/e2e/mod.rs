//! End-to-end protection of messages (AUTOSAR FO PRS E2EProtocol): a CRC with the data id in it, and a counter.

pub mod profile11;
pub mod profile5;

/// The largest step of the counter that a receiver accepts: up to `MAX_DELTA_COUNTER - 1` frames may be lost in a row.
pub const MAX_DELTA_COUNTER: u8 = 4;

/// E2E protection of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Protection {
    /// Profile 11, variant 11A ([`profile11`]): 8-bit CRC, counter from 0 to 14.
    Profile11,
    /// Profile 5 ([`profile5`]): 16-bit CRC, counter from 0 to 255.
    Profile5,
}

impl Protection {
    /// The largest counter; the next is 0.
    pub const fn counter_max(self) -> u8 {
        match self {
            Protection::Profile11 => 14,
            Protection::Profile5 => u8::MAX,
        }
    }

    /// The counter after `counter`.
    pub const fn counter_after(self, counter: u8) -> u8 {
        if counter >= self.counter_max() { 0 } else { counter + 1 }
    }
}

/// A fault in the counter of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CounterFault {
    /// The counter is that of the message before: a repetition (or exactly as many were lost as there are counters).
    Repeated,
    /// The counter is more than [`MAX_DELTA_COUNTER`] after the last one: more were lost, or it is an old message.
    WrongSequence {
        /// The counter of the message before.
        last: u8,
    },
    /// The counter is 15, which Profile 11 doesn't use.
    Invalid,
}

/// The counter supervision of one message: the check function of its profile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Supervision {
    last: Option<u8>,
}

impl Supervision {
    /// Supervision that accepts any counter first.
    pub const fn new() -> Supervision {
        Supervision { last: None }
    }

    /// Checks the counter of a message whose CRC is right, and returns how many messages were lost before it.
    ///
    /// δ = (counter − last) mod n with the n counters of the profile: 1 is the next, 2 to [`MAX_DELTA_COUNTER`] mean
    /// δ − 1 lost, 0 is a repetition, more is a wrong sequence. The counter is stored in every case, so the
    /// receiver is in step again with the message after a wrong sequence.
    ///
    /// # Errors
    /// [`CounterFault`]: the message must not be used. An invalid counter leaves the supervision as it was.
    pub const fn check(&mut self, protection: Protection, counter: u8) -> Result<u8, CounterFault> {
        if counter > protection.counter_max() {
            return Err(CounterFault::Invalid);
        }
        let Some(last) = self.last else {
            self.last = Some(counter);
            return Ok(0);
        };
        // Stored even if the message is rejected below: the next one is compared with what the sender really sent
        // before it.
        self.last = Some(counter);
        let counters = protection.counter_max() as u16 + 1;
        // Adding n first keeps the unsigned difference from underflowing.
        match (counter as u16 + counters - last as u16) % counters {
            0 => Err(CounterFault::Repeated),
            delta if delta <= MAX_DELTA_COUNTER as u16 => Ok(delta as u8 - 1),
            _ => Err(CounterFault::WrongSequence { last }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: [Protection; 2] = [Protection::Profile11, Protection::Profile5];

    #[test]
    fn the_counter_goes_round() {
        for protection in BOTH {
            let mut counter = 0;
            for expected in (1..=protection.counter_max()).chain([0, 1]) {
                counter = protection.counter_after(counter);
                assert_eq!(counter, expected);
            }
        }
    }

    #[test]
    fn judges_every_pair_of_counters() {
        for protection in BOTH {
            let counters = i32::from(protection.counter_max()) + 1;
            for last in 0..=protection.counter_max() {
                for counter in 0..=protection.counter_max() {
                    let mut supervision = Supervision::new();
                    assert_eq!(supervision.check(protection, last), Ok(0));
                    let expected = match (i32::from(counter) - i32::from(last)).rem_euclid(counters) {
                        0 => Err(CounterFault::Repeated),
                        delta @ 1..=4 => Ok(delta as u8 - 1),
                        _ => Err(CounterFault::WrongSequence { last }),
                    };
                    assert_eq!(supervision.check(protection, counter), expected, "{last} then {counter}");
                    // Whatever the verdict is, the message after it is judged by what the sender really sent.
                    let next = protection.counter_after(counter);
                    assert_eq!(supervision.check(protection, next), Ok(0), "in step again after {counter}");
                }
            }
        }
    }

    #[test]
    fn counter_15_of_profile_11_is_invalid_and_forgotten() {
        let profile = Protection::Profile11;
        let mut supervision = Supervision::new();
        assert_eq!(supervision.check(profile, 15), Err(CounterFault::Invalid));
        assert_eq!(supervision, Supervision::new());
        assert_eq!(supervision.check(profile, 3), Ok(0));
        assert_eq!(supervision.check(profile, 15), Err(CounterFault::Invalid));
        assert_eq!(supervision.check(profile, 4), Ok(0));
    }
}
