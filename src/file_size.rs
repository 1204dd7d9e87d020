//! Makes a write beyond the file size limit an error like a full disk, instead of the end of the process.

/// Makes a write beyond the file size limit fail with `EFBIG`. By default it raises SIGXFSZ, which kills the process in
/// the middle of a run (setrlimit(2), `RLIMIT_FSIZE`).
#[allow(unsafe_code, reason = "signal(2) has no safe wrapper among the dependencies")]
pub(crate) fn fail_writes_beyond_limit() {
    // SAFETY: SIGXFSZ may be ignored, and no handler of it is installed. The call can fail only for other signals.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}
