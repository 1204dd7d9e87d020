//! Rows: the numbers of each sample, combined from separate records.

use std::collections::VecDeque;

use crate::arm::Load;
use crate::recording::{Clipped, SampleRecord, StateRecord};

/// The names of a sample's numbers, in order.
pub const CHANNELS: [&str; 12] = [
    "torque1_nm",
    "torque2_nm",
    "force_x_n",
    "force_y_n",
    "head_force_x_n",
    "head_force_y_n",
    "acceleration_b_x_m_s2",
    "acceleration_b_y_m_s2",
    "acceleration_c_x_m_s2",
    "acceleration_c_y_m_s2",
    "alpha1_rad",
    "alpha2_rad",
];

/// The readings that the bits of clipped readings refer to, the lowest first: the order of recordings.
pub const CLIPPED_BITS: [&str; 6] = [
    "acceleration_b_x_m_s2",
    "acceleration_b_y_m_s2",
    "acceleration_c_x_m_s2",
    "acceleration_c_y_m_s2",
    "head_force_x_n",
    "head_force_y_n",
];

/// The numbers of a sample; NaN where unknown.
pub type Numbers = [f32; CHANNELS.len()];

/// The known values of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    pub numbers: Numbers,
    /// Which readings were beyond the range of their sensor, by [`CLIPPED_BITS`]; `None` if unknown.
    pub clipped: Option<u32>,
}

impl Row {
    /// A sample without any known value, and so without clipped readings.
    pub const UNKNOWN: Row = Row { numbers: [f32::NAN; CHANNELS.len()], clipped: Some(0) };
}

/// The bit for this number of a row among the clipped readings, if it is a reading.
pub fn clipped_bit(channel: usize) -> Option<u32> {
    let name = CHANNELS.get(channel)?;
    CLIPPED_BITS.iter().position(|bit| bit == name).map(|bit| 1 << bit)
}

/// The readings clipped in either of two samples; `None` if unknown for one of them.
pub fn clipped_in_either(one: Option<u32>, other: Option<u32>) -> Option<u32> {
    one.zip(other).map(|(one, other)| one | other)
}

/// A row waits for its other half until there are this many newer rows.
const LONGEST_WAIT: usize = 2048;

const LOAD: u8 = 1;
const READINGS: u8 = 2;

#[derive(Clone, Copy, Debug)]
struct Pending {
    sample: u64,
    row: Row,
    known: u8,
}

/// Incomplete rows: load and state of a sample come apart from its readings.
#[derive(Debug, Default)]
pub struct Rows {
    pending: VecDeque<Pending>,
    /// The sample after the last handed out.
    next: u64,
    /// No more data come for samples before this one.
    settled: u64,
    restarted: bool,
}

impl Rows {
    /// Takes a state with its load. The load at the end of a run is meaningless.
    pub fn state(&mut self, record: &StateRecord) {
        let ([t1, t2], [fx, fy], [a1, a2]) = (record.torque_nm, record.force_n, record.alpha_rad);
        let load = if record.is_end { [f64::NAN; 4] } else { [t1, t2, fx, fy] };
        self.put(record.sample, LOAD, &[(0, &load), (10, &[a1, a2])]);
    }

    /// Takes the load that an exciter commands.
    pub fn command(&mut self, sample: u64, load: &Load) {
        let (t, f) = (load.torque_nm, load.force_n);
        self.put(sample, LOAD, &[(0, &[t.x, t.y, f.x, f.y])]);
    }

    /// Takes the readings of a sample.
    pub fn readings(&mut self, record: &SampleRecord) {
        let places: [(usize, &[f64]); 3] =
            [(4, &record.head_force_n), (6, &record.acceleration_b_m_s2), (8, &record.acceleration_c_m_s2)];
        if let Some(row) = self.put(record.sample, READINGS, &places) {
            row.clipped = record.clipped.map(Clipped::bits);
        }
    }

