//! Frames that the tester sends by itself: samples as a plant, answers as an exciter.

use std::collections::BTreeSet;

use super::damage::Damage;

/// The ends of the ranges of the classic profile.
pub(super) const FORCE_END_N: f64 = 32_767.0 / 50.0;
pub(super) const ACCELERATION_END_M_S2: f64 = 32_767.0 / 20.0;
/// The most frames of a sample.
pub(super) const FRAMES: usize = 3;

/// Way in which samples are sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Samples {
    /// No sample is sent.
    #[default]
    Off,
    /// Every sample is sent, undamaged.
    Steady,
    /// The frame with this number, from 0, is omitted from each; in the FD profile a sample is one frame.
    Without(usize),
    /// The frame that completes each is damaged.
    Damaged(Damage),
    /// The index does not advance.
    Standing,
    /// Two per frame while the tester is operational.
    Pairs,
    /// Good and bad ones, as the soak chooses.
    Soak,
    /// All readings are clipped.
    Clipped,
    /// Each is sent when the one before is answered and a sample period has passed, the first when the plant is armed,
    /// as in lockstep at the speed of the clock.
    Awaited,
}

/// The samples of the tester.
#[derive(Clone, Debug, Default)]
pub(super) struct Source {
    pub samples: Samples,
    /// The index of the next sample.
    pub index: u16,
    /// Time at which the next sample is due, ns.
    pub due_ns: u64,
    /// Time at which the last sample was sent, ns.
    pub sent_ns: u64,
    /// The number of damaged ones so far.
    pub damaged: u64,
    /// Whether the tester follows a request to arm.
    pub arms: bool,
    /// A sample that was answered before it was sent.
    pub unsent: Option<u16>,
    /// Whether the first sample of a pair waits for the second.
    pub is_half: bool,
    /// Samples not to be answered: bad when sent last, or already answered.
    pub closed: BTreeSet<u16>,
    /// A sample that was answered although it was closed.
    pub wrong: Option<u16>,
}

impl Source {
    /// Returns the time at which the next sample is due.
    pub fn next_ns(&self) -> u64 {
        if self.samples == Samples::Off { u64::MAX } else { self.due_ns }
    }

    /// Sends samples of this kind from now on.
    pub fn begin(&mut self, samples: Samples) {
        self.samples = samples;
        self.due_ns = 0;
    }

    /// Sends samples of this kind, and follows a request to arm; awaited samples wait for that.
    pub fn arm_with(&mut self, samples: Samples) {
        self.arms = true;
        self.samples = samples;
        if samples == Samples::Awaited {
            self.due_ns = u64::MAX;
        }
    }
}

/// Answers of the tester, as the exciter, to the samples of a plant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Answers {
    None,
    /// A command of this force along x, N.
    Force(f64),
    /// A command of this force in a damaged frame.
    Damaged(f64, Damage),
    /// A command of this force, for the sample so many samples later; negative means earlier.
    Shifted(f64, i16),
    /// A command of this force, for this sample.
    Always(f64, u16),
    /// A command of this force, after the soak's choices; samples this much older are too old.
    Soak(f64, i16),
}
