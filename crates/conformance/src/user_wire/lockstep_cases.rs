//! Cases for both nodes in lockstep on a user protocol.

use std::collections::BTreeMap;

use super::controller_cases::{begin, fault, why};
use super::plant_cases::{arm, drive, judged_fault};
use super::readings::{fault_within_ns, says_state};
use super::tester::{Alter, Tester};
use crate::stop::{Stop, failed, inconclusive, late, skipped};
use crate::times::{MARGIN_NS, MS, ms};
use resonarm_bench::node::WireSpec;
use resonarm_bench::node::mapped::mapping::{Lockstep, Trigger};
use resonarm_protocol::{EmergencyCode, Id};

/// Samples that a controller has to answer.
const SAMPLES: u64 = 50;
/// Time for which the tester, as a plant, keeps a controller waiting, ns: twice as long as a machine may stop a
/// process.
const PAUSE_NS: u64 = 2 * MARGIN_NS;

/// Lets a controller answer so many samples more.
fn answers_more(t: &mut Tester, samples: u64) -> Result<(), Stop> {
    let to = t.plant()?.armed_samples + samples;
    let is_done = |t: &Tester| matches!(&t.end, super::end::End::Plant(plant) if plant.armed_samples >= to);
    t.until(t.settings.patience_ns + t.on.timeout_ns(), |t| is_done(t) || !t.is_armed())?;
    match fault(t)? {
        None if is_done(t) => Ok(()),
        None => inconclusive("it disarmed the plant before the samples were over"),
        Some(emergency) if emergency.code == EmergencyCode::SampleSequence => {
            failed(format!("it answers sample {} twice", emergency.sample))
        }
        Some(emergency) if emergency.code == EmergencyCode::CommandTimeout => {
            // The plant has waited since the answer that it rejected.
            let since_ns =
                t.now_ns().saturating_sub(t.on.timing.command_timeout_ns + 2 * MARGIN_NS + t.watch.held_up_ns);
            failed(match t.monitor.refused_since(since_ns) {
                Some(refused) => format!("the answer to sample {} is rejected: {refused}", emergency.sample),
                None => format!("sample {} has no answer: {}", emergency.sample, why(&emergency)),
            })
        }
        Some(emergency) => inconclusive(format!("the plant of the tester faults: {emergency}")),
    }
}

/// Each sample is answered once.
pub(super) fn controller_answers(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    let from = t.mark();
    let from_ns = t.now_ns();
    let before = t.plant()?.armed_samples;
    answers_more(t, SAMPLES)?;
    let samples = t.plant()?.armed_samples - before;
    let took_ns = t.now_ns() - from_ns;
    // Second answers may wait on the bus: to the plant they would be the answers to later samples.
    t.plant()?.is_paused = true;
    t.run_ns(MARGIN_NS)?;
    let answers = most_answers(t, from);
    // One more may answer the sample that was published as the watch began.
    if answers > samples + 1 {
        return failed(format!("it answers {samples} samples by {answers} frames of a message"));
    }
    t.note(format!("{samples} samples in {}", ms(took_ns)));
    Ok(())
}

/// Returns the number of answers from frame `from` on: of a message, or of the message with loads that came most often.
fn most_answers(t: &Tester, from: usize) -> u64 {
    let by_sync = match &t.on.spec {
        WireSpec::Mapped(mapping) => mapping.lockstep == Lockstep::Sync,
        WireSpec::Cia402(_) => true,
    };
    let mut counts: BTreeMap<Id, u64> = BTreeMap::new();
    for heard in &t.heard()[from..] {
        let is_answer = if by_sync { heard.is_sync() } else { heard.loads().next().is_some() };
        *counts.entry(heard.id).or_default() += u64::from(is_answer);
    }
    counts.into_values().max().unwrap_or(0)
}

/// A plant takes its time.
pub(super) fn controller_waits(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    answers_more(t, SAMPLES / 5)?;
    t.plant()?.is_paused = true;
    t.until(PAUSE_NS, |t| !t.is_armed())?;
    let paused = fault(t)?;
    t.plant()?.is_paused = false;
    match paused {
        Some(emergency) if emergency.code == EmergencyCode::SampleSequence => {
            return failed(format!("it doesn't wait: it answers sample {} twice", emergency.sample));
        }
        Some(emergency) => return inconclusive(format!("the plant of the tester faults: {emergency}")),
        None if !t.is_armed() => return failed(format!("it disarms a plant that has no sample for {}", ms(PAUSE_NS))),
        None => {}
    }
    answers_more(t, SAMPLES / 5)
}

/// The plant makes no sample before the last is answered.
pub(super) fn plant_waits(t: &mut Tester) -> Result<(), Stop> {
    let Some(mapping) = t.on.mapping() else {
        return skipped("drives send their positions at SYNC, by which a sample is answered");
    };
    let of_samples = mapping.outgoing.iter().filter(|message| message.trigger == Trigger::Every(1));
    let ids: Vec<Id> = of_samples.map(|message| message.id).collect();
    if ids.is_empty() {
        return skipped("no reading comes with every sample");
    }
    drive(t)?;
    t.alter = Alter::Mute;
    // The sample that follows the last command may still be on the bus.
    t.run_ns(MARGIN_NS)?;
    let from = t.mark();
    t.run_ns((t.on.timeout_ns() / 2).min(500 * MS))?;
    let early = t.heard()[from..].iter().find(|heard| ids.contains(&heard.id));
    match early {
        Some(heard) => failed(format!("{} comes, and nobody has answered the sample before", heard.message.message)),
        None => Ok(()),
    }
}

/// Without an answer the plant faults.
pub(super) fn plant_timeout(t: &mut Tester) -> Result<(), Stop> {
    t.on.awaited_ns()?;
    if !says_state(t) {
        return skipped("no reading that is sent at least twice a second carries the plant's fault");
    }
    arm(t)?;
    t.alter = Alter::Mute;
    let from = t.mark();
    let since_ns = t.commanded_ns;
    let within_ns = t.on.timeout_ns() + fault_within_ns(t);
    match judged_fault(t, from, since_ns, within_ns)? {
        Some(_) => Ok(()),
        None => late(format!("without an answer it says no fault within {}", ms(within_ns))),
    }
}
