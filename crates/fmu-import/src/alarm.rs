//! The time limit of a process that must not hang.

#![allow(unsafe_code, reason = "signals have no safe wrapper among the dependencies")]

/// Ends this process by SIGALRM after `seconds`.
pub(crate) fn end_within(seconds: u32) {
    // SAFETY: calls with numbers.
    unsafe {
        libc::signal(libc::SIGALRM, libc::SIG_DFL);
        libc::alarm(seconds);
    }
}
