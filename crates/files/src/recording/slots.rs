//! Stores records in a ring of small slots: a record of many states takes several, so that the others stay short to
//! copy.

use core::convert::Infallible;

use resonarm_bench::rig::{MOST_MORE, Readings};
use resonarm_bench::structure::{LoadSet, States};

use super::channels::{MOST_NUMBERS, Values};
use super::record::{Clipped, Event, FrameRecord, Record, SampleRecord, StateRecord, TickRecord};

/// Loads and states in the first slot: those of the arm with a coil.
const FIRST: usize = 9;
/// Loads and states, or readings, in each slot after it.
// Twelve numbers keep a slot no longer than that of a CAN FD frame, which is the longest other content.
const NEXT: usize = 12;

/// The most slots of a record.
pub const MOST_SLOTS: usize = 1 + (MOST_NUMBERS - FIRST).div_ceil(NEXT);

/// A record, a part of one, or another value of the ring's owner.
#[derive(Clone, Copy, Debug)]
pub struct Slot<Other = Infallible>(Content<Other>);

#[derive(Clone, Copy, Debug)]
enum Content<Other> {
    State(Head),
    /// Loads and states of the record that began before.
    States([f64; NEXT]),
    Sample(SampleHead),
    /// Readings of the sample that began before.
    Readings([f64; NEXT]),
    Frame(FrameRecord),
    Tick(TickRecord),
    Event(Event),
    Other(Other),
}

/// Entry of a ring: a record of the run, or another value, which is not recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Entry<'a, Other = Infallible> {
    /// A record of the run.
    Record(&'a Record),
    /// A value that is not part of the recording.
    Other(Other),
}

/// The beginning of a record of states.
#[derive(Clone, Copy, Debug)]
struct Head {
    sample: u64,
    /// The loads that the plant takes, then the states.
    first: [f64; FIRST],
    taken: LoadSet,
    moving: u8,
    count: u8,
    is_end: bool,
}

/// The beginning of a record of readings: what every rig has.
#[derive(Clone, Copy, Debug)]
struct SampleHead {
    sample: u64,
    acceleration_b_m_s2: [f64; 2],
    acceleration_c_m_s2: [f64; 2],
    head_force_n: [f64; 2],
    clipped: Clipped,
    /// Marks and number of the others.
    more_clipped: u32,
    more: u8,
}

/// Returns how many slots a record takes.
fn slots_for(record: &Record) -> usize {
    match record {
        Record::State(state) => 1 + (state.taken.len() + state.states.len()).saturating_sub(FIRST).div_ceil(NEXT),
        Record::Sample(sample) => 1 + sample.more.values().len().div_ceil(NEXT),
        Record::Frame(_) | Record::Tick(_) | Record::Event(_) => 1,
    }
}

/// Returns the first of these numbers, padded with zeros.
#[inline(always)]
fn padded<const N: usize>(numbers: impl IntoIterator<Item = f64>) -> [f64; N] {
    let mut padded = [0.0; N];
    padded.iter_mut().zip(numbers).for_each(|(to, number)| *to = number);
    padded
}

/// Returns the numbers of a record of states in the order of the slots.
#[inline(always)]
fn loads_and_states(state: &StateRecord) -> impl Iterator<Item = f64> {
    state.taken.parts(&state.load).chain(state.states.iter().copied())
}

/// Returns the first slot of a record.
#[inline(always)]
fn first<Other>(record: &Record) -> Slot<Other> {
    Slot(match record {
        Record::State(state) => Content::State(Head {
            sample: state.sample,
            first: padded(loads_and_states(state)),
            taken: state.taken,
            moving: state.states.moving().len() as u8,
            count: state.states.len() as u8,
            is_end: state.is_end,
        }),
        Record::Sample(sample) => Content::Sample(SampleHead {
            sample: sample.sample,
            acceleration_b_m_s2: sample.acceleration_b_m_s2,
            acceleration_c_m_s2: sample.acceleration_c_m_s2,
            head_force_n: sample.head_force_n,
            clipped: sample.clipped,
            more_clipped: sample.more.clipped(),
            more: sample.more.values().len() as u8,
        }),
        Record::Frame(frame) => Content::Frame(*frame),
        Record::Tick(tick) => Content::Tick(*tick),
        Record::Event(event) => Content::Event(*event),
    })
}

