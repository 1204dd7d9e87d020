//! Runs independent jobs on all cores.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Does `work` on every job, on all cores, and calls `done` after each. The results are in the order of the jobs. The
/// calling thread works, too: if the operating system has no more threads, it does the rest.
pub fn on_all_cores<J: Sync, R: Send>(jobs: &[J], work: impl Fn(&J) -> R + Sync, done: impl Fn() + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let cores = thread::available_parallelism().map_or(1, |cores| cores.get()).min(jobs.len());
    let worker = || {
        let mut results = Vec::new();
        loop {
            // Taken one by one and not divided beforehand, since some jobs take far longer than others.
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(index) else { return results };
            results.push((index, work(job)));
            done();
        }
    };
    let mut results: Vec<(usize, R)> = thread::scope(|scope| {
        let start = |_| thread::Builder::new().spawn_scoped(scope, worker).ok();
        // One less than there are cores: this thread works as well.
        let workers: Vec<_> = (1..cores).map_while(start).collect();
        let mut results = worker();
        for worker in workers {
            results.extend(worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
        }
        results
    });
    // The order must not depend on which thread was faster.
    results.sort_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_in_the_order_of_the_jobs() {
        let jobs: Vec<u64> = (0..100).collect();
        let count = AtomicUsize::new(0);
        let squares = on_all_cores(&jobs, |job| job * job, || _ = count.fetch_add(1, Ordering::Relaxed));
        assert!(squares.iter().zip(&jobs).all(|(square, job)| *square == job * job));
        assert_eq!((squares.len(), count.into_inner()), (100, 100));
        assert!(on_all_cores(&[] as &[u64], |job| *job, || ()).is_empty());
    }
}
