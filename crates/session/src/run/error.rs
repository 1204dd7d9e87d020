//! Errors that prevent a run from starting, or end it early.

use thiserror::Error;

use resonarm_bench::node::{ExciterLack, PublishError};
use resonarm_bench::plant::{PlantError, PlantSpecError};
use resonarm_bench::structure::ChannelName;
use resonarm_bus::BusError;
use resonarm_files::recording::RecordingError;
use resonarm_numeric::number::short;
use resonarm_realtime::{HistogramError, PeriodicError, RateError, Shortfall, SpinError};
use resonarm_scenario::ScenarioError;

use super::mode::Mode;
use super::pace::SpeedError;

/// Error of a run that can't start, or ended early.
#[derive(Debug, Error)]
pub enum RunError {
    /// The scenario is impossible.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The scenario's plant is impossible.
    #[error(transparent)]
    PlantSpec(#[from] PlantSpecError),
    /// The sample rate is impossible.
    #[error(transparent)]
    Rate(#[from] RateError),
    /// The speed is impossible.
    #[error(transparent)]
    Speed(#[from] SpeedError),
    /// A bus was given to a run without one.
    #[error("the mode free has no bus, since plant and exciter run in one loop; use the mode lockstep")]
    FreeHasNoBus,
    /// The structure has other states than the user protocol sends.
    #[error(
        "[wire]: the messages carry {name}, but the states of the structure are {has}; name one of these in \
         [[wire.readings]]"
    )]
    SentStates {
        /// The state that the protocol sends.
        name: ChannelName,
        /// The states of the structure.
        has: String,
    },
    /// A user protocol lacks something for the exciter.
    #[error(transparent)]
    WireLacks(#[from] ExciterLack),
    /// Bit errors were requested on a bus that can't simulate them.
    #[error(
        "network.bit_error_rate is {bit_error_rate}, but the bus of the mode {mode} can't simulate bit errors; leave it out, \
         use --mode free, or corrupt frames with [[network.faults]]",
        bit_error_rate = short(.bit_error_rate)
    )]
    BitErrors {
        /// The probability that a bit is not what was sent.
        bit_error_rate: f64,
        /// The mode of the run.
        mode: Mode,
    },
    /// A bit rate was requested for the bus that both nodes of a run in real time share.
    #[error(
        "network.bit_rate_hz is {bit_rate_hz}, but in real time plant and exciter of one process share a bus in memory, on which \
         frames take no time; leave it out, or use the mode free or lockstep"
    )]
    TimedInRealTime {
        /// Bits a second of arbitration.
        bit_rate_hz: u32,
    },
    /// The CAN bus can't be used.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The recording can't be created.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The run has ended, but its recording is incomplete.
    #[error("the recording lacks the end of the run: {0}; `resonarm inspect` shows the records that it has")]
    NotRecorded(RecordingError),
    /// The simulation of the plant failed.
    #[error("the simulation failed at {0}")]
    Plant(#[from] PlantError),
    /// A measurement could not be encoded.
    #[error("a measurement can't be sent: {0}")]
    Encode(#[from] PublishError),
    /// The operating system has no thread left for the run.
    #[error("the operating system denied the run another thread: {source}; end other programs, or raise `ulimit -u`")]
    NoThread {
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The run needs a real-time thread, and the operating system denies it.
    #[error("the run needs a real-time thread, but has {}", in_words(shortfalls))]
    NoRealTimeThread {
        /// Settings that the operating system denies.
        shortfalls: Vec<Shortfall>,
    },
    /// The loop can't busy-wait with these settings.
    #[error(transparent)]
    Spin(#[from] SpinError),
    /// The real-time loop ended itself.
    #[error(transparent)]
    Periodic(#[from] PeriodicError),
    /// The latencies could not be measured.
    #[error(transparent)]
    Histogram(#[from] HistogramError),
    /// No plant answered the exciter.
    #[error(
        "no plant was heard within {waited_s} s; start one with `resonarm run` on the same bus, with the same rate and base identifier",
        waited_s = short(.waited_s)
    )]
    NoPlant {
        /// Length of the exciter's wait, s.
        waited_s: f64,
    },
    /// The plant that answered was not armed.
    #[error(
        "a plant was heard, but it was not armed within {waited_s} s; see the plant's own messages: it may have failed, or another \
         exciter may control it", waited_s = short(.waited_s)
    )]
    PlantNotArmed {
        /// Length of the exciter's wait, s.
        waited_s: f64,
    },
    /// A run in one loop made no progress.
    #[error("plant and exciter made no progress: the plant is {plant}, the exciter {exciter}")]
    Stalled {
        /// State of the plant's node.
        plant: resonarm_protocol::NodeState,
        /// State of the exciter's node.
        exciter: resonarm_protocol::NodeState,
    },
}

fn in_words(shortfalls: &[Shortfall]) -> String {
    let words: Vec<String> = shortfalls.iter().map(Shortfall::to_string).collect();
    format!("{}; to run without it, use --rt auto", words.join("; and "))
}
