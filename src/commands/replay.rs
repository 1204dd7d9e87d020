//! `resonarm replay`: sends recorded frames to a bus, for any listener or against a live controller.

use std::path::PathBuf;

use clap::Args;

use crate::failure::{Failure, Verdict};
use crate::flags;
use crate::help::heading;
use crate::live::{self, LiveFlags, Showing};
use crate::numbers;
use crate::output::JsonFlag;
use crate::recordings::{self, TimeRange};
use crate::session::seconds;
use crate::supervise::supervise;
use resonarm::bus::{self, Bus, BusAddress};
use resonarm::control::Length;
use resonarm::export;
use resonarm::protocol::{Frame, Id};
use resonarm::realtime::SystemClock;
use resonarm::recording::{Direction, Recording};
use resonarm::replay::{Compared, Difference, Playback, Regression, ReplayError, play, play_against};
use resonarm::run::Signals;
use resonarm_numeric::number::short;

/// Sends the frames of a recording to a bus, or shows the recording in a browser.
///
/// The frames keep their recorded timing. To show the recording, use --live.
///
/// With --against it acts as the plant for a live controller: it sends the recorded plant's frames, waits for the
/// controller's answers, and compares them with the recorded commands, sample by sample (exit code 1 at a difference).
#[derive(Debug, Args)]
#[command(after_long_help = "Examples:\n  \
                        resonarm replay run.mcap --bus vcan0 --direction sent --id 203,204 --loop 0\n  \
                        resonarm replay run.mcap --bus can0 --against --limit-n 0.1")]
pub(crate) struct Replay {
    /// Recording, an MCAP file.
    file: PathBuf,
    /// CAN bus, as vcan0, can0, python-can:interface=I,channel=C; not with --live.
    #[arg(long, help_heading = heading::BUS, value_name = "BUS", required_unless_present = "live", conflicts_with = "live")]
    bus: Option<String>,
    /// Factor of the recorded speed, from 0.001 to 1e6, or 0 for as fast as possible.
    ///
    /// With --live it goes to 1000, and can't be 0.
    #[arg(long, help_heading = heading::BUS, value_name = "X", default_value_t = 1.0)]
    speed: f64,
    #[command(flatten)]
    selection: SelectionFlags,
    #[command(flatten)]
    against: AgainstFlags,
    #[command(flatten)]
    live: LiveFlags,
    /// With --live: stay at the first sample until the first viewer connects.
    #[arg(long, help_heading = heading::LIVE, requires = "live", conflicts_with = "bus")]
    wait: bool,
    /// Print the results as one JSON document.
    #[arg(long, help_heading = heading::OUTPUT, conflicts_with = "live")]
    json: bool,
}

/// The frames that are sent, and how often.
#[derive(Debug, Args)]
struct SelectionFlags {
    /// Direction of the frames, from the plant's point of view.
    #[arg(long, help_heading = heading::RECORDS, value_parser = flags::described(DIRECTIONS), value_name = "DIRECTION", default_value = "both", conflicts_with = "live")]
    direction: SentOnly,
    /// Only frames with these identifiers, hexadecimal, separated by commas.
    ///
    /// An identifier has 3 digits, an extended one 8, as in candump.
    #[arg(long, help_heading = heading::RECORDS, value_name = "ID,…", value_delimiter = ',', value_parser = identifier, conflicts_with = "live")]
    id: Vec<Id>,
    /// Identifiers to replace by others, hexadecimal, as 203=213, separated by commas.
    ///
    /// The checks of protected frames then fail.
    #[arg(long, help_heading = heading::RECORDS, value_name = "ID=ID,…", value_delimiter = ',', value_parser = mapping, conflicts_with = "live")]
    map: Vec<(Id, Id)>,
    #[command(flatten)]
    range: TimeRange,
    /// How often to send them, in succession; 0 repeats until it is stopped.
    ///
    /// With --live the recording stays at its end afterwards.
    #[arg(long = "loop", help_heading = heading::RECORDS, value_name = "N", default_value_t = 1, value_parser = numbers::integer(0..=u32::MAX))]
    times: u32,
}

/// Settings for a live controller and the tolerances.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::TEST)]
struct AgainstFlags {
    /// Compare the commands of a live controller on the bus with the recorded ones.
    #[arg(long, conflicts_with_all = ["direction", "id", "map", "from_s", "to_s", "times", "live"])]
    against: bool,
    /// Largest accepted difference of a commanded force, N; 0 is equal frames.
    #[arg(long, value_name = "N", default_value_t = 0.0)]
    limit_n: f64,
    /// Largest accepted difference of a commanded torque, N·m.
    #[arg(long, value_name = "N", default_value_t = 0.0)]
    limit_nm: f64,
    /// Longest wait for the controller, and for each of its answers, s.
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    patience_s: f64,
}