/// Appends a record, whole or not at all. Returns whether there was room. Neither allocates nor waits.
#[inline(always)]
pub fn push<Other>(ring: &mut rtrb::Producer<Slot<Other>>, record: &Record) -> bool {
    match record {
        Record::State(state) if state.taken.len() + state.states.len() > FIRST => {
            let mut rest = Values::new(&[]);
            loads_and_states(state).skip(FIRST).for_each(|number| rest.push(number));
            push_many(ring, record, &rest, Content::States)
        }
        Record::Sample(sample) if !sample.more.values().is_empty() => {
            push_many(ring, record, sample.more.values(), Content::Readings)
        }
        _ => ring.push(first(record)).is_ok(),
    }
}

/// Appends another value. Returns whether there was room. Neither allocates nor waits.
#[inline(always)]
pub fn push_other<Other>(ring: &mut rtrb::Producer<Slot<Other>>, other: Other) -> bool {
    ring.push(Slot(Content::Other(other))).is_ok()
}

/// Appends a record whose numbers beyond the first slot are `rest`.
fn push_many<Other>(
    ring: &mut rtrb::Producer<Slot<Other>>,
    record: &Record,
    rest: &[f64],
    content: fn([f64; NEXT]) -> Content<Other>,
) -> bool {
    // All slots are reserved at once and become visible together, so a reader never sees a part of a record.
    let Ok(chunk) = ring.write_chunk_uninit(slots_for(record)) else { return false };
    let rest = rest.chunks(NEXT).map(|numbers| Slot(content(padded(numbers.iter().copied()))));
    chunk.fill_from_iter(core::iter::once(first(record)).chain(rest));
    true
}

/// Says whether there is no room for a record.
pub(super) fn is_full<Other>(ring: &rtrb::Producer<Slot<Other>>, record: &Record) -> bool {
    ring.slots() < slots_for(record)
}

