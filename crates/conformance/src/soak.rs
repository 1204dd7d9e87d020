//! The random choices of a soak: good and bad frames.

use super::damage::{Damage, needs_fd};
use super::source::{Answers, FRAMES, Samples};
use resonarm_numeric::noise::Noise;
use resonarm_protocol::Profile;

/// The number of the soak's stream of random numbers.
const STREAM: u64 = 2;

/// Most bad frames in a row: a receiver accepts a frame after three losses.
const MOST_BAD: u32 = 2;

/// Random choices of a soak, with the numbers of frames sent.
#[derive(Debug)]
pub(super) struct Soak {
    noise: Noise,
    bad_in_row: u32,
    /// Number of good frames sent.
    pub good: u64,
    pub bad: u64,
}

impl Soak {
    pub fn new(seed: u64) -> Soak {
        Soak { noise: Noise::new(seed, STREAM), bad_in_row: 0, good: 0, bad: 0 }
    }

    /// The next frame's damage; `None` for a good one: every other one is bad, at most two in a row.
    fn damage(&mut self, profile: Profile) -> Option<Damage> {
        let drawn = Damage::ALL[self.below(Damage::ALL.len())];
        // After a jump an old counter would make the next good one a jump, too.
        let damage = if drawn == Damage::Repeated && self.bad_in_row > 0 { Damage::Bit } else { drawn };
        let is_bad = self.noise.uniform() < 0.5 && self.bad_in_row < MOST_BAD && !needs_fd(damage, profile);
        (self.bad_in_row, self.good, self.bad) = match is_bad {
            true => (self.bad_in_row + 1, self.good, self.bad + 1),
            false => (0, self.good + 1, self.bad),
        };
        is_bad.then_some(damage)
    }

    fn below(&mut self, n: usize) -> usize {
        // The remainder favours low numbers by a share of n/2⁶⁴ at most, which no soak could notice.
        (self.noise.bits() % n as u64) as usize
    }

    /// Answers to the plant's next sample: up to two bad commands, and a good one.
    pub fn answers(&mut self, force_n: f64, limit: i16, profile: Profile) -> Vec<Answers> {
        let mut answers = Vec::new();
        while let Some(damage) = self.damage(profile) {
            // Bad commands pull where good ones push, so that one that acts shows in the readings of the head.
            answers.push(match self.below(4) {
                0 => Answers::Shifted(-force_n, 1000),
                1 => Answers::Shifted(-force_n, -limit),
                _ => Answers::Damaged(-force_n, damage),
            });
        }
        answers.push(Answers::Force(force_n));
        answers
    }

    /// Chooses how the tester, as a plant, sends the next sample.
    pub fn samples(&mut self, profile: Profile) -> Samples {
        match self.damage(profile) {
            None => Samples::Steady,
            Some(_) if self.below(4) == 0 => Samples::Without(self.below(FRAMES)),
            Some(damage) => Samples::Damaged(damage),
        }
    }
}
