//! Samples of a plant's readings as a mapped exciter assembles them from messages.

use super::listener::Listener;
use crate::rig::{MOST_CHANNELS, Measurement, Reading, Readings};

/// The sample that is being received.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    /// Number of the plant's samples from one assembled sample to the next.
    pub every: u64,
    /// Readings of the sample that is being received; NaN where the protocol has none.
    pub readings: [f64; MOST_CHANNELS],
    clipped: u32,
    /// Number of readings beyond those of head, B and C that the controller is given.
    more: usize,
    /// Index of the message that completes a sample; the next field is that of the message that counts them.
    pub closing: usize,
    pub counting: usize,
    /// Number of samples since the last answered one.
    pub ahead: u64,
    /// Whether a complete sample waits for its answer.
    pub is_whole: bool,
}

impl Samples {
    /// Returns an empty sample of the readings up to the last that the controller needs, `channels` of them, and of
    /// those of head, B and C.
    pub fn new(listeners: &[Listener], every: u64, channels: usize) -> Samples {
        let parts = || listeners.iter().enumerate().filter(|(_, listener)| listener.is_of_sample);
        // The plant sends its messages in the order of the mapping, so the last one completes the sample.
        let closing = parts().map(|(place, _)| place).next_back().unwrap_or(0);
        let counting = parts().max_by_key(|(_, listener)| listener.counts()).map_or(0, |(place, _)| place);
        Samples {
            every,
            readings: [f64::NAN; MOST_CHANNELS],
            clipped: 0,
            more: channels.clamp(Measurement::CHANNELS, MOST_CHANNELS) - Measurement::CHANNELS,
            closing,
            counting,
            ahead: 0,
            is_whole: false,
        }
    }

    /// Returns the complete sample that waits, with this index.
    pub fn measurement(&self, sample: u64) -> Measurement {
        let reading = |place: usize| Reading { value: self.readings[place], clipped: self.clipped >> place & 1 == 1 };
        let pair = |place: usize| [reading(place), reading(place + 1)];
        let values = &self.readings[Measurement::CHANNELS..][..self.more];
        // Messages may carry more than the controller needs; their marks are left out together with their values.
        let clipped = self.clipped >> Measurement::CHANNELS & ((1 << self.more) - 1);
        Measurement {
            sample,
            head_force_n: pair(0),
            acceleration_b_m_s2: pair(2),
            acceleration_c_m_s2: pair(4),
            more: Readings::new(values, clipped).unwrap_or_default(),
        }
    }

    /// Adds a part of a sample, `ahead` samples after the one before.
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
