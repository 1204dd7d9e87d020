//! The channels of a recording, by topic.

use core::ops::Deref;

use super::schema::Topic;
use resonarm_bench::structure::{Channel, Kind, LOADS, LoadSet, MOST_STATES, READINGS, STATES, Structure};

/// The channels of a plant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channels {
    states: Vec<Channel>,
    readings: Vec<Channel>,
}

impl Channels {
    /// Returns the channels of the two-link arm, with or without the coil of a shaker.
    pub fn arm(has_coil: bool) -> Channels {
        let states = STATES.into_iter().filter(|channel| has_coil || channel.kind != Kind::Internal).collect();
        Channels { states, readings: READINGS.into() }
    }

    /// Returns the channels of a structure: coordinates and rates, loads, states of devices; and the readings of its
    /// outputs.
    pub fn of_structure(structure: &dyn Structure) -> Channels {
        Channels::new(structure.states(), structure.inputs(), structure.outputs())
    }

    /// Returns the channels of a plant with these states, loads and outputs, each in the order in which the plant has
    /// them.
    pub fn new(states: &[Channel], loads: LoadSet, outputs: &[Channel]) -> Channels {
        let (coordinates, devices): (Vec<Channel>, Vec<Channel>) =
            states.iter().partition(|channel| channel.kind == Kind::State);
        let states = [&coordinates[..], &loads.channels(), &devices].concat();
        let mut readings = outputs.to_vec();
        readings.sort_by_key(|channel| match channel.kind {
            Kind::Reading { clip_bit } => clip_bit,
            Kind::State | Kind::Load | Kind::Internal => u32::MAX,
        });
        Channels { states, readings }
    }

    /// Sets the channels of a topic.
    pub(super) fn set(&mut self, topic: Topic, channels: &[Channel]) {
        match topic {
            Topic::Samples => self.readings = channels.to_vec(),
            _ => self.states = channels.to_vec(),
        }
    }

    /// Returns the vectors of a topic: the name and the components of each.
    pub fn vectors(&self, topic: Topic) -> impl Iterator<Item = (&str, &[Channel])> {
        self.of(topic).chunk_by(|one, next| one.vector == next.vector).map(|vector| (vector[0].vector.as_str(), vector))
    }

    /// Returns the channels in the batches of a topic, in order; empty for frames, ticks and events.
    pub fn of(&self, topic: Topic) -> &[Channel] {
        match topic {
            Topic::States => &self.states,
            Topic::Samples => &self.readings,
            _ => &[],
        }
    }
}

impl Default for Channels {
    fn default() -> Channels {
        Channels::arm(false)
    }
}

/// The numbers of a record in the order of its channels.
#[derive(Clone, Copy, Debug)]
pub struct Values {
    numbers: [f64; MOST_NUMBERS],
    count: usize,
}

/// The most numbers of a record: all states and loads.
pub(super) const MOST_NUMBERS: usize = MOST_STATES + LOADS.len();

impl Values {
    /// Makes the numbers of these vectors, in order, at most [`MOST_NUMBERS`].
    pub(super) fn new(vectors: &[&[f64]]) -> Values {
        let mut values = Values { numbers: [0.0; MOST_NUMBERS], count: 0 };
        for vector in vectors {
            let end = values.count + vector.len();
            if let Some(to) = values.numbers.get_mut(values.count..end) {
                to.copy_from_slice(vector);
                values.count = end;
            }
        }
        values
    }

    /// Appends a number, if there is room.
    pub(super) fn push(&mut self, number: f64) {
        if let Some(to) = self.numbers.get_mut(self.count) {
            *to = number;
            self.count += 1;
        }
    }
}

impl Deref for Values {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        self.numbers.get(..self.count).unwrap_or(&self.numbers)
    }
}