/// The direction of the frames that are sent; none if all are. clap would take an `Option` itself for a flag without a
/// default.
type SentOnly = Option<Direction>;

const DIRECTIONS: [(SentOnly, &str, &str); 3] = [
    (None, "both", "Those the plant received and those it sent"),
    (Some(Direction::Received), "received", "Those the plant received: the exciter's commands"),
    (Some(Direction::Sent), "sent", "Those the plant sent: the sensors"),
];

/// Parses an identifier as candump writes it.
fn identifier(text: &str) -> Result<Id, String> {
    let frame = format!("{text}#").parse::<Frame>();
    frame.map(|frame| frame.id()).map_err(|error| format!("{error}; it must have 3 hexadecimal digits, or 8"))
}

fn mapping(text: &str) -> Result<(Id, Id), String> {
    let (from, to) = text.split_once('=').ok_or("it must be two identifiers, as 203=213")?;
    Ok((identifier(from)?, identifier(to)?))
}

impl Replay {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let address = self.bus.as_deref().map(str::parse::<BusAddress>).transpose()?;
        let recording = recordings::open(&self.file)?;
        let Some(address) = address else {
            let SelectionFlags { range, times, .. } = &self.selection;
            if range.from_s.or(range.to_s).is_some() {
                return Err(Failure::usage(
                    "--from-s and --to-s are for --bus: leave them out, and copy the range of time first, by `resonarm cut`",
                ));
            }
            // Judged now, since the live view takes the recording.
            let verdict = recordings::verdict(&recording);
            live::show(&self.live, recording, Showing { speed: self.speed, times: *times, wait: self.wait })?;
            return Ok(verdict);
        };
        // Judged now, since the thread that plays takes the recording.
        let whole = recordings::verdict(&recording);
        let json = JsonFlag { json: self.json };
        if self.against.against {
            let regression = self.regression()?;
            let compared =
                on_bus(&address, move |bus, signals| play_against(&recording, bus, &SystemClock, regression, signals))?;
            json.show(&compared, || text(&compared), &[])?;
            return Ok(Verdict::of(compared.first_difference.is_none()).and(whole));
        }
        let playback = self.playback(&recording)?;
        let played = on_bus(&address, move |bus, signals| play(&recording, bus, &SystemClock, &playback, signals))?;
        let text = || {
            let frames = played.frames;
            let length_s = played.recorded_s;
            let late_ms = played.latest_s * 1e3;
            format!(
                "{frames} frames of {length_s:.3} recorded seconds sent to {address}, the latest {late_ms:.3} ms late\n"
            )
        };
        json.show(&played, text, &[])?;
        Ok(whole)
    }

    fn playback(&self, recording: &Recording) -> Result<Playback, Failure> {
        let SelectionFlags { direction, id, map, range: TimeRange { from_s, to_s }, times } = &self.selection;
        let samples = match (from_s, to_s) {
            (None, None) => None,
            _ => Some(export::samples(recording, *from_s, *to_s)?),
        };
        let direction = *direction;
        let ids = id.clone();
        let mapped = map.clone();
        let times = *times;
        Ok(Playback { speed: self.speed, direction, ids, mapped, samples, times })
    }

    fn regression(&self) -> Result<Regression, Failure> {
        let AgainstFlags { limit_n, limit_nm, patience_s, .. } = self.against;
        for (flag, limit) in [("--limit-n", limit_n), ("--limit-nm", limit_nm)] {
            if limit < 0.0 {
                return Err(Failure::value(flag, limit, "it must be 0 or more"));
            }
        }
        Ok(Regression { speed: self.speed, limit_n, limit_nm, patience: seconds("--patience-s", patience_s)? })
    }
}

/// Runs `work` on the bus until it is done or stopped by a signal.
fn on_bus<T: Send + 'static>(
    address: &BusAddress,
    work: impl FnOnce(&mut dyn Bus, &Signals) -> Result<T, ReplayError> + Send + 'static,
) -> Result<T, Failure> {
    let mut bus = bus::open(address)?;
    let work = move |signals: &Signals| {
        let result = work(bus.as_mut(), signals);
        // Closed after an error, too, whose message takes precedence over one on closing.
        let closed = bus.close();
        result.and_then(|done| closed.map(|()| done).map_err(Into::into))
    };
    Ok(supervise("replay", Length::Unknown, |_, _| {}, work)??)
}

fn text(compared: &Compared) -> String {
    let Compared { frames, commands, largest_force_difference_n, largest_torque_difference_nm, first_difference } =
        compared;
    let mut text = format!(
        "{frames} frames of the plant sent, {commands} commands compared; largest differences {} N, {} N\u{b7}m\n",
        short(largest_force_difference_n),
        short(largest_torque_difference_nm)
    );
    if let Some(Difference { sample, kind }) = first_difference {
        text += &format!("first difference at sample {sample}: {kind}\n");
    }
    text
}