/// Passes the next entry to `hand`, if there is one. The parts of a record are in the ring together.
pub fn pop<Other, R>(ring: &mut rtrb::Consumer<Slot<Other>>, hand: impl FnOnce(Entry<'_, Other>) -> R) -> Option<R> {
    loop {
        let record = match ring.pop().ok()?.0 {
            Content::State(head) => Record::State(state(ring, &head)?),
            Content::Sample(head) => Record::Sample(SampleRecord {
                sample: head.sample,
                acceleration_b_m_s2: head.acceleration_b_m_s2,
                acceleration_c_m_s2: head.acceleration_c_m_s2,
                head_force_n: head.head_force_n,
                clipped: head.clipped,
                more: readings(ring, &head)?,
            }),
            Content::Frame(frame) => Record::Frame(frame),
            Content::Tick(tick) => Record::Tick(tick),
            Content::Event(event) => Record::Event(event),
            Content::Other(other) => return Some(hand(Entry::Other(other))),
            // Without its beginning it is no record.
            Content::States(_) | Content::Readings(_) => continue,
        };
        return Some(hand(Entry::Record(&record)));
    }
}

/// Passes the next record of a ring that has nothing else to `hand`.
pub(super) fn pop_record<R>(ring: &mut rtrb::Consumer<Slot>, hand: impl FnOnce(&Record) -> R) -> Option<R> {
    pop(ring, |entry| match entry {
        Entry::Record(record) => hand(record),
        Entry::Other(never) => match never {},
    })
}

/// Returns the record of states that begins with this head; `None` if a part is missing.
// Inlined, as the value is long to hand over.
#[inline(always)]
fn state<Other>(ring: &mut rtrb::Consumer<Slot<Other>>, head: &Head) -> Option<StateRecord> {
    let mut numbers = [0.0; MOST_NUMBERS];
    let loads = head.taken.len();
    let numbers = numbers.get_mut(..loads + usize::from(head.count))?;
    let (begin, rest) = numbers.split_at_mut(FIRST.min(numbers.len()));
    begin.iter_mut().zip(head.first).for_each(|(to, number)| *to = number);
    for part in rest.chunks_mut(NEXT) {
        // The parts of a record became visible together, so the next slot is here at once and need not be waited for.
        let Ok(Slot(Content::States(states))) = ring.pop() else { return None };
        part.iter_mut().zip(states).for_each(|(to, number)| *to = number);
    }
    let (loads, states) = numbers.split_at(loads);
    let states = States::written(head.moving.into(), head.count.into(), |to| to.copy_from_slice(states));
    let load = head.taken.load(loads.iter().copied());
    Some(StateRecord { sample: head.sample, states, load, taken: head.taken, is_end: head.is_end })
}

/// Returns the readings beyond those of the first slot; `None` if a part is missing.
#[inline(always)]
fn readings<Other>(ring: &mut rtrb::Consumer<Slot<Other>>, head: &SampleHead) -> Option<Readings> {
    let mut values = [0.0; MOST_MORE];
    let values = values.get_mut(..usize::from(head.more))?;
    for part in values.chunks_mut(NEXT) {
        let Ok(Slot(Content::Readings(numbers))) = ring.pop() else { return None };
        part.iter_mut().zip(numbers).for_each(|(to, number)| *to = number);
    }
    Readings::new(values, head.more_clipped)
}

#[cfg(test)]
mod tests {
    use super::*;
    use resonarm_bench::structure::{LOADS, MOST_STATES};

    fn record(sample: u64, moving: usize, internal: usize) -> Record {
        let number = |index: usize| sample as f64 + index as f64 / 128.0;
        let numbers: Vec<f64> = (0..moving + internal).map(number).collect();
        let states = States::new(&numbers[..moving], &numbers[moving..]).unwrap();
        state_record(sample, states, LoadSet::NATIVE)
    }

    fn state_record(sample: u64, states: States, taken: LoadSet) -> Record {
        let load = taken.load((1..).map(f64::from));
        Record::State(StateRecord { sample, states, load, taken, is_end: sample == 3 })
    }

    /// Returns a record of as many numbers as there can be.
    fn longest() -> Record {
        let numbers: Vec<f64> = (0..MOST_STATES).map(|place| place as f64 + 0.25).collect();
        let states = States::new(&numbers[..64], &numbers[64..]).unwrap();
        state_record(5, states, LoadSet::native_and(0..LOADS.len()))
    }

    #[test]
    fn records_of_any_length_come_out_as_they_went_in() {
        let tick = TickRecord { sample: 7, wakeup_ns: 1, exec_ns: 2, overruns: 0, cause: None };
        let (mut into, mut out) = rtrb::RingBuffer::<Slot>::new(64);
        let sample = |more: usize| {
            let numbers: Vec<f64> = (0..more).map(|place| place as f64 - 0.5).collect();
            Record::Sample(SampleRecord {
                sample: 5,
                acceleration_b_m_s2: [1.0, 2.0],
                acceleration_c_m_s2: [3.0, 4.0],
                head_force_n: [5.0, 6.0],
                clipped: Clipped { head_force: [true, false], ..Clipped::NONE },
                more: Readings::new(&numbers, u32::from(more > 0) << more.saturating_sub(1)).unwrap(),
            })
        };
        let wide = [sample(0), sample(1), sample(NEXT), sample(MOST_MORE), record(4, 64, 17), longest()];
        let others = [record(1, 4, 0), record(2, 4, 1), Record::Tick(tick), record(3, 16, 16)];
        let records = [&others[..], &wide[..]].concat();
        for _turn in 0..3 {
            assert!(records.iter().all(|record| !is_full(&into, record) && push(&mut into, record)));
            records.iter().for_each(|record| assert_eq!(pop_record(&mut out, |got| got == record), Some(true)));
            assert_eq!(pop_record(&mut out, |_| ()), None);
        }
    }

    #[test]
    fn a_record_without_room_is_left_out_whole() {
        let (mut into, mut out) = rtrb::RingBuffer::<Slot>::new(MOST_SLOTS + 1);
        let [wide, arm] = [longest(), record(2, 4, 0)];
        assert!(push(&mut into, &wide) && is_full(&into, &wide) && !push(&mut into, &wide) && push(&mut into, &arm));
        let mut next = || pop_record(&mut out, |record| *record);
        assert_eq!([next(), next(), next()], [Some(wide), Some(arm), None]);
    }

    #[test]
    fn a_slot_is_no_longer_than_a_frame_needs() {
        assert!(size_of::<Slot>() <= size_of::<FrameRecord>() + 8, "{}", size_of::<Slot>());
    }
}
