//! Good and bad frames at random, for a time set: nothing bad acts, and nothing good is refused.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use super::damage::{Damage, needs_fd};
use super::exciter_role::{begin, commands};
use super::plant_role::{drive, forces, period_ns};
use super::source::{FRAMES, Samples};
use super::tester::{Answers, MARGIN_NS, MS, Stop, Tester, emergency, failed, is_state, late, ms, skipped};
use resonarm_numeric::noise::Noise;
use resonarm_protocol::timing::COMMAND_AGE_NS;
use resonarm_protocol::{EmergencyCode, NodeState, Profile};
use resonarm_session::run::Mode;

/// The number of the soak's stream of random numbers.
const STREAM: u64 = 2;

/// Most bad frames in a row: a receiver accepts a frame after three losses.
const MOST_BAD: u32 = 2;

/// Interval of judging the log, ns.
const LOOK_NS: u64 = 100 * MS;

/// The random choices.
#[derive(Debug)]
pub(super) struct Soak {
    noise: Noise,
    bad_in_row: u32,
    /// Good frames sent.
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
        (self.noise.bits() % n as u64) as usize
    }

    /// Answers to the plant's next sample: up to two bad commands, and a good one.
    pub fn answers(&mut self, force_n: f64, limit: i16, profile: Profile) -> Vec<Answers> {
        let mut answers = Vec::new();
        while let Some(damage) = self.damage(profile) {
            answers.push(match self.below(4) {
                0 => Answers::Shifted(-force_n, 1000),
                1 => Answers::Shifted(-force_n, -limit),
                _ => Answers::Damaged(-force_n, damage),
            });
        }
        answers.push(Answers::Force(force_n));
        answers
    }

    /// What happens to the next sample of the tester as a plant.
    pub fn samples(&mut self, profile: Profile) -> Samples {
        match self.damage(profile) {
            None => Samples::Steady,
            Some(_) if self.below(4) == 0 => Samples::Without(self.below(FRAMES)),
            Some(damage) => Samples::Damaged(damage),
        }
    }
}

fn is_asked(t: &Tester) -> Result<(), Stop> {
    match t.settings.soak_ns {
        0 => skipped("no time is given for it (--soak-s)"),
        _ => Ok(()),
    }
}

/// A plant accepts the good commands and no bad one. If a hold-up of the tester makes it fault, the soak starts over.
pub(super) fn plant(t: &mut Tester) -> Result<(), Stop> {
    is_asked(t)?;
    t.soak = Some(Soak::new(t.settings.seed));
    let mut left_ns = t.settings.soak_ns;
    while left_ns > 0 {
        drive(t)?;
        t.held_up_ns = 0;
        let limit = i16::try_from(COMMAND_AGE_NS.div_ceil(period_ns(t)) + 1).unwrap_or(i16::MAX);
        t.answers = Answers::Soak(t.settings.force_n, limit);
        left_ns = left_ns.saturating_sub(soaked(t, left_ns)?);
    }
    let sent = t.soak.take().map_or_else(String::new, |soak| format!("{} good commands, {} bad", soak.good, soak.bad));
    t.note(sent);
    t.check_frames()
}

/// Soaks until the time is over, or the plant faults for lack of commands while the tester was held up; returns the
/// duration, ns.
fn soaked(t: &mut Tester, most_ns: u64) -> Result<u64, Stop> {
    let start_ns = t.now_ns();
    loop {
        let ran_ns = t.now_ns() - start_ns;
        if ran_ns >= most_ns {
            return Ok(ran_ns);
        }
        // Judged messages are dropped: a soak may take hours.
        t.heard.clear();
        t.run_ns(LOOK_NS.min(most_ns - ran_ns))?;
        if let Some((sample, read_n)) = forces(t, 0).find(|(_, read_n)| *read_n < -0.5 * t.settings.force_n) {
            return failed(format!("a bad command acts: the head reads {read_n:.2} N at sample {sample}"));
        }
        match t.heard.iter().find_map(|heard| emergency(&heard.message)) {
            Some(e)
                if e.code == EmergencyCode::CommandTimeout
                    && t.held_up_ns > super::held_up_limit_ns(Mode::RealTime, t.tested) =>
            {
                return Ok(t.now_ns() - start_ns);
            }
            Some(e) => return failed(format!("it faults after {} of good commands: {e}", ms(t.now_ns() - start_ns))),
            None => {}
        }
    }
}

/// An exciter answers the good samples, each once, and no bad one.
pub(super) fn exciter(t: &mut Tester) -> Result<(), Stop> {
    is_asked(t)?;
    begin(t)?;
    t.heard.clear();
    t.soak = Some(Soak::new(t.settings.seed));
    t.source.samples = Samples::Soak;
    let end_ns = t.now_ns() + t.settings.soak_ns;
    while t.now_ns() < end_ns {
        t.run_ns(LOOK_NS)?;
        judge(t)?;
        t.heard.clear();
    }
    t.source.samples = Samples::Steady;
    t.run_ns(2 * MARGIN_NS)?;
    judge(t)?;
    let sent = t.soak.take().map_or_else(String::new, |soak| format!("{} good samples, {} bad", soak.good, soak.bad));
    t.note(sent);
    t.check_frames()?;
    if commands(t, 0).is_empty() { late("after the bad samples it answers no good one") } else { Ok(()) }
}

fn judge(t: &Tester) -> Result<(), Stop> {
    if let Some(e) = t.heard.iter().find_map(|heard| emergency(&heard.message)) {
        return failed(format!("it faults: {e}"));
    }
    if t.heard.iter().any(|heard| is_state(&heard.message, NodeState::PreOperational)) {
        return failed("it ends");
    }
    match (t.source.wrong, t.source.unsent) {
        (Some(sample), _) => failed(format!("it answers sample {sample}, which was bad or has been answered")),
        (None, Some(sample)) => failed(format!("it answers sample {sample} before that is sent")),
        (None, None) => Ok(()),
    }
}
