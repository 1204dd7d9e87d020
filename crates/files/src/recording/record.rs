//! Records that a run passes to the recorder: small values of fixed size, so that they pass through a ring without
//! allocation.

use resonarm_protocol::Frame;

use super::channels::Values;
use super::schema::Topic;
use resonarm_bench::rig::Load;
use resonarm_bench::rig::Readings;
use resonarm_bench::structure::{LoadSet, States};
use resonarm_realtime::OverrunCause;

/// A record of a run.
///
/// `Name` is the type of an event's name: `&'static str` on the way in, so that a record needs no allocation, and
/// [`String`] when read back.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "most records are states, and a box allocates for each")]
pub enum Record<Name = &'static str> {
    /// The states of the structure at a sample and the load held over it.
    State(StateRecord),
    /// Readings of the sensors at a sample.
    Sample(SampleRecord),
    /// A frame on the bus.
    Frame(FrameRecord),
    /// Punctuality of a tick of the real-time loop.
    Tick(TickRecord),
    /// An event: a state change, a fault, an overrun.
    Event(Event<Name>),
}

impl<Name> Record<Name> {
    /// Returns the index of its sample.
    pub const fn sample(&self) -> u64 {
        match self {
            Record::State(record) => record.sample,
            Record::Sample(record) => record.sample,
            Record::Frame(record) => record.sample,
            Record::Tick(record) => record.sample,
            Record::Event(record) => record.sample,
        }
    }

    /// Returns the topic in which it is recorded.
    pub const fn topic(&self) -> Topic {
        match self {
            Record::State(_) => Topic::States,
            Record::Sample(_) => Topic::Samples,
            Record::Frame(_) => Topic::Frames,
            Record::Tick(_) => Topic::Ticks,
            Record::Event(_) => Topic::Events,
        }
    }

    /// Returns its numbers in the order of the channels of its topic; none for frames, ticks and events.
    pub fn values(&self) -> Values {
        match self {
            Record::State(record) => record.values(),
            Record::Sample(record) => record.values(),
            Record::Frame(_) | Record::Tick(_) | Record::Event(_) => Values::new(&[]),
        }
    }
}

/// The structure at sample `sample`, and the load held (zero-order) from `sample` to `sample + 1`.
///
/// They alone allow a bit-identical re-simulation of the run: states and load of a sample give the states of the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateRecord {
    /// Index of the sample; sample k is at k times the sample period.
    pub sample: u64,
    /// Coordinates, their rates, and states of devices and elements, in the order of the recording's channels; for the
    /// arm α1, α2, α̇1, α̇2, and the current in the coil of its shaker.
    pub states: States,
    /// The load: torques at joints, N·m, and the force of the exciter, N; for a shaker, its blocked force.
    pub load: Load,
    /// The parts of the load that the plant accepts, and a recording has.
    pub taken: LoadSet,
    /// Whether this is the end of the run: no step starts here, so the load is not held, and is 0 without a meaning.
    pub is_end: bool,
}

impl StateRecord {
    /// Its numbers in the order of [`Topic::States`](super::Topic::States).
    pub fn values(&self) -> Values {
        self.values_with(&self.load)
    }

    /// Returns its numbers with another load.
    pub(super) fn values_with(&self, load: &Load) -> Values {
        let mut values = Values::new(&[self.states.moving()]);
        self.taken.parts(load).for_each(|part| values.push(part));
        self.states.internal().iter().for_each(|state| values.push(*state));
        values
    }
}

/// Readings of the sensors at sample `sample`: after range, noise and quantisation, before the scaling of a protocol.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleRecord {
    /// Index of the sample.
    pub sample: u64,
    /// Acceleration of point B along x and y, m/s².
    pub acceleration_b_m_s2: [f64; 2],
    /// Acceleration of point C along x and y, m/s².
    pub acceleration_c_m_s2: [f64; 2],
    /// Force in the impedance head at C along x and y, N.
    pub head_force_n: [f64; 2],
    /// The readings that are beyond the range of their sensor.
    pub clipped: Clipped,
    /// The readings of the other sensors, with their own marks.
    pub more: Readings,
}

