//! A long run in real time: plant with all its instruments, bus in memory, controller and recording. Prints the memory
//! of the process during the run, and the missed deadlines by cause at the end.
//!
//! ```text
//! cargo run --release --example soak -- RATE_HZ DURATION_S CORE FILE
//! ```

use std::error::Error;
use std::fs;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use resonarm::realtime::ThreadSetup;
use resonarm::recording::Existing;
use resonarm::run::{BothReport, Mode, Options, RecordTo, Session, Signals};
use resonarm::scenario::Scenario;

/// Interval between measurements of the memory.
const LOOK: Duration = Duration::from_secs(30);
/// How long the controller may be delayed before the plant considers it lost, s.
const PATIENCE_S: f64 = 3600.0;

#[allow(
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a measurement reads the clock and prints what it saw"
)]
fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [rate_hz, duration_s, core, path] = arguments.as_slice() else {
        return Err("give RATE_HZ DURATION_S CORE FILE".into());
    };
    let mut scenario = Scenario::parse(
        &format!(
            "[simulation]\nrate_hz = {rate_hz}\nduration_s = {duration_s}\n\
             [excitation]\namplitude = {{ exciter_x = 50.0 }}\n\
             profile = {{ waveform = \"dwell\", frequency_hz = 15.0, duration_s = {duration_s}, settle_s = 1 }}\n"
        ),
        "the scenario of the soak",
    )?;
    // A stall of the machine is what the soak measures: it must be counted as overruns and not end the run.
    (scenario.network.command_timeout_s, scenario.network.partner_timeout_s) = (PATIENCE_S, PATIENCE_S);
    let options = Options {
        record: Some(RecordTo { path: path.into(), existing: Existing::Overwrite }),
        thread: Some(ThreadSetup { core: Some(core.parse()?), cores_awake: true, ..ThreadSetup::default() }),
        ..Options::default()
    };
    let session = Session::new(scenario, Mode::RealTime, options)?;
    let (begun, ended) = (Instant::now(), AtomicBool::new(false));
    let report = thread::scope(|scope| {
        scope.spawn(|| {
            while !ended.load(Ordering::Acquire) {
                thread::park_timeout(LOOK);
                println!("{:6.0} s  {}", begun.elapsed().as_secs_f64(), resident());
            }
        });
        // The plant's thread becomes a real-time one; the watching thread starts before it.
        let run = scope.spawn(|| session.both(&Signals::default(), &mut |_event| {}));
        let report = run.join();
        ended.store(true, Ordering::Release);
        report
    });
    let BothReport { plant, exciter } = report.map_err(|_| "the run panicked")??;
    println!("{:#?}\n{:#?}", plant, exciter.bus);
    match plant.error {
        Some(error) => Err(error.into()),
        None => Ok(()),
    }
}

/// The lines of `/proc/self/status` about memory in RAM.
fn resident() -> String {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let lines = status.lines().filter(|line| line.starts_with("VmRSS") || line.starts_with("RssAnon"));
    lines.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect::<Vec<_>>().join("  ")
}
