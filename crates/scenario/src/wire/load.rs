//! Bus load of a user protocol.

use super::WireSection;
use super::error::WireError;
use crate::Scenario;
use crate::dbc::Database;
use crate::error::ScenarioError;
use resonarm_bench::node::cia402::Cia402Spec;
use resonarm_bench::node::mapped::mapping::{Mapping, Trigger};
use resonarm_protocol::bits::{Bits, IdFormat, Stuffing, bounds};
use resonarm_protocol::load::share;
use resonarm_protocol::{FrameFormat, Id};
use resonarm_wire::canopen::dictionary::at;
use resonarm_wire::canopen::{EnabledPdo, enabled_pdos};

/// Largest share of a control bus that the messages may take. Above it, messages of low priority wait for long.
const MOST: f64 = 0.8;

/// Rejects messages that don't fit the bus, if the scenario states its bit rate, each with the largest possible
/// number of stuff bits. A command without a cycle time in the DBC counts once per sample; messages on request
/// don't count.
pub(super) fn check(scenario: &Scenario, section: &WireSection, mapping: &Mapping) -> Result<(), ScenarioError> {
    let Some(spec) = scenario.bus_of_bit_rate()? else { return Ok(()) };
    let database = section.database()?;
    let rate_hz = scenario.simulation.rate_hz;
    let sent = mapping.outgoing.iter().map(|message| {
        let per_second = match message.trigger {
            Trigger::Every(samples) => rate_hz / samples as f64,
            Trigger::Period(period_ns) => 1e9 / period_ns as f64,
            Trigger::Sync => rate_hz,
            Trigger::Request => 0.0,
        };
        (message.id, per_second)
    });
    // Requests are rare events and don't count.
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
    check_share(share(bits, spec.rates), "the messages of [wire]", "send readings less often")
}

fn check_share(share: f64, frames: &'static str, fix: &'static str) -> Result<(), ScenarioError> {
    if share <= MOST { Ok(()) } else { Err(WireError::Overload { frames, percent: 100.0 * share, fix }.into()) }
}

fn received_per_second(database: &Database, id: Id, rate_hz: f64) -> f64 {
    let cycle_ms = database.message_by_id(id).and_then(|message| message.cycle_time_ms());
    cycle_ms.filter(|cycle_ms| *cycle_ms > 0.0).map_or(rate_hz, |cycle_ms| 1e3 / cycle_ms)
}

/// Rejects CANopen drives that don't fit the bus, with the PDOs that they have after power-on. SYNC and a
/// target for each drive come once per sample; PDOs with an event timer follow their timer. A SYNC is counted
/// without data, as its counter is optional.
pub(super) fn check_drives(scenario: &Scenario, spec: &Cia402Spec) -> Result<(), ScenarioError> {
    let Some(bus) = scenario.bus_of_bit_rate()? else { return Ok(()) };
    let frames = |bytes: usize, per_second: f64| {
        let one = bounds(IdFormat::Standard, FrameFormat::Classic, bytes, Stuffing::Worst);
        one.times(libm::ceil(per_second) as u64)
    };
    let rate_hz = scenario.simulation.rate_hz;
    // The SYNC of each sample.
    let mut bits = frames(0, rate_hz);
    for drive in &spec.drives {
        let heartbeat_ms = drive.dictionary().number(at(0x1017, 0));
        if heartbeat_ms > 0 {
            bits = bits.plus(frames(1, 1e3 / heartbeat_ms as f64));
        }
        for pdo in enabled_pdos(&drive.dictionary()) {
            let per_second = match pdo {
                EnabledPdo { is_sent: true, kind: 254 | 255, event_timer_ms: ms @ 1.., .. } => 1e3 / f64::from(ms),
                EnabledPdo { is_sent: true, kind: every @ 2..=240, .. } => rate_hz / f64::from(every),
                // These types are sent on request or not at all, and requests don't count.
                EnabledPdo { is_sent: true, kind: 241..=253, .. } => 0.0,
                EnabledPdo { .. } => rate_hz,
            };
            bits = bits.plus(frames(pdo.bytes, per_second));
        }
    }
    let frames = "the frames of the drives, with a SYNC and a target for each drive once a sample,";
    check_share(share(bits, bus.rates), frames, "lower simulation.rate_hz")
}
