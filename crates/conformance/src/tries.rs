//! A case is tried until it has a result: hold-ups of the tester and of the node under test decide nothing.

use super::finding::{Finding, Verdict};
use super::stop::Stop;
use super::times::{MARGIN_NS, MS, ms};
use super::traffic::Traffic;
use super::wire::Wire;
use resonarm_bus::BusError;
use resonarm_protocol::Node;
use resonarm_protocol::timing::{COMMAND_TIMEOUT_NS, HEARTBEAT_PERIOD_NS};
use resonarm_session::run::Mode;

/// Number of times that a case is tried until it has a result.
const TRIES: u32 = 5;

/// Number of tries in which a node must be slow to fail. Fewer may be due to the machine: a node that is held up many
/// times briefly is slow without a noticeable silence. What may be chance is judged by as many tries.
const SLOW_TRIES: u32 = 3;

/// Time for which tester and node may be held up before a failure is inconclusive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// The tester between two looks at the bus, ns.
    pub held_up_ns: u64,
    /// The node between two of its frames, before it is taken to have been stopped, ns.
    pub silent_ns: u64,
}

impl Limits {
    /// The limits of cases about a node in a mode, on Resonarm's protocol.
    pub const fn of_node(mode: Mode, tested: Node) -> Limits {
        Limits { held_up_ns: held_up_limit_ns(mode, tested), silent_ns: silent_limit_ns(mode, tested) }
    }
}

/// Returns how long the tester may be held up before a failure is inconclusive: a plant faults without commands for 20
/// ms. In lockstep it waits.
pub(super) const fn held_up_limit_ns(mode: Mode, tested: Node) -> u64 {
    match (mode, tested) {
        (Mode::RealTime | Mode::Free, Node::Plant) => COMMAND_TIMEOUT_NS / 4,
        (Mode::Lockstep, _) | (_, Node::Exciter) => MARGIN_NS,
    }
}

/// Returns how long the node under test may be silent before it is taken to have been stopped. A plant sends samples at
/// least every 10 ms; an exciter without samples to answer, and a plant that waits in lockstep, send heartbeats. The
/// margin of the clock covers shorter silences.
const fn silent_limit_ns(mode: Mode, tested: Node) -> u64 {
    match (mode, tested) {
        (Mode::RealTime | Mode::Free, Node::Plant) => MARGIN_NS / 3,
        (Mode::Lockstep, _) | (_, Node::Exciter) => HEARTBEAT_PERIOD_NS + MARGIN_NS / 6,
    }
}

/// A tester looks at the bus at least this often, ns.
pub(super) const LOOK_NS: u64 = 5 * MS;

/// Hold-ups of a tester, and silences of the node under test.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watch {
    looked_at_ns: u64,
    heard_at_ns: Option<u64>,
    /// The longest time between two looks at the bus beyond the planned one, ns.
    pub held_up_ns: u64,
    /// The longest time between two frames of the node under test, ns.
    pub silent_ns: u64,
}

impl Watch {
    pub fn new(now_ns: u64) -> Watch {
        Watch { looked_at_ns: now_ns, heard_at_ns: None, held_up_ns: 0, silent_ns: 0 }
    }

    /// The tester has looked at the bus.
    pub fn look(&mut self, now_ns: u64) {
        // What the planned wait does not explain is a hold-up of this process, and no fault of the node.
        self.held_up_ns = self.held_up_ns.max(now_ns.saturating_sub(self.looked_at_ns.saturating_add(LOOK_NS)));
        self.looked_at_ns = now_ns;
    }

    /// A frame of the node under test has come.
    pub fn hear(&mut self, at_ns: u64) {
        self.silent_ns = self.silent_ns.max(at_ns - self.heard_at_ns.unwrap_or(at_ns));
        self.heard_at_ns = Some(at_ns);
    }
}

/// A tester in the middle of a case.
pub(super) trait Subject {
    /// Hold-ups and silences so far.
    fn watch(&self) -> Watch;
    /// Whether the node under test sends again without having booted: it was stopped.
    fn resumes(&mut self) -> Result<bool, Stop>;
    /// Ends the case: the node under test is released.
    fn release(&mut self) -> Result<(), Stop>;
    /// The frames of the node under test that the tester rejected so far, if there are any.
    fn rejected(&self) -> Option<Rejected>;
}

/// Frames of the node under test that the tester rejected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Rejected {
    /// The first of them and why, in words.
    pub text: String,
    /// Whether lost frames explain all of them: a tester that is held up for long loses frames.
    pub may_be_lost: bool,
}

/// The result of one try.
pub(super) enum TryResult {
    /// The node was slow, and nothing indicates that a process was held up.
    Slow(String),
    /// The node does what is a fault unless it is chance.
    Chance(String),
    Judged(Verdict),
}

/// One try, with what was measured.
pub(super) struct Try {
    pub result: TryResult,
    pub watch: Watch,
    pub measured: Vec<String>,
    pub traffic: Traffic,
}

