//! Compares a controller on a user protocol with the recorded one.
//!
//! Its commands name no sample, so they are compared by their order, message by message: the first command with a load
//! of one controller with the first of the other, the second with the second, and so on. Commands before that have no
//! load, and their number depends on when the controller was started. Requests to arm, disarm, reset or stop must come
//! in the same order; a repeated request counts once.

use core::ops::ControlFlow;

use alloc::collections::VecDeque;

use super::{Controller, DifferenceKind, REQUESTS, Test};
use crate::replay::error::ReplayError;
use resonarm_bench::node::mapped::mapping::{Action, Counts, Incoming, Mapping};
use resonarm_bench::rig::Load;
use resonarm_files::decoder::action_name;
use resonarm_files::recording::{Direction, FrameRecord};
use resonarm_protocol::Frame;

/// Commands that may wait to be compared: more than are under way at one moment.
const AHEAD: usize = 1024;

/// Statement in a controller's frame.
#[derive(Clone, Debug, PartialEq)]
enum Said {
    /// A request, by its name: `arm`.
    Request(&'static str),
    /// A load that is commanded by message `place`.
    Load { place: usize, load: Load },
}

/// A message that the plant accepts, and the last value of each event's signal.
#[derive(Clone, Debug)]
struct Message {
    incoming: Incoming,
    values: Vec<Option<f64>>,
}

/// Reads a controller's frames.
#[derive(Clone, Debug)]
struct Reader(Vec<Message>);

impl Reader {
    fn new(mapping: &Mapping) -> Reader {
        let message =
            |incoming: &Incoming| Message { incoming: incoming.clone(), values: vec![None; incoming.events.len()] };
        Reader(mapping.incoming.iter().map(message).collect())
    }

    /// Reads the statements of a controller's frame, requests first.
    fn hear(&mut self, frame: &Frame) -> Vec<Said> {
        let is_meant =
            |message: &Message| (message.incoming.id, message.incoming.format) == (frame.id(), frame.format());
        let place = self.0.iter().position(is_meant);
        place.map_or_else(Vec::new, |place| self.0[place].hear(place, frame.data()))
    }
}

impl Message {
    fn hear(&mut self, place: usize, payload: &[u8]) -> Vec<Said> {
        let mut said = Vec::new();
        for (event, before) in self.incoming.events.iter().zip(&mut self.values) {
            let action = match &event.signal {
                None => event.actions.first(),
                Some(signal) => {
                    let Ok(Some(value)) = signal.read(payload) else { continue };
                    let is_changed = before.replace(value) != Some(value);
                    let counts = event.counts == Counts::InEveryFrame || is_changed;
                    event.actions.iter().find(|(asking, _)| counts && *asking == value)
                }
            };
            said.extend(action.map(|(_, action)| Said::Request(action_name(*action))));
        }
        if let Ok(Some(load)) = self.incoming.load(payload) {
            said.push(Said::Load { place, load });
        }
        said
    }
}

/// State of the live controller, gathered from its frames so far.
pub(super) struct Live {
    reader: Reader,
    /// Whether any frame of it has been heard.
    is_there: bool,
    /// Whether it has commanded a load.
    has_begun: bool,
    /// Its requests since the last comparison, oldest first.
    requests: VecDeque<&'static str>,
    /// Its loads that are not yet compared, by the places of their messages.
    loads: Vec<VecDeque<Load>>,
}

impl Live {
    pub fn new(mapping: &Mapping) -> Live {
        let loads = vec![VecDeque::new(); mapping.incoming.len()];
        Live { reader: Reader::new(mapping), is_there: false, has_begun: false, requests: VecDeque::new(), loads }
    }

    fn has_ended(&self) -> bool {
        self.requests.back() == Some(&action_name(Action::Disarm))
    }
}

impl Controller for Live {
    fn hear(&mut self, frame: &Frame) {
        for said in self.reader.hear(frame) {
            self.is_there = true;
            match said {
                Said::Request(request) if self.requests.back() == Some(&request) => {}
                Said::Request(request) => {
                    self.requests.push_back(request);
                    if self.requests.len() > REQUESTS {
                        self.requests.pop_front();
                    }
                }
                Said::Load { place, load } => {
                    self.has_begun |= load != Load::default();
                    // One more load than the limit shows that it is ahead.
                    if self.has_begun && self.loads[place].len() <= AHEAD {
                        self.loads[place].push_back(load);
                    }
                }
            }
        }
    }
}

/// State of the recorded controller, gathered from its frames so far.
pub(super) struct Recorded {
    reader: Reader,
    has_begun: bool,
    asked: Option<&'static str>,
}

impl Recorded {
    pub fn new(mapping: &Mapping) -> Recorded {
        Recorded { reader: Reader::new(mapping), has_begun: false, asked: None }
    }
}

/// Waits until the live controller has caught up with this frame of the recorded one, and compares.
pub(super) fn expect(
    test: &mut Test<'_, Live>,
    recorded: &mut Recorded,
    record: &FrameRecord,
) -> Result<ControlFlow<()>, ReplayError> {
    if record.direction == Direction::Sent {
        return Ok(ControlFlow::Continue(()));
    }
    for said in recorded.reader.hear(&record.frame) {
        let missing = match said {
            Said::Request(request) if recorded.asked == Some(request) => None,
            Said::Request(expected) => {
                recorded.asked = Some(expected);
                test.wait_for(|live| live.requests.contains(&expected))?;
                let requests = &mut test.live.requests;
                match requests.iter().position(|asked| *asked == expected) {
                    // It stays, so that its repetitions are none.
                    Some(before) => {
                        requests.drain(..before);
                        None
                    }
                    None => Some(DifferenceKind::NoRequest { expected }),
                }
            }
            Said::Load { load, .. } if !recorded.has_begun && load == Load::default() => None,
            Said::Load { place, load: expected } => {
                recorded.has_begun = true;
                // A controller that has disarmed the plant sends no more loads: the difference is reported at once.
                test.wait_for(|live| !live.loads[place].is_empty() || live.has_ended())?;
                let ahead = test.live.loads[place].len();
                match test.live.loads[place].pop_front() {
                    Some(_) if ahead > AHEAD => Some(DifferenceKind::MoreCommands { ahead }),
                    Some(got) => {
                        test.compare(record.sample, expected, got);
                        None
                    }
                    None => Some(DifferenceKind::NoCommand { expected }),
                }
            }
        };
        if let Some(missing) = missing {
            if !test.live.is_there && !test.signals.is_stopped() {
                return Err(test.no_controller());
            }
            return Ok(test.differs(record.sample, missing));
        }
    }
    Ok(ControlFlow::Continue(()))
}
