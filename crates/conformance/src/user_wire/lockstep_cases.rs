//! Cases for both nodes in lockstep on a user's own protocol.

use alloc::format;
use alloc::vec::Vec;

use super::controller_cases::{begin, fault, why};
use super::plant_cases::{arm, drive, judged_fault, says_state};
use super::tester::{Alter, Tester};
use crate::tester::{MARGIN_NS, MS, Stop, failed, inconclusive, late, ms, skipped};
use resonarm_bench::node::mapped::mapping::Trigger;
use resonarm_protocol::{EmergencyCode, Id};

/// Samples that a controller has to answer.
const SAMPLES: u64 = 50;
/// For how long the tester, as a plant, keeps a controller waiting, ns: twice as long as a machine may stop a process.
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
        Some(emergency) => failed(format!("sample {} has no answer: {}", emergency.sample, why(&emergency))),
    }
}

/// Each sample is answered once.
pub(super) fn controller_answers(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    let from_ns = t.now_ns();
    answers_more(t, SAMPLES)?;
    t.note(format!("{SAMPLES} samples in {}", ms(t.now_ns() - from_ns)));
    Ok(())
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
        Some(emergency) => return failed(format!("while no sample comes: {}", why(&emergency))),
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
    // The sample that the last command has made may be on its way.
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
    if !says_state(t) {
        return skipped("no reading that is sent by itself says that the plant is in fault");
    }
    arm(t)?;
    t.alter = Alter::Mute;
    let (from, since_ns) = (t.mark(), t.sent_ns);
    match judged_fault(t, from, since_ns, t.on.timeout_ns() + MARGIN_NS)? {
        Some(_) => Ok(()),
        None => late(format!("without an answer it says no fault within {}", ms(t.on.timeout_ns() + MARGIN_NS))),
    }
}
