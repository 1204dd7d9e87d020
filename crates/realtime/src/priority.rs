//! Priorities of real-time threads.

use rustix::io::Errno;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A priority of `SCHED_FIFO`, 1 (lowest) to 99.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub struct FifoPriority(u8);

impl FifoPriority {
    /// Above threaded interrupt handlers (50), below the kernel's own watchdog and migration threads (99).
    pub const DEFAULT: Self = Self(80);
    /// Lowest priority of `SCHED_FIFO`.
    pub const MIN: Self = Self(1);

    /// Returns the priority as a number, 1 to 99.
    pub fn get(self) -> u8 {
        self.0
    }
}

impl TryFrom<u8> for FifoPriority {
    type Error = PriorityError;

    fn try_from(priority: u8) -> Result<Self, Self::Error> {
        if (1..=99).contains(&priority) { Ok(Self(priority)) } else { Err(PriorityError { priority }) }
    }
}

impl From<FifoPriority> for u8 {
    fn from(priority: FifoPriority) -> Self {
        priority.0
    }
}

/// A number that is no priority of `SCHED_FIFO`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the real-time priority is {priority}; it must be from 1 to 99")]
pub struct PriorityError {
    /// Number that is outside 1 to 99.
    pub priority: u8,
}

/// Puts the calling thread under `SCHED_FIFO`; threads that it starts later get the default scheduling.
#[allow(unsafe_code)] // no safe wrapper exists: rustix has no call that sets a scheduling policy
pub(super) fn set_fifo(priority: FifoPriority) -> Result<(), Errno> {
    const CALLING_THREAD: libc::c_long = 0;
    const NO_FLAGS: libc::c_long = 0;
    let attributes = libc::sched_attr {
        size: size_of::<libc::sched_attr>() as u32,
        sched_policy: libc::SCHED_FIFO.unsigned_abs(),
        sched_flags: libc::SCHED_FLAG_RESET_ON_FORK as u64,
        sched_nice: 0,
        sched_priority: priority.get().into(),
        sched_runtime: 0,
        sched_deadline: 0,
        sched_period: 0,
    };
    // SAFETY: the kernel reads `attributes.size` bytes from the pointer, which is that of a live value of that size,
    // and writes nothing.
    let result =
        unsafe { libc::syscall(libc::SYS_sched_setattr, CALLING_THREAD, core::ptr::from_ref(&attributes), NO_FLAGS) };
    if result == 0 {
        return Ok(());
    }
    Err(Errno::from_io_error(&std::io::Error::last_os_error()).unwrap_or(Errno::IO))
}
