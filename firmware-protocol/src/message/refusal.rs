//! Why a valid command did not reach the arm.

use core::fmt;

/// Why a valid command did not reach the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Refusal {
    /// The plant is not armed.
    NotArmed = 1,
    /// It answers a sample that is too old, or still to come.
    Late = 2,
    /// It answers an older sample than the last command that was taken.
    OutOfOrder = 3,
    /// It answers the same sample as the last command that was taken: the first counts.
    Repeated = 4,
    /// The exciter can't produce it.
    OutOfRange = 5,
    /// It changes the load faster than it may.
    RateOfChange = 6,
    /// The plant is beyond its largest travel.
    Travel = 7,
}

impl Refusal {
    /// Every reason.
    pub const ALL: [Refusal; 7] = [
        Refusal::NotArmed,
        Refusal::Late,
        Refusal::OutOfOrder,
        Refusal::Repeated,
        Refusal::OutOfRange,
        Refusal::RateOfChange,
        Refusal::Travel,
    ];

    /// The detail of [`EmergencyCode::CommandTimeout`](super::EmergencyCode::CommandTimeout): in the low byte how many
    /// commands were refused since the last one was taken, at most 255, in the high byte why the last of them was, 0 if
    /// none was.
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
            Refusal::Repeated => "the sample is answered already",
            Refusal::OutOfRange => "the exciter can't produce it",
            Refusal::RateOfChange => "it changes the load too fast",
            Refusal::Travel => "the plant is beyond its travel",
        })
    }
}
