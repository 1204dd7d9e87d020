//! The samples of a plant's readings as a mapped exciter gathers them.

use super::listener::Listener;
use crate::rig::{Measurement, Reading, Readings};

/// The samples as they come in.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    /// Every how many samples of the plant there is one.
    pub every: u64,
    /// The readings of the sample that comes in; NaN where the wire has none.
    pub readings: [f64; Measurement::CHANNELS],
    clipped: u8,
    /// The message that closes a sample, and that which counts them, by their places.
    closing: usize,
    pub counting: usize,
    /// Samples since the one that was answered last.
    pub ahead: u64,
    /// Whether a whole one waits for its answer.
    pub is_whole: bool,
}

impl Samples {
    pub fn new(listeners: &[Listener], every: u64) -> Samples {
        let parts = || listeners.iter().enumerate().filter(|(_, listener)| listener.is_of_sample);
        let closing = parts().map(|(place, _)| place).next_back().unwrap_or(0);
        let counting = parts().max_by_key(|(_, listener)| listener.counts()).map_or(0, |(place, _)| place);
        Samples {
            every,
            readings: [f64::NAN; Measurement::CHANNELS],
            clipped: 0,
            closing,
            counting,
            ahead: 0,
            is_whole: false,
        }
    }

    /// The whole sample that waits, with this index.
    pub fn measurement(&self, sample: u64) -> Measurement {
        let reading = |place: usize| Reading { value: self.readings[place], clipped: self.clipped >> place & 1 == 1 };
        let pair = |place: usize| [reading(place), reading(place + 1)];
        Measurement {
            sample,
            head_force_n: pair(0),
            acceleration_b_m_s2: pair(2),
            acceleration_c_m_s2: pair(4),
            more: Readings::NONE,
        }
    }

    /// Forgets all samples.
    pub fn restart(&mut self) {
        (self.ahead, self.is_whole) = (0, false);
    }

    /// Whether the message at this place is the last of a sample.
    pub fn closes(&self, place: usize) -> bool {
        place == self.closing
    }

    /// A part of a sample has come, so many samples after the one before.
    pub fn join(&mut self, listeners: &mut [Listener], place: usize, ahead: u64) {
        listeners[place].has_come = true;
        if place == self.counting {
            self.ahead = self.ahead.saturating_add(ahead);
        }
        if place != self.closing {
            return;
        }
        let mut parts = listeners.iter().filter(|listener| listener.is_of_sample);
        self.is_whole = parts.all(|listener| listener.has_come);
        self.clipped = listeners.iter().fold(0, |bits, listener| bits | listener.clipped);
        listeners.iter_mut().for_each(|listener| listener.has_come = false);
    }
}
