//! What keeps a recording from being replayed.

use thiserror::Error;

use crate::bus::BusError;
use crate::plant::{PlantError, PlantSpecError};
use crate::recording::RecordingError;
use crate::scenario::ScenarioError;

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
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// There is nothing to replay.
    #[error("the recording holds no {what}")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// The speed is impossible.
    #[error("the speed is {got}: it must be a positive number; 1 is the recorded speed")]
    Speed {
        /// What was given.
        got: f64,
    },
}
