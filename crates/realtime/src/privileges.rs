//! The real-time privileges of this process: found out by trying, without lasting change.

use std::fs;

use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};
use rustix::thread::{CapabilitySet, CpuSet, capabilities, sched_getaffinity};
use rustix::time::{ClockId, clock_getres};
use serde::Serialize;

use super::clock::to_ns;
use super::priority::{FifoPriority, set_fifo};

/// The coarsest resolution of the monotonic clock that a periodic loop can live with, ns.
const CLOCK_RESOLUTION_WANTED_NS: u64 = 1_000;

/// The real-time privileges of this process on this machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Privileges {
    /// The highest priority of `SCHED_FIFO` that a thread got; `None` if refused.
    pub fifo_priority_max: Option<FifoPriority>,
    /// Memory that may be locked into RAM, bytes; `None` without limit.
    pub memory_lock_limit_bytes: Option<u64>,
    /// The cores the calling thread may run on; `None` if the system doesn't report them (more than 1024 cores).
    pub allowed_cores: Option<Vec<usize>>,
    /// The cores that the kernel keeps free of other threads (`isolcpus`).
    pub isolated_cores: Vec<usize>,
    /// Resolution of the monotonic clock, ns.
    pub clock_resolution_ns: u64,
    /// Whether the kernel is fully preemptible (`PREEMPT_RT`).
    pub preempt_rt: bool,
    /// The frequency governor of the first allowed core, where the system reports it.
    pub governor: Option<String>,
}

impl Privileges {
    /// Finds out what the machine grants to this process. Nothing stays changed: the priority is tried on a thread that
    /// ends at once, and no memory is locked.
    pub fn probe() -> Self {
        let allowed_cores = allowed_cores().ok();
        let first_core = allowed_cores.as_ref().and_then(|cores| cores.first());
        let governor = first_core.and_then(|core| governor(*core));
        Self {
            fifo_priority_max: fifo_priority_max(),
            memory_lock_limit_bytes: memory_lock_limit_bytes(),
            isolated_cores: read_line("/sys/devices/system/cpu/isolated")
                .map_or_else(Vec::new, |text| core_list(&text)),
            allowed_cores,
            clock_resolution_ns: to_ns(clock_getres(ClockId::Monotonic)),
            preempt_rt: preempt_rt(),
            governor,
        }
    }

    /// The same for people: a line each, with how to fix what could be better.
    pub fn findings(&self) -> Vec<Finding> {
        vec![
            self.scheduling(),
            self.memory(),
            self.clock(),
            Finding {
                subject: "kernel preemption",
                state: if self.preempt_rt { "PREEMPT_RT" } else { "not PREEMPT_RT" }.to_owned(),
                fix: (!self.preempt_rt).then(|| {
                    "for bounded wake-up latency boot a real-time kernel: `apt install linux-image-rt-amd64` (Debian), \
                     `pro enable realtime-kernel` (Ubuntu)"
                        .to_owned()
                }),
            },
            self.cores(),
            self.frequency_governor(),
        ]
    }

    fn scheduling(&self) -> Finding {
        let (state, fix) = match self.fifo_priority_max {
            Some(max) if max >= FifoPriority::DEFAULT => (format!("SCHED_FIFO up to priority {}", max.get()), None),
            Some(max) => (format!("SCHED_FIFO only up to priority {}", max.get()), Some(fix_for_priority())),
            None => ("no SCHED_FIFO".to_owned(), Some(fix_for_priority())),
        };
        Finding { subject: "real-time scheduling", state, fix }
    }

    fn memory(&self) -> Finding {
        let (state, fix) = match self.memory_lock_limit_bytes {
            None => ("may be locked into RAM without limit".to_owned(), None),
            Some(limit) => {
                (format!("at most {} KiB may be locked into RAM", limit / 1024), Some(fix_for_memory_lock()))
            }
        };
        Finding { subject: "memory", state, fix }
    }

    fn clock(&self) -> Finding {
        let fix = (self.clock_resolution_ns > CLOCK_RESOLUTION_WANTED_NS)
            .then(|| "boot a kernel with high-resolution timers (CONFIG_HIGH_RES_TIMERS, no `highres=off`)".to_owned());
        Finding { subject: "monotonic clock", state: format!("resolution {} ns", self.clock_resolution_ns), fix }
    }

