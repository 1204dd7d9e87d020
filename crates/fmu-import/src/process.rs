//! The process in which the library of an FMU runs, and the one that watches it.
//!
//! ```text
//!   program ──────requests──────► FMU
//!      ▲ ▲──────────answers────────┘ ▲ waitpid, SIGKILL
//!      │ └───"it has ended"─────── guard ──► removes the folder
//!      └──────────lifeline───────────┘
//! ```
//!
//! Both are forked from this process and execute no other program: a user's program and the Python interpreter have no
//! command that could be executed. What runs after the fork takes no lock that another thread may have held: it uses
//! memory and the loader, which the C library keeps usable in the child of a process with threads, and files.
//!
//! The guard runs no code of the FMU. It waits until the FMU's process ends, and tells how, or until the lifeline is
//! closed, be it that this process has died. In both cases nothing of the FMU is left: no process and no folder.

#![allow(unsafe_code, reason = "processes and signals have no safe wrapper among the dependencies")]

use core::ffi::c_int;
use std::fs;
use std::io::{Error, PipeReader, PipeWriter, Read, Result, Write};
use std::os::fd::{AsRawFd, RawFd};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use crate::loaded::serve;
use crate::message::{Answer, Answers};
use crate::source::Source;

/// The ends of the pipes that belong to the FMU's process and the guard.
#[derive(Debug)]
pub(crate) struct FarEnds {
    pub requests: PipeReader,
    pub answers: PipeWriter,
    pub lifeline: PipeReader,
}

/// The guard of an FMU that may be unpacked now.
#[derive(Debug)]
pub(crate) struct Guard {
    pid: libc::pid_t,
    /// Closed to end the FMU.
    lifeline: Option<PipeWriter>,
}

impl Guard {
    /// Starts the guard of `folder`, which it removes at the end. [`Guard::load`] starts the FMU.
    ///
    /// # Errors
    /// That of fork(2).
    pub fn start(source: &Source, folder: &Path, ends: FarEnds, lifeline: PipeWriter) -> Result<Guard> {
        // What waits would be written by both processes.
        flush();
        // SAFETY: the child takes no lock of this process, and never returns from `watch`.
        match unsafe { libc::fork() } {
            -1 => Err(Error::last_os_error()),
            0 => {
                let watched = catch_unwind(AssertUnwindSafe(|| watch(source, folder, ends)));
                let _kept = fs::remove_dir_all(folder);
                exit(if matches!(watched, Ok(Ok(()))) { 0 } else { 1 })
            }
            pid => Ok(Guard { pid, lifeline: Some(lifeline) }),
        }
    }

    /// Starts the FMU, whose files are in the folder now.
    ///
    /// # Errors
    /// That of the pipe.
    pub fn load(&mut self) -> Result<()> {
        match &mut self.lifeline {
            Some(lifeline) => lifeline.write_all(&[0]),
            None => Ok(()),
        }
    }
}

impl Drop for Guard {
    /// Ends the FMU if it has not ended, and waits until its folder is removed.
    fn drop(&mut self) {
        self.lifeline = None;
        // SAFETY: a child of this process that nobody else waits for.
        while unsafe { libc::waitpid(self.pid, core::ptr::null_mut(), 0) } == -1
            && Error::last_os_error().kind() == std::io::ErrorKind::Interrupted
        {}
    }
}

/// Writes what waits in the buffers of C.
fn flush() {
    // SAFETY: no pointers: NULL stands for all files.
    unsafe { libc::fflush(core::ptr::null_mut()) };
}

/// Ends this process at once, without what the program has registered for its end.
fn exit(code: c_int) -> ! {
    // SAFETY: it does not return.
    unsafe { libc::_exit(code) }
}

/// Makes a result of what a system call returned: -1 is an error.
fn checked(returned: c_int) -> Result<c_int> {
    if returned == -1 { Err(Error::last_os_error()) } else { Ok(returned) }
}

/// Gives a new process handlers of signals, a process group and standard files of its own.
fn separate() -> Result<()> {
    // SAFETY: calls with numbers, and a set that is initialized by `sigemptyset`. Signals that can't be set are kept.
    unsafe {
        for signal in 1..=libc::SIGRTMAX() {
            libc::signal(signal, libc::SIG_DFL);
        }
        let mut none = core::mem::zeroed();
        libc::sigemptyset(&mut none);
        checked(libc::sigprocmask(libc::SIG_SETMASK, &none, core::ptr::null_mut()))?;
        // Ctrl-C goes to the processes of a terminal's group: it asks the program to stop, and the program ends the FMU.
        libc::setpgid(0, 0);
        let null = checked(libc::open(c"/dev/null".as_ptr(), libc::O_RDWR))?;
        checked(libc::dup2(null, libc::STDIN_FILENO))?;
        // Standard output may be a document of the program, such as that of `--json`.
        checked(libc::dup2(libc::STDERR_FILENO, libc::STDOUT_FILENO)).or_else(|_| checked(libc::dup2(null, 1)))?;
    }
    Ok(())
}

