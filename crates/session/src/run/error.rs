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

use super::{Mode, SpeedError};

/// Why a run can't begin, or ended early.
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
    #[error("the mode free has no bus: plant and exciter run in one loop; take the mode lockstep")]
    FreeHasNoBus,
    /// The structure has other states than the user protocol sends.
    #[error(
        "[wire]: its messages carry {name}, and the states of the structure are {has}: name one of these in \
         [[wire.readings]]"
    )]
    SentStates {
        /// The state that the protocol sends.
        name: ChannelName,
        /// The states of the structure.
        has: String,
    },
    /// A wire lacks something for the exciter.
    #[error(transparent)]
    WireLacks(#[from] ExciterLack),
    /// Bit errors were asked of a bus that can't be made to have them.
    #[error(
        "network.bit_error_rate is {bit_error_rate}: the bus of the mode {mode} has the bit errors that it has; leave it out, \
         take --mode free, where they are simulated, or corrupt frames by [[network.faults]]",
        bit_error_rate = short(.bit_error_rate)
    )]
    BitErrors {
        /// The probability that a bit is not what was sent.
        bit_error_rate: f64,
        /// The mode of the run.
        mode: Mode,
    },
    /// A bit rate was asked of the bus that both nodes of a run in real time share.
    #[error(
        "network.bit_rate_hz is {bit_rate_hz}: in real time plant and exciter of one process share a bus in memory, on which \
         frames take no time; leave it out, or take the mode free or lockstep"
    )]
    TimedInRealTime {
        /// Bits a second of arbitration.
        bit_rate_hz: u32,
    },
    /// The CAN bus can't be used.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The recording can't be begun.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The run has come to its end, its recording has not.
    #[error("the recording lacks the end of the run: {0}; `resonarm inspect` says what is there")]
    NotRecorded(RecordingError),
    /// The simulation of the plant failed.
    #[error("the simulation failed at {0}")]
    Plant(#[from] PlantError),
    /// A measurement could not be put on the wire.
    #[error("a measurement can't be sent: {0}")]
    Encode(#[from] PublishError),
    /// The system has no thread left for the run.
    #[error("the operating system denied the run another thread: {source}; end other programs, or raise `ulimit -u`")]
    NoThread {
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The run asks for a real-time thread, and the system refuses it.
    #[error("the thread of the run must be a real-time thread, and has {}", in_words(shortfalls))]
    NoRealTimeThread {
        /// Settings that the system refuses.
        shortfalls: Vec<Shortfall>,
    },
    /// The loop can't spin so.
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
        "no plant was heard within {waited_s} s: start one with `resonarm run` on the same bus, with the same rate and base identifier",
        waited_s = short(.waited_s)
    )]
    NoPlant {
        /// How long the exciter waited, s.
        waited_s: f64,
    },
    /// The plant that answered did not let itself be armed.
    #[error(
        "a plant was heard, but it was not armed within {waited_s} s: it may have failed, or another exciter holds it: its own \
         messages say which", waited_s = short(.waited_s)
    )]
    PlantNotArmed {
        /// How long the exciter waited, s.
        waited_s: f64,
    },
    /// A run in one loop made no progress.
    #[error("plant and exciter did not come to terms: the plant is {plant}, the exciter {exciter}")]
    Stalled {
        /// State of the plant's node.
        plant: resonarm_protocol::NodeState,
        /// State of the exciter's node.
        exciter: resonarm_protocol::NodeState,
    },
}

fn in_words(shortfalls: &[Shortfall]) -> String {
    let words: Vec<String> = shortfalls.iter().map(Shortfall::to_string).collect();
    format!("{}; without it: --rt auto", words.join("; and "))
}
