//! Making the calling thread a real-time thread, as far as the system permits.

use core::fmt;
use core::hint::black_box;
use core::num::NonZeroU64;

use rustix::io::Errno;
use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity, set_current_timer_slack};
use serde::Serialize;

use super::priority::{FifoPriority, set_fifo};
use super::privileges::{allowed_cores, fix_for_memory_lock, fix_for_priority, memory_lock_limit_bytes};
use crate::idle::CoresAwake;
use crate::shortfall::{Shortfall, Wanted};

/// Bytes of its stack that [`ThreadSetup::apply`] touches, so that the loop meets no page fault there: 256 KiB.
pub const PREFAULT_STACK_BYTES: usize = 256 * 1024;

/// Settings that a real-time thread is to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ThreadSetup {
    /// Scheduling by `SCHED_FIFO` with this priority; `None` leaves the scheduling unchanged.
    pub priority: Option<FifoPriority>,
    /// All memory of the process locked into RAM (`mlockall`).
    pub lock_memory: bool,
    /// The only core to run on; `None` lets the thread move.
    pub core: Option<usize>,
    /// All cores of the machine held out of their idle states ([`CoresAwake`]).
    pub cores_awake: bool,
}

impl Default for ThreadSetup {
    /// `SCHED_FIFO` 80, memory locked, no core reserved, idle states unchanged.
    fn default() -> Self {
        Self { priority: Some(FifoPriority::DEFAULT), lock_memory: true, core: None, cores_awake: false }
    }
}

impl ThreadSetup {
    /// Gives the calling thread what is asked for, as far as the system permits; the rest is in
    /// [`ThreadReport::shortfalls`]. Touches [`PREFAULT_STACK_BYTES`] of stack in any case.
    ///
    /// Threads that the calling thread starts later don't inherit the priority (`SCHED_FLAG_RESET_ON_FORK`), but do
    /// inherit the core. Memory is locked for the whole process. A thread that gets no priority asks for timers without
    /// slack instead, which would otherwise wake it up to 50 µs late. The cores stay awake as long as what is returned
    /// beside the report lives.
    pub fn apply(&self) -> (ThreadReport, Option<CoresAwake>) {
        let mut report = ThreadReport::default();
        prefault_stack();
        if let Some(core) = self.core {
            match pin(core) {
                Ok(()) => report.core = Some(core),
                Err(error) => report.shortfalls.push(Shortfall::core(core, error)),
            }
        }
        if self.lock_memory {
            match lock_memory() {
                Ok(lock) => report.memory = lock,
                Err(error) => report.shortfalls.push(Shortfall::memory(error)),
            }
        }
        if let Some(priority) = self.priority {
            match set_fifo(priority) {
                Ok(()) => report.priority = Some(priority),
                Err(error) => report.shortfalls.push(Shortfall::priority(priority, error)),
            }
        }
        // Timers of a thread under `SCHED_FIFO` have no slack anyway.
        if report.priority.is_none()
            && let Err(error) = set_current_timer_slack(NonZeroU64::new(1))
        {
            report.shortfalls.push(Shortfall::timer_slack(error));
        }
        let awake = self.cores_awake.then(CoresAwake::request).and_then(|asked| match asked {
            Ok(awake) => Some(awake),
            Err(shortfall) => {
                report.shortfalls.push(shortfall);
                None
            }
        });
        report.cores_awake = awake.is_some();
        (report, awake)
    }

    /// Leaves the core of the loop to it, if it has one: takes it from the calling thread, and so from all threads that
    /// this one starts from now on, unless there is no other core for them. The kernel does
    /// some of their work, above all of the network, on their core, and no real-time thread runs there meanwhile.
    ///
    /// # Errors
    /// The system's error.
    pub fn leave_core(&self) -> std::io::Result<()> {
        let others: Vec<usize> = allowed_cores()?.into_iter().filter(|core| Some(*core) != self.core).collect();
        if self.core.is_none() || others.is_empty() {
            return Ok(());
        }
        let mut set = CpuSet::new();
        others.iter().for_each(|core| set.set(*core));
        Ok(sched_setaffinity(None, &set)?)
    }
}

/// Settings that a thread was granted; by default none.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ThreadReport {
    /// The priority under `SCHED_FIFO`; `None` without it.
    pub priority: Option<FifoPriority>,
    /// Share of the process's memory that is locked.
    pub memory: MemoryLock,
    /// The core it is pinned to.
    pub core: Option<usize>,
    /// Whether the cores are held out of their idle states.
    pub cores_awake: bool,
    /// Settings that were asked for and denied.
    pub shortfalls: Vec<Shortfall>,
}

