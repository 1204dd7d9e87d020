//! Gathers rows of consecutive samples into one message, and takes them apart again.

use alloc::vec::Vec;

use super::record::TickRecord;
use super::schema::Topic;
use super::schema::proto::TickBatch;
use super::schema::proto::tick_batch::Cause;
use resonarm_realtime::OverrunCause;

/// A message that holds one row for each of a number of consecutive samples, column by column.
pub trait Batch: prost::Message {
    /// Record of which one row is made.
    type Row: Copy;

    /// Topic of the messages.
    const TOPIC: Topic;

    /// Makes an empty batch for samples from `first_sample` on.
    fn begin(&mut self, first_sample: u64, dt_s: f64);
    /// Index of the first sample.
    fn first_sample(&self) -> u64;
    /// Sample of a row.
    fn sample(row: &Self::Row) -> u64;
    /// Appends a row, which must be that of the next sample.
    fn append(&mut self, row: &Self::Row);
    /// Length of every column.
    fn columns(&self) -> Vec<usize>;
    /// Returns row `index`, if every column has it.
    fn row(&self, index: usize) -> Option<Self::Row>;

    /// Says whether the row can follow the rows of the batch.
    fn takes(&self, _row: &Self::Row) -> bool {
        true
    }

    /// Says whether every mark and cause has a known number.
    fn has_known_marks(&self) -> bool;

    /// Returns the samples of the first row and of the last, if it has a row. The error describes columns of different
    /// lengths, an unknown mark, or samples that run out of range.
    fn samples(&self) -> Result<Option<(u64, u64)>, String> {
        let columns = self.columns();
        let first = self.first_sample();
        let length = columns.iter().copied().max().unwrap_or(0);
        let Some(further) = length.checked_sub(1) else { return Ok(None) };
        // Of columns with different lengths nobody knows which numbers belong together, so no row of such a batch is
        // used.
        let is_good = columns.iter().all(|column| *column == length) && self.has_known_marks();
        match first.checked_add(further as u64).filter(|_| is_good) {
            Some(last) => Ok(Some((first, last))),
            None => Err(self.wrong()),
        }
    }

    /// Describes a damaged batch by its first sample and the lengths of its columns.
    fn wrong(&self) -> String {
        format!("a batch from sample {} with columns of {:?} rows", self.first_sample(), self.columns())
    }

    /// Passes all rows to `visit`, in order. Errors: as of [`Batch::samples`].
    fn rows(&self, mut visit: impl FnMut(Self::Row)) -> Result<(), String> {
        let Some((first, last)) = self.samples()? else { return Ok(()) };
        (0..=(last - first) as usize).try_for_each(|index| self.row(index).map(&mut visit)).ok_or_else(|| self.wrong())
    }
}

/// Gathers rows until a batch is full or the samples stop being consecutive.
#[derive(Debug)]
pub struct Batcher<B> {
    batch: B,
    rows: u32,
    limit: u32,
    dt_s: f64,
}

impl<B: Batch> Batcher<B> {
    /// Makes a batcher that gathers at most `limit` rows, `dt_s` apart, in `batch`, which is empty.
    pub fn new(batch: B, limit: u32, dt_s: f64) -> Batcher<B> {
        Batcher { batch, rows: 0, limit, dt_s }
    }

    /// Says whether `row` can't be appended before the batch is taken.
    pub fn must_take_before(&self, row: &B::Row) -> bool {
        self.rows == self.limit
            || (self.rows > 0 && !self.batch.takes(row))
            // Only the first sample is in the message; the others follow from their rows, so a gap needs another
            // batch.
            || (self.rows > 0 && self.batch.first_sample().checked_add(u64::from(self.rows)) != Some(B::sample(row)))
    }

    /// Appends a row to the batch.
    pub fn append(&mut self, row: &B::Row) {
        if self.rows == 0 {
            self.batch.begin(B::sample(row), self.dt_s);
        }
        self.batch.append(row);
        self.rows += 1;
    }

    /// Returns the batch, if it holds a row; the next row starts another.
    pub fn take(&mut self) -> Option<&B> {
        let rows = core::mem::take(&mut self.rows);
        (rows > 0).then_some(&self.batch)
    }
}

impl Batch for TickBatch {
    type Row = TickRecord;
    const TOPIC: Topic = Topic::Ticks;

    fn begin(&mut self, first_sample: u64, _dt_s: f64) {
        prost::Message::clear(self);
        self.first_step = first_sample;
    }

    fn first_sample(&self) -> u64 {
        self.first_step
    }

    fn sample(row: &TickRecord) -> u64 {
        row.sample
    }

    fn append(&mut self, row: &TickRecord) {
        self.wakeup_ns.push(row.wakeup_ns);
        self.exec_ns.push(row.exec_ns);
        self.overruns.push(row.overruns);
        self.cause.push(cause_number(row.cause));
    }

    fn columns(&self) -> Vec<usize> {
        // Older recordings have no column of causes.
        let cause = (!self.cause.is_empty()).then_some(self.cause.len());
        [self.wakeup_ns.len(), self.exec_ns.len(), self.overruns.len()].into_iter().chain(cause).collect()
    }

    fn has_known_marks(&self) -> bool {
        self.cause.iter().all(|number| cause_of(*number).is_some())
    }

    fn row(&self, index: usize) -> Option<TickRecord> {
        let cause = match self.cause.as_slice() {
            [] => None,
            column => cause_of(*column.get(index)?)?,
        };
        Some(TickRecord {
            sample: self.first_step.checked_add(index as u64)?,
            wakeup_ns: *self.wakeup_ns.get(index)?,
            exec_ns: *self.exec_ns.get(index)?,
            overruns: *self.overruns.get(index)?,
            cause,
        })
    }
}

/// Returns the number of a cause in the file.
fn cause_number(cause: Option<OverrunCause>) -> i32 {
    let number = match cause {
        None => Cause::None,
        Some(OverrunCause::WokeLate) => Cause::WokeLate,
        Some(OverrunCause::StepLong) => Cause::StepLong,
        Some(OverrunCause::BusLong) => Cause::BusLong,
    };
    number.into()
}

/// Returns the cause with a number in the file; `None` if there is no such number.
fn cause_of(number: i32) -> Option<Option<OverrunCause>> {
    let causes = core::iter::once(None).chain(OverrunCause::ALL.map(Some));
    causes.into_iter().find(|cause| cause_number(*cause) == number)
}
