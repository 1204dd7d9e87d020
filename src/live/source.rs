//! Where what is shown comes from: a run that goes on, or a recording.

use std::sync::mpsc;

use super::foxglove::Stream;
use super::message::{Order, PlayerStatus};
use super::model::Model;
use crate::control::ResponsePoint;
use crate::recording::Record;
use crate::run::Watcher;

/// What is taken from a loop's ring at once: more than a loop tells from one update to the next.
const MOST: usize = 1 << 13;

/// Where what is shown comes from.
pub enum Source {
    /// A run of this program.
    Run(Watcher),
    /// The player of a recording.
    Recording(Player),
}

/// The end of a player that is looked at.
pub struct Player {
    pub played: mpsc::Receiver<Played>,
    pub orders: mpsc::Sender<super::message::PlayerOrder>,
}

/// What a player tells.
pub enum Played {
    /// What was told is of the past: the recording goes on elsewhere.
    Restarted,
    /// Records, in order.
    Records(Vec<Record<String>>),
    /// A response that its controller has read.
    Response(Box<ResponsePoint>),
    /// Whether it plays, and how fast.
    Status(PlayerStatus),
}

impl Source {
    /// Hands what came since the last call to the model and, if it is wanted, to the stream.
    pub fn drain(&mut self, model: &mut Model, mut stream: Option<&mut Stream>) {
        match self {
            Source::Run(watcher) => {
                // Only the stream has frames.
                watcher.want_frames(stream.is_some());
                watcher.take(MOST, |_, told| {
                    model.told(told);
                    stream.iter_mut().for_each(|stream| stream.told(told));
                });
            }
            Source::Recording(player) => player.played.try_iter().for_each(|played| match played {
                Played::Records(records) => records.iter().for_each(|record| {
                    model.record(record);
                    stream.iter_mut().for_each(|stream| stream.record(record));
                }),
                Played::Restarted => model.restart(),
                Played::Response(point) => model.response(&point),
                Played::Status(status) => model.player(status),
            }),
        }
    }

    /// What the loop told and nobody was there in time to take.
    pub fn lost(&self) -> u64 {
        match self {
            Source::Run(watcher) => watcher.lost(),
            Source::Recording(_) => 0,
        }
    }

    /// Hands an order on; why it can't be.
    pub fn order(&mut self, order: Order) -> Result<(), String> {
        match (self, order) {
            (Source::Run(watcher), Order::Run(request)) => watcher.ask(request).map_err(|error| error.to_string()),
            (Source::Recording(player), Order::Player(order)) => {
                player.orders.send(order).map_err(|_ended| String::from("the player has ended"))
            }
            (Source::Run(_), Order::Player(_)) => Err(String::from("this is a run, and no recording")),
            (Source::Recording(_), Order::Run(_)) => Err(String::from("this is a recording, and no run")),
        }
    }
}
