//! The one table of channels: everything that names, orders or describes a state, a load or a reading takes it from
//! here.

use alloc::borrow::Cow;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use core::borrow::Borrow;
use core::fmt::{self, Write};
use core::ops::Deref;

use serde::{Serialize, Serializer};

use super::states::{MOST_COORDINATES, MOST_ELEMENTS};
use crate::rig::load::Load;
use crate::rig::measurement::Measurement;
use crate::rig::name::InstrumentName;
use crate::rig::readings::MOST_MORE;
use crate::rig::sensor::Measured;

/// The most bytes of the name of a channel.
const MOST_BYTES: usize = 39;

/// The name of a channel: up to 39 bytes, in the value itself, so that channels are copied without an allocation.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct ChannelName {
    bytes: [u8; MOST_BYTES],
    length: u8,
}

impl ChannelName {
    /// A name of ASCII characters, at most 39; what is longer is cut, which no name of the table is.
    pub(crate) const fn new(name: &str) -> ChannelName {
        let mut bytes = [0; MOST_BYTES];
        let name = name.as_bytes();
        let mut length = 0;
        while length < name.len() && length < MOST_BYTES {
            bytes[length] = name[length];
            length += 1;
        }
        ChannelName { bytes, length: length as u8 }
    }

    /// What a reading is called of which only its place among the outputs of the structure is known: `reading 7`. It
    /// allocates nothing, since a node names readings while it runs.
    pub(crate) fn of_reading(place: usize) -> ChannelName {
        ChannelName::numbered("reading", place)
    }

    /// A word and the number of a place that is counted from 0: `joint 9`.
    fn numbered(word: &str, place: usize) -> ChannelName {
        let mut name = ChannelName::new("");
        // The text is at most 28 bytes long, and writing to a name never fails.
        _ = write!(name, "{word} {}", place + 1);
        name
    }

    /// The name as text, of ASCII characters.
    pub fn as_str(&self) -> &str {
        // It was made of a text.
        str::from_utf8(&self.bytes[..usize::from(self.length)]).unwrap_or_default()
    }
}

impl Deref for ChannelName {
    type Target = str;

    fn deref(&self) -> &str {
        self.as_str()
    }
}

/// Appends to the name; what is beyond 39 bytes is cut.
impl fmt::Write for ChannelName {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        // Names are ASCII, so that no character is cut in half.
        for byte in text.bytes() {
            if let Some(to) = self.bytes.get_mut(usize::from(self.length)) {
                *to = byte;
                self.length += 1;
            }
        }
        Ok(())
    }
}

impl fmt::Display for ChannelName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self)
    }
}

impl fmt::Debug for ChannelName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

impl Borrow<str> for ChannelName {
    fn borrow(&self) -> &str {
        self
    }
}

impl From<&str> for ChannelName {
    fn from(name: &str) -> ChannelName {
        ChannelName::new(name)
    }
}

impl Serialize for ChannelName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self)
    }
}

impl PartialEq<str> for ChannelName {
    fn eq(&self, other: &str) -> bool {
        self.as_str() == other
    }
}

impl PartialEq<&str> for ChannelName {
    fn eq(&self, other: &&str) -> bool {
        self.as_str() == *other
    }
}

/// What a channel is to the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A coordinate of the structure or its rate.
    State,
    /// What is held (zero-order) from the sample to the next.
    Load,
    /// A state of a device, such as the current in a coil.
    Internal,
    /// A reading of an instrument; this bit of `clipped` is set if it was beyond the range of its sensor.
    Reading {
        /// The number of the bit.
        clip_bit: u32,
    },
}

impl Kind {
    /// The kind in words, as tables of channels state it.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::State => "state",
            Kind::Load => "load",
            Kind::Internal => "internal state",
            Kind::Reading { .. } => "reading",
        }
    }
}

/// What a channel measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Angle of a joint.
    Angle,
    /// Angular velocity of a joint, the rate of its angle.
    AngularVelocity,
    /// Torque at a joint.
    Torque,
    /// Force, along an axis or the shaker, N.
    Force,
    /// Acceleration of a point along an axis, m/s².
    Acceleration,
    /// Electric current in a coil, A.
    Current,
    /// A modal coordinate, of a shape that is normalised to the modal mass 1 kg.
    ModalDisplacement,
    /// Modal velocity, the rate of a modal coordinate.
    ModalVelocity,
    /// Displacement of a point, m.
    Displacement,
    /// Velocity of a point, m/s.
    Velocity,
    /// Length: the deflection of an element's spring.
    Length,
    /// The branch of its law that an element is on: 0 within a gap, open or sticking; 1 or −1 beyond the gap, in
    /// contact or slipping on the positive or the negative side.
    Branch,
}

