//! Rows: the numbers of each sample, combined from separate records.

use std::collections::VecDeque;

use serde::Serialize;

use resonarm_bench::rig::{Load, MOST_JOINTS};
use resonarm_bench::structure::{self, Axis, Channel, Kind, LOADS, LoadSet, NATIVE_LOADS, OUTPUTS, Quantity};
use resonarm_files::recording::channels::Channels;
use resonarm_files::recording::{SampleRecord, StateRecord, Topic};

/// The first of two numbers each: the load's torques and its force, the force in the head, the accelerations.
pub const TORQUE: usize = 0;
pub const FORCE: usize = 2;
pub const HEAD: usize = 4;
pub const ACCELERATION_B: usize = 6;
pub const ACCELERATION_C: usize = 8;
/// Place of the first coordinate, after loads and outputs.
pub const COORDINATES: usize = NATIVE_LOADS.len() + OUTPUTS.len();

/// A number of each sample that a panel plots.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plotted {
    /// Index of the number among the channels.
    pub channel: usize,
    /// Name of the number in the legend.
    pub label: String,
    /// Unit of the number.
    pub unit: &'static str,
}

/// Numbers of a sample that are shown, in their order: load, readings of the head, accelerations, coordinates, states
/// of elements, readings of the sensors beside B and C, loads that not every plant takes.
#[derive(Clone, Debug)]
pub struct Shown {
    channels: Vec<Channel>,
    /// Number of coordinates of the structure.
    coordinates: usize,
    /// The places of the elements' states among what belongs to devices and elements.
    internal: Vec<usize>,
    /// Number of readings of the sensors beside B and C.
    sensors: usize,
    /// The places among [`LOADS`] of the loads that not every plant takes.
    loads: Vec<usize>,
}

impl Shown {
    /// Makes the description for states and readings of these channels.
    pub fn new(table: &Channels) -> Shown {
        Shown::of(table.of(Topic::States), table.of(Topic::Samples))
    }

    fn of(states: &[Channel], readings: &[Channel]) -> Shown {
        let states = || states.iter();
        let moving = || states().filter(|channel| channel.kind == Kind::State);
        // A state is the coordinates, then as many rates. Rates are not shown.
        let coordinates = moving().count() / 2;
        let is_shown = |channel: &Channel| {
            matches!(channel.point, structure::Point::Element(_))
                && matches!(channel.quantity, Quantity::Angle | Quantity::Length)
        };
        let internal = states().filter(|channel| channel.kind == Kind::Internal).enumerate();
        let (internal, elements): (Vec<usize>, Vec<Channel>) =
            internal.filter(|(_, channel)| is_shown(channel)).map(|(place, channel)| (place, *channel)).unzip();
        let sensors = readings.get(OUTPUTS.len()..).unwrap_or_default();
        let channels =
            NATIVE_LOADS.into_iter().chain(OUTPUTS).chain(moving().take(coordinates).copied()).chain(elements);
        let loads: Vec<usize> = (0..LOADS.len())
            .filter(|place| !LoadSet::NATIVE.has(*place) && states().any(|channel| channel.name == LOADS[*place].name))
            .collect();
        let others = loads.iter().map(|place| LOADS[*place]);
        let channels = channels.chain(sensors.iter().copied()).chain(others).collect();
        Shown { channels, coordinates, internal, sensors: sensors.len(), loads }
    }

    /// The names of the numbers.
    pub fn names(&self) -> Vec<String> {
        self.channels.iter().map(|channel| channel.name.to_string()).collect()
    }

    /// The first reading of the sensors beside B and C.
    fn first_sensor(&self) -> usize {
        self.first_load() - self.sensors
    }

    /// The first load that not every plant takes.
    fn first_load(&self) -> usize {
        self.channels.len() - self.loads.len()
    }

    /// The loads of a quantity that not every plant takes, for panels: torques with the number of their joint, the force
    /// with its axis.
    pub fn other_loads(&self, quantity: Quantity) -> Vec<Plotted> {
        let of_quantity = |(_, place): &(usize, &usize)| LOADS[**place].quantity == quantity;
        let label = |place: usize| if place < MOST_JOINTS { format!("torque {}", place + 1) } else { "load z".into() };
        let all = (self.first_load()..).zip(&self.loads).filter(of_quantity);
        all.map(|(channel, place)| self.plotted(channel, label(*place))).collect()
    }

    /// Names of the readings that the bits of clipped readings stand for, the lowest bit first.
    pub fn clipped_bits(&self) -> Vec<String> {
        let sensors = self.channels.iter().skip(self.first_sensor()).take(self.sensors);
        structure::READINGS.iter().chain(sensors).map(|channel| channel.name.to_string()).collect()
    }

