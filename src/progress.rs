//! Progress on standard error: a bar on a terminal, elsewhere a plain line every ten seconds.
//!
//! Both follow the log levels like warnings: `-q`, and in `RESONARM_LOG` `error` and `off`, suppress them, also for the
//! target `resonarm::progress` alone.

use std::io::IsTerminal;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::output;
use resonarm::realtime::{Clock, SystemClock};

/// Delay before anything is shown on a terminal, ns.
const PATIENCE_NS: u64 = 2_000_000_000;
/// Interval of lines where there is no terminal, and delay before the first, ns.
const PACE_NS: u64 = 10_000_000_000;

/// How much of the work is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Done {
    /// The progress is unknown.
    Unknown,
    /// The finished and the total count, and its unit.
    Of(u64, u64, &'static str),
    /// The finished and the total amount, shown as a percentage.
    Share(u64, u64),
}

/// The times at which lines are due.
#[derive(Debug)]
pub(crate) struct Pace {
    name: &'static str,
    start_ns: u64,
    due_ns: u64,
}

impl Pace {
    /// Returns the times for work that is called `name` and begins now.
    pub fn new(name: &'static str, now_ns: u64) -> Pace {
        Pace { name, start_ns: now_ns, due_ns: now_ns + PACE_NS }
    }

    /// Returns the line that is due, if any.
    pub fn line(&mut self, now_ns: u64, done: Done) -> Option<String> {
        if now_ns < self.due_ns {
            return None;
        }
        // The next line is due from now, not from when this one was due: after a stall the lines that were missed do
        // not follow in a burst.
        self.due_ns = now_ns + PACE_NS;
        Some(words(self.name, done, now_ns.saturating_sub(self.start_ns) / 1_000_000_000))
    }
}

/// Says whether the log levels allow progress to be shown.
pub(crate) fn is_wanted() -> bool {
    tracing::enabled!(target: "resonarm::progress", tracing::Level::WARN)
}

fn words(name: &str, done: Done, after_s: u64) -> String {
    match done {
        Done::Unknown => format!("{name}: still at work after {after_s} s"),
        Done::Of(done, total, what) => format!("{name}: {done} of {total} {what} after {after_s} s"),
        Done::Share(done, total) => {
            let percent = 100.0 * done as f64 / total.max(1) as f64;
            format!("{name}: {percent:.0} % after {after_s} s")
        }
    }
}

/// Does work, and returns its result and its duration, s.
pub(crate) fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start_ns = SystemClock.now_ns();
    let done = work();
    (done, SystemClock.now_ns().saturating_sub(start_ns) as f64 * 1e-9)
}

/// Shows progress until it is dropped: a bar on a terminal after two seconds, elsewhere lines.
pub(crate) struct Progress {
    bar: ProgressBar,
    start_ns: u64,
    /// Ends the thread that writes lines when it is dropped.
    _lines: Option<Sender<()>>,
}

impl Progress {
    /// Shows the progress of `count` steps, in units of `what`.
    pub fn new(name: &'static str, count: usize, what: &'static str) -> Progress {
        // Hidden until work has lasted for a while: what is done at once shows no bar.
        let bar = ProgressBar::with_draw_target(Some(count as u64), ProgressDrawTarget::hidden()).with_message(name);
        if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len}, {elapsed}") {
            bar.set_style(style);
        }
        let counted = bar.clone();
        let done = move || Done::Of(counted.position(), counted.length().unwrap_or_default(), what);
        let lines = if std::io::stderr().is_terminal() { None } else { lines(name, done) };
        Progress { bar, start_ns: SystemClock.now_ns(), _lines: lines }
    }

    /// Shows the progress of work that can't be counted: by lines, on terminals too.
    pub fn uncounted(name: &'static str) -> Progress {
        // A bar that never moves would look like a program that hangs.
        Progress { bar: ProgressBar::hidden(), start_ns: 0, _lines: lines(name, || Done::Unknown) }
    }

    /// Sets the number of steps.
    pub fn expect(&self, count: usize) {
        self.bar.set_length(count as u64);
    }

    /// Adds one finished step.
    pub fn step(&self) {
        let after_ns = SystemClock.now_ns().saturating_sub(self.start_ns);
        if self.bar.is_hidden() && after_ns > PATIENCE_NS && std::io::stderr().is_terminal() && is_wanted() {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        self.bar.inc(1);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Writes lines on a separate thread until the returned sender is dropped. If the system has no thread left, work
/// continues without them.
fn lines(name: &'static str, done: impl Fn() -> Done + Send + 'static) -> Option<Sender<()>> {
    if !is_wanted() {
        return None;
    }
    let (sender, ended) = mpsc::channel();
    let mut pace = Pace::new(name, SystemClock.now_ns());
    let write = move || {
        while is_still_running(&ended, &pace) {
            if let Some(line) = pace.line(SystemClock.now_ns(), done()) {
                output::note(&line);
            }
        }
    };
    thread::Builder::new().name(String::from("progress")).spawn(write).ok().map(|_thread| sender)
}

/// Waits for the time of the next line; returns whether the work is still running.
fn is_still_running(ended: &Receiver<()>, pace: &Pace) -> bool {
    let wait = Duration::from_nanos(pace.due_ns.saturating_sub(SystemClock.now_ns()));
    // Dropping the sender ends the wait at once, so no line follows the end of the work.
    matches!(ended.recv_timeout(wait), Err(RecvTimeoutError::Timeout))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_written_at_a_steady_pace() {
        const S: u64 = 1_000_000_000;
        let mut pace = Pace::new("walk", 5 * S);
        let times = (5..60).filter(|s| pace.line(s * S, Done::Unknown).is_some());
        assert_eq!(times.collect::<Vec<_>>(), [15, 25, 35, 45, 55]);
    }

    #[test]
    fn lines_show_the_progress() {
        let said = |done| Pace::new("walk", 0).line(12_900_000_000, done).unwrap();
        insta::assert_snapshot!(said(Done::Of(3, 25, "points")), @"walk: 3 of 25 points after 12 s");
        insta::assert_snapshot!(said(Done::Share(31_400, 60_000)), @"walk: 52 % after 12 s");
        insta::assert_snapshot!(said(Done::Share(0, 0)), @"walk: 0 % after 12 s");
        insta::assert_snapshot!(said(Done::Unknown), @"walk: still at work after 12 s");
    }
}
