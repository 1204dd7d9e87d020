//! `resonarm import`: makes a recording of another tool's log.

use std::path::PathBuf;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::flags;
use crate::help::heading;
use crate::output::{Inputs, JsonFlag};
use crate::recordings::existing;
use resonarm::can_log::LogFormat;
use resonarm::import::{ImportOptions, Imported, Missing, SampleClock, WireImport, import};
use resonarm::scenario::Scenario;

/// Converts a CAN log into a recording, for `replay`, and with --scenario for `compare`.
///
/// The recording has no states of the arm, so `resim` does not accept it. The log is read twice and never held in memory.
/// Lines or objects that can't be read are counted and left out; then the exit code is 1.
///
/// With a scenario that has [wire] the recording also has the readings of the bench that was logged, for `identify`, if
/// its protocol carries all of them every sample; what is missing is named. CANopen drives have no readings, but states
/// and commanded torques. Samples that are not in the log are gaps.
#[derive(Debug, Args)]
pub(crate) struct Import {
    /// Log of `candump -L` or `candump -t a`, or ASC or BLF of Vector's tools.
    ///
    /// Python's `resonarm.import_log` reads TRC, MF4 and CSV.
    log: PathBuf,
    /// New recording.
    output: PathBuf,
    /// Format of the log [default: by its ending, .log for candump, .asc, .blf].
    #[arg(long, help_heading = heading::RECORDS, value_name = "FORMAT", value_parser = flags::one_of(LogFormat::ALL, LogFormat::name))]
    from: Option<LogFormat>,
    /// TOML file with the scenario that was logged, which goes into the recording.
    ///
    /// Its network and its sample rate are used to read the frames.
    #[arg(long, help_heading = heading::SIMULATED, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Interface, or channel, whose frames are imported [default: that of the first frame].
    #[arg(long, help_heading = heading::RECORDS, value_name = "NAME")]
    interface: Option<String>,
    /// Count samples of CANopen drives by SYNC frames, as in lockstep, not by time stamps.
    #[arg(long, help_heading = heading::RECORDS, requires = "scenario")]
    by_sync: bool,
    /// Overwrite the new recording if it exists.
    #[arg(long, help_heading = heading::OUTPUT)]
    overwrite: bool,
    #[command(flatten)]
    json: JsonFlag,
}

impl Import {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let format = match self.from {
            Some(format) => format,
            None => self.by_ending()?,
        };
        Inputs::of_scenario(self.scenario.as_deref()).check(&self.output)?;
        let options = ImportOptions {
            scenario: self.scenario.as_deref().map(Scenario::read).transpose()?,
            interface: self.interface.clone(),
            existing: existing(self.overwrite),
            clock: if self.by_sync { SampleClock::Sync } else { SampleClock::TimeStamps },
        };
        let imported = import(&self.log, format, &self.output, &options)?;
        self.json.show(&imported, || text(&imported), &[])?;
        Ok(Verdict::of(imported.unreadable == 0))
    }

    fn by_ending(&self) -> Result<LogFormat, Failure> {
        // Tools on Windows may write an ending in capitals.
        let name = self.log.to_string_lossy().to_ascii_lowercase();
        let found = LogFormat::ALL.into_iter().find(|format| name.ends_with(format.ending()));
        found.ok_or_else(|| {
            let log = self.log.display();
            let names = LogFormat::ALL.map(LogFormat::name).join(", ");
            let of_python = OF_PYTHON.into_iter().find(|ending| name.ends_with(ending));
            Failure::usage(match of_python {
                Some(ending) => format!(
                    "{log}: `import` does not read {ending}: convert it by `python -m can.logconvert {log} NEW.blf` and \
                     import that, or call `resonarm.import_log` of the Python package"
                ),
                None => format!("{log}: the ending of the name does not state the format: give it by --from, one of {names}"),
            })
        })
    }
}

/// Endings of the logs that python-can and asammdf can convert.
const OF_PYTHON: [&str; 4] = [".trc", ".mf4", ".csv", ".db"];

fn text(imported: &Imported) -> String {
    let Imported { path, frames, interface, of_other_interfaces, other_interfaces, others, .. } = imported;
    let Imported { unreadable, first_unreadable, duration_s, wire, .. } = imported;
    let frames_of = if *frames == 1 { "frame of" } else { "frames of" };
    let others_of =
        if *others == 1 { "line or object that is no frame" } else { "lines or objects that are no frames" };
    let mut more = String::new();
    if *of_other_interfaces > 0 {
        let names = other_interfaces.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
        let interface = interface.as_deref().unwrap_or("no name");
        more += &format!("imported interface {interface}; the others are {names}: choose one by --interface\n");
    }
    if let Some(first) = first_unreadable {
        let lines = if *unreadable == 1 { "line or object" } else { "lines or objects" };
        more += &format!("left out {unreadable} {lines} that can't be read; the first: {first}\n");
    }
    let of_wire = wire.as_ref().map_or(String::new(), wire_text);
    format!(
        "{}: {frames} {frames_of} {duration_s:.3} s; left out {of_other_interfaces} of other interfaces and \
         {others} {others_of}\n{more}{of_wire}",
        path.display()
    )
}

/// Says what was gathered from the frames of the scenario's user protocol, and what is missing.
fn wire_text(wire: &WireImport) -> String {
    let gaps = format!(
        "{} samples missing in {} gaps, {} left out since some of their frames are missing",
        wire.missing_samples, wire.gaps, wire.incomplete_samples
    );
    let mut text = match wire.missing_readings.is_empty() {
        true => format!("readings of {} samples; {gaps}\n", wire.samples),
        false => format!("no readings: {}\n", missing_text(&wire.missing_readings)),
    };
    text += &match wire.missing_states.is_empty() {
        true if wire.missing_readings.is_empty() => format!("states and commanded loads of {} samples\n", wire.states),
        true => format!("states and commanded loads of {} samples; {gaps}\n", wire.states),
        false => {
            format!("no states and loads; they are in the frames only: {}\n", missing_text(&wire.missing_states))
        }
    };
    if wire.is_placed_by_time {
        text += "a message with readings has neither index nor counter: its frames are placed by their time stamps\n";
    }
    for (message, frames) in &wire.refused_frames {
        text += &format!(
            "frames of {message} left out: {frames}; their checksum, counter or length is wrong, or a value is not a number\n"
        );
    }
    let WireImport { repeated_frames, lost_frames, .. } = wire;
    if repeated_frames + lost_frames > 0 {
        text += &format!(
            "frames left out because they repeat a sample or are late: {repeated_frames}; frames lost according to the counters: \
             {lost_frames}\n"
        );
    }
    text
}

/// Lists the channels that are missing, by the reason.
fn missing_text(missing: &[Missing]) -> String {
    let of = |is_carried: bool| {
        let names = missing.iter().filter(|of| of.is_carried == is_carried).map(|of| of.channel);
        names.collect::<Vec<_>>().join(", ")
    };
    match [of(false), of(true)] {
        [none, some] if some.is_empty() => format!("the user protocol does not carry {none}"),
        [none, some] if none.is_empty() => format!("the user protocol does not carry {some} every sample"),
        [none, some] => format!("the user protocol does not carry {none}, nor {some} every sample"),
    }
}
