//! The one table of channels: everything that names, orders or describes a state, a load or a reading takes it from
//! here.

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
    /// In words.
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
    /// Its rate.
    AngularVelocity,
    /// Torque at a joint.
    Torque,
    /// Force.
    Force,
    /// Acceleration.
    Acceleration,
    /// Electric current.
    Current,
}

impl Quantity {
    /// The unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Quantity::Angle => "rad",
            Quantity::AngularVelocity => "rad/s",
            Quantity::Torque => "N·m",
            Quantity::Force => "N",
            Quantity::Acceleration => "m/s²",
            Quantity::Current => "A",
        }
    }
}

/// A point of the arm: the joints 1, at the base, and 2, the elbow B; the tip C.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Point {
    /// The base.
    Joint1 = 1,
    /// The elbow.
    Joint2B = 2,
    /// The tip.
    TipC = 3,
}

impl Point {
    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Point::Joint1 => "joint 1",
            Point::Joint2B => "joint 2, B",
            Point::TipC => "tip C",
        }
    }
}

/// The axis of the base frame along or about which a channel is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Along x.
    X,
    /// Along y.
    Y,
    /// About z.
    AboutZ,
    /// None: a scalar.
    Scalar,
}

impl Axis {
    /// In words; empty for a scalar.
    pub const fn name(self) -> &'static str {
        match self {
            Axis::X => "x",
            Axis::Y => "y",
            Axis::AboutZ => "about z",
            Axis::Scalar => "",
        }
    }
}

/// A channel: one number a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Its name, with the unit.
    pub name: &'static str,
    /// The name of the vector that it is a component of; of a scalar its own.
    pub vector: &'static str,
    /// What it is to the plant.
    pub kind: Kind,
    /// What it measures.
    pub quantity: Quantity,
    /// Where.
    pub point: Point,
    /// Along which axis.
    pub axis: Axis,
}

const fn state(name: &'static str, vector: &'static str, quantity: Quantity, point: Point) -> Channel {
    Channel { name, vector, kind: Kind::State, quantity, point, axis: Axis::AboutZ }
}

const fn load(name: &'static str, vector: &'static str, quantity: Quantity, point: Point, axis: Axis) -> Channel {
    Channel { name, vector, kind: Kind::Load, quantity, point, axis }
}

const fn reading(clip_bit: u32, name: &'static str, vector: &'static str, point: Point, axis: Axis) -> Channel {
    let quantity = if clip_bit < 4 { Quantity::Acceleration } else { Quantity::Force };
    Channel { name, vector, kind: Kind::Reading { clip_bit }, quantity, point, axis }
}

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
    Channel {
        name: "coil_current_a",
        vector: "coil_current_a",
        kind: Kind::Internal,
        quantity: Quantity::Current,
        point: Point::TipC,
        axis: Axis::Scalar,
    },
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

/// The loads on the arm, in the order in which a plant takes them.
pub const LOADS: [Channel; 4] = [STATES[4], STATES[5], STATES[6], STATES[7]];

/// What the arm's instruments read, in the order of [`Measurement::readings`](crate::rig::Measurement::readings).
pub const OUTPUTS: [Channel; READINGS.len()] =
    [READINGS[4], READINGS[5], READINGS[0], READINGS[1], READINGS[2], READINGS[3]];
