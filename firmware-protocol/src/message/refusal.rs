//! The reasons for which a plant rejects a valid command, and their numbers in an emergency.

use core::fmt;

/// Reason for which a plant rejected a valid command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Refusal {
    /// The plant is not armed.
    NotArmed = 1,
    /// The command answers a sample that is too old, or in the future.
    Late = 2,
    /// The command answers an older sample than the last accepted command.
    OutOfOrder = 3,
    /// The command answers the same sample as the last accepted command: the first counts.
    Repeated = 4,
    /// The exciter can't produce it.
    OutOfRange = 5,
    /// The command changes the load faster than allowed.
    RateOfChange = 6,
    /// The plant is beyond its largest travel.
    Travel = 7,
}

impl Refusal {
    /// All reasons, in the order of their numbers.
    pub const ALL: [Refusal; 7] = [
        Refusal::NotArmed,
        Refusal::Late,
        Refusal::OutOfOrder,
        Refusal::Repeated,
        Refusal::OutOfRange,
        Refusal::RateOfChange,
        Refusal::Travel,
    ];

    /// The detail of [`EmergencyCode::CommandTimeout`](super::EmergencyCode::CommandTimeout): the low byte is how many
    /// commands were rejected since the last accepted one, at most 255; the high byte is the reason of the last
    /// refusal, 0 if there was none.
    pub const fn detail(count: u64, last: Option<Refusal>) -> u16 {
        let count = if count > 255 { 255 } else { count as u16 };
        match last {
            Some(refusal) => (refusal as u16) << 8 | count,
            None => count,
        }
    }

    /// The count and the reason in such a detail.
    pub fn from_detail(detail: u16) -> (u8, Option<Refusal>) {
        let [count, reason] = detail.to_le_bytes();
        (count, Refusal::ALL.into_iter().find(|known| *known as u8 == reason))
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Refusal::NotArmed => "the plant is not armed",
            Refusal::Late => "the sample it answers is too old or still to come",
            Refusal::OutOfOrder => "an older sample is answered after a newer one",
            Refusal::Repeated => "the sample has already been answered",
            Refusal::OutOfRange => "the load is beyond the exciter's limits",
            Refusal::RateOfChange => "it changes the load too fast",
            Refusal::Travel => "the plant is beyond its travel",
        })
    }
}
