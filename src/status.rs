//! A run's status line on standard error: rewritten in place on a terminal, elsewhere written periodically with
//! --status-s.

use core::time::Duration;

use clap::Args;

use crate::failure::Failure;
use crate::help::heading;
use crate::session::seconds;
use crate::supervise::Line;
use resonarm::protocol::NodeState;
use resonarm::realtime::{Clock, SystemClock};
use resonarm::run::{Shown, Signals};

/// Interval at which the line on a terminal is rewritten, ns.
const ANEW_NS: u64 = 200_000_000;
/// The window over which rate, load and lateness are measured, ns.
const WINDOW_NS: u64 = 1_000_000_000;

/// The interval of status lines where there is no terminal.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = heading::OUTPUT)]
pub(crate) struct StatusFlag {
    /// Interval of status lines where standard error is not a terminal, s.
    ///
    /// A line has rate, load, lateness, force and state. A terminal always shows it, unless --quiet is given.
    #[arg(long, value_name = "S", hide_short_help = true)]
    status_s: Option<f64>,
}

impl StatusFlag {
    /// Returns the interval, if one is given.
    pub fn every(self) -> Result<Option<Duration>, Failure> {
        let every = self.status_s.map(|given_s| seconds("--status-s", given_s)).transpose()?;
        match (self.status_s, every) {
            (Some(given_s), Some(Duration::ZERO)) => {
                Err(Failure::value("--status-s", given_s, "it must be above 0: the time from line to line in seconds"))
            }
            (_, every) => Ok(every),
        }
    }
}

/// The kind of line that is written.
pub(crate) enum Style {
    /// The line is text.
    People {
        /// The interval where there is no terminal; `None` writes none there.
        every: Option<Duration>,
    },
    /// No line is written: standard error holds JSON.
    Off,
}

pub(crate) struct Status {
    style: Style,
    /// The gauges at the beginning of the window, and its time, ns.
    before: Option<(u64, Shown)>,
    /// The values of the last whole window.
    window: Option<Window>,
    written_ns: u64,
}

/// Values over a window of time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Window {
    /// Rate at which samples were worked on, Hz.
    rate_hz: f64,
    /// The work's share of the time; `None` where it is not measured.
    load: Option<f64>,
    /// The lateness of the latest sample, ns.
    latest_ns: u64,
    /// The largest magnitudes of force and torques held, N and N·m.
    held: [f64; 2],
}

impl Status {
    pub fn new(style: Style) -> Status {
        let now_ns = SystemClock.now_ns();
        Status { style, before: None, window: None, written_ns: now_ns }
    }

    /// Writes the line if it is due.
    pub fn write(&mut self, line: &mut Line, signals: &Signals) {
        let every = match self.style {
            Style::People { every } => every,
            Style::Off => return line.without_progress(),
        };
        if every.is_some() {
            line.without_progress();
        }
        let (every_ns, window_ns) = match every {
            _ if line.is_on_terminal() => (ANEW_NS, WINDOW_NS),
            // A window of 0 is over whenever a line is due, so values are measured from line to line.
            Some(every) => (u64::try_from(every.as_nanos()).unwrap_or(u64::MAX), 0),
            None => return,
        };
        let now_ns = SystemClock.now_ns();
        if now_ns.saturating_sub(self.written_ns) >= every_ns {
            self.written_ns = now_ns;
            let text = self.text(now_ns, signals, window_ns);
            line.show(text);
        }
    }

    fn text(&mut self, now_ns: u64, signals: &Signals, window_ns: u64) -> String {
        let (since_ns, before) = *self.before.get_or_insert_with(|| (now_ns, signals.gauges().read()));
        let passed_ns = now_ns.saturating_sub(since_ns);
        // At least 1 ns has passed, for the rates are divided by it.
        if passed_ns >= window_ns.max(1) {
            let now = signals.gauges().read();
            self.window = Some(Window::between(&before, &now, passed_ns));
            self.before = Some((now_ns, now));
        }
        // `read` would reset the extremes of the window; `look` only shows the state.
        words(&signals.gauges().look(), self.window.as_ref(), signals.responses())
    }
}

impl Window {
    fn between(before: &Shown, now: &Shown, passed_ns: u64) -> Window {
        let passed_ns = passed_ns as f64;
        let work_ns = now.work_ns.saturating_sub(before.work_ns);
        Window {
            rate_hz: now.samples.saturating_sub(before.samples) as f64 * 1e9 / passed_ns,
            load: (work_ns > 0).then(|| work_ns as f64 / passed_ns),
            latest_ns: now.latest_ns,
            held: [now.force_n, now.torque_nm],
        }
    }
}

fn words(shown: &Shown, window: Option<&Window>, responses: u64) -> String {
    let mut text = String::from(match shown.state {
        NodeState::BootUp => "starting",
        NodeState::PreOperational => "not armed",
        NodeState::Operational => "armed",
        NodeState::Fault => "fault",
    });
    if let Some(Window { rate_hz, load, latest_ns, held }) = window {
        text += &format!(", {rate_hz:.0} samples/s");
        if let Some(load) = load {
            text += &format!(", load {:.1} %", 100.0 * load);
        }
        if *latest_ns > 0 {
            text += &format!(", late {:.0} µs", *latest_ns as f64 * 1e-3);
        }
        for (magnitude, unit) in held.iter().zip(["N", "N·m"]) {
            if *magnitude > 0.0 {
                text += &format!(", {magnitude:.1} {unit}");
            }
        }
    }
    if responses > 0 {
        text += &format!(", {responses} responses");
    }
    if shown.overruns > 0 {
        text += &format!(", {} overruns", shown.overruns);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHOWN: Shown = Shown {
        samples: 500,
        work_ns: 6_000_000,
        latest_ns: 0,
        overruns: 0,
        force_n: 0.0,
        torque_nm: 0.0,
        state: NodeState::PreOperational,
    };

    #[test]
    fn the_line_shows_only_what_is_known() {
        insta::assert_snapshot!(words(&SHOWN, None, 0), @"not armed");
        let now = Shown {
            samples: 1500,
            work_ns: 21_000_000,
            latest_ns: 84_600,
            overruns: 12,
            force_n: 39.96,
            state: NodeState::Operational,
            ..SHOWN
        };
        let window = Window::between(&SHOWN, &now, 1_000_000_000);
        insta::assert_snapshot!(words(&now, Some(&window), 3), @"armed, 1000 samples/s, load 1.5 %, late 85 µs, 40.0 N, 3 responses, 12 overruns");
        let idle = Window::between(&now, &now, 1_000_000_000);
        let torque = Window { latest_ns: 0, held: [0.0, 2.0], ..idle };
        insta::assert_snapshot!(words(&Shown { overruns: 0, ..now }, Some(&torque), 0), @"armed, 0 samples/s, 2.0 N·m");
    }
}
