//! `resonarm latency`: how punctual the real-time loop is on this machine, compared with a loop that does nothing.

use std::path::PathBuf;
use std::thread;

use clap::Args;
use serde::Serialize;

use crate::commands::doctor;
use crate::failure::{Failure, Verdict};
use crate::figures::latency_figure::{self, LatencyCurve, LatencyPlotFlag};
use crate::flags::{SpinFlag, ThreadFlags};
use crate::help::heading;
use crate::numbers;
use crate::output::{Inputs, JsonFlag, OverwriteFlag};
use crate::recordings::{existing, wait_for_reader};
use crate::session::seconds;
use resonarm::realtime::{
    Finding, LatencyHistogram, Percentiles, Privileges, SampleRate, SpinChoice, SystemClock, ThreadReport, ThreadSetup,
    bare_wakeups,
};
use resonarm::recording::Existing;
use resonarm::run::{Histograms, Mode, Options, RecordTo, RunError, Session, Signals};
use resonarm_figures::plot::Color;
use resonarm_numeric::number::short;

/// Measures how late the plant's loop wakes up on this machine, against an empty loop.
///
/// The two loops run in turns, on threads with the same settings. The command says what would improve the result.
#[derive(Debug, Args)]
#[command(
    after_long_help = "The plant runs on a bus in memory with all its instruments, a controller in another thread, and with \
                        --record a recording. For each percentile the report has the median over the turns, and as the longest value \
                        that of all turns.\n\n\
                        Example:\n  resonarm latency --rate-hz 1000,4000,10000 --core 1"
)]
pub(crate) struct Latency {
    /// Sample rates, Hz, integers from 1 to 65535, separated by commas.
    #[arg(long, help_heading = heading::RANGE, value_name = "HZ", value_delimiter = ',', default_value = "1000")]
    rate_hz: Vec<f64>,
    /// Length of a turn, s.
    #[arg(long, help_heading = heading::RANGE, value_name = "S", default_value_t = 1.0)]
    turn_s: f64,
    /// Number of turns of each loop at each rate.
    #[arg(long, help_heading = heading::RANGE, value_name = "N", default_value_t = 5, value_parser = numbers::integer(1..=u16::MAX))]
    turns: u16,
    #[command(flatten)]
    thread: ThreadFlags,
    /// Record the plant's turns into this MCAP file, which keeps the last.
    #[arg(long, help_heading = heading::OUTPUT, value_name = "FILE")]
    record: Option<PathBuf>,
    #[command(flatten)]
    spin: SpinFlag,
    #[command(flatten)]
    plot: LatencyPlotFlag,
    #[command(flatten)]
    overwrite: OverwriteFlag,
    #[command(flatten)]
    json: JsonFlag,
}

/// The delay of the controller after which the plant considers it lost, s.
const PATIENCE_S: f64 = 3600.0;

/// One turn of each loop.
struct Turn {
    bare: Percentiles,
    plant: Percentiles,
    execution: Percentiles,
    overruns: u64,
    lost_records: u64,
    spin: Option<SpinChoice>,
    /// The histograms of the three measurements.
    counted: [Option<LatencyHistogram>; 3],
}

/// The results at one rate, over all turns.
#[derive(Debug, PartialEq, Serialize)]
struct AtRate {
    rate_hz: f64,
    /// The lateness of the bare loop.
    bare_us: Percentiles,
    /// The lateness of the plant's loop.
    plant_us: Percentiles,
    /// The time of the plant's work for a sample.
    execution_us: Percentiles,
    /// The plant's median lateness over that of the bare loop.
    ratio_p50: f64,
    ratio_p99: f64,
    /// The number of deadlines that the plant missed.
    overruns: u64,
    /// The number of records that did not reach the recording.
    lost_records: u64,
    /// The time that the plant's loop spins before a deadline, in the last turn; `null` if it does not spin.
    spin: Option<SpinChoice>,
}

#[derive(Serialize)]
struct Document {
    /// The settings granted to the threads; `null` if none were asked for.
    thread: Option<ThreadReport>,
    rates: Vec<AtRate>,
    findings: Vec<Finding>,
}

