//! Gathers frames into messages, and takes them apart again.
//!
//! A message for each frame would be 60 % of a file: its head and index entry alone take 47 bytes. In columns the
//! repeating identifiers, lengths and times take a quarter of a byte a frame, and bytes of one meaning compress: 12
//! bytes a sample with classic frames, where payloads one after the other take 24.

use resonarm_protocol::{Frame, FrameFormat, Id};

use super::record::{Direction, FrameRecord};
use super::schema::proto::FrameBatch;
use super::schema::proto::frame_batch::Direction as Way;

/// Most frames in a batch: so many arrive in the time of a batch only on a bus that another node jams.
const MOST_FRAMES: usize = 4096;
/// Most frames in a batch that are accepted: with their payloads taken apart they are 64 times as large as in the file.
const MOST_FRAMES_READ: usize = 1 << 16;
/// Longest payload, bytes (ISO 11898-1, CAN FD).
const LONGEST_DATA: usize = 64;

/// Bits of the column `flags`.
mod flag {
    pub const EXTENDED: u32 = 1 << 0;
    pub const REMOTE: u32 = 1 << 1;
    pub const FD: u32 = 1 << 2;
    pub const BIT_RATE_SWITCH: u32 = 1 << 3;
    pub const ERROR_STATE: u32 = 1 << 4;
    pub const TIMED: u32 = 1 << 5;
    pub const ALL: u32 = (1 << 6) - 1;
}

/// Gathers frames until there are enough, or their samples span more than a batch does.
#[derive(Debug)]
pub struct FrameBatcher {
    frames: Vec<FrameRecord>,
    batch: FrameBatch,
    samples: u64,
}

impl FrameBatcher {
    /// Makes a batcher of the frames of at most `samples` samples on the bus `interface`.
    pub fn new(samples: u32, interface: &str) -> FrameBatcher {
        let batch = FrameBatch { interface: interface.to_string(), ..FrameBatch::default() };
        FrameBatcher { frames: Vec::new(), batch, samples: samples.into() }
    }

    /// Says whether `frame` can't be appended before the batch is taken.
    pub fn must_take_before(&self, frame: &FrameRecord) -> bool {
        self.frames.len() == MOST_FRAMES
            || self.frames.first().is_some_and(|first| {
                frame.sample.checked_sub(first.sample).is_none_or(|distance| distance >= self.samples)
            })
    }

    /// Appends a frame to the batch.
    pub fn append(&mut self, frame: &FrameRecord) {
        self.frames.push(*frame);
    }

    /// Returns the sample of the first frame and the batch, if it holds a frame; the next frame starts another.
    pub fn take(&mut self) -> Option<(u64, &FrameBatch)> {
        let first = self.frames.first()?.sample;
        fill(&mut self.batch, &self.frames);
        self.frames.clear();
        Some((first, &self.batch))
    }
}

/// Fills the columns of a batch with `frames`.
fn fill(batch: &mut FrameBatch, frames: &[FrameRecord]) {
    difference(&mut batch.step_difference, frames.iter().map(|record| record.sample));
    difference(&mut batch.time_difference_ns, frames.iter().map(|record| record.time_ns));
    difference(&mut batch.bus_timestamp_difference_ns, frames.iter().filter_map(|record| record.bus_timestamp_ns));
    column(&mut batch.direction, frames.iter().map(|record| way(record.direction).into()));
    column(&mut batch.id, frames.iter().map(|record| record.frame.id().raw()));
    column(&mut batch.flags, frames.iter().map(flags));
    column(&mut batch.length, frames.iter().map(|record| record.frame.len() as u32));
    batch.data.clear();
    let data = &mut batch.data;
    let payloads: Vec<&[u8]> = frames.iter().map(|record| record.frame.data()).collect();
    by_column(&batch.id, |row| payloads[row].len(), |row, place| data.push(payloads[row][place]));
}

/// Visits every byte of every payload, as row and place, in their order in the column `data`: by ascending identifier
/// the first bytes of all rows, then the second, and so on. So bytes of one meaning are adjacent.
fn by_column(ids: &[u32], length: impl Fn(usize) -> usize, mut visit: impl FnMut(usize, usize)) {
    let mut rows: Vec<usize> = (0..ids.len()).collect();
    rows.sort_by_key(|row| ids[*row]); // stable: rows of one identifier stay in order
    for rows in rows.chunk_by(|one, other| ids[*one] == ids[*other]) {
        let longest = rows.iter().map(|row| length(*row)).max().unwrap_or(0);
        for place in 0..longest {
            rows.iter().filter(|row| length(**row) > place).for_each(|row| visit(*row, place));
        }
    }
}

fn column<T>(column: &mut Vec<T>, values: impl Iterator<Item = T>) {
    column.clear();
    column.extend(values);
}

/// Appends the differences d_i = x_i − x_{i−1} with x_{−1} = 0, modulo 2⁶⁴; so x_i = d_0 + … + d_i.
fn difference(differences: &mut Vec<i64>, values: impl Iterator<Item = u64>) {
    let mut before = 0;
    column(differences, values.map(|value| value.wrapping_sub(core::mem::replace(&mut before, value)) as i64));
}