impl Quantity {
    /// The SI unit of the quantity.
    pub const fn unit(self) -> &'static str {
        match self {
            Quantity::Angle => "rad",
            Quantity::AngularVelocity => "rad/s",
            Quantity::Torque => "N·m",
            Quantity::Force => "N",
            Quantity::Acceleration => "m/s²",
            Quantity::Current => "A",
            Quantity::ModalDisplacement => "m·√kg",
            Quantity::ModalVelocity => "m·√kg/s",
            Quantity::Displacement => "m",
            Quantity::Velocity => "m/s",
            Quantity::Length => "m",
            Quantity::Branch => "1",
        }
    }
}

/// Where a channel is: at a point of the arm, which has the joints 1, at the base, and 2, the elbow B, and the tip C;
/// or at one of another structure, of which the loads and readings have the names of the arm's (the exciter acts at C).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Point {
    /// The joint at the base, joint 1.
    Joint1,
    /// The elbow of an arm, joint 2, where accelerometer B is.
    Joint2B,
    /// The tip, where the exciter and accelerometer C are.
    TipC,
    /// A joint of a chain, from 1 at the base.
    Joint(u8),
    /// None: a mode, from 1.
    Mode(u8),
    /// Where the program that makes the structure says: its coordinate, from 1.
    Coordinate(u8),
    /// An element, from 1.
    Element(u8),
    /// Where the sensor of this name is; of the sensors beside B and C it is the `number`-th, from 1.
    Sensor {
        /// The name of the sensor in the scenario.
        name: InstrumentName,
        /// The number of the sensor among those beside B and C, from 1.
        number: u8,
    },
}

impl Point {
    /// The point in words, as tables of channels state it.
    pub fn name(self) -> Cow<'static, str> {
        match self {
            Point::Joint1 => "joint 1".into(),
            Point::Joint2B => "joint 2, B".into(),
            Point::TipC => "tip C".into(),
            Point::Joint(joint) => format!("joint {joint}").into(),
            Point::Mode(mode) => format!("mode {mode}").into(),
            Point::Coordinate(coordinate) => format!("coordinate {coordinate}").into(),
            Point::Element(element) => format!("element {element}").into(),
            Point::Sensor { name, .. } => format!("sensor {name}").into(),
        }
    }

    /// The number of its node in files that number nodes.
    pub const fn node(self) -> u32 {
        match self {
            Point::Joint1 => 1,
            Point::Joint2B => 2,
            Point::TipC => 3,
            Point::Joint(joint) => 10 + joint as u32,
            Point::Mode(mode) => 100 + mode as u32,
            Point::Coordinate(coordinate) => 300 + coordinate as u32,
            Point::Element(element) => 200 + element as u32,
            Point::Sensor { number, .. } => 400 + number as u32,
        }
    }
}

/// The axis of the base frame along or about which a channel is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// The axis x of the base frame.
    X,
    /// The axis y of the base frame.
    Y,
    /// The axis z of the base frame.
    Z,
    /// A turn about the axis z.
    AboutZ,
    /// No axis: the channel is a scalar.
    Scalar,
}

impl Axis {
    /// In words; empty for a scalar.
    pub const fn name(self) -> &'static str {
        match self {
            Axis::X => "x",
            Axis::Y => "y",
            Axis::Z => "z",
            Axis::AboutZ => "about z",
            Axis::Scalar => "",
        }
    }
}

/// A channel: one number a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Its name, with the unit.
    pub name: ChannelName,
    /// The name of the vector that it is a component of; of a scalar its own.
    pub vector: ChannelName,
    /// What it is to the plant.
    pub kind: Kind,
    /// The physical quantity, which gives the unit.
    pub quantity: Quantity,
    /// The point or the coordinate to which the number belongs.
    pub point: Point,
    /// The axis along which or about which it is counted.
    pub axis: Axis,
}