    /// Writes numbers into the row of a sample. A sample before those returned begins another series.
    fn put(&mut self, sample: u64, known: u8, places: &[(usize, &[f64])]) -> Option<&mut Row> {
        if sample < self.next {
            *self = Rows { pending: VecDeque::new(), next: sample, settled: 0, restarted: true };
        }
        let at = self.pending.partition_point(|pending| pending.sample < sample);
        if self.pending.get(at).is_none_or(|pending| pending.sample != sample) {
            self.pending.insert(at, Pending { sample, row: Row::UNKNOWN, known: 0 });
        }
        let pending = self.pending.get_mut(at)?;
        pending.known |= known;
        for (first, values) in places {
            let numbers = pending.row.numbers.iter_mut().skip(*first);
            numbers.zip(*values).for_each(|(number, value)| *number = *value as f32);
        }
        Some(&mut pending.row)
    }

    /// No more data come for this sample and those before it.
    pub fn settle(&mut self, sample: u64) {
        self.settled = sample + 1;
    }

    /// The next row that is complete, or gets no more data, or has waited long enough.
    pub fn pop(&mut self) -> Option<(u64, Row)> {
        let is_due = self.pending.len() > LONGEST_WAIT;
        let is_over = |first: &Pending| is_due || first.sample < self.settled || first.known == LOAD | READINGS;
        let first = *self.pending.front().filter(|first| is_over(first))?;
        self.pending.pop_front();
        self.next = first.sample + 1;
        Some((first.sample, first.row))
    }

    /// Whether another series has begun since the last call.
    pub fn take_restarted(&mut self) -> bool {
        core::mem::take(&mut self.restarted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(sample: u64) -> SampleRecord {
        let pair = [sample as f64, -1.0];
        let (acceleration_b_m_s2, acceleration_c_m_s2, head_force_n) = (pair, pair, pair);
        SampleRecord { sample, acceleration_b_m_s2, acceleration_c_m_s2, head_force_n, clipped: None }
    }

    #[test]
    fn halves_are_combined_in_any_order() {
        let mut rows = Rows::default();
        rows.readings(&readings(0));
        rows.readings(&readings(1));
        assert_eq!(rows.pop(), None);
        rows.command(1, &Load::force_n(2.0, 3.0));
        assert_eq!(rows.pop(), None, "sample 0 comes first");
        rows.command(0, &Load::force_n(1.0, 0.0));
        let (sample, row) = rows.pop().unwrap();
        assert_eq!((sample, row.numbers[2], row.numbers[4]), (0, 1.0, 0.0));
        assert!(row.numbers[10].is_nan());
        let (sample, row) = rows.pop().unwrap();
        assert_eq!((sample, &row.numbers[2..6]), (1, &[2.0, 3.0, 1.0, -1.0][..]));
    }

    #[test]
    fn clipped_readings_have_their_bits() {
        let mut rows = Rows::default();
        let [mut clipped, none, not_told] = [0, 1, 2].map(readings);
        clipped.clipped = Some(Clipped { acceleration_c: [false, true], head_force: [true, false], ..Clipped::NONE });
        for record in [clipped, SampleRecord { clipped: Some(Clipped::NONE), ..none }, not_told] {
            rows.readings(&record);
            rows.command(record.sample, &Load::default());
        }
        let clipped: Vec<Option<u32>> = core::iter::from_fn(|| rows.pop()).map(|(_, row)| row.clipped).collect();
        let bit = |name: &str| 1 << CLIPPED_BITS.iter().position(|bit| *bit == name).unwrap();
        let both = bit("acceleration_c_y_m_s2") | bit("head_force_x_n");
        assert_eq!(clipped, [Some(both), Some(0), None]);
    }

    #[test]
    fn half_a_row_is_returned_in_the_end_and_an_earlier_sample_starts_over() {
        let mut rows = Rows::default();
        (0..=LONGEST_WAIT as u64).for_each(|sample| rows.readings(&readings(sample)));
        assert_eq!(rows.pop().map(|(sample, _)| sample), Some(0));
        assert_eq!(rows.pop(), None);
        assert!(!rows.take_restarted());
        rows.settle(2);
        assert_eq!([1, 2].map(|_| rows.pop().map(|(sample, _)| sample)), [Some(1), Some(2)]);
        assert_eq!(rows.pop(), None);
        rows.readings(&readings(0));
        rows.command(0, &Load::default());
        assert!(rows.take_restarted() && !rows.take_restarted());
        assert_eq!(rows.pop().map(|(sample, _)| sample), Some(0));
        assert_eq!(rows.pop(), None);
    }
}
