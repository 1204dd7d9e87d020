//! The result of a conformance case.

use super::traffic::Traffic;
use resonarm_bus::BusError;

/// The result of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The node does what it must.
    Passed,
    /// The node does not conform, with what it does.
    Failed(String),
    /// Undecided, with the reason.
    Inconclusive(String),
    /// The case was not tried, with the reason.
    Skipped(String),
}

/// The findings of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Verdict on the node under test.
    pub verdict: Verdict,
    /// Measurements of the last try, in words.
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
