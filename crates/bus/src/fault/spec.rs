//! Faults of the network as a scenario states them.

use resonarm_protocol::{Id, Node};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use resonarm_numeric::number::short;

/// The most faults of a network.
pub const MOST_FAULTS: usize = 64;
/// Longest delay of a frame, s.
const DELAY_MAX_S: f64 = 10.0;
/// Highest rate of a babbling node, Hz: more than the shortest frames that fit 8 Mbit/s.
const BABBLE_MAX_HZ: f64 = 100_000.0;
/// The largest identifier of 11 bits.
const ID_MAX: u32 = 0x7FF;
/// The largest identifier of 29 bits.
const EXTENDED_ID_MAX: u32 = 0x1FFF_FFFF;

/// Whose end of the bus has a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultNode {
    /// The plant's end of the bus.
    Plant,
    /// The exciter's end of the bus.
    Exciter,
}

impl From<FaultNode> for Node {
    fn from(node: FaultNode) -> Node {
        match node {
            FaultNode::Plant => Node::Plant,
            FaultNode::Exciter => Node::Exciter,
        }
    }
}

/// Direction of the frames that a fault concerns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultDirection {
    /// Frames that the node sends.
    Send,
    /// Frames that it receives.
    Receive,
    /// Frames in both directions.
    Both,
}

/// Kind of a fault at an end of the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// A frame is lost.
    Loss,
    /// A frame comes later by a constant, and those behind it wait for it.
    Delay,
    /// A frame comes later by a random time, even from zero to the delay, and those behind it wait for it.
    Jitter,
    /// A frame comes later by a constant, and those behind it overtake it.
    Reordering,
    /// A frame comes twice.
    Duplication,
    /// One bit of the content is inverted, as if the frame's own CRC had missed it.
    BitError,
    /// The node sends additional frames of random content.
    Babble,
    /// The node's controller is bus-off: it neither sends nor receives, and says so.
    BusOff,
    /// The node's line is cut: nothing comes in; what is sent is never acknowledged, and the transmit queue is full.
    LinkDown,
}

/// A fault as a scenario states it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultSpec {
    /// Whose end of the bus has it.
    pub node: FaultNode,
    /// Kind of fault that is injected.
    pub kind: FaultKind,
    /// Direction of the frames, for a kind that has one; `None` is both directions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<FaultDirection>,
    /// Begin, s since the node's bus was opened, not negative; in a free run of simulated time.
    pub from_s: f64,
    /// End, s, after the begin. `None` lasts to the end of the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
    /// The 11-bit identifiers of the frames that have it, of babble those that are sent in turn. Without identifiers of
    /// either length all frames have it, and babble has the identifier 0, the highest priority.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ids: Vec<u32>,
    /// The same of 29 bits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub extended_ids: Vec<u32>,
    /// The probability with which a frame has it, 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
    /// Number of frames that have the fault: the first so many of each direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u64>,
    /// Delay of a frame, s, at most 10.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay_s: Option<f64>,
    /// Frames that a babbling node sends per second, at most 100000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
}

/// Errors of the description of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FaultError {
    /// A number is impossible.
    #[error("network.faults, number {number}: `{name}` is {got}: it must be {expected}", got = short(.got))]
    Value {
        /// Number of the fault in the scenario, from 1 on.
        number: usize,
        /// Key of the number in the scenario.
        name: &'static str,
        /// Number that the scenario gives.
        got: f64,
        /// Description of the valid numbers.
        expected: &'static str,
    },
    /// A fault does not say how much.
    #[error("network.faults, number {number}: `{key}` is missing: add it, or change `kind`")]
    KeyMissing {
        /// Number of the fault in the scenario, from 1 on.
        number: usize,
        /// The key that is missing.
        key: &'static str,
    },
    /// A fault states a key that its kind does not use.
    #[error("network.faults, number {number}: `{key}` does not apply to this kind of fault: leave it out")]
    KeyIdle {
        /// Number of the fault in the scenario, from 1 on.
        number: usize,
        /// Key that does not apply.
        key: &'static str,
    },
    /// Probability and count together.
    #[error(
        "network.faults, number {number}: `probability` and `count` are both given, and each selects the frames that have the fault: leave one out"
    )]
    Both {
        /// Number of the fault in the scenario, from 1 on.
        number: usize,
    },
    /// More faults than a network takes.
    #[error("network.faults has {got} entries: it must have at most {MOST_FAULTS}")]
    TooMany {
        /// Number of faults that the scenario gives.
        got: usize,
    },
}