impl fmt::Display for ThreadReport {
    /// Writes the settings granted: `SCHED_FIFO priority 80, memory locked now and later, core 1, cores kept awake`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.priority {
            Some(priority) => write!(f, "SCHED_FIFO priority {}", priority.get())?,
            None => f.write_str("ordinary scheduling")?,
        }
        f.write_str(match self.memory {
            MemoryLock::None => ", memory not locked",
            MemoryLock::Current => ", memory locked as mapped now",
            MemoryLock::All => ", memory locked now and later",
        })?;
        match self.core {
            Some(core) => write!(f, ", core {core}")?,
            None => f.write_str(", any core")?,
        }
        f.write_str(if self.cores_awake { ", cores kept awake" } else { "" })
    }
}

/// Share of the process's memory that is locked into RAM.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum MemoryLock {
    /// No memory is locked.
    #[default]
    None,
    /// The memory that was mapped when the lock was made. Later memory isn't, because the process's limit would make
    /// allocations fail: the loop itself makes none.
    Current,
    /// All, also what will be mapped later.
    All,
}

impl Shortfall {
    fn priority(priority: FifoPriority, error: Errno) -> Self {
        let what = format!("SCHED_FIFO priority {}", priority.get());
        Self { wanted: Wanted::Priority, what, why: error.to_string(), fix: fix_for_priority() }
    }

    fn memory(error: Errno) -> Self {
        let what = "memory locked into RAM".to_owned();
        Self { wanted: Wanted::MemoryLock, what, why: error.to_string(), fix: fix_for_memory_lock() }
    }

    fn core(core: usize, error: Errno) -> Self {
        let allowed = allowed_cores().map_or_else(|error| error.to_string(), |cores| format!("{cores:?}"));
        let fix = format!("choose a core that this process may use: {allowed}");
        Self { wanted: Wanted::Core, what: format!("core {core}"), why: error.to_string(), fix }
    }

    fn timer_slack(error: Errno) -> Self {
        let fix = "real-time scheduling makes it unnecessary".to_owned();
        Self { wanted: Wanted::TimerSlack, what: "timers without slack".to_owned(), why: error.to_string(), fix }
    }
}

/// Writes to [`PREFAULT_STACK_BYTES`] of stack below the caller's frame, so that their pages are there.
#[inline(never)]
fn prefault_stack() {
    // `black_box` keeps the compiler from leaving the writes out, which are what maps the pages.
    black_box(&mut [0_u8; PREFAULT_STACK_BYTES]);
}

fn pin(core: usize) -> Result<(), Errno> {
    if core >= CpuSet::MAX_CPU {
        return Err(Errno::INVAL);
    }
    let mut set = CpuSet::new();
    set.set(core);
    sched_setaffinity(None, &set)
}

/// `MCL_FUTURE` under a limit would make any later allocation fail once the limit is reached, so it is asked for only
/// when the process has no limit.
fn lock_memory() -> Result<MemoryLock, Errno> {
    // Below a limit MCL_FUTURE would make later allocations fail once it is reached, so only what is mapped now is
    // locked.
    if memory_lock_limit_bytes().is_none() {
        mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map(|()| MemoryLock::All)
    } else {
        mlockall(MlockAllFlags::CURRENT).map(|()| MemoryLock::Current)
    }
}

#[cfg(test)]
mod tests {
    use super::super::privileges::program_path;
    use super::*;

    /// Runs `body` on a separate thread, whose settings end with it.
    fn on_a_thread<T: Send>(body: impl FnOnce() -> T + Send) -> T {
        std::thread::scope(|scope| scope.spawn(body).join().unwrap())
    }

    /// Policy and priority of the calling thread as the kernel reports them: fields 41 and 40 of `/proc/self/stat`.
    fn scheduling() -> (u32, u32) {
        let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
        let after_name: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
        // The name of the program may hold spaces, so the fields are counted from behind it. The first of them is
        // field 3 of proc(5), so that field 41 has the index 38.
        (after_name[38].parse().unwrap(), after_name[37].parse().unwrap())
    }

    #[test]
    fn nothing_asked_is_nothing_done() {
        let setup = ThreadSetup { priority: None, lock_memory: false, core: None, cores_awake: false };
        let (report, awake) = on_a_thread(|| setup.apply());
        assert!(report == ThreadReport::default() && awake.is_none(), "{report:?}");
    }