impl Channel {
    /// Which coordinates it is one of, or the rate of one; `None` of loads, readings and internal states.
    pub const fn coordinates(&self) -> Option<Coordinates> {
        match (self.kind, self.quantity) {
            (Kind::State, Quantity::Angle | Quantity::AngularVelocity) => Some(Coordinates::Joints),
            (Kind::State, Quantity::ModalDisplacement | Quantity::ModalVelocity) => Some(Coordinates::Modes),
            (Kind::State, Quantity::Displacement | Quantity::Velocity) => Some(Coordinates::Displacements),
            _ => None,
        }
    }
}

const fn state(name: &str, vector: &str, quantity: Quantity, point: Point) -> Channel {
    let name = ChannelName::new(name);
    let vector = ChannelName::new(vector);
    Channel { name, vector, kind: Kind::State, quantity, point, axis: Axis::AboutZ }
}

const fn load(name: &str, vector: &str, quantity: Quantity, point: Point, axis: Axis) -> Channel {
    let name = ChannelName::new(name);
    let vector = ChannelName::new(vector);
    Channel { name, vector, kind: Kind::Load, quantity, point, axis }
}

const fn reading(clip_bit: u32, name: &str, vector: &str, point: Point, axis: Axis) -> Channel {
    let name = ChannelName::new(name);
    let vector = ChannelName::new(vector);
    let quantity = if clip_bit < 4 { Quantity::Acceleration } else { Quantity::Force };
    Channel { name, vector, kind: Kind::Reading { clip_bit }, quantity, point, axis }
}

const fn internal(name: &str, quantity: Quantity, point: Point) -> Channel {
    let name = ChannelName::new(name);
    Channel { name, vector: name, kind: Kind::Internal, quantity, point, axis: Axis::Scalar }
}

/// The current in the coil of a shaker.
pub const COIL_CURRENT: Channel = internal("coil_current_a", Quantity::Current, Point::TipC);

/// States and loads of the arm in the order of files and tables. The last is only in plants whose shaker has a coil.
pub const STATES: [Channel; 9] = [
    state("alpha1_rad", "alpha_rad", Quantity::Angle, Point::Joint1),
    state("alpha2_rad", "alpha_rad", Quantity::Angle, Point::Joint2B),
    state("alpha1_dot_rad_s", "alpha_dot_rad_s", Quantity::AngularVelocity, Point::Joint1),
    state("alpha2_dot_rad_s", "alpha_dot_rad_s", Quantity::AngularVelocity, Point::Joint2B),
    load("torque1_nm", "torque_nm", Quantity::Torque, Point::Joint1, Axis::AboutZ),
    load("torque2_nm", "torque_nm", Quantity::Torque, Point::Joint2B, Axis::AboutZ),
    load("force_x_n", "force_n", Quantity::Force, Point::TipC, Axis::X),
    load("force_y_n", "force_n", Quantity::Force, Point::TipC, Axis::Y),
    COIL_CURRENT,
];

/// Readings of the arm's instruments in the order of files and tables.
pub const READINGS: [Channel; 6] = [
    reading(0, "acceleration_b_x_m_s2", "acceleration_b_m_s2", Point::Joint2B, Axis::X),
    reading(1, "acceleration_b_y_m_s2", "acceleration_b_m_s2", Point::Joint2B, Axis::Y),
    reading(2, "acceleration_c_x_m_s2", "acceleration_c_m_s2", Point::TipC, Axis::X),
    reading(3, "acceleration_c_y_m_s2", "acceleration_c_m_s2", Point::TipC, Axis::Y),
    reading(4, "head_force_x_n", "head_force_n", Point::TipC, Axis::X),
    reading(5, "head_force_y_n", "head_force_n", Point::TipC, Axis::Y),
];

/// The axes of a sensor at a point, along those of the base frame.
pub(super) const AXES: [(Axis, &str); 3] = [(Axis::X, "x"), (Axis::Y, "y"), (Axis::Z, "z")];

/// What a sensor can measure: the quantity, the beginning of its channels' names and their unit.
const SENSORS: [(Measured, Quantity, &str, &str); 4] = [
    (Measured::Acceleration, Quantity::Acceleration, "acceleration", "m_s2"),
    (Measured::Velocity, Quantity::Velocity, "velocity", "m_s"),
    (Measured::Displacement, Quantity::Displacement, "displacement", "m"),
    (Measured::Angle, Quantity::Angle, "angle", "rad"),
];

