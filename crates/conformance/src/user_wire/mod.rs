//! Conformance to a user protocol: the cases of a scenario with `[wire]`.
//!
//! What the node under test must do follows from the mapping alone. The tester's own end is the node that the program
//! runs on this protocol: before a controller under test the plant of the scenario, simulated; before a plant under
//! test the emulated exciter. What that node sends can be altered on its way to the bus, and every frame of the node
//! under test is checked by the [`Decoder`], which knows counters, checksums and meanings.

mod cases;
mod constant;
mod controller_cases;
mod craft;
mod drive_cases;
mod end;
mod lockstep_cases;
mod monitor;
mod plant_cases;
mod protocol;
mod readings;
mod refusal_cases;
mod requirements;
mod tester;

pub use cases::{WireCase, WireScript, wire_cases};
pub use protocol::{UserWire, UserWireError};
pub use requirements::WIRE_REQUIREMENTS;

use super::finding::Finding;
use super::stop::Stop;
use super::times::{GONE_NS, MS};
use super::tries::{Rejected, Subject, Try, Watch, conclude, tries};
use crate::settings::Settings;
use crate::wire::Wire;
use end::End;
use resonarm_bus::BusError;
use resonarm_protocol::EmergencyCode;
use tester::{Alter, Tester};

/// Time that a plant under test, or a controller, is given to come to rest after a case, ns.
const RELEASE_NS: u64 = 300 * MS;

impl Subject for Tester<'_> {
    fn watch(&self) -> Watch {
        self.watch
    }

    fn resumes(&mut self) -> Result<bool, Stop> {
        let from = self.mark();
        Ok(self.wait_for(from, GONE_NS, |_| true)?.is_some())
    }

    /// A controller hears of a fault of the plant, and a plant is disarmed.
    fn release(&mut self) -> Result<(), Stop> {
        self.alter = Alter::Nothing;
        let now_ns = self.now_ns();
        match &mut self.end {
            End::Listener => return Ok(()),
            End::Plant(plant) => {
                plant.is_paused = false;
                plant.node.fault(now_ns, EmergencyCode::Overrun, 1);
            }
            End::Exciter(node) => node.leave(now_ns),
        }
        self.run_ns(RELEASE_NS)
    }

    /// The frames were rejected by their form, or by the tester's plant for a load beyond its limits.
    fn rejected(&self) -> Option<Rejected> {
        self.monitor.rejected().or_else(|| {
            let End::Plant(plant) = &self.end else { return None };
            let text = plant.loads_beyond_limits(&self.monitor.heard)?;
            Some(Rejected { text, may_be_lost: false })
        })
    }
}

/// Runs a case of a user protocol, up to five times if a hold-up keeps it from a result or the node was slow.
///
/// # Errors
/// [`BusError`] if the bus is gone.
pub fn run_on_wire(
    case: &WireCase,
    wire: &mut dyn Wire,
    user_wire: &UserWire,
    settings: Settings,
) -> Result<Finding, BusError> {
    let limits = user_wire.limits();
    tries(limits, wire, |wire| {
        let mut tester = Tester::new(wire, user_wire, settings);
        let result = conclude((case.script.0)(&mut tester), &mut tester, limits)?;
        let Tester { watch, notes, monitor, .. } = tester;
        Ok(Try { result, watch, measured: notes, traffic: monitor.traffic })
    })
}

#[cfg(test)]
mod tests;