/// Tries a case up to five times, if a hold-up keeps it from a result or the node was slow.
///
/// # Errors
/// [`BusError`] if the bus is gone.
pub(super) fn tries(
    limits: Limits,
    wire: &mut dyn Wire,
    mut attempt: impl FnMut(&mut dyn Wire) -> Result<Try, BusError>,
) -> Result<Finding, BusError> {
    let start_ns = wire.now_ns();
    let mut tries = 0;
    let mut slow = 0;
    let mut chance = 0;
    let mut slow_text = String::new();
    loop {
        tries += 1;
        let Try { result, watch: Watch { held_up_ns, silent_ns, .. }, measured, traffic } = attempt(wire)?;
        let is_held_up = held_up_ns > limits.held_up_ns || silent_ns > limits.silent_ns;
        // The node must be slow in several tries to fail; and an undecided try counts for nothing if a hold-up
        // explains it.
        let says_nothing = match &result {
            TryResult::Slow(text) => {
                slow += 1;
                slow_text = text.clone();
                slow < SLOW_TRIES
            }
            TryResult::Chance(_) => {
                chance += 1;
                chance < SLOW_TRIES
            }
            TryResult::Judged(verdict) => matches!(verdict, Verdict::Inconclusive(_)) && is_held_up,
        };
        // Slow and chance results count over all tries, also when an undecided one lies between them.
        if says_nothing && tries < TRIES {
            continue;
        }
        let verdict = match result {
            TryResult::Slow(text) if slow == SLOW_TRIES => Verdict::Failed(text),
            TryResult::Chance(text) if chance == SLOW_TRIES => Verdict::Failed(text),
            TryResult::Chance(text) if slow == 0 => {
                Verdict::Inconclusive(format!("{text}, in {chance} of {tries} tries"))
            }
            TryResult::Judged(verdict) if slow == 0 || matches!(verdict, Verdict::Failed(_)) => verdict,
            _ => Verdict::Inconclusive(format!("{slow_text}, in {slow} of {tries} tries")),
        };
        let took_ns = wire.now_ns().saturating_sub(start_ns);
        return Ok(Finding { verdict, measured, took_ns, held_up_ns, silent_ns, traffic });
    }
}

/// The result of a script, after which the node under test is released.
///
/// # Errors
/// [`BusError`] if the bus is gone.
pub(super) fn conclude(
    outcome: Result<(), Stop>,
    subject: &mut impl Subject,
    limits: Limits,
) -> Result<TryResult, BusError> {
    let result = judge(outcome, subject, limits)?;
    // After a failure, too, so that the next case meets a node at rest.
    unless_gone(subject.release())?;
    Ok(match result {
        TryResult::Judged(Verdict::Passed) => TryResult::Judged(beside_rejected(subject, limits)),
        other => other,
    })
}

/// The verdict on a script that found nothing wrong. A case never passes beside a frame that the tester itself
/// rejected: such a frame is lost to any partner of the node.
fn beside_rejected(subject: &impl Subject, limits: Limits) -> Verdict {
    let held_up_ns = subject.watch().held_up_ns;
    match subject.rejected() {
        None => Verdict::Passed,
        Some(Rejected { text, may_be_lost: true }) if held_up_ns > limits.held_up_ns => {
            Verdict::Inconclusive(format!("{text}; but the tester was held up for {}", ms(held_up_ns)))
        }
        Some(Rejected { text, .. }) => Verdict::Failed(text),
    }
}

/// The result of a script.
///
/// # Errors
/// [`BusError`] if the bus is gone.
fn judge(outcome: Result<(), Stop>, subject: &mut impl Subject, limits: Limits) -> Result<TryResult, BusError> {
    let Err(stop) = outcome else { return Ok(TryResult::Judged(Verdict::Passed)) };
    let Watch { held_up_ns, silent_ns, .. } = subject.watch();
    Ok(match stop {
        Stop::Bus(error) => return Err(error),
        Stop::Skipped(text) => TryResult::Judged(Verdict::Skipped(text)),
        Stop::Inconclusive(text) => TryResult::Judged(Verdict::Inconclusive(text)),
        // A wrong frame is wrong whatever held the tester up. What a node does, or does too late, may be due to that.
        Stop::Wrong(text) => TryResult::Judged(Verdict::Failed(text)),
        Stop::Failed(text) | Stop::Late(text) | Stop::Slow(text) if held_up_ns > limits.held_up_ns => {
            let text = format!("{text}; but the tester was held up for {}", ms(held_up_ns));
            TryResult::Judged(Verdict::Inconclusive(text))
        }
        Stop::Failed(text) => TryResult::Judged(Verdict::Failed(text)),
        Stop::Slow(text) if silent_ns > limits.silent_ns => {
            TryResult::Judged(Verdict::Inconclusive(as_if_stopped(&text, silent_ns)))
        }
        Stop::Slow(text) => TryResult::Slow(text),
        Stop::Chance(text) => TryResult::Chance(text),
        Stop::Late(text) => {
            // The tester waits on here, to see whether the node sends again without having booted: then it was
            // stopped, and not late by itself.
            let has_resumed = unless_gone(subject.resumes())?.unwrap_or(false);
            let silent_ns = subject.watch().silent_ns;
            TryResult::Judged(match has_resumed && silent_ns > limits.silent_ns {
                true => Verdict::Inconclusive(as_if_stopped(&text, silent_ns)),
                false => Verdict::Failed(text),
            })
        }
    })
}

fn as_if_stopped(text: &str, silent_ns: u64) -> String {
    format!("{text}; but it was silent for {}, as if stopped", ms(silent_ns))
}

/// Passes on only a lost bus, which ends the verdicts.
///
/// # Errors
/// [`BusError`] if the bus is gone.
pub(super) fn unless_gone<T>(result: Result<T, Stop>) -> Result<Option<T>, BusError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(Stop::Bus(error)) => Err(error),
        Err(_) => Ok(None),
    }
}