/// The channels of a sensor beside B and C: one for each axis, `acceleration_m3_z_m_s2`, or of a joint `angle_enc1_rad`.
/// It is the `number`-th of them, from 1, and before it there are `before` channels of theirs.
pub fn sensor_channels(
    name: InstrumentName,
    measures: Measured,
    axes: &[Axis],
    number: u8,
    before: usize,
) -> Vec<Channel> {
    let Some((_, quantity, what, unit)) = SENSORS.into_iter().find(|(of, ..)| *of == measures) else {
        return Vec::new();
    };
    let channel = |(axis, clip_bit): (&Axis, u32)| {
        let along = AXES.into_iter().find(|(of, _)| of == axis).map_or(String::new(), |(_, along)| format!("_{along}"));
        let channel = ChannelName::new(&format!("{what}_{name}{along}_{unit}"));
        Channel {
            name: channel,
            vector: channel,
            kind: Kind::Reading { clip_bit },
            quantity,
            point: Point::Sensor { name, number },
            axis: *axis,
        }
    };
    axes.iter().zip((Measurement::CHANNELS + before) as u32..).map(channel).collect()
}

/// The channels of sensors beside B and C that have these names, at most [`MOST_MORE`].
///
/// # Errors
/// The first name that no channel of a sensor has, or that is one too many.
pub fn named_sensor_channels<'a>(names: &[&'a str]) -> Result<Vec<Channel>, &'a str> {
    if let Some(&name) = names.get(MOST_MORE) {
        return Err(name);
    }
    let parsed = names.iter().map(|name| parsed(name).ok_or(*name)).collect::<Result<Vec<_>, _>>()?;
    let mut channels = Vec::new();
    for (sensor, number) in parsed.chunk_by(|one, next| (one.0, one.1) == (next.0, next.1)).zip(1..) {
        let axes: Vec<Axis> = sensor.iter().map(|(.., axis)| *axis).collect();
        channels.extend(sensor_channels(sensor[0].0, sensor[0].1, &axes, number, channels.len()));
    }
    Ok(channels)
}

/// The sensor of a channel, what it measures, and the axis.
fn parsed(name: &str) -> Option<(InstrumentName, Measured, Axis)> {
    let of = |(measures, _, what, unit): (Measured, Quantity, &str, &str)| {
        let middle = name.strip_prefix(what)?.strip_prefix('_')?.strip_suffix(unit)?.strip_suffix('_')?;
        if measures == Measured::Angle {
            return Some((InstrumentName::new(middle)?, measures, Axis::AboutZ));
        }
        let (sensor, along) = middle.rsplit_once('_')?;
        let (axis, _) = AXES.into_iter().find(|(_, of)| *of == along)?;
        Some((InstrumentName::new(sensor)?, measures, axis))
    };
    SENSORS.into_iter().find_map(of)
}

/// The loads that the native protocol carries, which every plant has, in their order.
pub const NATIVE_LOADS: [Channel; 4] = [STATES[4], STATES[5], STATES[6], STATES[7]];

/// The name of the angle of a joint, counted from 0 at the base, or of its rate; `joint` and its number beyond
/// [`MOST_JOINTS`](crate::rig::MOST_JOINTS).
pub fn joint_channel_name(joint: usize, is_rate: bool) -> ChannelName {
    let names = if is_rate { &ALPHA_DOT } else { &ALPHA };
    names.get(joint).map_or_else(|| ChannelName::numbered("joint", joint), |name| ChannelName::new(name))
}

/// The names of [`LOADS`], in their order.
pub const LOAD_NAMES: [&str; Load::PARTS] = [
    "torque1_nm",
    "torque2_nm",
    "torque3_nm",
    "torque4_nm",
    "torque5_nm",
    "torque6_nm",
    "torque7_nm",
    "torque8_nm",
    "force_x_n",
    "force_y_n",
    "force_z_n",
];

/// Every load that can act on a structure, in the order of [`Load::parts`]: torques at the joints, then the force of the
/// exciter along x, y and z.
pub const LOADS: [Channel; Load::PARTS] = [
    NATIVE_LOADS[0],
    NATIVE_LOADS[1],
    load(LOAD_NAMES[2], "torque_nm", Quantity::Torque, Point::Joint(3), Axis::AboutZ),
    load(LOAD_NAMES[3], "torque_nm", Quantity::Torque, Point::Joint(4), Axis::AboutZ),
    load(LOAD_NAMES[4], "torque_nm", Quantity::Torque, Point::Joint(5), Axis::AboutZ),
    load(LOAD_NAMES[5], "torque_nm", Quantity::Torque, Point::Joint(6), Axis::AboutZ),
    load(LOAD_NAMES[6], "torque_nm", Quantity::Torque, Point::Joint(7), Axis::AboutZ),
    load(LOAD_NAMES[7], "torque_nm", Quantity::Torque, Point::Joint(8), Axis::AboutZ),
    NATIVE_LOADS[2],
    NATIVE_LOADS[3],
    load(LOAD_NAMES[10], "force_n", Quantity::Force, Point::TipC, Axis::Z),
];