/// Checks all faults of a network.
///
/// # Errors
/// [`FaultError`] names the first that is refused.
pub fn check(faults: &[FaultSpec]) -> Result<(), FaultError> {
    if faults.len() > MOST_FAULTS {
        return Err(FaultError::TooMany { got: faults.len() });
    }
    faults.iter().enumerate().try_for_each(|(index, fault)| fault.check(index + 1))
}

impl FaultSpec {
    /// Whether the fault is of frames that go `direction`.
    pub(super) fn goes(&self, direction: FaultDirection) -> bool {
        [None, Some(FaultDirection::Both), Some(direction)].contains(&self.direction)
    }

    /// Returns the times at which the fault begins and ends, ns.
    pub(super) fn span_ns(&self) -> core::ops::Range<u64> {
        nanoseconds(self.from_s)..self.to_s.map_or(u64::MAX, nanoseconds)
    }

    /// The identifiers of both lengths, those of 11 bits first.
    pub(super) fn identifiers(&self) -> Vec<Id> {
        // Every identifier has passed `check`, so that no bits are lost.
        let standard = self.ids.iter().map(|id| Id::Standard(*id as u16));
        standard.chain(self.extended_ids.iter().map(|id| Id::Extended(*id))).collect()
    }

    fn check(&self, number: usize) -> Result<(), FaultError> {
        let value = |name, got, expected, fits| {
            if fits { Ok(()) } else { Err(FaultError::Value { number, name, got, expected }) }
        };
        value("from_s", self.from_s, "zero or a positive number", self.from_s.is_finite() && self.from_s >= 0.0)?;
        let to_s = self.to_s.unwrap_or(f64::INFINITY);
        value("to_s", to_s, "later than `from_s`", to_s > self.from_s)?;
        self.check_keys(number)?;
        let largest = |ids: &[u32]| ids.iter().copied().max().unwrap_or(0);
        let standard = largest(&self.ids);
        let extended = largest(&self.extended_ids);
        let expected = "an identifier of 11 bits, at most 2047; put identifiers of 29 bits in `extended_ids`";
        value("ids", f64::from(standard), expected, standard <= ID_MAX)?;
        let expected = "an identifier of 29 bits, at most 536870911";
        value("extended_ids", f64::from(extended), expected, extended <= EXTENDED_ID_MAX)?;
        let probability = self.probability.unwrap_or(1.0);
        value("probability", probability, "from 0 to 1", (0.0..=1.0).contains(&probability))?;
        if self.probability.is_some() && self.count.is_some() {
            return Err(FaultError::Both { number });
        }
        let delay_s = self.delay_s.unwrap_or(DELAY_MAX_S);
        let positive = |got: f64, most: f64| got > 0.0 && got <= most;
        value("delay_s", delay_s, "a positive number of seconds, at most 10", positive(delay_s, DELAY_MAX_S))?;
        let rate_hz = self.rate_hz.unwrap_or(BABBLE_MAX_HZ);
        value("rate_hz", rate_hz, "a positive number, at most 100000", positive(rate_hz, BABBLE_MAX_HZ))
    }

    /// Checks that all keys that the kind needs are there, and no others.
    fn check_keys(&self, number: usize) -> Result<(), FaultError> {
        use FaultKind::{Babble, BusOff, Delay, Jitter, LinkDown, Reordering};
        let is_late = matches!(self.kind, Delay | Jitter | Reordering);
        let of_frames = !matches!(self.kind, Babble | BusOff | LinkDown);
        for (key, needed, stated) in
            [("delay_s", is_late, self.delay_s.is_some()), ("rate_hz", self.kind == Babble, self.rate_hz.is_some())]
        {
            match (needed, stated) {
                (true, false) => return Err(FaultError::KeyMissing { number, key }),
                (false, true) => return Err(FaultError::KeyIdle { number, key }),
                _ => {}
            }
        }
        for (key, useful, stated) in [
            ("direction", !matches!(self.kind, Babble | BusOff), self.direction.is_some()),
            ("ids", of_frames || self.kind == Babble, !self.ids.is_empty()),
            ("extended_ids", of_frames || self.kind == Babble, !self.extended_ids.is_empty()),
            ("probability", of_frames, self.probability.is_some()),
            ("count", of_frames, self.count.is_some()),
        ] {
            if stated && !useful {
                return Err(FaultError::KeyIdle { number, key });
            }
        }
        Ok(())
    }
}

/// A time that is not negative, in whole nanoseconds.
pub(super) fn nanoseconds(time_s: f64) -> u64 {
    libm::round(time_s * 1e9) as u64
}
