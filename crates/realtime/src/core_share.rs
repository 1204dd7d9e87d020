//! Who used the core that a thread runs on, as the kernel counts it: proc(5).

use std::fs;

use rustix::thread::{Pid, gettid};

/// The unit of the times in `/proc/stat`: `USER_HZ` is 100 on every machine that Rust compiles for with Linux.
pub const STEAL_UNIT_NS: u64 = 10_000_000;

/// A thread, whose share of its core is looked at from another.
#[derive(Debug)]
pub struct CoreShare {
    thread: Pid,
    before: Option<Counts>,
}

/// The kernel's counts so far.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Counts {
    /// Time that the host took from each core, ns.
    stolen_ns: Vec<u64>,
    /// Time for which the thread could have run and waited for a core, ns.
    waited_ns: u64,
    /// Number of times that the thread was given a core.
    turns: u64,
}

/// Use of the core between two looks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Share {
    /// Time that the host took from the core on which the thread runs now, ns, in units of [`STEAL_UNIT_NS`].
    pub stolen_ns: u64,
    /// Time for which the thread waited for a core that other threads had, ns.
    pub waited_ns: u64,
    /// Number of times that the thread was given a core.
    pub turns: u64,
}

impl CoreShare {
    /// Returns the observer of the calling thread.
    pub fn of_this_thread() -> CoreShare {
        CoreShare { thread: gettid(), before: None }
    }

    /// Returns the use of the core since the last look; `None` at the first, and where the kernel does not report it.
    pub fn look(&mut self) -> Option<Share> {
        let folder = format!("/proc/self/task/{}", self.thread.as_raw_pid());
        let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
        let stolen_ns = stolen_ns(&read("/proc/stat"));
        let (waited_ns, turns) = waited(&read(&format!("{folder}/schedstat")));
        let counts = Counts { stolen_ns, waited_ns, turns };
        let core = core(&read(&format!("{folder}/stat")))?;
        let before = self.before.replace(counts.clone())?;
        // Both counts are of the core on which it runs now. What was stolen from one that it has left is not counted.
        let of_core = |counts: &Counts| counts.stolen_ns.get(core).copied().unwrap_or(0);
        Some(Share {
            stolen_ns: of_core(&counts).saturating_sub(of_core(&before)),
            waited_ns: waited_ns.saturating_sub(before.waited_ns),
            turns: turns.saturating_sub(before.turns),
        })
    }
}

/// The column `steal` of each core: the eighth number of its line in `/proc/stat`. A core that is offline has no line.
fn stolen_ns(stat: &str) -> Vec<u64> {
    let mut cores = Vec::new();
    for line in stat.lines() {
        let mut words = line.split_ascii_whitespace();
        let Some(core) = words.next().and_then(|word| word.strip_prefix("cpu")) else { continue };
        // The first line, `cpu`, is the sum over all cores. No number follows its name, so it is left out here.
        let (Ok(core), Some(steal)) = (core.parse::<usize>(), words.nth(7)) else { continue };
        cores.resize(cores.len().max(core + 1), 0);
        cores[core] = steal.parse::<u64>().unwrap_or(0).saturating_mul(STEAL_UNIT_NS);
    }
    cores
}

/// The second and the third number of a thread's `schedstat`.
fn waited(schedstat: &str) -> (u64, u64) {
    let mut numbers = schedstat.split_ascii_whitespace().map(|word| word.parse().unwrap_or(0)).skip(1);
    (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0))
}

/// The core that a thread ran on last: the 39th field of its `stat`. The second field, its name, is in parentheses and
/// may hold spaces.
fn core(stat: &str) -> Option<usize> {
    let (_, behind_name) = stat.rsplit_once(')')?;
    // The fields behind the name begin with the third, so that the 39th is the 37th of them.
    behind_name.split_ascii_whitespace().nth(36)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steal_is_read_by_core_and_the_sum_of_all_cores_is_not() {
        let stat = "cpu  9 9 9 9 9 9 9 77 0 0\ncpu0 1 2 3 4 5 6 7 21 0 0\ncpu2 1 2 3 4 5 6 7 56 0 0\nintr 5 5 5\n";
        assert_eq!(stolen_ns(stat), [210_000_000, 0, 560_000_000]);
        assert_eq!(stolen_ns("cpu0 1 2 3\ncpux 1 2 3 4 5 6 7 8\n"), [0_u64; 0]);
    }

    #[test]
    fn what_a_thread_waited_and_where_it_ran() {
        assert_eq!(waited("154181 2738103 2\n"), (2_738_103, 2));
        assert_eq!(waited(""), (0, 0));
        let fields: Vec<String> = (3..=52).map(|field| field.to_string()).collect();
        assert_eq!(core(&format!("17 (a name) with) {}", fields.join(" "))), Some(39));
        assert_eq!(core("17 (name) S 1"), None);
    }

    #[test]
    fn the_kernel_reports_on_a_thread_of_this_process() {
        let mut share = CoreShare::of_this_thread();
        assert_eq!(share.look(), None, "at first there is nothing to compare with");
        let found = std::thread::scope(|scope| scope.spawn(|| share.look()).join().unwrap());
        // How long it waited depends on the machine; only that it is reported is checked.
        assert!(found.is_some());
    }
}