/// Which of [`LOADS`] a plant takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadSet(u16);

impl LoadSet {
    /// The loads that the native protocol carries.
    // Bits 0 and 1 are the torques at the first two joints, bits 8 and 9 the forces along x and y.
    pub const NATIVE: LoadSet = LoadSet(0b11_0000_0011);

    /// The loads among these channels, which must be in the order of [`LOADS`]; `None` if a channel is no load or stands
    /// in another order.
    pub fn of_channels<'a>(channels: impl IntoIterator<Item = &'a Channel>) -> Option<LoadSet> {
        let mut set = 0;
        let mut next = 0;
        for channel in channels {
            let place = next + LOADS.get(next..)?.iter().position(|load| load == channel)?;
            set |= 1 << place;
            next = place + 1;
        }
        Some(LoadSet(set))
    }

    /// The native loads, and those of these places in [`LOADS`].
    pub fn native_and(places: impl IntoIterator<Item = usize>) -> LoadSet {
        let more = places.into_iter().filter(|place| *place < LOADS.len());
        LoadSet(more.fold(LoadSet::NATIVE.0, |set, place| set | 1 << place))
    }

    /// Whether it has the load at this place in [`LOADS`].
    pub const fn has(self, place: usize) -> bool {
        place < LOADS.len() && self.0 >> place & 1 == 1
    }

    /// Whether it has those that the native protocol carries.
    pub const fn has_native(self) -> bool {
        self.0 & LoadSet::NATIVE.0 == LoadSet::NATIVE.0
    }

    /// The number of its loads.
    pub const fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether it has none.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The places of its loads in [`LOADS`], in order.
    pub fn places(self) -> impl Iterator<Item = usize> {
        (0..LOADS.len()).filter(move |place| self.has(*place))
    }

    /// The channels of its loads, in the order of [`LOADS`].
    pub fn channels(self) -> Vec<Channel> {
        self.places().map(|place| LOADS[place]).collect()
    }

    /// The parts of a load that it has, in order.
    pub fn parts(self, load: &Load) -> impl Iterator<Item = f64> {
        let parts = load.parts();
        self.places().map(move |place| parts[place])
    }

    /// The load of these parts, in the order of the set.
    pub fn load(self, parts: impl IntoIterator<Item = f64>) -> Load {
        let mut all = [0.0; Load::PARTS];
        self.places().zip(parts).for_each(|(place, part)| all[place] = part);
        Load::from_parts(&all)
    }

    /// The first part of a load that is not zero and that it has not: its place in [`LOADS`], and its value.
    pub fn lacks(self, load: &Load) -> Option<(usize, f64)> {
        load.parts().into_iter().enumerate().find(|(place, part)| *part != 0.0 && !self.has(*place))
    }
}

/// What the arm's instruments read, in the order of [`Measurement::readings`](crate::rig::Measurement::readings).
pub const OUTPUTS: [Channel; READINGS.len()] =
    // The head comes first, as in a sample of the protocol. Files have it last.
    [READINGS[4], READINGS[5], READINGS[0], READINGS[1], READINGS[2], READINGS[3]];

/// `$before` n `$after` for every n.
macro_rules! names {
    ($before:literal, $after:literal: $($n:literal)*) => { [$(concat!($before, $n, $after)),*] };
}

/// Names of angles, of modal coordinates, of displacements, each with their rates, and of states of elements.
const ALPHA: [&str; 8] = names!("alpha", "_rad": 1 2 3 4 5 6 7 8);
const ALPHA_DOT: [&str; 8] = names!("alpha", "_dot_rad_s": 1 2 3 4 5 6 7 8);
const MODAL: [&str; MOST_COORDINATES] = names!("q", "_m_sqrt_kg":
    1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32);
const MODAL_DOT: [&str; MOST_COORDINATES] = names!("q", "_dot_m_sqrt_kg_s":
    1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32);
