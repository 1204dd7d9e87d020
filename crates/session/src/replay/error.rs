//! Errors of replay and re-simulation.

use thiserror::Error;

use super::player::SPEEDS;
use resonarm_bench::node::ExciterLack;
use resonarm_bench::plant::{PlantError, PlantSpecError};
use resonarm_bench::rig::Load;
use resonarm_bench::structure::ChannelName;
use resonarm_bus::BusError;
use resonarm_files::recording::RecordingError;
use resonarm_numeric::number::short;
use resonarm_protocol::{FrameError, Mismatch};
use resonarm_scenario::ScenarioError;

/// Why a recording can't be replayed or simulated again.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The recording can't be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The recording's scenario can't be used.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The recording's scenario makes no plant.
    #[error("the recording's scenario makes no plant: {0}")]
    Plant(#[from] PlantSpecError),
    /// The simulation failed where the recorded one went on.
    #[error("simulated again, the run fails at {0}")]
    Simulation(#[from] PlantError),
    /// The CAN bus can't be used.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// What a CANopen master asks, and how often, depends on time.
    #[error(
        "the recording's run was with CANopen drives, and --against does not test their masters: what a master asks by service data, and \
         how often, depends on time; record a run of the new master with the same scenario in lockstep, and compare both recordings by \
         `resonarm diff`"
    )]
    AgainstDrives,
    /// A free run has handed the plant a load that no frame carries.
    #[error(
        "the recorded run has the load {part}, which a free run hands to the plant and no frame carries: a controller on a bus can't \
         command it, and --against can't compare it; record a run with a protocol of your own that carries it ([wire])"
    )]
    AgainstLoad {
        /// Part of the load.
        part: ChannelName,
    },
    /// Nobody is there to be tested.
    #[error("no controller was heard on the bus within {} s (--patience-s)", short(.waited_s))]
    NoController {
        /// How long was waited, s.
        waited_s: f64,
    },
    /// An identifier can't take a frame's place.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// There is nothing to replay.
    #[error("the recording holds no {what}")]
    Empty {
        /// Kind of records that the recording lacks.
        what: &'static str,
    },
    /// The recording was made of a log.
    #[error(
        "the recording was imported from {log} and holds frames alone: to be simulated again a run needs its states and \
         loads (/plant/steps){}; `replay` takes it", if *.has_scenario { "" } else { " and its scenario" }
    )]
    Imported {
        /// Log from which the recording was imported.
        log: String,
        /// Whether the scenario is known.
        has_scenario: bool,
    },
    /// An FMU that would have to begin in the middle of its run.
    #[error(
        "the recording begins at sample {sample}, and its structure is an FMU, which can be simulated again from its start alone: take \
         the whole recording"
    )]
    FmuFromStart {
        /// First sample of the recording.
        sample: u64,
    },
    /// An FMU of which no state is recorded.
    #[error(
        "the recording has no states of its FMU, so that nothing can be compared: map displacement and velocity of a degree of freedom \
         in structure.outputs"
    )]
    FmuWithoutStates,
    /// An FMU that does not repeat itself.
    #[error(
        "the FMU does not repeat itself: simulated twice from its start under the recorded loads, it differs from itself at sample \
         {sample}, so that its run can't be simulated again"
    )]
    FmuNotRepeating {
        /// First sample at which the two simulations differ.
        sample: u64,
    },
    /// What the instruments have gathered before the first sample is not known.
    #[error(
        "the recording begins at sample {sample} without what its instruments had gathered until then, so readings can't be \
         compared: cut it anew from the whole run, or compare the states alone"
    )]
    NoInstruments {
        /// First sample of the recording.
        sample: u64,
    },
    /// The current of the shaker's coil at the first sample is not known.
    #[error(
        "the recording begins at sample {sample} and does not hold the current in the coil of its shaker: \
         simulate the whole recording again, from sample 0 on"
    )]
    NoCurrent {
        /// First sample of the recording.
        sample: u64,
    },
    /// The speed is impossible.
    #[error(
        "the speed is {got}: it must be 0, which is as fast as it goes, or from {} to {}; 1 is the recorded speed",
        SPEEDS.start(), SPEEDS.end(), got = short(.got))]
    Speed {
        /// Speed that was requested.
        got: f64,
    },
    /// The samples are not those of the scenario.
    #[error(
        "the recording states {recorded_s} s from sample to sample, its scenario {configured_s} s \
         (simulation.rate_hz): it can't be simulated again",
        recorded_s = short(.recorded_s), configured_s = short(.configured_s)
    )]
    SamplePeriod {
        /// In the recording, s.
        recorded_s: f64,
        /// In its scenario, s.
        configured_s: f64,
    },
    /// A load is none that the exciter can have produced.
    #[error(
        "the recording's load at sample {sample} is {:?} N, {:?} N·m: beyond the exciter's limits in its \
         scenario (rig.exciter: {limit_n} N, {limit_nm} N·m)",
        .load.forces_n(), .load.torques_nm(), limit_n = short(.limit_n), limit_nm = short(.limit_nm)
    )]
    Load {
        /// Sample with the impossible load.
        sample: u64,
        /// The recorded load, which the exciter could not have produced.
        load: Load,
        /// Largest force of the exciter, N.
        limit_n: f64,
        /// Largest torque of the exciter, N·m.
        limit_nm: f64,
    },
    /// The recorded plant is none for a controller of this version.
    #[error(
        "a controller of this version refuses the recorded plant{}: read it with the version that recorded it",
        Mismatch::from_detail(*.detail).map_or(String::new(), |mismatch| format!(" ({mismatch})"))
    )]
    Incompatible {
        /// The [`Mismatch`] by its number.
        detail: u16,
    },
    /// What a controller on the scenario's own protocol played is not known.
    #[error(
        "the scenario with its own [wire] has neither [excitation] nor [control]: responses are read with the [excitation] that a \
         controller played, or with the [control] of Resonarm's exciter"
    )]
    NoExcitation,
    /// The scenario's own protocol lacks something for the controller that is to be run again.
    #[error(transparent)]
    WireLacks(#[from] ExciterLack),
    /// It was imported from a log that has no readings.
    #[error(
        "the recording was imported from {log} and has no readings, by which responses are read: `import` names those that its wire does \
         not carry"
    )]
    NoReadings {
        /// Log from which the recording was imported.
        log: String,
    },
    /// No command on the scenario's own protocol has a load.
    #[error("no command in the recording has a load, so nothing says when the excitation began")]
    NoLoad,
    /// Another controller was recorded than that of the scenario in the recording.
    #[error(
        "the recorded command at sample {sample} is {got}, by the scenario in the recording it is \
         {expected}: another controller was recorded; run plant and exciter with the same scenario"
    )]
    Command {
        /// The sample at which it came in.
        sample: u64,
        /// The load, as recorded.
        got: Box<Load>,
        /// The load that the controller of the scenario in the recording commands.
        expected: Box<Load>,
    },
}

impl ReplayError {
    /// [`ReplayError::Command`] of these loads.
    pub(super) fn command(sample: u64, got: Load, expected: Load) -> ReplayError {
        ReplayError::Command { sample, got: Box::new(got), expected: Box::new(expected) }
    }
}
