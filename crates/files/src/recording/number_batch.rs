//! Batches of states and readings, column by column, and conversion of their rows to records.

use core::marker::PhantomData;
use std::sync::Arc;

use prost::bytes::{Buf, BufMut};
use prost::encoding::{self, DecodeContext, WireType};
use prost::{DecodeError, Message};

use super::batch::Batch;
use super::channels::Values;
use super::layout::{DT_S, Layout, STEP};
use super::record::{Clipped, SampleRecord, StateRecord};
use super::schema::Topic;
use resonarm_bench::rig::{MOST_MORE, Readings};
use resonarm_bench::structure::{MOST_STATES, READINGS, States};

/// A record of numbers in the order of the table, with a mark.
pub trait Numbers: Copy + core::fmt::Debug + Send + Sync {
    /// Topic of its batches.
    const TOPIC: Topic;

    /// Index of its sample.
    fn sample(&self) -> u64;
    /// Its numbers, in the order of the table.
    fn values(&self) -> Values;
    /// Returns the mark: whether it is the end of a run, or which readings are clipped.
    fn mark(&self) -> u32;
    /// Makes the record of the numbers in the channels of a layout; `None` if one is invalid.
    fn of(sample: u64, number: impl Fn(usize) -> f64, layout: &Layout, mark: u32) -> Option<Self>;
}

impl Numbers for StateRecord {
    const TOPIC: Topic = Topic::States;

    fn sample(&self) -> u64 {
        self.sample
    }

    fn values(&self) -> Values {
        StateRecord::values(self)
    }

    fn mark(&self) -> u32 {
        self.is_end.into()
    }

    fn of(sample: u64, number: impl Fn(usize) -> f64, layout: &Layout, mark: u32) -> Option<StateRecord> {
        let Layout { moving, taken, .. } = *layout;
        let states = layout.fields.len().checked_sub(taken.len());
        let states = states.filter(|states| (moving..=MOST_STATES).contains(states))?;
        let states = States::written(moving, states, |numbers| {
            let (coordinates, internal) = numbers.split_at_mut(moving);
            coordinates.iter_mut().enumerate().for_each(|(place, to)| *to = number(place));
            internal.iter_mut().enumerate().for_each(|(place, to)| *to = number(moving + taken.len() + place));
        });
        let load = taken.load((moving..).map(number));
        Some(StateRecord { sample, states, load, taken, is_end: mark != 0 })
    }
}

impl Numbers for SampleRecord {
    const TOPIC: Topic = Topic::Samples;

    fn sample(&self) -> u64 {
        self.sample
    }

    fn values(&self) -> Values {
        SampleRecord::values(self)
    }

    fn mark(&self) -> u32 {
        self.clipped_bits()
    }

    fn of(sample: u64, number: impl Fn(usize) -> f64, layout: &Layout, mark: u32) -> Option<SampleRecord> {
        let more = layout.fields.len().checked_sub(READINGS.len()).filter(|more| *more <= MOST_MORE)?;
        let [acceleration_b_m_s2, acceleration_c_m_s2, head_force_n] =
            [0, 2, 4].map(|place| [number(place), number(place + 1)]);
        let clipped = Clipped::from_bits(mark);
        let mut values = [0.0; MOST_MORE];
        let values = &mut values[..more];
        values.iter_mut().zip(READINGS.len()..).for_each(|(value, place)| *value = number(place));
        let more = Readings::new(values, mark >> Clipped::COUNT)?;
        Some(SampleRecord { sample, acceleration_b_m_s2, acceleration_c_m_s2, head_force_n, clipped, more })
    }
}

/// A batch of states or readings, column by column.
#[derive(Clone, Debug)]
pub struct NumberBatch<R> {
    layout: Arc<Layout>,
    first_sample: u64,
    dt_s: f64,
    columns: Vec<Vec<f64>>,
    /// Marks of readings, one a row.
    clipped: Vec<u32>,
    /// The mark of states: the last row is the end of a run.
    ends: bool,
    row: PhantomData<R>,
}

impl<R: Numbers> NumberBatch<R> {
    /// Returns an empty batch for rows of this layout.
    pub fn new(layout: Arc<Layout>) -> NumberBatch<R> {
        let columns = vec![Vec::new(); layout.fields.len()];
        NumberBatch { layout, first_sample: 0, dt_s: 0.0, columns, clipped: Vec::new(), ends: false, row: PhantomData }
    }