    #[test]
    fn the_kernel_agrees_with_the_report() {
        let core = allowed_cores().unwrap()[0];
        let priority = FifoPriority::try_from(7).unwrap();
        let setup = ThreadSetup { priority: Some(priority), lock_memory: false, core: Some(core), cores_awake: true };
        on_a_thread(|| {
            let (report, awake) = setup.apply();
            assert_eq!(report.cores_awake, awake.is_some());
            assert_eq!(report.cores_awake, !report.shortfalls.iter().any(|s| s.wanted == Wanted::CoresAwake));
            assert_eq!(report.core, Some(core), "{:?}", report.shortfalls);
            assert_eq!(allowed_cores().unwrap(), [core]);
            let (policy, priority) = scheduling();
            match report.priority {
                Some(got) => {
                    assert_eq!((policy, priority), (libc::SCHED_FIFO as u32, got.get().into()));
                    assert_eq!(on_a_thread(scheduling).0, libc::SCHED_OTHER as u32, "inherited");
                }
                None => {
                    assert_ne!(policy, libc::SCHED_FIFO as u32);
                    assert_eq!(report.shortfalls[0].wanted, Wanted::Priority);
                }
            }
        });
    }

    #[test]
    fn other_threads_leave_the_loop_s_core_if_they_can_and_the_loop_gets_it_still() {
        let allowed = allowed_cores().unwrap();
        let [core, others @ ..] = &allowed[..] else { panic!("no core") };
        let setup = |core| ThreadSetup { priority: None, lock_memory: false, core, cores_awake: false };
        let left = |core| {
            on_a_thread(|| {
                setup(core).leave_core().unwrap();
                on_a_thread(|| allowed_cores().unwrap())
            })
        };
        assert_eq!(left(Some(*core)), if others.is_empty() { &allowed } else { others });
        // A core beyond those that a set can hold is none of the allowed ones, so leaving it takes nothing away.
        assert_eq!([left(None), left(Some(CpuSet::MAX_CPU))], [allowed.clone(), allowed.clone()]);
        let pinned = on_a_thread(|| {
            setup(Some(*core)).leave_core().unwrap();
            setup(Some(*core)).apply().0.core
        });
        assert_eq!(pinned, Some(*core));
    }

    #[test]
    fn a_core_that_is_not_there_is_a_shortfall_and_the_run_continues() {
        for core in [CpuSet::MAX_CPU - 1, CpuSet::MAX_CPU] {
            let setup = ThreadSetup { priority: None, lock_memory: false, core: Some(core), cores_awake: false };
            let (report, _awake) = on_a_thread(|| setup.apply());
            assert_eq!((report.core, report.shortfalls.len()), (None, 1));
            assert_eq!(report.shortfalls[0].wanted, Wanted::Core);
        }
        let shortfall = Shortfall {
            fix: "choose a core that this process may use: [0, 1]".to_owned(),
            ..Shortfall::core(9, Errno::INVAL)
        };
        insta::assert_snapshot!(shortfall, @"no core 9: Invalid argument (os error 22); to fix: choose a core that this process may use: [0, 1]");
    }

    #[test]
    fn a_refusal_is_reported_with_its_fix() {
        let said = |shortfall: Shortfall| shortfall.to_string().replace(&program_path(), "PROGRAM");
        insta::assert_snapshot!(said(Shortfall::priority(FifoPriority::DEFAULT, Errno::PERM)), @"no SCHED_FIFO priority 80: Operation not permitted (os error 1); to fix: `sudo setcap cap_sys_nice,cap_ipc_lock=ep PROGRAM`; or the line `* - rtprio 99` in /etc/security/limits.conf, a new login, and `ulimit -r` shows 99; in a container `--cap-add=SYS_NICE`");
        insta::assert_snapshot!(said(Shortfall::memory(Errno::NOMEM)), @"no memory locked into RAM: Cannot allocate memory (os error 12); to fix: `sudo setcap cap_sys_nice,cap_ipc_lock=ep PROGRAM`; or the line `* - memlock unlimited` in /etc/security/limits.conf, a new login, and `ulimit -l` shows unlimited; in a container `--cap-add=IPC_LOCK`");
    }

    #[test]
    fn priorities_out_of_range_are_refused() {
        assert_eq!([1, 99].map(|p| FifoPriority::try_from(p).unwrap().get()), [1, 99]);
        assert!(FifoPriority::try_from(100).is_err());
        insta::assert_snapshot!(FifoPriority::try_from(0).unwrap_err(), @"the real-time priority is 0; it must be from 1 to 99");
    }
}
