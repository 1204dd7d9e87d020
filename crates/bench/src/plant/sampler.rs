//! What the converters sample: the force in the impedance head, and the motion that every sensor reads.

use alloc::vec;
use alloc::vec::Vec;

use super::sampling::{Course, Filter};
use super::write;
use crate::rig::converter::MOST_ORDER;
use crate::structure::{Channel, OUTPUTS, Quantity};
use resonarm_dynamics::structure::Kinematics;

/// The number of the head's channels, which come before those of the sensors.
const HEAD: usize = 2;

/// What one channel has gathered: its last sample, and partial sums of a filter for the readings after this hold and
/// the next ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Gathered {
    sampled: f64,
    sums: [f64; MOST_ORDER],
}

/// How the current in a coil differs over a step from what [`Sampler::start`] and [`Sampler::end`] were read with, A: at
/// both ends, and the transient at the start.
#[derive(Clone, Copy, Debug)]
pub(super) struct CurrentChange {
    pub ends_a: [f64; 2],
    pub transient_a: f64,
}

/// The converters of all channels. The motion at both ends of a step is read into [`Sampler::start`] and
/// [`Sampler::end`], which have one entry for each degree of freedom that a sensor reads: B x, y; C x, y; then the other
/// sensors in the order of their channels.
#[derive(Clone, Debug)]
pub(super) struct Sampler {
    /// `None` of converters that sample an instant.
    filter: Option<Filter>,
    /// Head x, y; B x, y; C x, y; the other sensors.
    channels: Vec<Channel>,
    gathered: Vec<Gathered>,
    /// What was gathered at the start of a hold, to which a hold that can't be finished returns.
    before: Vec<Gathered>,
    pub start: Vec<Kinematics>,
    pub end: Vec<Kinematics>,
    /// The accelerations at both ends by each ampere in a coil, 1/A times their unit; zeros without a coil.
    pub start_per_ampere: Vec<f64>,
    pub end_per_ampere: Vec<f64>,
}

impl Sampler {
    /// The converters of a rig with these sensors beside B and C.
    pub fn new(filter: Option<Filter>, others: &[Channel]) -> Sampler {
        let channels = [&OUTPUTS[..], others].concat();
        let count = channels.len();
        let dofs = channels.len() - HEAD;
        Sampler {
            filter,
            channels,
            gathered: vec![Gathered::default(); count],
            before: vec![Gathered::default(); count],
            start: vec![Kinematics::default(); dofs],
            end: vec![Kinematics::default(); dofs],
            start_per_ampere: vec![0.0; dofs],
            end_per_ampere: vec![0.0; dofs],
        }
    }

    /// The filter of the converters, if they have one.
    pub fn filter(&self) -> Option<&Filter> {
        self.filter.as_ref()
    }

    /// The channels in their order: head x, y; B x, y; C x, y; the other sensors.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Begins a hold: keeps what was gathered, for a hold that fails.
    pub fn begin(&mut self) {
        self.before.copy_from_slice(&self.gathered);
    }

    /// Returns to the start of the hold.
    pub fn undo(&mut self) {
        self.gathered.copy_from_slice(&self.before);
    }

    /// Makes the end of a step the start of the next.
    pub fn step_on(&mut self) {
        core::mem::swap(&mut self.start, &mut self.end);
        core::mem::swap(&mut self.start_per_ampere, &mut self.end_per_ampere);
    }

    /// Sets the accelerations at the start of the first step of a hold from the velocities and the accelerations that
    /// were read at both ends.
    pub fn begin_step(&mut self, acceleration: impl Fn([f64; 2], [f64; 2]) -> f64) {
        for (start, end) in self.start.iter_mut().zip(&self.end) {
            start.acceleration = acceleration([start.velocity, end.velocity], [start.acceleration, end.acceleration]);
        }
    }

    /// Samples the head's force, N, and the motion in [`Sampler::end`], as converters without a filter do.
    pub fn sample(&mut self, head_n: [f64; HEAD]) {
        let motions = self.channels[HEAD..].iter().zip(&self.end).map(|(channel, at)| instant(channel.quantity, at));
        let sampled = head_n.into_iter().chain(motions);
        self.gathered.iter_mut().zip(sampled).for_each(|(gathered, sampled)| gathered.sampled = sampled);
    }

    /// Settles the converters, as if they had always sampled the head's force, N, and the motion in [`Sampler::end`].
    pub fn settle(&mut self, head_n: [f64; HEAD]) {
        self.sample(head_n);
        if let Some(filter) = &self.filter {
            self.gathered.iter_mut().for_each(|gathered| gathered.sums = filter.settled(gathered.sampled));
        }
    }

    /// Adds step `index` of a hold, from [`Sampler::start`] to [`Sampler::end`], to the sums of the filter: with the
    /// head's force over the step, N, and, of a structure with a coil, its current.
    pub fn add(&mut self, index: usize, head_n: &[Course; HEAD], change: Option<CurrentChange>) {
        let Some(filter) = &self.filter else { return };
        let (head, sensors) = self.gathered.split_at_mut(HEAD);
        head.iter_mut().zip(head_n).for_each(|(gathered, course)| filter.add(&mut gathered.sums, index, course));
        let ends = self.start.iter().zip(&self.end);
        let per_ampere = self.start_per_ampere.iter().zip(&self.end_per_ampere);
        let sensors = sensors.iter_mut().zip(&self.channels[HEAD..]);
        for (((gathered, channel), (start, end)), (start_per_ampere, end_per_ampere)) in
            sensors.zip(ends).zip(per_ampere)
        {
            let mut from = start.acceleration;
            let mut to = end.acceleration;
            let mut transient = 0.0;
            if let Some(CurrentChange { ends_a, transient_a }) = change {
                from += start_per_ampere * ends_a[0];
                to += end_per_ampere * ends_a[1];
                transient = start_per_ampere * transient_a;
            }
            let acceleration = filter.course([(start.velocity, from), (end.velocity, to)], transient);
            let course = match channel.quantity {
                Quantity::Velocity => filter.velocity(start.velocity, acceleration),
                Quantity::Displacement | Quantity::Angle => {
                    filter.displacement((start.displacement, start.velocity), acceleration)
                }
                _ => acceleration,
            };
            filter.add(&mut gathered.sums, index, &course);
        }
    }

    /// Ends a hold: the sums of a filter that are complete become the samples.
    pub fn end_hold(&mut self) {
        if self.filter.is_none() {
            return;
        }
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

    /// How many numbers of a channel are saved: its sample, and the sums of a filter.
    fn saved_of_channel(&self) -> usize {
        if self.filter.is_some() { 1 + MOST_ORDER } else { 1 }
    }

    /// The count of numbers that [`Sampler::save`] writes.
    pub fn saved_len(&self) -> usize {
        self.channels.len() * self.saved_of_channel()
    }

    /// Writes what was gathered, as much as there is room for.
    pub fn save(&self, mut saved: &mut [f64]) {
        let sums = self.saved_of_channel() - 1;
        for gathered in &self.gathered {
            saved = write(saved, &[gathered.sampled]);
            saved = write(saved, &gathered.sums[..sums]);
        }
    }

    /// Takes up what [`Sampler::save`] wrote.
    pub fn restore(&mut self, saved: &[f64]) {
        let numbers = saved.chunks_exact(self.saved_of_channel());
        for (gathered, numbers) in self.gathered.iter_mut().zip(numbers) {
            gathered.sampled = numbers[0];
            write(&mut gathered.sums, &numbers[1..]);
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
