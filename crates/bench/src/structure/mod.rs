//! A structure under test as the bench knows it: channels that act on it and that it answers in, one step a sample.

pub(crate) mod channel;
mod named_sensors;
mod states;

pub use channel::{
    Axis, COIL_CURRENT, Channel, ChannelName, Coordinates, Kind, LOAD_NAMES, LOADS, LoadSet, NATIVE_LOADS, OUTPUTS,
    Point, Quantity, READINGS, STATES, branch_channel, coordinate_channels, element_channel, joint_channel_name,
    known_states, named_sensor_channels, sensor_channels,
};
pub use named_sensors::{NamedReading, NothingSensed, named_readings};
pub use states::{MOST_COORDINATES, MOST_ELEMENTS, MOST_STATES, States};

use alloc::boxed::Box;
use core::fmt;

use thiserror::Error;

use crate::rig::load::Load;
use crate::rig::shaker::ShakerLimit;
use resonarm_dynamics::structure::StepError;
use resonarm_numeric::number::short;

/// A structure with what drives it and the converters that sample it.
///
/// A plant calls it once a sample: [`Structure::sense`], then [`Structure::advance`] with the load that is held up to
/// the next sample. Numbers stand in the order of its channels, in their units. The same numbers give the same bits.
pub trait Structure: fmt::Debug + Send + Sync {
    /// The loads that act on it. They are [`LoadSet::NATIVE`] at least.
    fn inputs(&self) -> LoadSet;

    /// What the converters sample.
    fn outputs(&self) -> &[Channel];

    /// The states from which, with the inputs, those of the next sample follow: coordinates, their rates, states of
    /// devices.
    fn states(&self) -> &[Channel];

    /// How many numbers [`Structure::save`] writes: the states, and what the converters have gathered for the next
    /// samples.
    fn saved_len(&self) -> usize;

    /// Advances from the sample at `time_s`, s, to the next with the load held (zero-order). It has no part that is
    /// not among the inputs.
    ///
    /// # Errors
    /// [`StructureError`]; the structure then stays at the sample.
    fn advance(&mut self, time_s: f64, load: &Load) -> Result<(), StructureError>;

    /// Writes the outputs as the converters sample them at the sample.
    fn sense(&self, outputs: &mut [f64]);

    /// Writes the states and what the converters have gathered.
    fn save(&self, saved: &mut [f64]);

    /// Takes up what [`Structure::save`] wrote. With the states alone, the converters have always sampled the outputs
    /// at these states without a load.
    ///
    /// # Errors
    /// [`StructureError::Saved`] if the numbers are more or fewer, or one is not finite; nothing changes then.
    fn restore(&mut self, saved: &[f64]) -> Result<(), StructureError>;

    /// The distance of the point that the exciter acts on from rest, m, without sign.
    fn travel_m(&self) -> f64;

    /// A copy in the same state.
    fn boxed_clone(&self) -> Box<dyn Structure>;
}

impl Clone for Box<dyn Structure> {
    fn clone(&self) -> Box<dyn Structure> {
        self.boxed_clone()
    }
}

/// The name of a signal that ends faulty programs, in brackets after a blank; else empty.
const fn signal_name(signal: i32) -> &'static str {
    match signal {
        4 => " (SIGILL, an invalid instruction)",
        6 => " (SIGABRT, abort)",
        7 => " (SIGBUS, an invalid address)",
        8 => " (SIGFPE, a division by zero)",
        9 => " (SIGKILL, as the system does when it runs out of memory)",
        11 => " (SIGSEGV, an invalid address)",
        14 => " (SIGALRM, as it took too long to end)",
        15 => " (SIGTERM)",
        _ => "",
    }
}

/// Fault of a third-party library during a step.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ForeignFault {
    /// It returned another status than OK.
    #[error("it returned {0}")]
    Status(&'static str),
    /// It asks to end the simulation.
    #[error("it requested the end of the simulation")]
    Terminates,
    /// It came to another time than that of the step's end.
    #[error("it stopped at {reached_s} s, not at the end of the step", reached_s = short(.reached_s))]
    Reached {
        /// Where it came to, s.
        reached_s: f64,
    },
    /// A number that is not finite.
    #[error("it gave {got}")]
    NotFinite {
        /// The number that is infinite or not a number.
        got: f64,
    },
    /// It ended its own process.
    #[error("it ended its own process with exit code {code}, as licence checks and STOP of Fortran do")]
    Exited {
        /// The code: 0 is no success here.
        code: i32,
    },
    /// A signal ended its process.
    #[error("signal {signal}{} ended its process", signal_name(*signal))]
    Killed {
        /// The number of the signal.
        signal: i32,
    },
    /// Its process does not answer in the form that is agreed on.
    #[error("the connection to its process is lost: the library closed or wrote to files that are not its own")]
    Lost,
    /// It can't be loaded again.
    #[error("it can't be loaded again; the log has the reason")]
    NotLoaded,
    /// A step of it failed before.
    #[error("an earlier step failed, so that the FMU can't make another one: make a new plant")]
    HasFailed,
    /// A copy that was made after the first step.
    #[error(
        "this plant was copied from one whose FMU was running, and the state of a running FMU can't be copied: copy the plant before \
         its first step"
    )]
    CopyOfRunning,
}

/// Why a structure can't go to the next sample, or to a saved state.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StructureError {
    /// The shaker's amplifier switched off.
    #[error("the {what} would be {got} {unit}, and {most} {unit} is its limit", what = .limit.names()[0], unit = .limit.names()[1])]
    Tripped {
        /// The quantity that is limited.
        limit: ShakerLimit,
        /// The value that would result, in the limit's unit.
        got: f64,
        /// The largest value that the amplifier allows, in the same unit.
        most: f64,
    },
    /// A step of a structure of the library could not be made.
    #[error(transparent)]
    Step(#[from] StepError),
    /// A load on an input that the structure doesn't have.
    #[error("{name} is {got}: nothing of the structure takes this load; command 0, or place the exciter elsewhere")]
    NoInput {
        /// The name of the load that nothing takes.
        name: ChannelName,
        /// Its value, in its unit.
        got: f64,
    },
    /// The step of a structure of one's own failed; the program that makes it says why.
    #[error("the structure's own program could not make the step")]
    Own,
    /// The library of somebody else that makes the steps failed.
    #[error("the FMU fails: {call} at {t_s} s: {fault}", t_s = short(.t_s))]
    Foreign {
        /// The function of the library that failed.
        call: &'static str,
        /// The time from which it was called, s.
        t_s: f64,
        /// What the library did in place of the step.
        fault: ForeignFault,
    },
    /// A saved state of an FMU, which an importer can't set.
    #[error("the state of an FMU can't be set: it runs from its start alone")]
    ForeignState,
    /// Saved numbers that are not of this structure.
    #[error("a saved state of {got} finite numbers: the structure has {states}, or {all} with its converters")]
    Saved {
        /// Numbers given, up to the first that is not finite.
        got: usize,
        /// The number of states.
        states: usize,
        /// The states and what the converters have gathered: [`Structure::saved_len`].
        all: usize,
    },
}