impl SampleRecord {
    /// Its numbers in the order of [`Topic::Samples`](super::Topic::Samples).
    pub fn values(&self) -> Values {
        let SampleRecord { acceleration_b_m_s2, acceleration_c_m_s2, head_force_n, more, .. } = self;
        Values::new(&[acceleration_b_m_s2, acceleration_c_m_s2, head_force_n, more.values()])
    }

    /// Returns which of its numbers are clipped, one bit each in their order.
    pub fn clipped_bits(&self) -> u32 {
        // The six readings of every rig come first, so their bits are the same in all recordings.
        self.clipped.bits() | self.more.clipped() << Clipped::COUNT
    }
}

/// The readings of a sample that are beyond the range of their sensor, so that the value is the last within it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clipped {
    /// Acceleration of point B along x and y.
    pub acceleration_b: [bool; 2],
    /// Acceleration of point C along x and y.
    pub acceleration_c: [bool; 2],
    /// Force in the impedance head along x and y.
    pub head_force: [bool; 2],
}

impl Clipped {
    /// No reading is clipped.
    pub const NONE: Clipped =
        Clipped { acceleration_b: [false; 2], acceleration_c: [false; 2], head_force: [false; 2] };

    /// The number of bits.
    pub const COUNT: usize = 6;

    /// Returns the marks one by one: of B, of C, of the head, x before y.
    pub(crate) fn marks(self) -> [bool; 6] {
        let [b_x, b_y] = self.acceleration_b;
        let [c_x, c_y] = self.acceleration_c;
        let [x, y] = self.head_force;
        [b_x, b_y, c_x, c_y, x, y]
    }

    /// Returns the bits in the file: 0 and 1 for B, 2 and 3 for C, 4 and 5 for the head, x before y.
    pub fn bits(self) -> u32 {
        self.marks().into_iter().enumerate().map(|(bit, clipped)| u32::from(clipped) << bit).sum()
    }

    /// Makes the marks from the bits in the file; bits beyond [`Clipped::COUNT`] are those of other sensors.
    pub(super) fn from_bits(bits: u32) -> Clipped {
        let pair = |bit: u32| [bits >> bit & 1 == 1, bits >> (bit + 1) & 1 == 1];
        Clipped { acceleration_b: pair(0), acceleration_c: pair(2), head_force: pair(4) }
    }

    /// Says whether any reading is clipped.
    pub fn any(self) -> bool {
        self != Clipped::NONE
    }
}

/// Direction of a frame, seen from the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Received from the bus.
    Received,
    /// Sent to the bus.
    Sent,
}

/// A frame and its times on the bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRecord {
    /// The sample in which the frame took effect (received) or which it describes (sent).
    pub sample: u64,
    /// Direction of the frame.
    pub direction: Direction,
    /// Time at which the run loop handled it, nanoseconds since the start of the run.
    pub time_ns: u64,
    /// Time at which the kernel or the adapter saw it, nanoseconds of the UNIX epoch, where known.
    pub bus_timestamp_ns: Option<u64>,
    /// The frame as it was sent or received.
    pub frame: Frame,
}

/// One tick of the real-time loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickRecord {
    /// Index of the sample.
    pub sample: u64,
    /// Delay of the loop's waking after the tick's deadline, ns.
    pub wakeup_ns: u64,
    /// Execution time of the tick, ns.
    pub exec_ns: u64,
    /// Deadlines missed since the tick before: 0 when on time.
    pub overruns: u32,
    /// Cause of the missed deadlines; `None` if none was missed, and in old recordings without causes.
    pub cause: Option<OverrunCause>,
}

/// An event at a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event<Name = &'static str> {
    /// Index of the sample.
    pub sample: u64,
    /// Time of the event, nanoseconds since the start of the run.
    pub time_ns: u64,
    /// Short stable name, for example `state.fault`.
    pub name: Name,
    /// Number that belongs to it (a fault code, a count), 0 if it has none.
    pub value: i64,
}