    fn cores(&self) -> Finding {
        let Some(allowed) = &self.allowed_cores else {
            return Finding { subject: "cores", state: "not reported by this system".to_owned(), fix: None };
        };
        let state = format!("{allowed:?} allowed, {:?} isolated", self.isolated_cores);
        // The only core can't be given away. The last one is as good as any, and not core 0, which serves the
        // interrupts.
        let spare = allowed.last().filter(|_| allowed.len() > 1 && self.isolated_cores.is_empty());
        let fix = spare.map(|core| {
            let others: Vec<String> = allowed.iter().filter(|other| *other != core).map(usize::to_string).collect();
            format!(
                "to keep a core for the loop, other threads' work and interrupts off it, boot with \
                 `isolcpus={core} nohz_full={core} rcu_nocbs={core} irqaffinity={}`, and pin to it",
                others.join(",")
            )
        });
        Finding { subject: "cores", state, fix }
    }

    fn frequency_governor(&self) -> Finding {
        let (state, fix) = match self.governor.as_deref() {
            None => ("not reported by this system".to_owned(), None),
            Some("performance") => ("performance".to_owned(), None),
            Some(other) => (
                other.to_owned(),
                Some("for steady execution times: `sudo cpupower frequency-set -g performance`".to_owned()),
            ),
        };
        Finding { subject: "frequency governor", state, fix }
    }
}

/// One thing found out about this machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Subject of the finding, such as the frequency governor.
    pub subject: &'static str,
    /// State in which the machine was found.
    pub state: String,
    /// Way to improve it; `None` if it is well.
    #[serde(rename = "mend")]
    pub fix: Option<String>,
}

/// The cores that the calling thread may run on.
pub(super) fn allowed_cores() -> Result<Vec<usize>, Errno> {
    let set = sched_getaffinity(None)?;
    Ok((0..CpuSet::MAX_CPU).filter(|core| set.is_set(*core)).collect())
}

/// Returns how much memory may be locked, bytes; `None` without limit: by `CAP_IPC_LOCK` or by `RLIMIT_MEMLOCK`.
pub(super) fn memory_lock_limit_bytes() -> Option<u64> {
    let capable = capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
    if capable { None } else { getrlimit(Resource::Memlock).current }
}

pub(super) fn fix_for_priority() -> String {
    format!(
        "`sudo setcap cap_sys_nice,cap_ipc_lock=ep {}`; or the line `* - rtprio 99` in /etc/security/limits.conf, a new \
         login, and `ulimit -r` shows 99; in a container `--cap-add=SYS_NICE`",
        program_path()
    )
}

pub(super) fn fix_for_memory_lock() -> String {
    format!(
        "`sudo setcap cap_sys_nice,cap_ipc_lock=ep {}`; or the line `* - memlock unlimited` in \
         /etc/security/limits.conf, a new login, and `ulimit -l` shows unlimited; in a container `--cap-add=IPC_LOCK`",
        program_path()
    )
}

pub(super) fn program_path() -> String {
    std::env::current_exe().map_or_else(|_| "resonarm".to_owned(), |path| path.display().to_string())
}

/// The highest priority that a thread gets, of those that the limits could allow.
fn fifo_priority_max() -> Option<FifoPriority> {
    let limit = getrlimit(Resource::Rtprio).current.map_or(99, |limit| limit.min(99)) as u8;
    // A process with CAP_SYS_NICE may use any priority, whatever its limit says, so 99 is tried first. Without it the
    // kernel grants priorities up to RLIMIT_RTPRIO (sched(7)).
    let candidates = [99, limit].into_iter().filter_map(|priority| FifoPriority::try_from(priority).ok());
    std::thread::scope(|scope| {
        let try_all = || candidates.clone().find(|priority| set_fifo(*priority).is_ok());
        // Without another thread there is no real-time one either.
        let trial = std::thread::Builder::new().spawn_scoped(scope, try_all).ok()?;
        trial.join().unwrap_or(None)
    })
}

/// Kernels with `PREEMPT_RT` say so in `/sys/kernel/realtime` (out-of-tree patches) or in their version line.
fn preempt_rt() -> bool {
    read_line("/sys/kernel/realtime").is_some_and(|text| text == "1")
        || read_line("/proc/sys/kernel/version").is_some_and(|text| text.contains("PREEMPT_RT"))
}

fn governor(core: usize) -> Option<String> {
    read_line(&format!("/sys/devices/system/cpu/cpu{core}/cpufreq/scaling_governor"))
}

