//! Causes of missed deadlines.

use serde::Serialize;

/// Cause of missed deadlines, as far as the loop itself knows it: what the loop did when they passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum OverrunCause {
    /// The loop slept for an earlier deadline, and was woken too late.
    WokeLate,
    /// The loop worked on the tick before, half of the time or more on something else than the bus.
    StepLong,
    /// The loop worked on the tick before, most of the time on the bus: taking frames in and sending them.
    BusLong,
}

impl OverrunCause {
    /// All causes that the loop can tell apart.
    pub const ALL: [Self; 3] = [Self::WokeLate, Self::StepLong, Self::BusLong];

    /// Returns the name of the cause in text.
    pub const fn name(self) -> &'static str {
        match self {
            Self::WokeLate => "woke-late",
            Self::StepLong => "step-long",
            Self::BusLong => "bus-long",
        }
    }

    /// The cause if the work took `work_ns`, `bus_ns` of them on the bus.
    pub(super) const fn of_work(work_ns: u64, bus_ns: u64) -> Self {
        if bus_ns > work_ns / 2 { Self::BusLong } else { Self::StepLong }
    }
}

/// Missed deadlines by cause: each counts once, so that the sum is the number of overruns. The field names are those of
/// the program's JSON.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct OverrunCauses {
    /// [`OverrunCause::WokeLate`], where it is not known who had the core.
    pub woke_late: u64,
    /// [`OverrunCause::StepLong`], where it is not known who had the core.
    pub step_long: u64,
    /// [`OverrunCause::BusLong`], where it is not known who had the core.
    pub bus_long: u64,
    /// The host of this virtual machine had the core meanwhile.
    pub stolen: u64,
    /// Other threads had the core meanwhile, and the loop waited for it.
    pub preempted: u64,
}

impl OverrunCauses {
    /// Adds `missed` deadlines to those of `cause`.
    pub fn count(&mut self, cause: OverrunCause, missed: u64) {
        *self.of(cause) += missed;
    }

    /// Returns the count of each cause, with its name in words for people.
    pub const fn in_words(&self) -> [(&'static str, u64); 5] {
        [
            ("while the host had the core", self.stolen),
            ("while other threads had the core", self.preempted),
            ("woke late", self.woke_late),
            ("step long", self.step_long),
            ("bus long", self.bus_long),
        ]
    }

    /// Returns the number of missed deadlines of all causes.
    pub fn total(&self) -> u64 {
        self.woke_late + self.step_long + self.bus_long + self.stolen + self.preempted
    }

    /// The count of one cause.
    pub fn of(&mut self, cause: OverrunCause) -> &mut u64 {
        match cause {
            OverrunCause::WokeLate => &mut self.woke_late,
            OverrunCause::StepLong => &mut self.step_long,
            OverrunCause::BusLong => &mut self.bus_long,
        }
    }
}
