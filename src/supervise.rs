//! Supervises a long run: a separate thread for the work, tokio for signals and progress.

use std::future::Future;
use std::io::IsTerminal;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::oneshot;
use tokio::time::Instant;

use crate::failure::Failure;
use crate::output;
use crate::progress::{self, Done, Pace};
use resonarm::control::Length;
use resonarm::realtime::{Clock, SystemClock};
use resonarm::run::Signals;

/// The interval at which the progress bar moves.
const PROGRESS: Duration = Duration::from_millis(100);
/// Signals within this time of the first are the same request: timeout(1) sends its signal twice, and a closing
/// terminal sends one in addition to the shell's.
const SAME_REQUEST: Duration = Duration::from_millis(500);

/// The last line on a terminal's standard error: a progress bar and a text.
pub(crate) struct Line {
    bar: ProgressBar,
    length: Length,
    is_on_terminal: bool,
    shows_text: bool,
    /// The times of lines of progress where there is no terminal.
    pace: Option<Pace>,
}

impl Line {
    fn new(name: &'static str, length: Length) -> Line {
        let is_wanted = progress::is_wanted();
        // A terminal on which nothing is to be shown is treated as a file: no bar, and status lines with --status-s only.
        let is_on_terminal = is_wanted && std::io::stderr().is_terminal();
        let has_lines = is_wanted && !is_on_terminal && length != Length::Unknown;
        let pace = has_lines.then(|| Pace::new(name, SystemClock.now_ns()));
        Line { bar: bar(length, is_on_terminal), length, is_on_terminal, shows_text: false, pace }
    }

    /// Suppresses the lines of progress: other lines show it, or standard error holds no text for people.
    pub fn without_progress(&mut self) {
        self.pace = None;
    }

    pub fn is_on_terminal(&self) -> bool {
        self.is_on_terminal
    }

    /// Replaces the text in the line; where there is no terminal, writes `text` as a separate line.
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
            // Until now there was no bar: nothing can be said of how much is done.
            if let Length::Unknown = self.length {
                self.bar = ProgressBar::no_length();
            }
            if let Ok(style) = ProgressStyle::with_template(template) {
                self.bar.set_style(style);
            }
        }
        self.bar.set_message(text);
    }

    /// Writes `text` above the line.
    pub fn note(&self, text: &str) {
        self.bar.suspend(|| output::note(text));
    }

    fn set_progress(&mut self, signals: &Signals) {
        let done = match self.length {
            Length::Responses(total) => Done::Of(signals.responses(), total, "points"),
            Length::Samples(total) => Done::Share(signals.done(), total),
            Length::Unknown => return,
        };
        if let Done::Of(done, ..) | Done::Share(done, _) = done {
            self.bar.set_position(done);
        }
        if let Some(line) = self.pace.as_mut().and_then(|pace| pace.line(SystemClock.now_ns(), done)) {
            output::note(&line);
        }
    }
}

/// Does `work` on a separate thread, called `name`. SIGINT (Ctrl-C), SIGTERM and SIGHUP ask it to stop, and it ends
/// cleanly; another one, half a second later or more, ends the process. `length` is the length of the work, if it is
/// known; `on_tick` is called periodically with the last line of a terminal, and once at the end.
pub(crate) fn supervise<T: Send + 'static>(
    name: &'static str,
    length: Length,
    mut on_tick: impl FnMut(&mut Line, &Signals),
    work: impl FnOnce(&Signals) -> T + Send + 'static,
) -> Result<T, Failure> {
    let signals = Arc::new(Signals::default());
    let watched = Arc::clone(&signals);
    let start = |source| Failure::Start { what: name, source };
    check_descriptors().map_err(start)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(start)?;
    // The program listens before the work begins, so that a signal at its very start also stops it.
    let listening = {
        let _entered = runtime.enter();
        Listening::new().map_err(start)?
    };
    let (done, finished) = oneshot::channel();
    let worker = thread::Builder::new()
        .name(name.to_string())
        .spawn(move || {
            let result = work(&watched);
            // The message is sent before the thread ends, and its sender dropped in a panic: either wakes the loop that
            // waits for it.
            let _nobody_waits = done.send(());
            result
        })
        .map_err(start)?;
    let mut line = Line::new(name, length);
    runtime.block_on(watch(&signals, listening, &mut line, &mut on_tick, finished));
    // One more tick reports the changes since the last one.
    on_tick(&mut line, &signals);
    line.bar.finish_and_clear();
    worker.join().map_err(|_panic| Failure::Panic(name))
}

/// Fails if the system has no file descriptors left for the runtime, which panics where it gets none for its signals.
fn check_descriptors() -> std::io::Result<()> {
    // Eight descriptors: more than the runtime's poll, its waker and its pair of sockets for signals need.
    let pairs = [(); 4].map(|()| UnixStream::pair());
    pairs.into_iter().try_for_each(|pair| pair.map(drop))
}

/// Waits for the end of the work and passes on requests to stop.
async fn watch(
    signals: &Signals,
    Listening { mut interrupt, mut terminate, mut hangup }: Listening,
    line: &mut Line,
    on_tick: &mut impl FnMut(&mut Line, &Signals),
    finished: impl Future<Output = Result<(), oneshot::error::RecvError>>,
) {
    let mut beat = tokio::time::interval(PROGRESS);
    let mut asked = None;
    tokio::pin!(finished);
    loop {
        tokio::select! {
            // An error means that the worker panicked: `join` reports it.
            _ended = &mut finished => break,
            _ = interrupt.recv() => ask_to_stop(signals, &mut asked),
            _ = terminate.recv() => ask_to_stop(signals, &mut asked),
            // Without a listener the block yields `None`, which disables the branch.
            Some(_) = async { hangup.as_mut()?.recv().await } => ask_to_stop(signals, &mut asked),
            _ = beat.tick() => {
                line.set_progress(signals);
                on_tick(line, signals);
            }
        }
    }
}

/// The signals that ask the work to stop.
struct Listening {
    interrupt: Signal,
    terminate: Signal,
    /// SIGHUP; `None` if it is ignored, as `nohup` sets it: then it stays ignored.
    hangup: Option<Signal>,
}

impl Listening {
    /// Begins to listen, within a runtime.
    fn new() -> std::io::Result<Listening> {
        Ok(Listening {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            hangup: if ignores_hangup() { None } else { Some(signal(SignalKind::hangup())?) },
        })
    }
}

/// Says whether this process was started with SIGHUP ignored: the first bit of `SigIgn` in its status (proc(5)).
fn ignores_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).map(str::trim);
    mask.and_then(|mask| u64::from_str_radix(mask, 16).ok()).is_some_and(|mask| mask & 1 == 1)
}

/// Asks the work to stop, or ends the process at another request; `asked` is the time of the first.
fn ask_to_stop(signals: &Signals, asked: &mut Option<Instant>) {
    let now = Instant::now();
    if now - *asked.get_or_insert(now) > SAME_REQUEST {
        // 128 + SIGINT, as in shells. The recording stays readable up to its last flush.
        std::process::exit(130);
    }
    signals.stop();
}

/// Makes a progress bar if the length is known and there is a terminal.
fn bar(length: Length, is_on_terminal: bool) -> ProgressBar {
    let (total, template) = match length {
        _ if !is_on_terminal => return ProgressBar::hidden(),
        Length::Samples(samples) => (samples, "{bar:40} {pos}/{len}, {elapsed} of {duration}"),
        Length::Responses(responses) => (responses, "{bar:40} {pos} of {len} points, {elapsed}"),
        Length::Unknown => return ProgressBar::hidden(),
    };
    let bar = ProgressBar::new(total);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}
