//! Whether a node keeps the protocol: cases that play its partner on a bus.
//!
//! A case is a script of what is sent and what must come, or must not, within which time. It is written against a
//! [`Wire`], a bus with a clock: on a real bus it tests firmware, in tests a node in virtual time. [`REQUIREMENTS`] are
//! the demands of `SPEC.md`, and say which no case can see. A node in real time and one in lockstep have lists of their
//! own.
//!
//! What is judged on the clock has a margin of [`MARGIN_NS`], for the machine may hold any process up. What a plant
//! does is judged by the indices of its own samples, which stand still when it does. If the tester was held up itself
//! for longer than its partner puts up with, a failure is inconclusive, and the case is tried again. So is what the
//! node under test should have done by the clock, if it was silent meanwhile and then went on: it was stopped itself.
//! Many short stops add up without such a silence: a node that faults later than it must fails at the third time.

extern crate alloc;

mod bus_off_cases;
mod cases;
mod common_cases;
mod counters;
mod damage;
mod evidence;
mod exciter_cases;
mod exciter_role;
mod inject;
mod load;
mod lockstep_cases;
mod pair_cases;
mod plant_cases;
mod plant_role;
mod refusal_cases;
mod requirements;
mod saturation_cases;
mod settings;
mod sine_cases;
mod soak_cases;
mod source;
mod tester;
mod traffic;
mod wire;

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

pub use cases::{Case, cases};
pub use evidence::Evidence;
pub use requirements::{Check, REQUIREMENTS, Requirement};
pub use settings::{ExpectedSine, Settings, SineAmplitude};
pub use tester::MARGIN_NS;
pub use traffic::{Commands, Range, Refused, Traffic};
pub use wire::{BusOff, BusWire, Stopped, Wire};

use resonarm_bus::BusError;
use resonarm_protocol::timing::{COMMAND_TIMEOUT_NS, HEARTBEAT_PERIOD_NS};
use resonarm_protocol::{EmergencyCode, Network, Node, OperatorRequest};
use resonarm_session::run::Mode;
use tester::{Answers, Stop, Tester, ms};

/// How often a case is tried until it says something.
const TRIES: u32 = 5;

/// In how many tries a node must have been slow to be failed for it. Fewer may be the machine's doing: a node that is
/// held up for many short times is slow without a silence that would tell.
const SLOW_TRIES: u32 = 3;

/// What a case says of a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It does what it must.
    Passed,
    /// It does not, and what it does.
    Failed(String),
    /// It can't be said, and why.
    Inconclusive(String),
    /// It was not tried, and why.
    Skipped(String),
}

/// What a case found.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The verdict.
    pub verdict: Verdict,
    /// What was measured, in words.
    pub measured: Vec<String>,
    /// How long it took, ns on the wire's clock, with all tries.
    pub took_ns: u64,
    /// The longest time for which the tester was held up in the last try, ns.
    pub held_up_ns: u64,
    /// The longest time in which the node under test said nothing in the last try, between two frames of it, ns.
    pub silent_ns: u64,
    /// What came from the bus in the last try.
    pub traffic: Traffic,
}

impl Finding {
    /// Of a case in which the bus was lost.
    pub fn lost(error: &BusError) -> Finding {
        let verdict = Verdict::Inconclusive(error.to_string());
        let traffic = Traffic::default();
        Finding { verdict, measured: Vec::new(), took_ns: 0, held_up_ns: 0, silent_ns: 0, traffic }
    }
}

/// What a try came to.
enum Outcome {
    /// The node was slow, and nothing says that a process was held up.
    Slow(String),
    Judged(Verdict),
}

/// Runs a case, again if a hold-up keeps it from saying anything or the node was slow, up to five times.
///
/// # Errors
/// [`BusError`] if the bus is gone.
pub fn run(case: &Case, wire: &mut dyn Wire, network: Network, settings: Settings) -> Result<Finding, BusError> {
    let start_ns = wire.now_ns();
    let (mut tries, mut slow) = (0, 0);
    let mut slow_text = String::new();
    loop {
        tries += 1;
        let mut tester = Tester::new(wire, network, case.tested, settings);
        let outcome = once(case, &mut tester)?;
        let (held_up_ns, silent_ns, measured) = (tester.held_up_ns, tester.silent_ns, tester.notes);
        let traffic = tester.traffic;
        let is_held_up = held_up_ns > held_up_limit_ns(case.mode, case.tested) || silent_ns > silent_limit_ns(case);
        let says_nothing = match &outcome {
            Outcome::Slow(text) => {
                (slow, slow_text) = (slow + 1, text.clone());
                slow < SLOW_TRIES
            }
            Outcome::Judged(verdict) => matches!(verdict, Verdict::Inconclusive(_)) && is_held_up,
        };
        if says_nothing && tries < TRIES {
            continue;
        }
        let verdict = match outcome {
            Outcome::Slow(text) if slow == SLOW_TRIES => Verdict::Failed(text),
            Outcome::Judged(verdict) if slow == 0 || matches!(verdict, Verdict::Failed(_)) => verdict,
            _ => Verdict::Inconclusive(format!("{slow_text}, in {slow} of {tries} tries")),
        };
        let took_ns = wire.now_ns().saturating_sub(start_ns);
        return Ok(Finding { verdict, measured, took_ns, held_up_ns, silent_ns, traffic });
    }
}

