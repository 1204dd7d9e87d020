//! What goes to a viewer's page, and what comes from it.
//!
//! Text messages are JSON objects with a `kind`. The update, thirty times a second, is a binary message: the length of
//! its head as a little-endian 32-bit number, the head as JSON, zeros up to a multiple of four bytes, and
//! single-precision numbers, little-endian: for each stretch its least and its largest row, then the latest rows.

use serde::{Deserialize, Serialize};

use super::about::{About, Action};
use super::extremes::Stretch;
use super::rows::Row;
use resonarm_bench::control::SetPoint;
use resonarm_session::run::Request;

/// A text message to the page.
#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Told<'a> {
    /// First of all.
    About(&'a About),
    /// The state of the node that is watched.
    State(&'a NodeStatus),
    /// Something that happened.
    Event(&'a EventLine),
    /// A response that was read.
    Response(&'a ReadPoint),
    /// The computed branch that the responses should lie on.
    Branch(&'a BranchLines),
    /// Spectra of the latest samples.
    Spectrum(&'a Spectra),
    /// Another series of samples begins: what was drawn and told is of the past, but for the branch.
    Restarted,
    /// Where a recording is.
    Player(&'a PlayerStatus),
    /// The set-point that the exciter goes to or holds, if one can be set: at first, and when it changes.
    SetPoint(&'a SetPointLine),
    /// A request was handed on.
    Taken,
    /// A request was not.
    Refused {
        /// Why.
        why: &'a str,
    },
    /// The run is over.
    Ended,
}

/// The state of a node.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NodeStatus {
    /// Its state: unknown, boot-up, pre-operational, operational, fault.
    pub state: &'static str,
    /// The fault that is latched, in words.
    pub fault: Option<String>,
}

/// An event.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EventLine {
    /// When in simulated time, s.
    pub time_s: f64,
    /// What, as recordings have it.
    pub name: String,
    /// A number that belongs to it.
    pub value: i64,
    /// In words, if it is a fault.
    pub text: Option<String>,
}

/// A response that was read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReadPoint {
    pub frequency_hz: f64,
    /// The largest |α1| and |α2|.
    pub amplitude_rad: [f64; 2],
    /// Amplitude of the load, N or N·m.
    pub load: f64,
    /// Lag of the response behind the load in a closed loop.
    pub lag_deg: Option<f64>,
    pub settled: bool,
    /// Whether α1 and α2 rest on clipped readings.
    pub clipped: [bool; 2],
}

/// A branch of computed motions: lists of frequency, Hz, and the largest |α1| and |α2|, rad; `None` between two
/// stretches.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BranchLines {
    pub stable: Vec<Option<[f64; 3]>>,
    pub unstable: Vec<Option<[f64; 3]>>,
    pub folds: Vec<[f64; 3]>,
}

/// Amplitude spectra.
#[derive(Clone, Debug, Serialize)]
pub struct Spectra {
    /// From one line to the next, Hz.
    pub line_hz: f64,
    /// Of the force in the head along x and y, or of the commanded load, if nothing is read.
    pub force: [Vec<f32>; 2],
    /// Of the acceleration of C along x and y, m/s².
    pub acceleration_c: [Vec<f32>; 2],
    /// Which readings that they are of were clipped, by the bits that [`About`] names.
    pub clipped: u32,
    /// Where the largest line of the acceleration stands, Hz.
    pub peak_hz: Option<f64>,
}

/// A set-point, as a request has it: N or N·m, Hz, degrees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SetPointLine {
    pub load: f64,
    pub frequency_hz: f64,
    pub phase_deg: f64,
}

impl From<SetPoint> for SetPointLine {
    fn from(SetPoint { load, frequency_hz, phase_deg }: SetPoint) -> SetPointLine {
        SetPointLine { load, frequency_hz, phase_deg }
    }
}

/// Where a recording is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlayerStatus {
    pub playing: bool,
    /// Recorded seconds a second.
    pub speed: f64,
    /// The sample that is shown.
    pub sample: u64,
}

/// How the loop keeps time, since the last update.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Timing {
    /// The mean and the largest part of a sample period that the work of a sample took.
    pub load: f64,
    pub load_most: f64,
    /// The mean and the latest time that a sample was late, µs.
    pub late_us: f64,
    pub late_most_us: f64,
}