fn read_line(path: &str) -> Option<String> {
    fs::read_to_string(path).ok().map(|text| text.trim().to_owned())
}

/// The kernel's form of a list of cores, for example `1,4-6`.
fn core_list(text: &str) -> Vec<usize> {
    let range = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(first.parse().ok()?..=last.parse().ok()?)
    };
    text.split(',').filter_map(range).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_probe_reports_what_the_kernel_grants_and_changes_nothing() {
        let cores_before = allowed_cores().unwrap();
        let probe = Privileges::probe();
        assert_eq!(allowed_cores().unwrap(), cores_before);
        assert_eq!(probe.allowed_cores, Some(cores_before));
        assert!(probe.clock_resolution_ns > 0);
        if let Some(max) = probe.fifo_priority_max {
            std::thread::scope(|scope| scope.spawn(|| set_fifo(max).unwrap()).join().unwrap());
        }
        let stat = fs::read_to_string("/proc/thread-self/stat").unwrap();
        let policy = stat.rsplit(')').next().unwrap().split_whitespace().nth(38).unwrap();
        assert_ne!(policy, (libc::SCHED_FIFO as u32).to_string(), "the calling thread was left under SCHED_FIFO");
    }

    fn report(privileges: &Privileges) -> String {
        let line = |finding: Finding| match finding.fix {
            Some(fix) => format!("{}: {}; to fix: {fix}", finding.subject, finding.state),
            None => format!("{}: {}", finding.subject, finding.state),
        };
        privileges.findings().into_iter().map(line).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn a_machine_with_nothing_gets_advice_on_everything() {
        let privileges = Privileges {
            fifo_priority_max: None,
            memory_lock_limit_bytes: Some(8 << 20),
            allowed_cores: Some(vec![0, 1]),
            isolated_cores: Vec::new(),
            clock_resolution_ns: 4_000_000,
            preempt_rt: false,
            governor: Some("powersave".to_owned()),
        };
        insta::assert_snapshot!(report(&privileges).replace(&program_path(), "PROGRAM"), @"
        real-time scheduling: no SCHED_FIFO; to fix: `sudo setcap cap_sys_nice,cap_ipc_lock=ep PROGRAM`; or the line `* - rtprio 99` in /etc/security/limits.conf, a new login, and `ulimit -r` shows 99; in a container `--cap-add=SYS_NICE`
        memory: at most 8192 KiB may be locked into RAM; to fix: `sudo setcap cap_sys_nice,cap_ipc_lock=ep PROGRAM`; or the line `* - memlock unlimited` in /etc/security/limits.conf, a new login, and `ulimit -l` shows unlimited; in a container `--cap-add=IPC_LOCK`
        monotonic clock: resolution 4000000 ns; to fix: boot a kernel with high-resolution timers (CONFIG_HIGH_RES_TIMERS, no `highres=off`)
        kernel preemption: not PREEMPT_RT; to fix: for bounded wake-up latency boot a real-time kernel: `apt install linux-image-rt-amd64` (Debian), `pro enable realtime-kernel` (Ubuntu)
        cores: [0, 1] allowed, [] isolated; to fix: to keep a core for the loop, other threads' work and interrupts off it, boot with `isolcpus=1 nohz_full=1 rcu_nocbs=1 irqaffinity=0`, and pin to it
        frequency governor: powersave; to fix: for steady execution times: `sudo cpupower frequency-set -g performance`
        ");
    }

    #[test]
    fn a_machine_set_up_well_has_nothing_to_fix() {
        let privileges = Privileges {
            fifo_priority_max: FifoPriority::try_from(99).ok(),
            memory_lock_limit_bytes: None,
            allowed_cores: Some(vec![0, 1, 2]),
            isolated_cores: vec![2],
            clock_resolution_ns: 1,
            preempt_rt: true,
            governor: Some("performance".to_owned()),
        };
        insta::assert_snapshot!(report(&privileges), @"
        real-time scheduling: SCHED_FIFO up to priority 99
        memory: may be locked into RAM without limit
        monotonic clock: resolution 1 ns
        kernel preemption: PREEMPT_RT
        cores: [0, 1, 2] allowed, [2] isolated
        frequency governor: performance
        ");
    }

    #[test]
    fn lists_of_cores_are_read_as_the_kernel_writes_them() {
        assert_eq!(core_list("1,4-6,9"), [1, 4, 5, 6, 9]);
        assert_eq!(core_list("3"), [3]);
        assert!(core_list("").is_empty());
    }
}
