//! Rows: the numbers of each sample, combined from separate records.

use std::collections::VecDeque;

use resonarm_bench::structure::{self, Channel, Kind, STATES};
use resonarm_dynamics::arm::Load;
use resonarm_files::recording::{SampleRecord, StateRecord};

/// What the numbers of a sample are, in their order: load, readings of the head, accelerations, angles.
const SHOWN: [&Channel; 12] = {
    let (state, reading) = (&STATES, &structure::READINGS);
    [
        &state[4],
        &state[5],
        &state[6],
        &state[7],
        &reading[4],
        &reading[5],
        &reading[0],
        &reading[1],
        &reading[2],
        &reading[3],
        &state[0],
        &state[1],
    ]
};

/// The names of the numbers of a sample.
pub fn names() -> [&'static str; SHOWN.len()] {
    SHOWN.map(|channel| channel.name)
}

/// What the bits that mark clipped readings stand for, the lowest first.
pub fn clipped_bits() -> [&'static str; structure::READINGS.len()] {
    structure::READINGS.map(|channel| channel.name)
}

/// The numbers of a sample; NaN where nothing is known.
pub type Numbers = [f32; SHOWN.len()];

/// The known values of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    pub numbers: Numbers,
    /// Which readings were beyond the range of their sensor, by [`clipped_bits`].
    pub clipped: u32,
}

impl Row {
    /// A sample without any known value, and so without clipped readings.
    pub const UNKNOWN: Row = Row { numbers: [f32::NAN; SHOWN.len()], clipped: 0 };
}

/// The bit for this number of a row among the clipped readings, if it is a reading.
pub fn clipped_bit(channel: usize) -> Option<u32> {
    match SHOWN.get(channel)?.kind {
        Kind::Reading { clip_bit } => Some(1 << clip_bit),
        _ => None,
    }
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
        let ([t1, t2], [fx, fy], [a1, a2]) = (record.torque_nm, record.force_n, record.alpha_rad());
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
            row.clipped = record.clipped.bits();
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
    use resonarm_files::recording::Clipped;

    fn readings(sample: u64) -> SampleRecord {
        let pair = [sample as f64, -1.0];
        let (acceleration_b_m_s2, acceleration_c_m_s2, head_force_n) = (pair, pair, pair);
        SampleRecord { sample, acceleration_b_m_s2, acceleration_c_m_s2, head_force_n, clipped: Clipped::NONE }
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
    fn clipped_readings_are_marked_by_their_bits() {
        let mut rows = Rows::default();
        let [mut clipped, none] = [0, 1].map(readings);
        clipped.clipped = Clipped { acceleration_c: [false, true], head_force: [true, false], ..Clipped::NONE };
        for record in [clipped, none] {
            rows.readings(&record);
            rows.command(record.sample, &Load::default());
        }
        let marked: Vec<u32> = core::iter::from_fn(|| rows.pop()).map(|(_, row)| row.clipped).collect();
        let bit = |name: &str| 1 << clipped_bits().iter().position(|bit| *bit == name).unwrap();
        let both = bit("acceleration_c_y_m_s2") | bit("head_force_x_n");
        assert_eq!(marked, [both, 0]);
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