/// How long the tester may be held up before a failure says nothing: a plant faults without commands for 20 ms.
/// In lockstep it waits.
const fn held_up_limit_ns(mode: Mode, tested: Node) -> u64 {
    match (mode, tested) {
        (Mode::RealTime | Mode::Free, Node::Plant) => COMMAND_TIMEOUT_NS / 4,
        (Mode::Lockstep, _) | (_, Node::Exciter) => MARGIN_NS,
    }
}

/// How long the node under test may be silent before it is taken to have been stopped. A plant sends samples every 10
/// ms at least; an exciter that has none to answer, and a plant that waits in lockstep, sends heartbeats. What is
/// shorter the margin of the clock covers.
const fn silent_limit_ns(case: &Case) -> u64 {
    match (case.mode, case.tested) {
        (Mode::RealTime | Mode::Free, Node::Plant) => MARGIN_NS / 3,
        (Mode::Lockstep, _) | (_, Node::Exciter) => HEARTBEAT_PERIOD_NS + MARGIN_NS / 6,
    }
}

/// One try, after which the node under test is left in peace.
fn once(case: &Case, tester: &mut Tester) -> Result<Outcome, BusError> {
    let outcome = match case.script.run(tester) {
        Ok(()) => Outcome::Judged(Verdict::Passed),
        Err(stop) => judge(case, tester, stop)?,
    };
    unless_gone(part(tester))?;
    Ok(outcome)
}

/// What a script that came to a stop says.
fn judge(case: &Case, tester: &mut Tester, stop: Stop) -> Result<Outcome, BusError> {
    let held_up_ns = tester.held_up_ns;
    Ok(match stop {
        Stop::Bus(error) => return Err(error),
        Stop::Skipped(text) => Outcome::Judged(Verdict::Skipped(text)),
        Stop::Inconclusive(text) => Outcome::Judged(Verdict::Inconclusive(text)),
        Stop::Wrong(text) => Outcome::Judged(Verdict::Failed(text)),
        Stop::Failed(text) | Stop::Late(text) | Stop::Slow(text)
            if held_up_ns > held_up_limit_ns(case.mode, case.tested) =>
        {
            let text = format!("{text}; but the tester was held up for {}", ms(held_up_ns));
            Outcome::Judged(Verdict::Inconclusive(text))
        }
        Stop::Failed(text) => Outcome::Judged(Verdict::Failed(text)),
        Stop::Slow(text) if tester.silent_ns > silent_limit_ns(case) => {
            Outcome::Judged(Verdict::Inconclusive(as_if_stopped(&text, tester.silent_ns)))
        }
        Stop::Slow(text) => Outcome::Slow(text),
        Stop::Late(text) => {
            let goes_on = unless_gone(tester.goes_on())?.unwrap_or(false);
            let silent_ns = tester.silent_ns;
            Outcome::Judged(match goes_on && silent_ns > silent_limit_ns(case) {
                true => Verdict::Inconclusive(as_if_stopped(&text, silent_ns)),
                false => Verdict::Failed(text),
            })
        }
    })
}

fn as_if_stopped(text: &str, silent_ns: u64) -> String {
    format!("{text}; but it was silent for {}, as if stopped", ms(silent_ns))
}

/// Only a bus that is gone ends the verdicts.
fn unless_gone<T>(result: Result<T, Stop>) -> Result<Option<T>, BusError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(Stop::Bus(error)) => Err(error),
        Err(_) => Ok(None),
    }
}

/// Leaves the node under test in peace.
fn part(tester: &mut Tester) -> Result<(), Stop> {
    tester.answers = Answers::None;
    if tester.tested == Node::Plant {
        tester.request(OperatorRequest::Disarm)?;
    }
    tester.is_alive = false;
    tester.send_emergency(EmergencyCode::Leaving, 0)
}

#[cfg(test)]
mod tests;
