//! Two samples per frame, in the FD profile, if both nodes state that they can.

use super::exciter_cases::Answered;
use super::exciter_role::{begin_with, commands, exchange_hellos};
use super::plant_role::{arm, forces, hold, meet};
use super::source::{Answers, Samples};
use super::stop::{Stop, failed, late, skipped};
use super::tester::Tester;
use super::times::MS;
use resonarm_protocol::{Message, SamplesPerFrame};

/// Skips the case unless the last capabilities of the node under test state it.
fn can(t: &Tester) -> Result<(), Stop> {
    match t.last_capabilities() {
        Some(capabilities) if capabilities.samples_per_frame == SamplesPerFrame::Two => Ok(()),
        _ => skipped("its capabilities don't announce it"),
    }
}

/// A plant that can, armed by an exciter that can, sends pairs without a gap, and accepts the answer to the second.
pub(super) fn plant(t: &mut Tester) -> Result<(), Stop> {
    t.samples_per_frame = SamplesPerFrame::Two;
    meet(t)?;
    can(t)?;
    arm(t, Answers::Force(t.settings.force_n))?;
    let from = t.heard.len();
    hold(t)?;
    hold(t)?;
    t.check_frames()?;
    let frames: Vec<(u16, SamplesPerFrame)> = t.heard[from..].iter().filter_map(|h| indices(&h.message)).collect();
    let Some(first) = frames.iter().position(|(_, samples)| *samples == SamplesPerFrame::Two) else {
        return failed("armed by an exciter that takes two samples a frame it sends one");
    };
    // A plant changes to pairs when it is armed, so the first frames heard may have one sample.
    let start = frames[first].0;
    if !start.is_multiple_of(2) {
        return failed(format!("a pair begins with sample {start}, which is odd"));
    }
    for (n, frame) in frames[first..].iter().enumerate() {
        let wanted = (start.wrapping_add(2 * n as u16), SamplesPerFrame::Two);
        if *frame != wanted {
            let index = frame.0;
            let samples = frame.1 as u8;
            let wanted = wanted.0;
            return failed(format!(
                "received a frame of {samples} samples from {index} on, expected the pair from {wanted} on"
            ));
        }
    }
    t.note(format!("{} pairs", frames.len() - first));
    match forces(t, from).last() {
        Some((_, read_n)) if (read_n - t.settings.force_n).abs() < 0.2 * t.settings.force_n => Ok(()),
        Some((_, read_n)) => failed(format!("commanded {} N, the head reads {read_n:.2} N", t.settings.force_n)),
        None => failed("the head measures no force"),
    }
}

fn indices(message: &Message) -> Option<(u16, SamplesPerFrame)> {
    match message {
        Message::SensorPair(pair) => Some((pair.sample, SamplesPerFrame::Two)),
        Message::Sensors(sensors) => Some((sensors.sample, SamplesPerFrame::One)),
        _ => None,
    }
}

/// An exciter that can answers the second of a pair, once.
pub(super) fn exciter(t: &mut Tester) -> Result<(), Stop> {
    t.samples_per_frame = SamplesPerFrame::Two;
    exchange_hellos(t)?;
    // Its capabilities follow its hello.
    t.run_ns(100 * MS)?;
    can(t)?;
    begin_with(t, Samples::Pairs)?;
    let from = t.heard.len();
    let first = t.source.index;
    t.run_ns(300 * MS)?;
    t.check_frames()?;
    let answered = commands(t, from);
    let sent = t.source.index.wrapping_sub(first);
    if let Some(sample) = answered.iter().find(|sample| sample.is_multiple_of(2)) {
        return failed(format!("it answers sample {sample}, the first of a pair"));
    }
    if answered.windows(2).any(|two| two[0] == two[1]) {
        return failed("it answers a pair twice");
    }
    // Each pair counts by its second sample, which has an odd index.
    let second: Vec<u16> = answered.iter().map(|sample| sample / 2).collect();
    let answers = Answered::new(&second, first.div_ceil(2), sent / 2);
    let pairs = sent / 2;
    t.note(format!("{} of {pairs} pairs answered", answers.count));
    // As for single samples, not more than a fifth may be lost.
    match 5 * answers.missing() > usize::from(pairs) + 10 {
        true => late(format!("it answers {} of {pairs} pairs", answers.count)),
        false => Ok(()),
    }
}