const DISPLACEMENT: [&str; MOST_COORDINATES] = names!("x", "_m":
    1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32);
const DISPLACEMENT_DOT: [&str; MOST_COORDINATES] = names!("x", "_dot_m_s":
    1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32);
const ELEMENT_M: [&str; MOST_ELEMENTS] = names!("element", "_m": 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16);
const ELEMENT_RAD: [&str; MOST_ELEMENTS] = names!("element", "_rad": 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16);

const ELEMENT_BRANCH: [&str; MOST_ELEMENTS] = names!("element", "_branch": 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16);

/// What the coordinates of a structure are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinates {
    /// Angles of joints, each against its angle at rest, rad.
    Joints,
    /// Coordinates of modes whose shapes are normalised to the modal mass 1 kg, m·√kg.
    Modes,
    /// Displacements from rest, m.
    Displacements,
}

impl Coordinates {
    /// The most of them.
    pub const fn most(self) -> usize {
        match self {
            Coordinates::Joints => ALPHA.len(),
            Coordinates::Modes | Coordinates::Displacements => MOST_COORDINATES,
        }
    }
}

/// The channels of `count` coordinates and their rates, at most [`Coordinates::most`].
pub fn coordinate_channels(of: Coordinates, count: usize) -> Vec<Channel> {
    let rows: [(&'static [&'static str], &'static str, Quantity); 2] = match of {
        Coordinates::Joints => {
            [(&ALPHA, "alpha_rad", Quantity::Angle), (&ALPHA_DOT, "alpha_dot_rad_s", Quantity::AngularVelocity)]
        }
        Coordinates::Modes => [
            (&MODAL, "q_m_sqrt_kg", Quantity::ModalDisplacement),
            (&MODAL_DOT, "q_dot_m_sqrt_kg_s", Quantity::ModalVelocity),
        ],
        Coordinates::Displacements => {
            [(&DISPLACEMENT, "x_m", Quantity::Displacement), (&DISPLACEMENT_DOT, "x_dot_m_s", Quantity::Velocity)]
        }
    };
    let place = |number: u8| match (of, number) {
        (Coordinates::Joints, 1) => (Point::Joint1, Axis::AboutZ),
        (Coordinates::Joints, 2) => (Point::Joint2B, Axis::AboutZ),
        (Coordinates::Joints, _) => (Point::Joint(number), Axis::AboutZ),
        (Coordinates::Modes, _) => (Point::Mode(number), Axis::Scalar),
        (Coordinates::Displacements, _) => (Point::Coordinate(number), Axis::Scalar),
    };
    let row = |(names, vector, quantity): (&'static [&'static str], _, _)| {
        names.iter().take(count).zip(1..).map(move |(name, number)| {
            let (point, axis) = place(number);
            Channel { axis, ..state(name, vector, quantity, point) }
        })
    };
    rows.into_iter().flat_map(row).collect()
}

/// The channel of the state of element `index`, from 0, at a joint or elsewhere; `None` beyond the table.
pub fn element_channel(index: usize, is_at_joint: bool) -> Option<Channel> {
    let (names, quantity): (&[&'static str], _) =
        if is_at_joint { (&ELEMENT_RAD, Quantity::Angle) } else { (&ELEMENT_M, Quantity::Length) };
    Some(internal(names.get(index)?, quantity, Point::Element(index as u8 + 1)))
}

/// The channel of the branch that element `index`, from 0, is on; `None` beyond the table.
pub fn branch_channel(index: usize) -> Option<Channel> {
    Some(internal(ELEMENT_BRANCH.get(index)?, Quantity::Branch, Point::Element(index as u8 + 1)))
}

/// Every channel of states and loads that a recording can have, in the order of files and tables: coordinates, rates,
/// loads, the current of a coil, states of elements.
pub fn known_states() -> Vec<Channel> {
    let kinds = [Coordinates::Joints, Coordinates::Modes, Coordinates::Displacements];
    let coordinates = kinds.into_iter().flat_map(|of| coordinate_channels(of, of.most()));
    let elements = (0..MOST_ELEMENTS).flat_map(|index| [true, false].map(|at| element_channel(index, at)));
    let branches = (0..MOST_ELEMENTS).map(branch_channel);
    let internal = elements.chain(branches).flatten();
    coordinates.chain(LOADS).chain([COIL_CURRENT]).chain(internal).collect()
}