    const IS_STATES: bool = matches!(R::TOPIC, Topic::States);

    /// Returns the sample period that it states, s.
    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }

    /// Returns the number of samples with a reading beyond the range of its sensor.
    pub fn clipped_samples(&self) -> usize {
        self.clipped.iter().filter(|bits| **bits != 0).count()
    }
}

impl<R: Numbers> Message for NumberBatch<R> {
    fn encode_raw(&self, buf: &mut impl BufMut) {
        encoding::uint64::encode(STEP, &self.first_sample, buf);
        encoding::double::encode(DT_S, &self.dt_s, buf);
        if self.ends {
            encoding::bool::encode(self.layout.mark, &true, buf);
        }
        encoding::uint32::encode_packed(self.layout.mark, &self.clipped, buf);
        for (field, column) in self.layout.fields.iter().zip(&self.columns) {
            encoding::double::encode_packed(*field, column, buf);
        }
    }

    fn merge_field(
        &mut self,
        tag: u32,
        wire: WireType,
        buf: &mut impl Buf,
        context: DecodeContext,
    ) -> Result<(), DecodeError> {
        if let Some(place) = self.layout.fields.iter().position(|field| *field == tag) {
            return encoding::double::merge_repeated(wire, &mut self.columns[place], buf, context);
        }
        match tag {
            STEP => encoding::uint64::merge(wire, &mut self.first_sample, buf, context),
            DT_S => encoding::double::merge(wire, &mut self.dt_s, buf, context),
            tag if tag != self.layout.mark => encoding::skip_field(wire, tag, buf, context),
            // The mark is one flag for the last row of states, and a column of bits of readings.
            _ if Self::IS_STATES => encoding::bool::merge(wire, &mut self.ends, buf, context),
            _ => encoding::uint32::merge_repeated(wire, &mut self.clipped, buf, context),
        }
    }

    fn encoded_len(&self) -> usize {
        let columns = self.layout.fields.iter().zip(&self.columns);
        encoding::uint64::encoded_len(STEP, &self.first_sample)
            + encoding::double::encoded_len(DT_S, &self.dt_s)
            + if self.ends { encoding::bool::encoded_len(self.layout.mark, &true) } else { 0 }
            + encoding::uint32::encoded_len_packed(self.layout.mark, &self.clipped)
            + columns.map(|(field, column)| encoding::double::encoded_len_packed(*field, column)).sum::<usize>()
    }

    fn clear(&mut self) {
        self.first_sample = 0;
        self.dt_s = 0.0;
        self.ends = false;
        self.clipped.clear();
        self.columns.iter_mut().for_each(Vec::clear);
    }
}

impl<R: Numbers> Batch for NumberBatch<R> {
    type Row = R;
    const TOPIC: Topic = R::TOPIC;

    fn begin(&mut self, first_sample: u64, dt_s: f64) {
        self.clear();
        self.first_sample = first_sample;
        self.dt_s = dt_s;
    }

    fn first_sample(&self) -> u64 {
        self.first_sample
    }

    fn sample(row: &R) -> u64 {
        row.sample()
    }

    fn append(&mut self, row: &R) {
        row.values().iter().zip(&mut self.columns).for_each(|(value, column)| column.push(*value));
        match Self::IS_STATES {
            true => self.ends = row.mark() != 0,
            false => self.clipped.push(row.mark()),
        }
    }

    fn takes(&self, _row: &R) -> bool {
        !self.ends
    }

    fn columns(&self) -> Vec<usize> {
        let marks = (!Self::IS_STATES).then_some(self.clipped.len());
        self.columns.iter().map(Vec::len).chain(marks).collect()
    }

    fn has_known_marks(&self) -> bool {
        let readings = self.columns.len() as u32;
        self.clipped.iter().all(|bits| bits.checked_shr(readings).is_none_or(|unknown| unknown == 0))
    }

    fn row(&self, index: usize) -> Option<R> {
        let columns = &self.columns;
        let sample = self.first_sample.checked_add(index as u64)?;
        columns.iter().all(|column| index < column.len()).then_some(())?;
        let mark = match Self::IS_STATES {
            true => u32::from(self.ends && index + 1 == columns[0].len()),
            false => *self.clipped.get(index)?,
        };
        // Looked up by place and not copied into a row first, since a recording can have millions of rows.
        R::of(sample, |place| columns[place][index], &self.layout, mark)
    }
}
