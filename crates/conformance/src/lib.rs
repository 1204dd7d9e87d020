//! Conformance of a node to the protocol: cases that play its partner on a bus.
//!
//! A case is a script of what is sent and what must, or must not, be received within which time. It is written against
//! a [`Wire`], a bus with a clock: on a real bus it tests firmware, in tests a node in virtual time. [`REQUIREMENTS`]
//! are the demands of `SPEC.md`, and state which ones no case can check. Nodes in real time and in lockstep have
//! separate lists.
//!
//! Times by the clock have a margin of [`MARGIN_NS`], for the machine may hold any process up. A plant is judged by the
//! indices of its own samples, which stop when it is stopped. If the tester itself was held up for longer than its
//! partner tolerates, a failure is inconclusive, and the case is tried again. So is a delay of the node under test if
//! it was silent meanwhile and then resumed: it was stopped itself. Many short stops add up without such a silence: a
//! node that faults too late fails at the third time.

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

/// How often a case is tried until it has a result.
const TRIES: u32 = 5;

/// In how many tries a node must be slow to fail. Fewer may be due to the machine: a node that is held up many times
/// briefly is slow without a noticeable silence.
const SLOW_TRIES: u32 = 3;

/// The result of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The node does what it must.
    Passed,
    /// It does not, with what it does.
    Failed(String),
    /// Undecided, with the reason.
    Inconclusive(String),
    /// Not tried, with the reason.
    Skipped(String),
}

/// The findings of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The verdict.
    pub verdict: Verdict,
    /// Measurements, in words.
    pub measured: Vec<String>,
    /// Duration, ns on the wire's clock, of all tries.
    pub took_ns: u64,
    /// The longest hold-up of the tester in the last try, ns.
    pub held_up_ns: u64,
    /// The longest silence of the node under test in the last try, between two of its frames, ns.
    pub silent_ns: u64,
    /// The frames received in the last try.
    pub traffic: Traffic,
}

impl Finding {
    /// The finding of a case in which the bus was lost.
    pub fn lost(error: &BusError) -> Finding {
        let verdict = Verdict::Inconclusive(error.to_string());
        let traffic = Traffic::default();
        Finding { verdict, measured: Vec::new(), took_ns: 0, held_up_ns: 0, silent_ns: 0, traffic }
    }
}

/// The result of one try.
enum TryResult {
    /// The node was slow, and nothing indicates that a process was held up.
    Slow(String),
    Judged(Verdict),
}

/// Runs a case, up to five times if a hold-up keeps it from a result or the node was slow.
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
            TryResult::Slow(text) => {
                (slow, slow_text) = (slow + 1, text.clone());
                slow < SLOW_TRIES
            }
            TryResult::Judged(verdict) => matches!(verdict, Verdict::Inconclusive(_)) && is_held_up,
        };
        if says_nothing && tries < TRIES {
            continue;
        }
        let verdict = match outcome {
            TryResult::Slow(text) if slow == SLOW_TRIES => Verdict::Failed(text),
            TryResult::Judged(verdict) if slow == 0 || matches!(verdict, Verdict::Failed(_)) => verdict,
            _ => Verdict::Inconclusive(format!("{slow_text}, in {slow} of {tries} tries")),
        };
        let took_ns = wire.now_ns().saturating_sub(start_ns);
        return Ok(Finding { verdict, measured, took_ns, held_up_ns, silent_ns, traffic });
    }
}

/// How long the tester may be held up before a failure is inconclusive: a plant faults without commands for 20 ms.
/// In lockstep it waits.
const fn held_up_limit_ns(mode: Mode, tested: Node) -> u64 {
    match (mode, tested) {
        (Mode::RealTime | Mode::Free, Node::Plant) => COMMAND_TIMEOUT_NS / 4,
        (Mode::Lockstep, _) | (_, Node::Exciter) => MARGIN_NS,
    }
}

/// How long the node under test may be silent before it is taken to have been stopped. A plant sends samples at least
/// every 10 ms; an exciter without samples to answer, and a plant that waits in lockstep, send heartbeats. The margin
/// of the clock covers shorter silences.
const fn silent_limit_ns(case: &Case) -> u64 {
    match (case.mode, case.tested) {
        (Mode::RealTime | Mode::Free, Node::Plant) => MARGIN_NS / 3,
        (Mode::Lockstep, _) | (_, Node::Exciter) => HEARTBEAT_PERIOD_NS + MARGIN_NS / 6,
    }
}

/// One try, after which the node under test is released.
fn once(case: &Case, tester: &mut Tester) -> Result<TryResult, BusError> {
    let outcome = match case.script.run(tester) {
        Ok(()) => TryResult::Judged(Verdict::Passed),
        Err(stop) => judge(case, tester, stop)?,
    };
    unless_gone(release(tester))?;
    Ok(outcome)
}

/// The result of a script that stopped early.
fn judge(case: &Case, tester: &mut Tester, stop: Stop) -> Result<TryResult, BusError> {
    let held_up_ns = tester.held_up_ns;
    Ok(match stop {
        Stop::Bus(error) => return Err(error),
        Stop::Skipped(text) => TryResult::Judged(Verdict::Skipped(text)),
        Stop::Inconclusive(text) => TryResult::Judged(Verdict::Inconclusive(text)),
        Stop::Wrong(text) => TryResult::Judged(Verdict::Failed(text)),
        Stop::Failed(text) | Stop::Late(text) | Stop::Slow(text)
            if held_up_ns > held_up_limit_ns(case.mode, case.tested) =>
        {
            let text = format!("{text}; but the tester was held up for {}", ms(held_up_ns));
            TryResult::Judged(Verdict::Inconclusive(text))
        }
        Stop::Failed(text) => TryResult::Judged(Verdict::Failed(text)),
        Stop::Slow(text) if tester.silent_ns > silent_limit_ns(case) => {
            TryResult::Judged(Verdict::Inconclusive(as_if_stopped(&text, tester.silent_ns)))
        }
        Stop::Slow(text) => TryResult::Slow(text),
        Stop::Late(text) => {
            let has_resumed = unless_gone(tester.resumes())?.unwrap_or(false);
            let silent_ns = tester.silent_ns;
            TryResult::Judged(match has_resumed && silent_ns > silent_limit_ns(case) {
                true => Verdict::Inconclusive(as_if_stopped(&text, silent_ns)),
                false => Verdict::Failed(text),
            })
        }
    })
}

fn as_if_stopped(text: &str, silent_ns: u64) -> String {
    format!("{text}; but it was silent for {}, as if stopped", ms(silent_ns))
}

/// Only a lost bus ends the verdicts.
fn unless_gone<T>(result: Result<T, Stop>) -> Result<Option<T>, BusError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(Stop::Bus(error)) => Err(error),
        Err(_) => Ok(None),
    }
}

/// Releases the node under test.
fn release(tester: &mut Tester) -> Result<(), Stop> {
    tester.answers = Answers::None;
    if tester.tested == Node::Plant {
        tester.request(OperatorRequest::Disarm)?;
    }
    tester.is_alive = false;
    tester.send_emergency(EmergencyCode::Leaving, 0)
}

#[cfg(test)]
mod tests;
