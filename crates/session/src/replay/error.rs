//! Errors of replay and re-simulation.

use core::ops::RangeInclusive;

use thiserror::Error;

use resonarm_bench::node::ExciterLack;
use resonarm_bench::plant::{PlantError, PlantSpecError};
use resonarm_bench::rig::Load;
use resonarm_bench::structure::ChannelName;
use resonarm_bus::BusError;
use resonarm_files::recording::RecordingError;
use resonarm_numeric::number::short;
use resonarm_protocol::{FrameError, Mismatch};
use resonarm_scenario::ScenarioError;

/// Valid speeds, in times the recorded one; 0 is as fast as possible.
pub(super) const SPEEDS: RangeInclusive<f64> = 1e-3..=1e6;

/// Error of a replay or a re-simulation.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The recording can't be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The recording's scenario can't be used.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The recording's scenario describes no valid plant.
    #[error("the recording's scenario describes no valid plant: {0}")]
    Plant(#[from] PlantSpecError),
    /// The re-simulation failed where the recorded run continued.
    #[error("the re-simulation failed at {0}")]
    Simulation(#[from] PlantError),
    /// The CAN bus can't be used.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// CANopen masters are not tested against recordings, since their requests depend on time.
    #[error(
        "`--against` can't test a CANopen master: what a master requests by SDO, and how often, depends on time; record a run of the new \
         master with the same scenario in lockstep, and compare both recordings with `resonarm diff`"
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
    /// No controller was heard on the bus.
    #[error("no controller was heard on the bus within {} s (--patience-s)", short(.waited_s))]
    NoController {
        /// Length of the wait, s.
        waited_s: f64,
    },
    /// An identifier can't be given to a frame.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The recording has no such records.
    #[error("the recording holds no {what}")]
    Empty {
        /// Kind of records that the recording lacks.
        what: &'static str,
    },
    /// The recording was imported from a log.
    #[error(
        "the recording was imported from {log} and holds only frames; a re-simulation needs the states and \
         loads of the run (/plant/steps){}; use `replay` to play the frames", if *.has_scenario { "" } else { " and its scenario" }
    )]
    Imported {
        /// Log from which the recording was imported.
        log: String,
        /// Whether the scenario is known.
        has_scenario: bool,
    },
    /// The re-simulation of an FMU would have to start in the middle of its run.
    #[error(
        "the recording begins at sample {sample}, but its structure is an FMU, which can be simulated only from its start; use the whole \
         recording"
    )]
    FmuFromStart {
        /// First sample of the recording.
        sample: u64,
    },
    /// No state of the FMU is recorded.
    #[error(
        "the recording has no states of its FMU, so nothing can be compared; map the displacement and the velocity of a degree of freedom \
         in structure.outputs, and record again"
    )]
    FmuWithoutStates,
    /// The FMU is not deterministic.
    #[error(
        "the FMU is not deterministic: two simulations from its start under the recorded loads differ from each other at sample \
         {sample}, so the run can't be re-simulated"
    )]
    FmuNotRepeating {
        /// First sample at which the two simulations differ.
        sample: u64,
    },
    /// The state of the instruments before the first sample is not recorded.
    #[error(
        "the recording begins at sample {sample} and does not hold the state of its instruments there, so readings can't be \
         compared; cut it again from the whole run, or compare the states alone"
    )]
    NoInstruments {
        /// First sample of the recording.
        sample: u64,
    },
    /// The current of the shaker's coil at the first sample is not recorded.
    #[error(
        "the recording begins at sample {sample} and does not hold the current in the coil of its shaker; \
         re-simulate the whole recording, from sample 0 on"
    )]
    NoCurrent {
        /// First sample of the recording.
        sample: u64,
    },
    /// The speed is impossible.
    #[error(
        "the speed is {got}: it must be 0 (as fast as possible), or from {} to {}; 1 is the recorded speed",
        SPEEDS.start(), SPEEDS.end(), got = short(.got))]
    Speed {
        /// Speed that was requested.
        got: f64,
    },
    /// The sample period of the recording differs from that of its scenario.
    #[error(
        "the sample period is {recorded_s} s in the recording, but {configured_s} s in its scenario \
         (simulation.rate_hz), so the run can't be re-simulated",
        recorded_s = short(.recorded_s), configured_s = short(.configured_s)
    )]
    SamplePeriod {
        /// In the recording, s.
        recorded_s: f64,
        /// In its scenario, s.
        configured_s: f64,
    },
    /// The exciter can't have produced a recorded load.
    #[error(
        "the recorded load at sample {sample} is {load}, beyond the limits of the exciter in the scenario (rig.exciter: \
         {limit_n} N, {limit_nm} N·m)",
        limit_n = short(.limit_n), limit_nm = short(.limit_nm)
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
    /// The recorded plant is incompatible with a controller of this version.
    #[error(
        "a controller of this version rejects the recorded plant{}; use the version that recorded it",
        Mismatch::from_detail(*.detail).map_or(String::new(), |mismatch| format!(" ({mismatch})"))
    )]
    Incompatible {
        /// The [`Mismatch`] by its number.
        detail: u16,
    },
    /// The scenario does not say which excitation a controller on a user protocol played.
    #[error(
        "the scenario has a user protocol ([wire]), but neither [excitation] nor [control]; state the [excitation] that the \
         controller played, or the [control] of Resonarm's exciter, so that responses can be read"
    )]
    NoExcitation,
    /// The user protocol lacks something for the controller that is to be run again.
    #[error(transparent)]
    WireLacks(#[from] ExciterLack),
    /// The recording was imported from a log that has no readings.
    #[error(
        "the recording was imported from {log} and has no readings, so no responses can be read: the user protocol does not carry all of \
         them, and `import` lists the missing ones"
    )]
    NoReadings {
        /// Log from which the recording was imported.
        log: String,
    },
    /// No command on the user protocol has a load.
    #[error("no command in the recording has a load, so the start of the excitation is unknown")]
    NoLoad,
    /// The recording was made with another controller than that of its scenario.
    #[error(
        "the recorded command at sample {sample} is {got}, but the scenario in the recording gives \
         {expected}, so another controller was recorded; run plant and exciter with the same scenario"
    )]
    Command {
        /// The sample at which the command arrived.
        sample: u64,
        /// The load, as recorded.
        got: Box<Load>,
        /// The load that the controller of the scenario in the recording commands.
        expected: Box<Load>,
    },
}

impl ReplayError {
    /// Makes [`ReplayError::Command`] of these loads.
    pub(super) fn command(sample: u64, got: Load, expected: Load) -> ReplayError {
        ReplayError::Command { sample, got: Box::new(got), expected: Box::new(expected) }
    }
}