    /// The readings of the sensors beside B and C for panels: each with the name of its sensor and its axis.
    pub fn sensors(&self) -> Vec<Plotted> {
        let label = |place: usize| match (self.channels[place].point, self.channels[place].axis) {
            (structure::Point::Sensor { name, .. }, axis @ (Axis::X | Axis::Y | Axis::Z)) => {
                format!("{name} {}", axis.name())
            }
            (structure::Point::Sensor { name, .. }, _) => name.to_string(),
            _ => self.channels[place].name.to_string(),
        };
        (self.first_sensor()..self.first_load()).map(|place| self.plotted(place, label(place))).collect()
    }

    /// A number for a panel.
    pub fn plotted(&self, channel: usize, label: String) -> Plotted {
        Plotted { channel, label, unit: self.channels.get(channel).map_or("", |channel| channel.quantity.unit()) }
    }

    /// The coordinates for panels.
    pub fn coordinates(&self) -> Vec<Plotted> {
        self.labelled(COORDINATES..COORDINATES + self.coordinates)
    }

    /// The states of elements for panels.
    pub fn elements(&self) -> Vec<Plotted> {
        self.labelled(COORDINATES + self.coordinates..self.first_sensor())
    }

    fn labelled(&self, places: core::ops::Range<usize>) -> Vec<Plotted> {
        places.map(|place| self.plotted(place, label(self.channels[place].point))).collect()
    }
}

/// A coordinate, or the state of an element, as panels call it.
fn label(point: structure::Point) -> String {
    match point {
        structure::Point::Joint1 => subscripted('\u{3b1}', 1),
        structure::Point::Joint2B => subscripted('\u{3b1}', 2),
        structure::Point::Joint(joint) => subscripted('\u{3b1}', joint),
        structure::Point::Mode(mode) => subscripted('q', mode),
        structure::Point::Coordinate(coordinate) => subscripted('x', coordinate),
        structure::Point::Element(element) => format!("element {element}"),
        structure::Point::TipC => String::from("C"),
        structure::Point::Sensor { name, .. } => name.to_string(),
    }
}

/// A symbol with a number as its subscript.
fn subscripted(symbol: char, number: impl ToString) -> String {
    // U+2080 to U+2089 are the digits as subscripts.
    let subscript = |digit: char| digit.to_digit(10).and_then(|digit| char::from_u32(0x2080 + digit));
    core::iter::once(symbol).chain(number.to_string().chars().filter_map(subscript)).collect()
}

/// The numbers of a sample; NaN where nothing is known.
pub type Numbers = Box<[f32]>;

/// The known values of a sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub numbers: Numbers,
    /// Readings that were beyond the range of their sensor, by [`Shown::clipped_bits`].
    pub clipped: u32,
}

impl Row {
    /// A sample without any known value of `count`, and so without clipped readings.
    pub fn unknown(count: usize) -> Row {
        Row { numbers: vec![f32::NAN; count].into(), clipped: 0 }
    }
}

/// The bit for this number of a row among the clipped readings, if it is a reading.
pub fn clipped_bit(channel: usize) -> Option<u32> {
    match OUTPUTS.get(channel.checked_sub(NATIVE_LOADS.len())?)?.kind {
        Kind::Reading { clip_bit } => Some(1 << clip_bit),
        _ => None,
    }
}

/// A row waits for its other half until there are this many newer rows.
const LONGEST_WAIT: usize = 2048;

const LOAD: u8 = 1;
const READINGS: u8 = 2;

#[derive(Clone, Debug)]
struct Pending {
    sample: u64,
    row: Row,
    known: u8,
}

/// Incomplete rows: load and state of a sample come apart from its readings.
#[derive(Debug)]
pub struct Rows {
    shown: Shown,
    pending: VecDeque<Pending>,
    /// The sample after the last handed out.
    next: u64,
    /// No more data come for samples before this one.
    settled: u64,
    restarted: bool,
}

impl Rows {
    /// Returns rows without any sample.
    pub fn new(shown: Shown) -> Rows {
        Rows { shown, pending: VecDeque::new(), next: 0, settled: 0, restarted: false }
    }

    /// Drops all samples, as for a new series.
    pub fn restart(&mut self) {
        *self = Rows::new(self.shown.clone());
    }

    /// Takes a state with its load. The load at the end of a run is meaningless.
    pub fn state(&mut self, record: &StateRecord) {
        let (load, others) = self.loads(&record.load);
        let load = if record.is_end { [f64::NAN; 4] } else { load };
        let others = if record.is_end { vec![f64::NAN; others.len()] } else { others };
        let elements = COORDINATES + self.shown.coordinates;
        let internal = record.states.internal();
        let of_elements = self.shown.internal.iter().map(|place| internal.get(*place).copied().unwrap_or(f64::NAN));
        let of_elements: Vec<f64> = of_elements.collect();
        let places = [
            (TORQUE, &load[..]),
            (COORDINATES, record.states.coordinates()),
            (elements, &of_elements),
            (self.shown.first_load(), &others),
        ];
        self.put(record.sample, LOAD, &places);
    }

    /// Takes the load that an exciter commands.
    pub fn command(&mut self, sample: u64, load: &Load) {
        let (load, others) = self.loads(load);
        self.put(sample, LOAD, &[(TORQUE, &load), (self.shown.first_load(), &others)]);
    }