/// The head of an update.
#[derive(Debug, Serialize)]
pub struct UpdateHead {
    /// The newest sample.
    pub sample: u64,
    /// Its time, s; of a recording that of the sample that is shown.
    pub time_s: f64,
    /// First samples of the stretches.
    pub stretches: Vec<u64>,
    /// Samples in a stretch.
    pub width: u64,
    /// First of the latest rows, which follow each other without a gap.
    pub first: u64,
    /// How many rows.
    pub rows: usize,
    /// Which readings were clipped in each stretch, by the bits that [`About`] names.
    pub stretches_clipped: Vec<u32>,
    /// Which were in each row.
    pub rows_clipped: Vec<u32>,
    /// How the loop keeps time; none if it has no schedule.
    pub timing: Option<Timing>,
    /// Deadlines missed since the run or the recording began.
    pub overruns: u64,
    /// Why, in words, and how many of them: by each cause that there was.
    pub overrun_causes: Vec<(&'static str, u64)>,
    /// What the loop told and nobody was there in time to take.
    pub lost: u64,
    /// Updates that viewers were too slow for, all together.
    pub lost_updates: u64,
    pub viewers: usize,
}

/// An update as it is sent.
pub fn update(head: &UpdateHead, stretches: &[Stretch], rows: &[Row]) -> serde_json::Result<Vec<u8>> {
    let json = serde_json::to_vec(head)?;
    let mut bytes = Vec::with_capacity(8 + json.len() + 48 * (2 * stretches.len() + rows.len()));
    bytes.extend_from_slice(&(json.len() as u32).to_le_bytes());
    bytes.extend_from_slice(&json);
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let extremes = stretches.iter().flat_map(|stretch| [&stretch.least, &stretch.largest]);
    for numbers in extremes.chain(rows.iter().map(|row| &row.numbers)) {
        numbers.iter().for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
    }
    Ok(bytes)
}

/// What a page asks for: `{"token": "…", "request": "arm"}`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Asked {
    pub token: String,
    pub request: Wish,
}

/// A request of a page.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Wish {
    Arm,
    Disarm,
    Reset,
    /// Lead the sine to a set-point: N or N·m, Hz, degrees.
    Set {
        load: f64,
        frequency_hz: f64,
        phase_deg: f64,
    },
    Play,
    Pause,
    /// Go on at this time, s.
    Seek {
        time_s: f64,
    },
    /// Halt, and go so many samples on, or back if it is negative; no further than the recording goes.
    Step {
        samples: i64,
    },
    /// Recorded seconds a second.
    Speed {
        times: f64,
    },
}

/// What a wish is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// For a loop.
    Run(Request),
    /// For the player of a recording.
    Player(PlayerOrder),
}

/// What is asked of the player of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlayerOrder {
    Play,
    Pause,
    Seek { time_s: f64 },
    Step { samples: i64 },
    Speed { times: f64 },
}

/// The slowest and the fastest that a recording is played, recorded seconds a second.
pub const SPEEDS: core::ops::RangeInclusive<f64> = 0.001..=1000.0;

impl Wish {
    /// The action that it is.
    fn action(self) -> Action {
        match self {
            Wish::Arm => Action::Arm,
            Wish::Disarm => Action::Disarm,
            Wish::Reset => Action::Reset,
            Wish::Set { .. } => Action::Set,
            Wish::Play | Wish::Pause | Wish::Seek { .. } | Wish::Step { .. } | Wish::Speed { .. } => Action::Play,
        }
    }

    /// The order that it comes to, or why it is none.
    pub fn order(self, about: &About) -> Result<Order, String> {
        if !about.allows(self.action()) {
            return Err(format!("{:?} can't be asked of a {}", self.action(), about.role).to_lowercase());
        }
        let within = |name: &str, value: f64, [least, most]: [f64; 2], unit: &str| {
            let holds = value.is_finite() && (least..=most).contains(&value);
            if holds {
                Ok(())
            } else {
                Err(format!("{name} is {value} {unit}: it must be from {least} to {most} {unit}"))
            }
        };
        Ok(match self {
            Wish::Arm => Order::Run(Request::Arm),
            Wish::Disarm => Order::Run(Request::Disarm),
            Wish::Reset => Order::Run(Request::Reset),
            Wish::Set { load, frequency_hz, phase_deg } => {
                let Some(limits) = &about.steering else { return Err(String::from("nothing is steered here")) };
                let [load_range, frequency_hz_range, phase_deg_range] =
                    [limits.load, limits.frequency_hz, limits.phase_deg];
                within("the load", load, load_range, about.unit)?;
                within("the frequency", frequency_hz, frequency_hz_range, "Hz")?;
                within("the phase", phase_deg, phase_deg_range, "\u{b0}")?;
                Order::Run(Request::Set(SetPoint { load, frequency_hz, phase_deg }))
            }
            Wish::Play => Order::Player(PlayerOrder::Play),
            Wish::Pause => Order::Player(PlayerOrder::Pause),
            Wish::Seek { time_s } => {
                let (first, last) = about.samples.unwrap_or((0, 0));
                let at_s = |sample: u64| sample as f64 / about.rate_hz;
                within("the time", time_s, [at_s(first), at_s(last)], "s")?;
                Order::Player(PlayerOrder::Seek { time_s })
            }
            Wish::Step { samples } => Order::Player(PlayerOrder::Step { samples }),
            Wish::Speed { times } => {
                within("the speed", times, [*SPEEDS.start(), *SPEEDS.end()], "times")?;
                Order::Player(PlayerOrder::Speed { times })
            }
        })
    }
}