/// Returns the values with these differences.
fn sums(differences: &[i64]) -> impl Iterator<Item = u64> {
    differences.iter().scan(0_u64, |value, difference| {
        *value = value.wrapping_add(*difference as u64);
        Some(*value)
    })
}

fn way(direction: Direction) -> Way {
    match direction {
        Direction::Received => Way::Received,
        Direction::Sent => Way::Sent,
    }
}

fn direction(way: i32) -> Result<Direction, String> {
    match Way::try_from(way) {
        Ok(Way::Received) => Ok(Direction::Received),
        Ok(Way::Sent) => Ok(Direction::Sent),
        _ => Err(format!("a frame of direction {way}")),
    }
}

fn flags(record: &FrameRecord) -> u32 {
    let set = |flag: u32, is: bool| if is { flag } else { 0 };
    let format = match record.frame.format() {
        FrameFormat::Classic => 0,
        FrameFormat::Remote => flag::REMOTE,
        FrameFormat::Fd { bit_rate_switch, error_state_indicator } => {
            flag::FD | set(flag::BIT_RATE_SWITCH, bit_rate_switch) | set(flag::ERROR_STATE, error_state_indicator)
        }
    };
    let extended = matches!(record.frame.id(), Id::Extended(_));
    format | set(flag::EXTENDED, extended) | set(flag::TIMED, record.bus_timestamp_ns.is_some())
}

/// Passes the frames of a batch to `visit`, in order. The error describes an invalid batch.
pub(super) fn batch(batch: &FrameBatch, mut visit: impl FnMut(FrameRecord)) -> Result<(), String> {
    let rows = batch.id.len();
    let lengths = [batch.step_difference.len(), batch.time_difference_ns.len(), batch.direction.len()];
    if lengths.into_iter().chain([batch.flags.len(), batch.length.len()]).any(|length| length != rows) {
        return Err(format!("a batch of frames with columns of different lengths, {rows} rows in `id`"));
    }
    if rows > MOST_FRAMES_READ {
        return Err(format!("a batch of {rows} frames, more than the limit of {MOST_FRAMES_READ}"));
    }
    let payloads = payloads(batch)?;
    let mut bus_timestamps = sums(&batch.bus_timestamp_difference_ns);
    let times = sums(&batch.step_difference).zip(sums(&batch.time_difference_ns));
    for (row, (sample, time_ns)) in times.enumerate() {
        let flags = batch.flags[row];
        // A flag that this version does not know may change what the frame means, so it is not ignored.
        if flags & !flag::ALL != 0 {
            return Err(format!("a frame with flags {flags:#x}"));
        }
        let bus_timestamp_ns = match flags & flag::TIMED {
            0 => None,
            _ => Some(bus_timestamps.next().ok_or("a batch of frames with too few bus timestamps")?),
        };
        let frame = frame(batch.id[row], flags, batch.length[row], &payloads[row])?;
        visit(FrameRecord { sample, direction: direction(batch.direction[row])?, time_ns, bus_timestamp_ns, frame });
    }
    match bus_timestamps.next() {
        None => Ok(()),
        Some(_) => Err(String::from("a batch of frames with too many bus timestamps")),
    }
}

/// Returns the payload of each frame, from the columns of bytes.
fn payloads(batch: &FrameBatch) -> Result<Vec<[u8; LONGEST_DATA]>, String> {
    let length = |row: usize| match batch.flags[row] & flag::REMOTE {
        // A remote frame states a length and has no data.
        0 => batch.length[row] as usize,
        _ => 0,
    };
    if let Some(length) = (0..batch.id.len()).map(length).find(|length| *length > LONGEST_DATA) {
        return Err(format!("a frame of {length} bytes"));
    }
    // Checked before the bytes are distributed, so that `next` below always has one.
    let expected: usize = (0..batch.id.len()).map(length).sum();
    if batch.data.len() != expected {
        return Err(format!("a batch of frames with {} bytes of payload, expected {expected}", batch.data.len()));
    }
    let mut payloads = vec![[0; LONGEST_DATA]; batch.id.len()];
    let mut bytes = batch.data.iter();
    by_column(&batch.id, length, |row, place| payloads[row][place] = bytes.next().copied().unwrap_or_default());
    Ok(payloads)
}

