//! States and samples as channels: a number a sample, with name, unit and place on the arm.

use core::ops::RangeInclusive;

use super::{ExportError, Part};
use crate::recording::{Origin, Recording, RecordingError, SampleRecord, StateRecord};

/// What a channel is a measure of, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    /// Angle of a joint, rad.
    Angle,
    /// Its rate, rad/s.
    AngularVelocity,
    /// Torque at a joint, N·m.
    Torque,
    /// Force, N.
    Force,
    /// Acceleration, m/s².
    Acceleration,
}

/// A point of the arm: the joints 1, at the base, and 2, the elbow B; the tip C.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Point {
    Joint1 = 1,
    Joint2B = 2,
    TipC = 3,
}

/// Along which axis of the base frame, or about which.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Axis {
    X,
    Y,
    AboutZ,
}

/// A channel.
#[derive(Clone, Copy, Debug)]
pub struct Channel {
    /// Its name in the schemas, with its unit.
    pub name: &'static str,
    pub quantity: Quantity,
    pub point: Point,
    pub axis: Axis,
}

const fn channel(name: &'static str, quantity: Quantity, point: Point, axis: Axis) -> Channel {
    Channel { name, quantity, point, axis }
}

const STATES: [Channel; 8] = [
    channel("alpha1_rad", Quantity::Angle, Point::Joint1, Axis::AboutZ),
    channel("alpha2_rad", Quantity::Angle, Point::Joint2B, Axis::AboutZ),
    channel("alpha1_dot_rad_s", Quantity::AngularVelocity, Point::Joint1, Axis::AboutZ),
    channel("alpha2_dot_rad_s", Quantity::AngularVelocity, Point::Joint2B, Axis::AboutZ),
    channel("torque1_nm", Quantity::Torque, Point::Joint1, Axis::AboutZ),
    channel("torque2_nm", Quantity::Torque, Point::Joint2B, Axis::AboutZ),
    channel("force_x_n", Quantity::Force, Point::TipC, Axis::X),
    channel("force_y_n", Quantity::Force, Point::TipC, Axis::Y),
];

const SAMPLES: [Channel; 6] = [
    channel("acceleration_b_x_m_s2", Quantity::Acceleration, Point::Joint2B, Axis::X),
    channel("acceleration_b_y_m_s2", Quantity::Acceleration, Point::Joint2B, Axis::Y),
    channel("acceleration_c_x_m_s2", Quantity::Acceleration, Point::TipC, Axis::X),
    channel("acceleration_c_y_m_s2", Quantity::Acceleration, Point::TipC, Axis::Y),
    channel("head_force_x_n", Quantity::Force, Point::TipC, Axis::X),
    channel("head_force_y_n", Quantity::Force, Point::TipC, Axis::Y),
];

/// The channels of a part; none of frames, ticks and events.
pub const fn channels(part: Part) -> &'static [Channel] {
    match part {
        Part::States => &STATES,
        Part::Samples => &SAMPLES,
        Part::Frames | Part::Ticks | Part::Events => &[],
    }
}

/// How long before its sample a channel was read, in samples: the delay of the instruments' converters.
pub fn lead(part: Part, origin: &Origin) -> f64 {
    match part {
        Part::Samples => origin.reading_delay_samples,
        _ => 0.0,
    }
}

/// The values of [`STATES`].
pub const fn state_values(record: &StateRecord) -> [f64; 8] {
    let StateRecord { alpha_rad: [a, b], alpha_dot_rad_s: [c, d], torque_nm: [e, f], force_n: [g, h], .. } = *record;
    [a, b, c, d, e, f, g, h]
}

/// The values of [`SAMPLES`].
pub const fn sample_values(record: &SampleRecord) -> [f64; 6] {
    let SampleRecord { acceleration_b_m_s2: [a, b], acceleration_c_m_s2: [c, d], head_force_n: [e, f], .. } = *record;
    [a, b, c, d, e, f]
}

/// Hands the values of every wanted sample of a part to `visit`, in order and without a gap; the first sample and how
/// many there were.
///
/// # Errors
/// [`ExportError::Recording`] if samples are missing.
pub fn visit(
    recording: &Recording,
    part: Part,
    wanted: &RangeInclusive<u64>,
    mut visit: impl FnMut(&[f64]) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    let mut each = |sample: u64, values: &[f64]| if wanted.contains(&sample) { visit(values) } else { Ok(()) };
    let goes_on = |sample: u64| sample <= *wanted.end();
    match part {
        Part::States => {
            for record in within(recording.states()?, |record| goes_on(record.sample)) {
                let record = record?;
                each(record.sample, &state_values(&record))?;
            }
        }
        Part::Samples => {
            for record in within(recording.samples()?, |record| goes_on(record.sample)) {
                let record = record?;
                each(record.sample, &sample_values(&record))?;
            }
        }
        Part::Frames | Part::Ticks | Part::Events => {}
    }
    Ok(())
}

/// The records up to the first that is beyond what is wanted.
fn within<T>(
    records: impl Iterator<Item = Result<T, RecordingError>>,
    goes_on: impl Fn(&T) -> bool,
) -> impl Iterator<Item = Result<T, RecordingError>> {
    records.take_while(move |record| record.as_ref().map_or(true, &goes_on))
}

/// The first sample of a part among the wanted ones, and how many there are.
///
/// # Errors
/// As [`visit`]; [`ExportError::Recording`] as well if the part has no samples there.
pub fn span(recording: &Recording, part: Part, wanted: &RangeInclusive<u64>) -> Result<(u64, u64), ExportError> {
    let first = match part {
        Part::States => recording.states()?.next().transpose()?.map(|record| record.sample),
        Part::Samples => recording.samples()?.next().transpose()?.map(|record| record.sample),
        Part::Frames | Part::Ticks | Part::Events => None,
    };
    let records = recording.summary().topics.get(part.topic().name()).map_or(0, |topic| topic.records);
    let Some(first) = first else { return Ok((*wanted.start(), 0)) };
    // They are without a gap, and the last may have the largest of all numbers.
    let (from, last) = ((*wanted.start()).max(first), (*wanted.end()).min(first + (records - 1)));
    Ok((from, last.checked_sub(from).map_or(0, |behind| behind + 1)))
}
