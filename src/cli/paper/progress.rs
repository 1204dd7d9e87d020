//! A progress bar for what takes longer than two seconds.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::since;
use crate::realtime::{Clock, SystemClock};

/// How long nothing is shown, s.
const PATIENCE_S: f64 = 2.0;

/// A bar on standard error that shows after two seconds, if that is a terminal.
pub(in crate::cli) struct Progress {
    bar: ProgressBar,
    start_ns: u64,
}

impl Progress {
    /// A bar of `count` steps.
    pub fn new(name: &'static str, count: usize) -> Progress {
        let bar = ProgressBar::with_draw_target(Some(count as u64), ProgressDrawTarget::hidden()).with_message(name);
        if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {pos}/{len}, {elapsed}") {
            bar.set_style(style);
        }
        Progress { bar, start_ns: SystemClock.now_ns() }
    }

    /// There are this many steps.
    pub fn expect(&self, count: usize) {
        self.bar.set_length(count as u64);
    }

    /// One step more is done.
    pub fn step(&self) {
        if self.bar.is_hidden() && since(self.start_ns) > PATIENCE_S && std::io::stderr().is_terminal() {
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
