//! Clipped readings: a plant marks them, and an exciter accepts samples that have them.

use super::exciter_cases::Answered;
use super::exciter_role::{begin, commands};
use super::plant_role::drive;
use super::source::{ACCELERATION_END_M_S2, FORCE_END_N, Samples};
use super::stop::{Stop, failed, late, skipped};
use super::tester::{Tester, emergency};
use super::times::MARGIN_NS;
use resonarm_protocol::{Measured, Message, OperatorCommand, OperatorRequest, SensorValues};

/// The end of the range of the FD profile.
const SINGLE_END: f64 = f32::MAX as f64;
/// Readings from this share of the range's end on count as being at the end: half a count less.
const AT_THE_END: f64 = 1.0 - 0.5 / 32_767.0;

/// A reading, the end of its range, and its flag.
type Marked = (f64, f64, bool);

/// A reading at the end of its range has its flag.
pub(super) fn plant(t: &mut Tester) -> Result<(), Stop> {
    let from = t.heard.len();
    drive(t)?;
    let mut marked = 0;
    let mut unmarked = 0;
    for heard in &t.heard[from..] {
        for (value, end, is_saturated) in readings(&heard.message) {
            marked += usize::from(is_saturated);
            unmarked += usize::from(value.abs() >= end * AT_THE_END && !is_saturated);
        }
    }
    match (marked, unmarked) {
        (0, 0) => skipped("no reading was clipped"),
        (_, 0) => {
            t.note(format!("{marked} clipped readings"));
            Ok(())
        }
        (_, n) => failed(format!("{n} readings are at the end of their range without their flag")),
    }
}

fn readings(message: &Message) -> Vec<Marked> {
    let ends = |axes: [Measured; 2], end| axes.map(|axis| (axis.value, end, axis.saturated)).to_vec();
    match message {
        Message::Head(head) => ends(head.axes(), FORCE_END_N),
        Message::AccelerometerB(a) | Message::AccelerometerC(a) => ends(a.axes(), ACCELERATION_END_M_S2),
        Message::Sensors(sensors) => singles(&sensors.values),
        Message::SensorPair(pair) => pair.values.iter().flat_map(singles).collect(),
        _ => Vec::new(),
    }
}

fn singles(values: &SensorValues) -> Vec<Marked> {
    let SensorValues { force_n, acceleration_b_m_s2, acceleration_c_m_s2 } = values;
    let all = [force_n, acceleration_b_m_s2, acceleration_c_m_s2].into_iter().flatten();
    all.map(|measured| (measured.value, SINGLE_END, measured.saturated)).collect()
}

/// Samples with clipped readings are complete: they are answered, or the plant is disarmed.
pub(super) fn exciter(t: &mut Tester) -> Result<(), Stop> {
    begin(t)?;
    let from = t.heard.len();
    let first = t.source.index;
    t.source.samples = Samples::Clipped;
    t.run_ns(2 * MARGIN_NS)?;
    if let Some(e) = t.heard[from..].iter().find_map(|heard| emergency(&heard.message)) {
        return failed(format!("it faults at clipped readings: {e}"));
    }
    if t.heard[from..].iter().any(|heard| is_disarm(&heard.message)) {
        t.note(String::from("it disarms"));
        return Ok(());
    }
    let sent = t.source.index.wrapping_sub(first);
    let answers = Answered::new(&commands(t, from), first, sent);
    let answered = answers.count;
    t.note(format!("{answered} of {sent} samples answered"));
    match 5 * answers.missing() > usize::from(sent) + 10 {
        true => late(format!("it answers {answered} of {sent} samples with clipped readings, and doesn't disarm")),
        false => Ok(()),
    }
}

fn is_disarm(message: &Message) -> bool {
    matches!(message, Message::Operator(OperatorCommand { request: OperatorRequest::Disarm, .. }))
}
