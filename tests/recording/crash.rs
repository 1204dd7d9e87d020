//! A run killed with SIGKILL: the recording holds everything up to the last flush.
//!
//! The recorder promises this within a time, and a machine may hold up any thread. So the child measures how long its
//! threads were held up, and the loss may exceed the promise only by that time.

use std::env;
use std::error::Error;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use resonarm::protocol::{Frame, Id};
use resonarm::recording::{
    Configuration, Direction, Existing, FlushPolicy, FrameRecord, Integrity, Options, Record, Recorder, Recording,
    RecordingError, StateRecord, recover,
};
use resonarm::rig::Load;
use resonarm::structure::{LoadSet, States};

/// The file into which the child records; a test is the child if it is set.
const CHILD: &str = "RESONARM_TEST_CRASH_RECORDING";
/// Kills of a child that records as fast as it goes.
const KILLS: u64 = 100;
/// How often such a child flushes, in samples, and how many records are on their way at most.
const FLUSH_SAMPLES: u64 = 50;
const CAPACITY: usize = 64;
/// The promise of the recorder, ms and samples at 1 kHz.
const INTERVAL: u64 = 100;

type TestResult<T = ()> = Result<T, Box<dyn Error>>;

#[allow(clippy::disallowed_methods)] // the test plays the run loop, which passes the clock
fn now() -> Instant {
    Instant::now()
}

/// A monotonic clock.
fn clock() -> Duration {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(now).elapsed()
}

/// When the writer thread last looked at its clock, and the longest time from one look to the next, ns.
static LOOKED_NS: AtomicU64 = AtomicU64::new(0);
static LONGEST_NS: AtomicU64 = AtomicU64::new(0);

/// The clock by which the writer thread flushes: it looks once a turn.
fn flush_clock() -> Duration {
    let time = clock();
    let now_ns = time.as_nanos() as u64;
    let before_ns = LOOKED_NS.swap(now_ns, Ordering::SeqCst);
    if before_ns > 0 {
        LONGEST_NS.fetch_max(now_ns - before_ns, Ordering::SeqCst);
    }
    time
}

/// How much more than the promise may be lost now, ms and samples at 1 kHz, if turns of the writer took at most g and
/// the last samples were late by l.
///
/// The last complete flush began at a look at time f, and holds all records up to the look before, f − g at the
/// earliest. The look that begins the next flush comes by f + interval + g; until that flush is complete, which takes
/// at most g, now is within interval + 2g of f. So the loss is of a time of interval + 3g, and in a time t at most
/// t + l samples arrive.
fn slack(late: Duration) -> u64 {
    let now_ns = clock().as_nanos() as u64;
    let turn_ns = LONGEST_NS.load(Ordering::SeqCst).max(now_ns.saturating_sub(LOOKED_NS.load(Ordering::SeqCst)));
    (3 * turn_ns).div_ceil(1_000_000) + late.as_millis() as u64 + 1
}

/// Records at 1 kHz, and prints every 10th sample with the slack at that time, until it is killed; at most a minute.
fn record(path: &Path) -> TestResult {
    let flush = FlushPolicy::Interval { interval: Duration::from_millis(INTERVAL), clock: flush_clock };
    let options = Options { flush, ..Options::real_time(1e-3, "memory", 1_700_000_000_000_000_000, clock) };
    let recorder = Recorder::create(path, &Configuration::new().with("seed", 7), options)?;
    let mut channel = recorder.channel("plant", 4096)?;
    let (start, mut latest) = (clock(), Duration::ZERO);
    for sample in 0..60_000 {
        let deadline = start + Duration::from_millis(sample);
        while let Some(rest) = deadline.checked_sub(clock()).filter(|rest| !rest.is_zero()) {
            // It may return early, so the loop looks at the clock again.
            thread::park_timeout(rest);
        }
        latest = latest.max(clock() - deadline);
        let [state, frame] = records_at(sample, clock().as_nanos() as u64)?;
        channel.push(&state);
        channel.push(&frame);
        if sample % 10 == 0 {
            writeln!(std::io::stdout(), "sample {sample} {}", slack(latest))?;
        }
    }
    Err("the recording was not killed".into())
}

/// A state and a frame that contain their sample.
fn records_at(sample: u64, time_ns: u64) -> TestResult<[Record; 2]> {
    let x = sample as f64;
    let (load, taken) = (Load::force_n(1.0, x), LoadSet::NATIVE);
    let state =
        StateRecord { sample, states: States::new(&[x, -x, 0.5 * x, x], &[]).unwrap(), load, taken, is_end: false };
    let frame = Frame::classic(Id::Standard(0x203), &sample.to_le_bytes())?;
    let (direction, bus_timestamp_ns) = (Direction::Sent, None);
    Ok([Record::State(state), Record::Frame(FrameRecord { sample, direction, time_ns, bus_timestamp_ns, frame })])
}

/// Records as fast as possible, waiting for the writer, and prints every 10th sample, until it is killed.
fn record_fast(path: &Path) -> TestResult {
    let options = Options { flush: FlushPolicy::Samples(FLUSH_SAMPLES), ..Options::virtual_time(1e-3, "memory") };
    let recorder = Recorder::create(path, &Configuration::new().with("seed", 7), options)?;
    let mut channel = recorder.channel("plant", CAPACITY)?;
    for sample in 0..10_000_000 {
        records_at(sample, sample * 1_000_000)?.into_iter().try_for_each(|record| channel.push_blocking(&record))?;
        if sample % 10 == 0 {
            writeln!(std::io::stdout(), "sample {sample} 0")?;
        }
    }
    Err("the recording was not killed".into())
}

