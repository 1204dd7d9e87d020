//! Conformance of a node to the protocol: cases that play its partner on a bus.
//!
//! A case is a script of what is sent and what must, or must not, be received within which time. It is written against
//! a [`Wire`], a bus with a clock: on a real bus it tests firmware, in tests a node in virtual time. [`REQUIREMENTS`]
//! are the demands of `SPEC.md`, and state which ones no case can check. Nodes in real time and in lockstep have
//! separate lists. On a user protocol the demands are those of its mapping, [`WIRE_REQUIREMENTS`];
//! [`run_on_wire`] runs the cases for a [`UserWire`].
//!
//! Times by the clock have a margin of [`MARGIN_NS`], for the machine may hold any process up. A plant is judged by the
//! indices of its own samples, which stop when it is stopped. If the tester itself was held up for longer than its
//! partner tolerates, a failure is inconclusive, and the case is tried again. So is a delay of the node under test if
//! it was silent meanwhile and then resumed: it was stopped itself. Many short stops add up without such a silence: a
//! node that faults too late fails at the third time. No case passes beside a frame of the node that the tester
//! rejected.

mod as_plant;
mod bus_off_cases;
mod bus_wire;
mod case;
mod cases;
mod common_cases;
mod counter_cases;
mod counters;
mod damage;
mod evidence;
mod exciter_cases;
mod exciter_role;
mod finding;
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
mod soak;
mod soak_cases;
mod source;
mod stop;
mod tester;
mod times;
mod traffic;
mod tries;
mod user_wire;
mod wire;

pub use bus_wire::BusWire;
pub use case::Case;
pub use cases::{ProtocolCase, Script, cases};
pub use evidence::{Evidence, configuration};
pub use finding::{Finding, Verdict};
pub use requirements::{Check, REQUIREMENTS, Requirement};
pub use settings::{ExpectedSine, Settings, SineAmplitude};
pub use times::MARGIN_NS;
pub use traffic::{Commands, Range, Refused, Traffic, UserRefused};
pub use user_wire::{UserWire, UserWireError, WIRE_REQUIREMENTS, WireCase, WireScript, run_on_wire, wire_cases};
pub use wire::{BusOff, Stopped, Wire};

use resonarm_bus::BusError;
use resonarm_protocol::{EmergencyCode, Network, Node, NodeState, OperatorRequest};
use source::Answers;
use stop::Stop;
use tester::{Tester, is_state};
use times::GONE_NS;
use tries::{Limits, Rejected, Subject, Try, Watch, conclude, tries};

/// Runs a case, up to five times if a hold-up keeps it from a result or the node was slow.
///
/// # Errors
/// [`BusError`] if the bus is gone.
pub fn run(
    case: &ProtocolCase,
    wire: &mut dyn Wire,
    network: Network,
    settings: Settings,
) -> Result<Finding, BusError> {
    let limits = Limits::of_node(case.mode, case.tested);
    tries(limits, wire, |wire| {
        let mut tester = Tester::new(wire, network, case.tested, settings);
        let result = conclude((case.script.0)(&mut tester), &mut tester, limits)?;
        let Tester { watch, notes, traffic, .. } = tester;
        Ok(Try { result, watch, measured: notes, traffic })
    })
}

impl Subject for Tester<'_> {
    fn watch(&self) -> Watch {
        self.watch
    }

    fn resumes(&mut self) -> Result<bool, Stop> {
        let word = self.wait_for(GONE_NS, |_| true)?;
        Ok(word.is_some_and(|heard| !is_state(&heard.message, NodeState::BootUp)))
    }

    /// The plant is disarmed, and the partner leaves.
    fn release(&mut self) -> Result<(), Stop> {
        self.answers = Answers::None;
        if self.tested == Node::Plant {
            self.request(OperatorRequest::Disarm)?;
        }
        self.is_alive = false;
        self.send_emergency(EmergencyCode::Leaving, 0)
    }

    fn rejected(&self) -> Option<Rejected> {
        self.rejected_frames()
    }
}

#[cfg(test)]
mod tests;
