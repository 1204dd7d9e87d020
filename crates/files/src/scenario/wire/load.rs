//! The load of a user's messages on the bus.

use super::{WireError, WireSection};
use crate::dbc::Database;
use crate::scenario::{Scenario, ScenarioError};
use resonarm_bench::node::mapped::mapping::{Mapping, Trigger};
use resonarm_protocol::bits::{Bits, IdFormat, Stuffing, bounds};
use resonarm_protocol::load::share;
use resonarm_protocol::{FrameFormat, Id};

/// The largest share of a bus for control that the messages may take: above, those of low priority wait for long.
const MOST: f64 = 0.8;

/// Refuses messages that the bus, if the scenario names its bit rate, can't carry, each with the most stuff bits that
/// there can be. A command whose cycle time the DBC doesn't say comes once a sample; what is sent on request counts as
/// nothing.
pub(super) fn check(scenario: &Scenario, section: &WireSection, mapping: &Mapping) -> Result<(), ScenarioError> {
    let Some(spec) = scenario.bus_of_bit_rate()? else { return Ok(()) };
    let (database, rate_hz) = (section.database()?, scenario.simulation.rate_hz);
    let sent = mapping.outgoing.iter().map(|message| {
        let per_second = match message.trigger {
            Trigger::Every(samples) => rate_hz / samples as f64,
            Trigger::Period(period_ns) => 1e9 / period_ns as f64,
            Trigger::Sync => rate_hz,
            Trigger::Request => 0.0,
        };
        (message.id, per_second)
    });
    let received = mapping.incoming.iter().filter(|message| message.is_sync || !message.commands.is_empty());
    let received = received.map(|message| (message.id, received_per_second(&database, message.id, rate_hz)));
    let of_message = |(id, per_second): (Id, f64)| {
        let (format, length) = database
            .message_by_id(id)
            .map_or((FrameFormat::Classic, 8), |message| (message.format(), message.length()));
        let kind = if matches!(id, Id::Standard(_)) { IdFormat::Standard } else { IdFormat::Extended };
        bounds(kind, format, length, Stuffing::Worst).times(libm::ceil(per_second) as u64)
    };
    let bits = sent.chain(received).map(of_message).fold(Bits::default(), Bits::plus);
    let load = share(bits, spec.rates);
    if load <= MOST { Ok(()) } else { Err(WireError::Overload { percent: 100.0 * load }.into()) }
}

fn received_per_second(database: &Database, id: Id, rate_hz: f64) -> f64 {
    let cycle_ms = database.message_by_id(id).and_then(|message| message.cycle_time_ms());
    cycle_ms.filter(|cycle_ms| *cycle_ms > 0.0).map_or(rate_hz, |cycle_ms| 1e3 / cycle_ms)
}