/// Starts this test again as the process to be killed.
fn start(name: &str, path: &Path) -> TestResult<Child> {
    let mut command = Command::new(env::current_exe()?);
    command.args(["--exact", name, "--nocapture"]).env(CHILD, path).stdout(Stdio::piped());
    Ok(command.spawn()?)
}

/// Waits until the child has printed `sample` and kills it. Returns the last sample it printed, and the slack then.
fn kill_at(sample: u64, child: &mut Child) -> TestResult<(u64, u64)> {
    let output = child.stdout.take().ok_or("the child has no output")?;
    let mut lines = BufReader::new(output).lines();
    let mut said = || -> TestResult<Option<(u64, u64)>> {
        let Some(line) = lines.next().transpose()? else { return Ok(None) };
        // The test harness may print before it on the same line; its own lines are no samples. The last line may be
        // cut off.
        let numbers = line.rsplit("sample ").next().and_then(|numbers| numbers.split_once(' '));
        let parsed = numbers.and_then(|(sample, slack)| Some((sample.parse().ok()?, slack.parse().ok()?)));
        Ok(Some(parsed.unwrap_or_default()))
    };
    let mut last = (0, 0);
    while last.0 < sample {
        last = said()?.ok_or("the child has ended by itself")?;
    }
    child.kill()?;
    child.wait()?;
    // The pipe still has what the child printed between that line and its death.
    while let Some(line) = said()? {
        last = last.max(line);
    }
    Ok(last)
}

#[test]
fn a_killed_run_loses_at_most_the_flush_interval() -> TestResult {
    if let Some(path) = env::var_os(CHILD) {
        return record(Path::new(&path));
    }
    let directory = tempfile::tempdir()?;
    for kill_after in [30, 470, 1000] {
        let path = directory.path().join(format!("killed-{kill_after}.mcap"));
        let mut child = start("crash::a_killed_run_loses_at_most_the_flush_interval", &path)?;
        let said = kill_at(kill_after, &mut child);
        child.kill()?; // in case it was not reached
        let (said, slack) = said?;

        let saved = check(&path, directory.path())?;
        assert!(saved + INTERVAL + slack > said, "{saved} samples saved of {said}, with a slack of {slack}");
    }
    Ok(())
}

/// Checks the file after a kill: the beginning of the run, without a gap, recoverable. Returns the number of samples.
fn check(path: &Path, directory: &Path) -> TestResult<u64> {
    let recording = Recording::open(path)?;
    let Integrity::Truncated { last_sample, .. } = recording.integrity() else {
        return Err(format!("killed, but {:?}", recording.integrity()).into());
    };
    assert_eq!(recording.configuration().get("seed"), Some("7"));
    let saved = last_sample.map_or(0, |last| last + 1);
    let states = recording.states()?.collect::<Result<Vec<_>, _>>()?;
    assert_eq!(states.len() as u64, saved);
    let is_whole =
        |(state, k): (&StateRecord, u64)| state.sample == k && state.states.coordinates() == [k as f64, -(k as f64)];
    assert!(states.iter().zip(0..).all(is_whole));
    // A flush by the clock may come between the two records of a sample.
    assert!((recording.frames()?.count() as u64).abs_diff(saved) <= 1);

    let repaired = directory.join("repaired.mcap");
    let recovered = recover(path, &repaired, Existing::Overwrite);
    if saved == 0 && matches!(recovered, Err(RecordingError::NothingRecovered { .. })) {
        return Ok(0); // killed before the first flush
    }
    assert!(recovered?.missing_samples.is_empty());
    assert_eq!(Recording::open(&repaired)?.states()?.count() as u64, saved);
    Ok(saved)
}

/// Whenever the kill comes, the file has all records except those on their way and those after the last flush: this
/// promise depends on no clock.
#[test]
fn a_hundred_kills_at_random_moments() -> TestResult {
    if let Some(path) = env::var_os(CHILD) {
        return record_fast(Path::new(&path));
    }
    let directory = tempfile::tempdir()?;
    let path = directory.path().join("killed.mcap");
    let mut random = 1_u64;
    for kill in 0..KILLS {
        // A linear congruential generator (Knuth, MMIX) chooses the sample; the child continues meanwhile.
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let kill_after = (random >> 33) % 2000;
        let mut child = start("crash::a_hundred_kills_at_random_moments", &path)?;
        let said = kill_at(kill_after, &mut child);
        child.kill()?; // in case it was not reached
        let (said, _) = said?;
        let saved = check(&path, directory.path()).map_err(|error| format!("kill {kill} after {said}: {error}"))?;
        // Two records a sample; those of the last sample printed were pushed completely.
        let most_lost = FLUSH_SAMPLES + CAPACITY as u64 / 2 + 1;
        assert!(saved + most_lost > said, "{saved} samples saved of {said} at kill {kill}");
        std::fs::remove_file(&path)?;
    }
    Ok(())
}
