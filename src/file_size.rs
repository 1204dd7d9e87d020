//! A write beyond the limit of file sizes is an error like a full disk, and not the end of the process.

/// Makes such a write fail with `EFBIG`. By default it raises SIGXFSZ, which kills the process in the middle of a run
/// (setrlimit(2), `RLIMIT_FSIZE`).
#[allow(unsafe_code, reason = "signal(2) has no safe wrapper among the dependencies")]
pub(super) fn fail_writes_beyond_limit() {
    // SAFETY: SIGXFSZ is a signal that may be ignored, and no handler of it is installed. The call can fail for other
    // signals alone.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}
