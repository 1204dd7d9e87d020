//! The source of the live view: a run, or a recording.

use std::sync::mpsc;

use super::foxglove::Stream;
use super::message::{Order, PlayerOrder, PlayerStatus};
use super::model::Model;
use resonarm_bench::control::ResponsePoint;
use resonarm_files::recording::Record;
use resonarm_session::run::Watcher;

/// Most records taken from a loop's ring at once: more than a loop sends between two updates.
const MOST: usize = 1 << 13;

/// The source of the live view.
pub enum Source {
    /// A run of this program.
    Run(Watcher),
    /// The player of a recording.
    Recording(Player),
}

/// The viewers' end of a player.
pub struct Player {
    pub played: mpsc::Receiver<Played>,
    pub orders: mpsc::Sender<PlayerOrder>,
    /// Whether it begins to play when the first viewer comes.
    pub waits: bool,
}

/// A message from a player.
pub enum Played {
    /// The recording continues at another sample, which is now shown; everything sent before is obsolete. Records of it
    /// and of the time before it, in order.
    Moved { sample: u64, records: Vec<Record<String>> },
    /// Records up to the sample that is shown, in order.
    Records { sample: u64, records: Vec<Record<String>> },
    /// A response that its controller has read.
    Response(Box<ResponsePoint>),
    /// Whether it plays, how fast, and where it is.
    Status(PlayerStatus),
}

impl Source {
    /// Passes the data since the last call to the model and, if it is wanted, to the stream.
    pub fn drain(&mut self, model: &mut Model, mut stream: Option<&mut Stream>) {
        match self {
            Source::Run(watcher) => {
                // Only the stream needs frames.
                watcher.want_frames(stream.is_some());
                watcher.take(MOST, |_, notice| {
                    model.notice(notice);
                    stream.iter_mut().for_each(|stream| stream.notice(notice));
                });
            }
            Source::Recording(player) => player.played.try_iter().for_each(|played| {
                if matches!(played, Played::Moved { .. }) {
                    model.restart();
                }
                match played {
                    Played::Moved { sample, records } | Played::Records { sample, records } => {
                        records.iter().for_each(|record| {
                            model.record(record);
                            stream.iter_mut().for_each(|stream| stream.record(record));
                        });
                        model.shown(sample);
                    }
                    Played::Response(point) => model.response(&point),
                    Played::Status(status) => model.player(status),
                }
            }),
        }
    }

    /// Records of the loop that were not taken in time.
    pub fn lost(&self) -> u64 {
        match self {
            Source::Run(watcher) => watcher.lost(),
            Source::Recording(_) => 0,
        }
    }

    /// Starts a player that waits for its first viewer, once there are viewers.
    pub fn viewed(&mut self, viewers: usize) {
        if let Source::Recording(player) = self
            && viewers > 0
            && core::mem::take(&mut player.waits)
        {
            // A player that has ended plays no more.
            let _ended = player.orders.send(PlayerOrder::Play);
        }
    }

    /// Passes an order on, or returns why this is impossible.
    pub fn order(&mut self, order: Order) -> Result<(), String> {
        match (self, order) {
            (Source::Run(watcher), Order::Run(request)) => watcher.ask(request).map_err(|error| error.to_string()),
            (Source::Recording(player), Order::Player(order)) => {
                player.orders.send(order).map_err(|_ended| String::from("the player has ended"))
            }
            (Source::Run(_), Order::Player(_)) => {
                Err(String::from("this is a run, not a recording: requests of the player do not apply"))
            }
            (Source::Recording(_), Order::Run(_)) => {
                Err(String::from("this is a recording, not a run: requests to the run do not apply"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_viewer_starts_a_recording_that_waits() {
        let (_played, receiver) = mpsc::channel();
        let (orders, ordered) = mpsc::channel();
        let mut source = Source::Recording(Player { played: receiver, orders, waits: true });
        for viewers in [0, 0, 2, 1, 0, 1] {
            source.viewed(viewers);
        }
        assert_eq!(ordered.try_iter().collect::<Vec<_>>(), [PlayerOrder::Play]);
    }
}
