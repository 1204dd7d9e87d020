//! `resonarm replay`: recorded frames back on a bus.

use std::path::PathBuf;
use std::sync::Arc;

use clap::{Args, ValueEnum};

use super::failure::{Failure, Verdict};
use super::supervise::supervise;
use super::{inspect, output};
use crate::bus::{self, BusAddress};
use crate::control::Length;
use crate::realtime::SystemClock;
use crate::recording::{Direction, Recording};
use crate::replay::{Playback, play};
use crate::run::Signals;

/// Sends the frames of a recording to a bus, with their recorded timing.
#[derive(Debug, Args)]
pub(super) struct Replay {
    /// The recording, an MCAP file.
    file: PathBuf,
    /// The bus: vcan0, can0, python-can:interface=I,channel=C.
    #[arg(long, value_name = "BUS")]
    bus: String,
    /// Times the recorded speed, from 0.001 to 1000000; 0 is as fast as it goes.
    #[arg(long, value_name = "X", default_value_t = 1.0, allow_hyphen_values = true)]
    speed: f64,
    /// Which frames, as the plant saw them.
    #[arg(long, value_enum, default_value_t = Which::Both)]
    frames: Which,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Which {
    /// Those the plant received and those it sent.
    Both,
    /// Those the plant received: the exciter's commands.
    Received,
    /// Those the plant sent: the sensors.
    Sent,
}

impl Replay {
    pub fn execute(&self) -> Result<Verdict, Failure> {
        let address: BusAddress = self.bus.parse()?;
        let recording = Recording::open(&self.file)?;
        if let Some(note) = inspect::integrity_note(recording.integrity()) {
            tracing::warn!("{note}");
        }
        let direction = match self.frames {
            Which::Both => None,
            Which::Received => Some(Direction::Received),
            Which::Sent => Some(Direction::Sent),
        };
        let playback = Playback { speed: self.speed, direction };
        let mut bus = bus::open(&address)?;
        let signals = Arc::new(Signals::default());
        let watched = Arc::clone(&signals);
        let played = supervise(
            "replay",
            &signals,
            Length::Unknown,
            || {},
            move || {
                let result = play(&recording, bus.as_mut(), &SystemClock, playback, &watched);
                let closed = bus.close();
                result.and_then(|played| closed.map(|()| played).map_err(Into::into))
            },
        )??;
        if self.json {
            output::print_json(&played)?;
        } else {
            output::print(&format!(
                "{} frames of {:.3} recorded seconds sent to {address}, the latest {:.3} ms late\n",
                played.frames,
                played.recorded_s,
                played.latest_s * 1e3
            ))?;
        }
        Ok(Verdict::Positive)
    }
}