impl Latency {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let setup = self.thread.setup()?;
        seconds("--turn-s", self.turn_s)?;
        self.plot.check(self.overwrite.overwrite, &Inputs::default())?;
        let mut existing = existing(self.overwrite.overwrite);
        // All are checked before the first is run.
        for rate_hz in &self.rate_hz {
            self.session(*rate_hz, setup, existing)?;
        }
        let _reader = self.record.as_deref().map(wait_for_reader).transpose()?;
        let mut got = None;
        let mut all = Vec::with_capacity(self.rate_hz.len());
        for rate_hz in &self.rate_hz {
            // The two loops alternate in short turns, so that a slow change of the machine's load affects both alike.
            let mut turns = Vec::with_capacity(usize::from(self.turns));
            for _ in 0..self.turns {
                turns.push(self.turn(&self.session(*rate_hz, setup, existing)?, *rate_hz, setup, &mut got)?);
                // A file that was there before the command is still protected: only the first turn creates it.
                existing = Existing::Overwrite; // by a turn of this call
            }
            all.push((*rate_hz, turns));
        }
        let rates = all.iter().map(|(rate_hz, turns)| AtRate::of(*rate_hz, turns)).collect();
        let mut written = Vec::new();
        if let Some(stem) = &self.plot.plot {
            let panels: Vec<_> = all.iter().map(|(rate_hz, turns)| panel(*rate_hz, turns)).collect();
            let thread = got.as_ref().map_or(String::from("ordinary threads"), ToString::to_string);
            written = latency_figure::write(stem, &thread, &panels)?;
        }
        let document = Document { thread: got, rates, findings: Privileges::probe().findings() };
        let text = || table(&document) + "\n" + &doctor::in_words(&document.findings);
        self.json.show(&document, text, &written)
    }

    /// Makes a session of a plant and a controller that drives it below the first resonance for a turn.
    fn session(&self, rate_hz: f64, setup: Option<ThreadSetup>, existing: Existing) -> Result<Session, Failure> {
        let mut scenario = crate::commands::exciter::scenario()?;
        scenario.simulation.rate_hz = rate_hz;
        scenario.simulation.duration_s = Some(self.turn_s);
        // A delayed controller must not disturb the plant's loop.
        scenario.network.command_timeout_s = PATIENCE_S;
        scenario.network.partner_timeout_s = PATIENCE_S;
        let options = Options {
            record: self.record.clone().map(|path| RecordTo { path, existing }),
            spin: self.spin.spin,
            thread: setup,
            on_shortfall: self.thread.on_shortfall(),
            ..Options::default()
        };
        Ok(Session::new(scenario, Mode::RealTime, options)?)
    }

    /// Runs one turn of each loop, on separate threads, whose settings end with them.
    fn turn(
        &self,
        session: &Session,
        rate_hz: f64,
        setup: Option<ThreadSetup>,
        got: &mut Option<ThreadReport>,
    ) -> Result<Turn, Failure> {
        let rate = SampleRate::new(rate_hz)?;
        let ticks = (self.turn_s * rate_hz) as u64;
        let bare = on_a_thread("bare loop", || {
            // Dropping `_awake` would let the cores go back to their idle states: it is kept until the end of the
            // turn.
            let (report, _awake) = setup.map(|setup| setup.apply()).unzip();
            let mut latencies = LatencyHistogram::new().map_err(RunError::from)?;
            let spin = self.spin.spin.choose(&SystemClock, rate)?;
            bare_wakeups(&SystemClock, rate, spin.map_or(0, |choice| choice.spin_ns()), ticks, &mut latencies);
            Ok::<_, RunError>((report, latencies))
        })??;
        let plant = on_a_thread("plant", || session.both(&Signals::default(), &mut |_event| {}))??.plant;
        *got = bare.0;
        if let Some(error) = plant.error {
            return Err(error.into());
        }
        let lost_records = plant.recording.iter().flat_map(|recording| recording.lost.values()).sum();
        match (bare.1.percentiles(), plant.wakeup_us, plant.exec_us) {
            (Some(percentiles), Some(wakeup), Some(execution)) => {
                let Histograms { wakeup: late, exec } = plant.histograms;
                let overruns = plant.overruns;
                let spin = plant.spin;
                let counted = [Some(bare.1), late, exec];
                Ok(Turn { bare: percentiles, plant: wakeup, execution, overruns, lost_records, spin, counted })
            }
            _ => Err(Failure::value(
                "--turn-s",
                self.turn_s,
                format!("it must contain at least one sample at {rate_hz} Hz"),
            )),
        }
    }
}

fn on_a_thread<T: Send>(what: &'static str, body: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    thread::scope(|scope| {
        let started = thread::Builder::new().spawn_scoped(scope, body);
        let worker = started.map_err(|source| Failure::Start { what, source })?;
        worker.join().map_err(|_panic| Failure::Panic(what))
    })
}