/// Closes the program's files in this process, except those that are `kept`.
///
/// No process may be forked after this. A library of the program may have registered a handler for forks that needs its
/// files: that of Apache Arrow, which runs in every Python program with pandas or pyarrow, aborts the new process if the
/// files of its pipe are closed.
fn close_others(kept: [RawFd; 2]) -> Result<()> {
    let open = fs::read_dir("/proc/self/fd")?;
    let open = open.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
    // Collected before any is closed, since the folder is read through one of these files.
    let open: Vec<RawFd> = open.filter(|fd| *fd > 2 && !kept.contains(fd)).collect();
    for fd in open {
        // SAFETY: a file of the program, which goes on in its own process; nothing of it is used in this one.
        unsafe { libc::close(fd) };
    }
    Ok(())
}

extern "C" fn ignore(_signal: c_int) {}

/// The guard: starts the FMU's process when it is told to, and waits for its end or that of the program.
fn watch(source: &Source, folder: &Path, FarEnds { requests, answers, mut lifeline }: FarEnds) -> Result<()> {
    separate()?;
    if lifeline.read(&mut [0])? == 0 {
        return Ok(());
    }
    let answers_fd = answers.as_raw_fd();
    let answers = Arc::new(Answers::new(answers));
    // SAFETY: sets that are initialized by `sigemptyset`, and a handler that does nothing.
    let awake = unsafe {
        let mut awake = core::mem::zeroed();
        libc::sigemptyset(&mut awake);
        let mut child = core::mem::zeroed();
        libc::sigemptyset(&mut child);
        libc::sigaddset(&mut child, libc::SIGCHLD);
        // Blocked but for `ppoll`, so that an end just before it is not missed.
        checked(libc::sigprocmask(libc::SIG_BLOCK, &child, core::ptr::null_mut()))?;
        libc::signal(libc::SIGCHLD, ignore as *const () as libc::sighandler_t);
        awake
    };
    // SAFETY: this process has one thread, and the child never returns from `run`.
    let (guard, pid) = unsafe { (libc::getpid(), checked(libc::fork())?) };
    if pid == 0 {
        drop(lifeline);
        let kept = [requests.as_raw_fd(), answers_fd];
        run(source, folder, requests, &answers, guard, kept);
    }
    drop(requests);
    close_others([answers_fd, lifeline.as_raw_fd()])?;
    let ended = |options| -> Result<Option<c_int>> {
        let mut status = 0;
        // SAFETY: a variable to write to.
        Ok((checked(unsafe { libc::waitpid(pid, &mut status, options) })? == pid).then_some(status))
    };
    loop {
        if let Some(status) = ended(libc::WNOHANG)? {
            // The folder is gone when the program hears of the end, which may be the last thing that it does.
            let _kept = fs::remove_dir_all(folder);
            let _nobody_listens = answers.send(&Answer::Ended { status }, &[]);
            return Ok(());
        }
        let mut polled = libc::pollfd { fd: lifeline.as_raw_fd(), events: libc::POLLIN, revents: 0 };
        // SAFETY: one structure, no time limit, and a set of signals.
        if unsafe { libc::ppoll(&mut polled, 1, core::ptr::null(), &awake) } > 0 {
            // SAFETY: a child that was not waited for yet.
            unsafe { libc::kill(pid, libc::SIGKILL) };
            ended(0)?;
            return Ok(());
        }
    }
}

#[cfg(target_env = "gnu")]
unsafe extern "C" {
    /// on_exit(3) of glibc: `function` gets the code of exit(3).
    fn on_exit(function: extern "C" fn(c_int, *mut core::ffi::c_void), argument: *mut core::ffi::c_void) -> c_int;
}

#[cfg(target_env = "gnu")]
extern "C" fn leave(code: c_int, _argument: *mut core::ffi::c_void) {
    flush();
    exit(code)
}

/// The process of the FMU, in which only the files that are `kept` stay open.
fn run(
    source: &Source,
    folder: &Path,
    requests: PipeReader,
    answers: &Arc<Answers>,
    guard: libc::pid_t,
    kept: [RawFd; 2],
) -> ! {
    let prepared = || -> Result<()> {
        // SAFETY: calls with numbers, a set that is initialized by `sigemptyset`, and a function that lives as long as
        // the process.
        unsafe {
            libc::signal(libc::SIGCHLD, libc::SIG_DFL);
            let mut none = core::mem::zeroed();
            libc::sigemptyset(&mut none);
            checked(libc::sigprocmask(libc::SIG_SETMASK, &none, core::ptr::null_mut()))?;
            checked(libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL))?;
            // The signal comes only for a death after the call above (prctl(2)); a guard that has died before it has
            // left this process to another parent.
            if libc::getppid() != guard {
                exit(1);
            }
            // Called before what the program had registered for its own end, and after what the FMU registers.
            #[cfg(target_env = "gnu")]
            on_exit(leave, core::ptr::null_mut());
        }
        close_others(kept)?;
        serve(source, folder, requests, answers)
    };
    let served = catch_unwind(AssertUnwindSafe(prepared));
    flush();
    exit(if matches!(served, Ok(Ok(()))) { 0 } else { 1 })
}
