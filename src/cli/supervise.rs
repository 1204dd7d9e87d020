//! A long run under supervision: a thread of its own for the work, tokio for everything else.

use std::future::Future;
use std::io::IsTerminal;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::oneshot;
use tokio::time::Instant;

use super::failure::Failure;
use super::output;
use crate::control::Length;
use crate::run::Signals;

/// How often the progress bar moves.
const PROGRESS: Duration = Duration::from_millis(100);
/// Signals that come within this time of the first are the same request: timeout(1) sends its signal twice, and a
/// terminal that is closed sends one beside the shell's.
const SAME_REQUEST: Duration = Duration::from_millis(500);

/// The last line on a terminal's standard error: a progress bar, and what is shown beside it.
pub(super) struct Line {
    bar: ProgressBar,
    length: Length,
    is_on_terminal: bool,
    shows_text: bool,
}

impl Line {
    fn new(length: Length) -> Line {
        let is_on_terminal = std::io::stderr().is_terminal();
        Line { bar: bar(length, is_on_terminal), length, is_on_terminal, shows_text: false }
    }

    /// Whether there is such a line.
    pub fn is_on_terminal(&self) -> bool {
        self.is_on_terminal
    }

    /// Shows `text` in it, in place of what it showed; where there is no terminal, writes it as a line of its own.
    pub fn show(&mut self, text: String) {
        if !self.is_on_terminal {
            return output::note(&text);
        }
        if !self.shows_text {
            self.shows_text = true;
            let template = match self.length {
                Length::Samples(_) => "{bar:12} {percent}% {msg}",
                Length::Responses(_) => "{bar:12} {pos}/{len} {msg}",
                Length::Unknown => "{msg}",
            };
            if let Length::Unknown = self.length {
                self.bar = ProgressBar::no_length();
            }
            if let Ok(style) = ProgressStyle::with_template(template) {
                self.bar.set_style(style);
            }
        }
        self.bar.set_message(text);
    }

    /// Writes `text` above it.
    pub fn note(&self, text: &str) {
        self.bar.suspend(|| output::note(text));
    }

    fn set_progress(&self, signals: &Signals) {
        match self.length {
            Length::Responses(_) => self.bar.set_position(signals.responses()),
            Length::Samples(_) => self.bar.set_position(signals.done()),
            Length::Unknown => {}
        }
    }
}

/// Does `work` on a thread of its own, called `name`. SIGINT (Ctrl-C), SIGTERM and SIGHUP ask it to stop, and it ends
/// in order; another one, half a second later or more, ends the process. `length` is how long the work takes, if it is
/// known; `tell` is called now and then with the last line of a terminal, and once at the end.
pub(super) fn supervise<T: Send + 'static>(
    name: &'static str,
    signals: &Arc<Signals>,
    length: Length,
    mut tell: impl FnMut(&mut Line),
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Failure> {
    let start = |source| Failure::Start { what: name, source };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(start)?;
    let (done, finished) = oneshot::channel();
    let worker = thread::Builder::new()
        .name(name.to_string())
        .spawn(move || {
            let result = work();
            let _nobody_waits = done.send(());
            result
        })
        .map_err(start)?;
    let mut line = Line::new(length);
    runtime.block_on(watch(signals, &mut line, &mut tell, finished)).map_err(start)?;
    tell(&mut line);
    line.bar.finish_and_clear();
    worker.join().map_err(|_panic| Failure::Panic(name))
}

/// Waits for the end of the work, passing on what the user asks.
async fn watch(
    signals: &Signals,
    line: &mut Line,
    tell: &mut impl FnMut(&mut Line),
    finished: impl Future<Output = Result<(), oneshot::error::RecvError>>,
) -> std::io::Result<()> {
    let (mut interrupt, mut terminate) = (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
    // `nohup` has it ignored, and it stays so.
    let mut hangup = if ignores_hangup() { None } else { Some(signal(SignalKind::hangup())?) };
    let mut beat = tokio::time::interval(PROGRESS);
    let mut asked = None;
    tokio::pin!(finished);
    loop {
        tokio::select! {
            // An error means that the worker ended without a word: its panic shows when it is joined.
            _ended = &mut finished => break,
            _ = interrupt.recv() => ask_to_stop(signals, &mut asked),
            _ = terminate.recv() => ask_to_stop(signals, &mut asked),
            Some(_) = async { hangup.as_mut()?.recv().await } => ask_to_stop(signals, &mut asked),
            _ = beat.tick() => {
                line.set_progress(signals);
                tell(line);
            }
        }
    }
    Ok(())
}

/// Whether this process was started with SIGHUP ignored: the first bit of `SigIgn` in its status (proc(5)).
fn ignores_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).map(str::trim);
    mask.and_then(|mask| u64::from_str_radix(mask, 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

/// Asks for the end, or ends the process at another request; `asked` is when the first came.
fn ask_to_stop(signals: &Signals, asked: &mut Option<Instant>) {
    let now = Instant::now();
    if now - *asked.get_or_insert(now) > SAME_REQUEST {
        // 128 + SIGINT, as shells have it. The recording stays readable up to its last flush.
        std::process::exit(130);
    }
    signals.stop();
}

/// A progress bar if the run is long enough and somebody can see it.
fn bar(length: Length, is_on_terminal: bool) -> ProgressBar {
    let (total, template) = match length {
        Length::Samples(samples) => (samples, "{bar:40} {pos}/{len}, {elapsed} of {duration}"),
        Length::Responses(responses) => (responses, "{bar:40} {pos} of {len} points, {elapsed}"),
        Length::Unknown => return ProgressBar::hidden(),
    };
    if !is_on_terminal {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template(template);
    let bar = ProgressBar::new(total);
    match style {
        Ok(style) => bar.with_style(style),
        Err(_bad_template) => bar,
    }
}