    /// The parts of a load that every plant takes, and the others that this one takes.
    fn loads(&self, load: &Load) -> ([f64; NATIVE_LOADS.len()], Vec<f64>) {
        let parts = load.parts();
        (load.native_parts(), self.shown.loads.iter().map(|place| parts[*place]).collect())
    }

    /// Takes the readings of a sample.
    pub fn readings(&mut self, record: &SampleRecord) {
        let places: [(usize, &[f64]); 4] = [
            (HEAD, &record.head_force_n),
            (ACCELERATION_B, &record.acceleration_b_m_s2),
            (ACCELERATION_C, &record.acceleration_c_m_s2),
            (self.shown.first_sensor(), record.more.values()),
        ];
        if let Some(row) = self.put(record.sample, READINGS, &places) {
            row.clipped = record.clipped_bits();
        }
    }

    /// Writes numbers into the row of a sample. A sample before those returned begins another series.
    fn put(&mut self, sample: u64, known: u8, places: &[(usize, &[f64])]) -> Option<&mut Row> {
        // A sample older than those handed out begins another series.
        if sample < self.next {
            self.restart();
            self.next = sample;
            self.restarted = true;
        }
        // Kept in the order of samples, though records of one kind may come behind those of the other.
        let at = self.pending.partition_point(|pending| pending.sample < sample);
        if self.pending.get(at).is_none_or(|pending| pending.sample != sample) {
            self.pending.insert(at, Pending { sample, row: Row::unknown(self.shown.channels.len()), known: 0 });
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
        // A row whose other record was lost must not hold up all later ones.
        let is_due = self.pending.len() > LONGEST_WAIT;
        let is_over = |first: &Pending| is_due || first.sample < self.settled || first.known == LOAD | READINGS;
        self.pending.front().filter(|first| is_over(first))?;
        let first = self.pending.pop_front()?;
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
    use resonarm_bench::rig::Readings;
    use resonarm_files::recording::Clipped;

    fn rows() -> Rows {
        Rows::new(Shown::new(&Channels::arm(true)))
    }

    fn readings(sample: u64) -> SampleRecord {
        let pair = [sample as f64, -1.0];
        let acceleration_b_m_s2 = pair;
        let acceleration_c_m_s2 = pair;
        let head_force_n = pair;
        SampleRecord {
            sample,
            acceleration_b_m_s2,
            acceleration_c_m_s2,
            head_force_n,
            clipped: Clipped::NONE,
            more: Readings::NONE,
        }
    }

    #[test]
    fn halves_are_combined_in_any_order() {
        let mut rows = rows();
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

    /// Rows of two modes with two elements, the first without a state: coordinates, then the state; branches are left
    /// out.
    #[test]
    fn rows_have_coordinates_and_states_of_elements() {
        use resonarm_bench::structure::{
            Coordinates, LoadSet, States, branch_channel, coordinate_channels, element_channel,
        };
        let mut states = coordinate_channels(Coordinates::Modes, 2);
        states.extend(element_channel(1, false));
        states.extend([0, 1].into_iter().filter_map(branch_channel));
        let mut rows = Rows::new(Shown::of(&states, &[]));
        assert_eq!(rows.shown.names()[COORDINATES..], ["q1_m_sqrt_kg", "q2_m_sqrt_kg", "element2_m"]);
        let states = States::new(&[1.0, 2.0, 3.0, 4.0], &[5.0, 1.0, -1.0]).unwrap();
        rows.state(&StateRecord {
            sample: 0,
            states,
            load: Load::force_n(6.0, 7.0),
            taken: LoadSet::NATIVE,
            is_end: false,
        });
        rows.readings(&readings(0));
        let (_, row) = rows.pop().unwrap();
        assert_eq!((&row.numbers[FORCE..HEAD], &row.numbers[COORDINATES..]), (&[6.0, 7.0][..], &[1.0, 2.0, 5.0][..]));
    }

    #[test]
    fn clipped_readings_are_marked_by_their_bits() {
        let mut rows = rows();
        let [mut clipped, none] = [0, 1].map(readings);
        clipped.clipped = Clipped { acceleration_c: [false, true], head_force: [true, false], ..Clipped::NONE };
        for record in [clipped, none] {
            rows.readings(&record);
            rows.command(record.sample, &Load::default());
        }
        let marked: Vec<u32> = core::iter::from_fn(|| rows.pop()).map(|(_, row)| row.clipped).collect();
        let names = rows.shown.clipped_bits();
        let bit = |name: &str| 1 << names.iter().position(|bit| *bit == name).unwrap();
        let both = bit("acceleration_c_y_m_s2") | bit("head_force_x_n");
        assert_eq!(marked, [both, 0]);
    }

    #[test]
    fn half_a_row_is_returned_in_the_end_and_an_earlier_sample_starts_over() {
        let mut rows = rows();
        // One row more than the queue holds, and none of them complete.
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
