//! The sensors other than head, B and C, as the converters sample them.

use alloc::vec;
use alloc::vec::Vec;

use super::sampling::{Course, Filter};
use super::write;
use crate::rig::converter::MOST_ORDER;
use crate::structure::{Channel, Quantity};
use resonarm_dynamics::structure::Kinematics;

/// What one channel has gathered: its last sample, and partial sums of a filter for the readings after this hold and
/// the next ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Gathered {
    sampled: f64,
    sums: [f64; MOST_ORDER],
}

/// The channels of the sensors other than head, B and C. All vectors have as many entries as there are channels.
#[derive(Clone, Debug, Default)]
pub(super) struct OtherSensors {
    channels: Vec<Channel>,
    gathered: Vec<Gathered>,
    /// What was gathered at the start of a hold, to which a hold that can't be finished returns.
    before: Vec<Gathered>,
    /// The motion at the start and at the end of a step.
    pub start: Vec<Kinematics>,
    pub end: Vec<Kinematics>,
    /// The accelerations at both ends by each ampere in a coil, 1/A times their unit.
    pub start_per_ampere: Vec<f64>,
    pub end_per_ampere: Vec<f64>,
}

/// How the current in a coil differs over a step from what [`OtherSensors::start`] and [`OtherSensors::end`] were read with, A: at both
/// ends, and the transient at the start.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CurrentChange {
    pub ends_a: [f64; 2],
    pub transient_a: f64,
}

impl OtherSensors {
    pub fn new(channels: Vec<Channel>) -> OtherSensors {
        let count = channels.len();
        OtherSensors {
            gathered: vec![Gathered::default(); count],
            before: vec![Gathered::default(); count],
            start: vec![Kinematics::default(); count],
            end: vec![Kinematics::default(); count],
            start_per_ampere: vec![0.0; count],
            end_per_ampere: vec![0.0; count],
            channels,
        }
    }

    pub fn is_empty(&self) -> bool {
        self.channels.is_empty()
    }

    /// Begins a hold: keeps what was gathered, for a hold that fails.
    pub fn begin(&mut self) {
        self.before.copy_from_slice(&self.gathered);
    }

    /// Returns to the start of the hold.
    pub fn undo(&mut self) {
        self.gathered.copy_from_slice(&self.before);
    }

    /// The end of a step is the start of the next.
    pub fn step_on(&mut self) {
        core::mem::swap(&mut self.start, &mut self.end);
        core::mem::swap(&mut self.start_per_ampere, &mut self.end_per_ampere);
    }

    /// Sets the accelerations at the start of the first step of a hold, by what was read at both ends.
    pub fn begin_step(&mut self, acceleration: impl Fn([f64; 2], [f64; 2]) -> f64) {
        for (start, end) in self.start.iter_mut().zip(&self.end) {
            start.acceleration = acceleration([start.velocity, end.velocity], [start.acceleration, end.acceleration]);
        }
    }

    /// The converters as if they had always sampled the motion in [`OtherSensors::start`].
    pub fn settle(&mut self, filter: Option<&Filter>) {
        for ((gathered, channel), at) in self.gathered.iter_mut().zip(&self.channels).zip(&self.start) {
            let sampled = instant(channel.quantity, at);
            let sums = filter.map_or([0.0; MOST_ORDER], |filter| filter.settled_one(sampled));
            *gathered = Gathered { sampled, sums };
        }
    }

    /// Samples the motion in [`OtherSensors::end`], as converters without a filter do.
    pub fn sample(&mut self) {
        for ((gathered, channel), at) in self.gathered.iter_mut().zip(&self.channels).zip(&self.end) {
            gathered.sampled = instant(channel.quantity, at);
        }
    }

    /// Adds step `index` of a hold, from [`OtherSensors::start`] to [`OtherSensors::end`].
    pub fn add(&mut self, filter: &Filter, index: usize, change: CurrentChange) {
        for (place, (gathered, channel)) in self.gathered.iter_mut().zip(&self.channels).enumerate() {
            let (start, end) = (self.start[place], self.end[place]);
            let per_ampere = [self.start_per_ampere[place], self.end_per_ampere[place]];
            let [from, to] = [0, 1].map(|end| per_ampere[end] * change.ends_a[end]);
            let ends = [(start.velocity, start.acceleration + from), (end.velocity, end.acceleration + to)];
            let acceleration = filter.course(ends, per_ampere[0] * change.transient_a);
            let course: Course = match channel.quantity {
                Quantity::Velocity => filter.velocity(start.velocity, acceleration),
                Quantity::Displacement | Quantity::Angle => {
                    filter.displacement((start.displacement, start.velocity), acceleration)
                }
                _ => acceleration,
            };
            filter.add_course(&mut gathered.sums, index, &course);
        }
    }

    /// Ends a hold of converters with a filter.
    pub fn read(&mut self) {
        for gathered in &mut self.gathered {
            gathered.sampled = gathered.sums[0];
            gathered.sums.rotate_left(1);
            gathered.sums[MOST_ORDER - 1] = 0.0;
        }
    }

    /// Writes what the converters have sampled.
    pub fn sense(&self, outputs: &mut [f64]) {
        outputs.iter_mut().zip(&self.gathered).for_each(|(output, gathered)| *output = gathered.sampled);
    }

    /// The count of numbers that [`OtherSensors::save`] writes.
    pub fn saved_len(&self, has_filter: bool) -> usize {
        self.channels.len() * if has_filter { 1 + MOST_ORDER } else { 1 }
    }

    /// Writes what was gathered, as much as there is room for.
    pub fn save(&self, mut saved: &mut [f64], has_filter: bool) {
        for gathered in &self.gathered {
            saved = write(saved, &[gathered.sampled]);
            if has_filter {
                saved = write(saved, &gathered.sums);
            }
        }
    }

    /// Takes up what [`OtherSensors::save`] wrote.
    pub fn restore(&mut self, saved: &[f64], has_filter: bool) {
        let each = if has_filter { 1 + MOST_ORDER } else { 1 };
        for (gathered, saved) in self.gathered.iter_mut().zip(saved.chunks_exact(each)) {
            gathered.sampled = saved[0];
            write(&mut gathered.sums, &saved[1..]);
        }
    }
}

/// The value that a sensor of this quantity measures of a motion, in the unit of the quantity.
pub fn instant(quantity: Quantity, at: &Kinematics) -> f64 {
    match quantity {
        Quantity::Velocity => at.velocity,
        Quantity::Displacement | Quantity::Angle => at.displacement,
        _ => at.acceleration,
    }
}