/// Makes the frame with the first `length` bytes of `payload`.
fn frame(id: u32, flags: u32, length: u32, payload: &[u8; LONGEST_DATA]) -> Result<Frame, String> {
    let is = |flag: u32| flags & flag != 0;
    let id = match (is(flag::EXTENDED), u16::try_from(id)) {
        (true, _) => Id::Extended(id),
        (false, Ok(id)) => Id::Standard(id),
        (false, Err(_)) => return Err(format!("a standard frame with identifier {id:#x}")),
    };
    let bit_rate_switch = is(flag::BIT_RATE_SWITCH);
    let error_state_indicator = is(flag::ERROR_STATE);
    let format = match (is(flag::FD), is(flag::REMOTE), bit_rate_switch || error_state_indicator) {
        (true, false, _) => FrameFormat::Fd { bit_rate_switch, error_state_indicator },
        (false, true, false) => FrameFormat::Remote,
        (false, false, false) => FrameFormat::Classic,
        _ => return Err(format!("a frame with flags {flags:#x}")),
    };
    let data = payload.get(..length as usize).ok_or_else(|| format!("a frame of {length} bytes"))?;
    Frame::new(id, format, data).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::any;

    use super::*;

    /// Returns a batch of two frames: 3 bytes, then 2 with a bus timestamp.
    fn two() -> FrameBatch {
        let record = |sample, id, data: &[u8], bus_timestamp_ns| FrameRecord {
            sample,
            direction: Direction::Sent,
            time_ns: 1000 * sample,
            bus_timestamp_ns,
            frame: Frame::classic(Id::Standard(id), data).unwrap(),
        };
        let mut batch = FrameBatch::default();
        fill(&mut batch, &[record(5, 0x205, &[1, 2, 3], None), record(6, 0x203, &[4, 5], Some(7))]);
        batch
    }

    #[test]
    fn columns_stand_by_identifier_and_place() {
        let batch = FrameBatch {
            interface: String::new(),
            step_difference: vec![5, 1],
            time_difference_ns: vec![5000, 1000],
            direction: vec![2, 2],
            id: vec![0x205, 0x203],
            flags: vec![0, flag::TIMED],
            length: vec![3, 2],
            bus_timestamp_difference_ns: vec![7],
            data: vec![4, 5, 1, 2, 3],
        };
        assert_eq!(two(), batch);
    }

    proptest::proptest! {
        /// Columns of any values are rejected, or are those of the frames that they contain.
        #[test]
        fn any_columns_are_refused_or_come_back(
            rows in proptest::collection::vec((any::<i64>(), any::<i64>(), 0..4, 0..0x900_u32, 0..80_u32, 0..70_u32), 0..6),
            bus_timestamp_difference_ns in proptest::collection::vec(any::<i64>(), 0..4),
            data in proptest::collection::vec(any::<u8>(), 0..40),
        ) {
            let columns = FrameBatch {
                interface: String::new(),
                step_difference: rows.iter().map(|row| row.0).collect(),
                time_difference_ns: rows.iter().map(|row| row.1).collect(),
                direction: rows.iter().map(|row| row.2).collect(),
                id: rows.iter().map(|row| row.3).collect(),
                flags: rows.iter().map(|row| row.4).collect(),
                length: rows.iter().map(|row| row.5).collect(),
                bus_timestamp_difference_ns,
                data,
            };
            let mut frames = Vec::new();
            if batch(&columns, |frame| frames.push(frame)).is_ok() {
                let mut again = FrameBatch::default();
                fill(&mut again, &frames);
                assert_eq!(again, columns);
            }
        }
    }

    /// A few bytes, compressed, may state any number of frames without a payload.
    #[test]
    fn a_batch_of_more_frames_than_a_recorder_writes_is_refused() {
        let rows = MOST_FRAMES_READ + 1;
        let differences = vec![0; rows];
        let columns = FrameBatch {
            step_difference: differences.clone(),
            time_difference_ns: differences,
            direction: vec![1; rows],
            id: vec![0; rows],
            flags: vec![0; rows],
            length: vec![0; rows],
            ..FrameBatch::default()
        };
        insta::assert_snapshot!(batch(&columns, |_| {}).unwrap_err(), @"a batch of 65537 frames, more than the limit of 65536");
    }

    #[test]
    fn a_batch_that_contradicts_itself_is_refused() {
        let error = |change: fn(&mut FrameBatch)| {
            let mut changed = two();
            change(&mut changed);
            batch(&changed, |_| {}).unwrap_err()
        };
        insta::assert_snapshot!(error(|batch| batch.length.push(0)), @"a batch of frames with columns of different lengths, 2 rows in `id`");
        insta::assert_snapshot!(error(|batch| batch.data.push(0)), @"a batch of frames with 6 bytes of payload, expected 5");
        insta::assert_snapshot!(error(|batch| batch.length[0] = 4), @"a batch of frames with 5 bytes of payload, expected 6");
        insta::assert_snapshot!(error(|batch| batch.length[0] = u32::MAX), @"a frame of 4294967295 bytes");
        insta::assert_snapshot!(error(|batch| batch.direction[0] = 0), @"a frame of direction 0");
        insta::assert_snapshot!(error(|batch| batch.flags[0] = 64), @"a frame with flags 0x40");
        insta::assert_snapshot!(error(|batch| batch.flags[0] = flag::ERROR_STATE), @"a frame with flags 0x10");
        insta::assert_snapshot!(error(|batch| batch.flags[0] = flag::TIMED), @"a batch of frames with too few bus timestamps");
        insta::assert_snapshot!(error(|batch| batch.flags[1] = 0), @"a batch of frames with too many bus timestamps");
        insta::assert_snapshot!(error(|batch| batch.id[0] = 0x10205), @"a standard frame with identifier 0x10205");
        insta::assert_snapshot!(error(|batch| batch.id[0] = 0x905), @"identifier 0x905 does not fit 11 bits (at most 0x7FF)");
    }
}