impl AtRate {
    /// Returns the medians over the turns, and the largest values of all.
    fn of(rate_hz: f64, turns: &[Turn]) -> AtRate {
        let bare_us = medians(turns.iter().map(|turn| turn.bare));
        let plant_us = medians(turns.iter().map(|turn| turn.plant));
        AtRate {
            rate_hz,
            bare_us,
            plant_us,
            execution_us: medians(turns.iter().map(|turn| turn.execution)),
            ratio_p50: plant_us.p50 / bare_us.p50,
            ratio_p99: plant_us.p99 / bare_us.p99,
            overruns: turns.iter().map(|turn| turn.overruns).sum(),
            lost_records: turns.iter().map(|turn| turn.lost_records).sum(),
            spin: turns.last().and_then(|turn| turn.spin),
        }
    }
}

/// Returns the curves of a rate, over all turns: the plant over the bare loop.
fn panel(rate_hz: f64, turns: &[Turn]) -> (Option<String>, Vec<LatencyCurve<'_>>) {
    let curves = [("late, bare loop", Color::Grey), ("late, plant", Color::Blue), ("work, plant", Color::Vermillion)];
    let counted = |which: usize| turns.iter().filter_map(|turn| turn.counted[which].as_ref()).collect();
    let curves = curves.into_iter().enumerate().map(|(which, (name, color))| LatencyCurve {
        name,
        color,
        counted: counted(which),
    });
    (Some(format!("{} Hz", short(&rate_hz))), curves.collect())
}

/// Returns the median of each percentile over the turns, the upper one of an even number; the maximum of the maxima.
fn medians(turns: impl Iterator<Item = Percentiles> + Clone) -> Percentiles {
    let median = |of: fn(&Percentiles) -> f64| {
        let mut values: Vec<f64> = turns.clone().map(|turn| of(&turn)).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    Percentiles {
        p50: median(|turn| turn.p50),
        p99: median(|turn| turn.p99),
        p99_9: median(|turn| turn.p99_9),
        p99_99: median(|turn| turn.p99_99),
        max: turns.map(|turn| turn.max).fold(0.0, f64::max),
    }
}

fn table(document: &Document) -> String {
    let mut text = match &document.thread {
        Some(report) => format!("threads: {report}\n"),
        None => String::from("threads: ordinary ones\n"),
    };
    text += &format!("{:>9}  {:<22} {:>9} {:>9} {:>9} {:>9}\n", "rate", "µs", "p50", "p99", "p99.9", "longest");
    for at in &document.rates {
        let rows = [("late, bare loop", at.bare_us), ("late, plant", at.plant_us), ("work, plant", at.execution_us)];
        for (name, Percentiles { p50, p99, p99_9, max, .. }) in rows {
            let rate = format!("{} Hz", short(&at.rate_hz));
            text += &format!("{rate:>9}  {name:<22} {p50:>9.1} {p99:>9.1} {p99_9:>9.1} {max:>9.1}\n");
        }
        let AtRate { ratio_p50, ratio_p99, overruns, lost_records, .. } = at;
        let lost = if *lost_records == 0 { String::new() } else { format!(", {lost_records} records lost") };
        text += &format!(
            "{:>9}  {:<22} {ratio_p50:>9.2} {ratio_p99:>9.2}            {overruns} overruns{lost}\n",
            "", "plant over bare loop"
        );
        if let Some(spin) = &at.spin {
            text += &format!("{:>9}  spinning {spin}\n", "");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn percentiles(p50: f64, max: f64) -> Percentiles {
        Percentiles { p50, p99: 2.0 * p50, p99_9: 3.0 * p50, p99_99: 4.0 * p50, max }
    }

    #[test]
    fn medians_of_the_turns_and_the_longest_are_reported() {
        let turn = |bare, plant, longest| Turn {
            bare: percentiles(bare, 400.0),
            plant: percentiles(plant, longest),
            execution: percentiles(12.0, 90.0),
            overruns: 1,
            lost_records: 2,
            spin: None,
            counted: [None, None, None],
        };
        // The second turn was disturbed.
        let at = AtRate::of(1000.0, &[turn(20.0, 22.0, 300.0), turn(500.0, 900.0, 7000.5), turn(21.0, 23.1, 250.0)]);
        assert_eq!(at.ratio_p50, 1.1);
        let document = Document { thread: None, rates: vec![at], findings: Vec::new() };
        insta::assert_snapshot!(table(&document), @"
        threads: ordinary ones
             rate  µs                           p50       p99     p99.9   longest
          1000 Hz  late, bare loop             21.0      42.0      63.0     400.0
          1000 Hz  late, plant                 23.1      46.2      69.3    7000.5
          1000 Hz  work, plant                 12.0      24.0      36.0      90.0
                   plant over bare loop        1.10      1.10            3 overruns, 6 records lost
        ");
    }
}
