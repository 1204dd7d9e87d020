//! Messages to and from a viewer's page.
//!
//! Text messages are JSON objects with a `kind`. The update, thirty times a second, is a binary message: the length of
//! its head as a little-endian 32-bit number, the head as JSON, zeros up to a multiple of four bytes, and
//! single-precision numbers, little-endian: for each stretch its least and its largest row, then the latest rows.

use serde::{Deserialize, Serialize};

use super::about::{About, Action};
use super::extremes::Stretch;
use super::rows::Row;
use super::test_panel::TestStatus;
use resonarm_bench::control::SetPoint;
use resonarm_session::run::Request;

/// A text message to the page.
#[derive(Debug, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum PageMessage<'a> {
    /// Description of the run or recording, always sent first.
    About(&'a About),
    /// The state of the watched node.
    State(&'a NodeStatus),
    /// An event of the run.
    Event(&'a EventLine),
    /// A response that was read.
    Response(&'a ReadPoint),
    /// The computed branch that the responses should lie on.
    Branch(&'a BranchLines),
    /// Spectra of the latest samples.
    Spectrum(&'a Spectra),
    /// How far a vibration test is, and what it has reached.
    Test(&'a TestStatus),
    /// Another series of samples begins: everything drawn or sent before is obsolete, except the branch.
    Restarted,
    /// The position in a recording.
    Player(&'a PlayerStatus),
    /// The set-point that the exciter approaches or holds, if one can be set: at first, and when it changes.
    SetPoint(&'a SetPoint),
    /// A request was accepted.
    Taken,
    /// A request was refused.
    Refused {
        /// Reason why the request was refused.
        why: &'a str,
    },
    /// The run is over.
    Ended,
}

/// The state of a node.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NodeStatus {
    /// State of the node: unknown, boot-up, pre-operational, operational, fault.
    pub state: &'static str,
    /// The latched fault, in words.
    pub fault: Option<String>,
}

/// An event of the run, as the page lists it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EventLine {
    /// Simulated time of the event, s.
    pub time_s: f64,
    /// Name of the event in recordings.
    pub name: String,
    /// A number that belongs to it.
    pub value: i64,
    /// A description, if it is a fault.
    pub text: Option<String>,
}

/// A response that was read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReadPoint {
    pub frequency_hz: f64,
    /// Amplitudes of the response, by the `responses` of [`About`].
    pub amplitude: Vec<f64>,
    /// Amplitude of the load, N or N·m.
    pub load: f64,
    /// Lag of the response behind the load in a closed loop.
    pub lag_deg: Option<f64>,
    pub settled: bool,
    /// Whether each size was computed from clipped readings.
    pub clipped: Vec<bool>,
}

/// A branch of computed periodic responses: lists of frequency, Hz, and the sizes of the response, by the `responses`
/// of [`About`]; `None` between two stretches.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BranchLines {
    /// Stable responses; `None` separates stretches.
    pub stable: Vec<Option<Vec<f64>>>,
    /// Unstable responses; `None` separates stretches.
    pub unstable: Vec<Option<Vec<f64>>>,
    /// Folds of the branch.
    pub folds: Vec<Vec<f64>>,
}

/// Amplitude spectra of the latest samples.
#[derive(Clone, Debug, Serialize)]
pub struct Spectra {
    /// Distance between two lines, Hz.
    pub line_hz: f64,
    /// Amplitudes of the force in the head along x and y, or of the commanded load if there are no readings.
    pub force: [Vec<f32>; 2],
    /// Amplitudes of the acceleration of C along x and y, m/s².
    pub acceleration_c: [Vec<f32>; 2],
    /// Readings used that were clipped, by the bits that [`About`] names.
    pub clipped: u32,
    /// Frequency of the largest line of the acceleration, Hz.
    pub peak_hz: Option<f64>,
}

/// The position in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlayerStatus {
    pub playing: bool,
    /// Recorded seconds per second.
    pub speed: f64,
    /// The sample that is shown.
    pub sample: u64,
}

/// Timing of the loop since the last update.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Timing {
    /// The mean and the largest fraction of a sample period that the work of a sample took.
    pub load: f64,
    pub load_most: f64,
    /// The mean and the latest lateness of a sample, µs.
    pub late_us: f64,
    pub late_most_us: f64,
}

/// The head of an update.
#[derive(Debug, Serialize)]
pub struct UpdateHead {
    /// Index of the newest sample.
    pub sample: u64,
    /// Time of the newest sample, s; in a recording that of the sample shown.
    pub time_s: f64,
    /// First samples of the stretches.
    pub stretches: Vec<u64>,
    /// Samples in a stretch.
    pub width: u64,
    /// First of the latest rows, which are contiguous.
    pub first: u64,
    /// Number of the latest rows.
    pub rows: usize,
    /// Readings that were clipped in each stretch, by the bits that [`About`] names.
    pub stretches_clipped: Vec<u32>,
    /// Readings that were clipped in each row.
    pub rows_clipped: Vec<u32>,
    /// Timing of the loop; `None` if it has no schedule.
    pub timing: Option<Timing>,
    /// Deadlines missed since the run or the recording began.
    pub overruns: u64,
    /// Their causes, in words, each with its count.
    pub overrun_causes: Vec<(&'static str, u64)>,
    /// Records of the loop that were lost because nothing took them in time.
    pub lost: u64,
    /// Updates that viewers were too slow for, in total.
    pub lost_updates: u64,
    pub viewers: usize,
}

/// The bytes of an update.
pub fn update(head: &UpdateHead, stretches: &[Stretch], rows: &[Row]) -> serde_json::Result<Vec<u8>> {
    let json = serde_json::to_vec(head)?;
    let row_bytes = rows.first().map_or(0, |row| size_of_val(&*row.numbers));
    let mut bytes = Vec::with_capacity(8 + json.len() + row_bytes * (2 * stretches.len() + rows.len()));
    bytes.extend_from_slice(&(json.len() as u32).to_le_bytes());
    bytes.extend_from_slice(&json);
    // The page reads the numbers in place: a Float32Array must begin at a multiple of four bytes.
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let extremes = stretches.iter().flat_map(|stretch| [&stretch.least, &stretch.largest]);
    for numbers in extremes.chain(rows.iter().map(|row| &row.numbers)) {
        numbers.iter().for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
    }
    Ok(bytes)
}

/// A request with its token: `{"token": "…", "request": "arm"}`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PageRequest {
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
    /// Set the sine's set-point: N or N·m, Hz, degrees.
    Set {
        load: f64,
        frequency_hz: f64,
        phase_deg: f64,
    },
    Play,
    Pause,
    /// Continue at this time, s.
    Seek {
        time_s: f64,
    },
    /// Pause, and move by so many samples, negative for back, within the recording.
    Step {
        samples: i64,
    },
    /// Recorded seconds per second.
    Speed {
        times: f64,
    },
}

/// A request of a viewer that has passed all checks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// A request to the loop of a run.
    Run(Request),
    /// Order for the player of a recording.
    Player(PlayerOrder),
}

/// A command to the player of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlayerOrder {
    Play,
    Pause,
    Seek { time_s: f64 },
    Step { samples: i64 },
    Speed { times: f64 },
}

/// The slowest and the fastest playback, recorded seconds per second.
pub const SPEEDS: core::ops::RangeInclusive<f64> = 0.001..=1000.0;

impl Wish {
    /// The action that the request needs.
    fn action(self) -> Action {
        match self {
            Wish::Arm => Action::Arm,
            Wish::Disarm => Action::Disarm,
            Wish::Reset => Action::Reset,
            Wish::Set { .. } => Action::Set,
            Wish::Play | Wish::Pause | Wish::Seek { .. } | Wish::Step { .. } | Wish::Speed { .. } => Action::Play,
        }
    }

    /// The order for this request, or why it is refused.
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
                let Some(limits) = &about.steering else {
                    return Err(String::from(
                        "the run has no set-point to change: expected a run of an exciter with a steered excitation",
                    ));
                };
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
