//! The load on a structure.

use alloc::borrow::Cow;
use core::fmt;
use core::ops::{Add, Sub};

use nalgebra::{SVector, Vector3};
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use resonarm_numeric::number::short;

/// The most joints at which a torque can act.
pub const MOST_JOINTS: usize = 8;

/// The load that an exciter puts on a structure: a value of fixed size, whatever the structure takes of it. In a scenario
/// it is a table of the parts that are not 0, by [`Load::NAMES`], as `{ joint1 = 20.0 }`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Torques at the joints, from joint 1 at the base, N·m.
    pub torque_nm: SVector<f64, MOST_JOINTS>,
    /// Force at the exciter's point along x, y and z of the base frame, N.
    pub force_n: Vector3<f64>,
}

impl Load {
    /// The number of its parts.
    pub const PARTS: usize = MOST_JOINTS + 3;

    /// The names of its parts in a scenario, in the order of [`LOADS`](crate::structure::LOADS).
    pub const NAMES: [&str; Load::PARTS] = [
        "joint1",
        "joint2",
        "joint3",
        "joint4",
        "joint5",
        "joint6",
        "joint7",
        "joint8",
        "exciter_x",
        "exciter_y",
        "exciter_z",
    ];

    /// Torques at joints 1 and 2, N·m, without a force.
    pub fn torque_nm(joint1_nm: f64, joint2_nm: f64) -> Load {
        Load::planar([joint1_nm, joint2_nm], [0.0; 2])
    }

    /// A force at the exciter's point along x and y, N, without torques.
    pub fn force_n(x_n: f64, y_n: f64) -> Load {
        Load::planar([0.0; 2], [x_n, y_n])
    }

    /// Torques at joints 1 and 2, N·m, and a force along x and y, N: what the native protocol carries.
    pub fn planar([joint1_nm, joint2_nm]: [f64; 2], [x_n, y_n]: [f64; 2]) -> Load {
        let mut torque_nm = SVector::zeros();
        torque_nm[0] = joint1_nm;
        torque_nm[1] = joint2_nm;
        Load { torque_nm, force_n: Vector3::new(x_n, y_n, 0.0) }
    }

    /// A torque at one joint, counted from 0 at the base, N·m; no load beyond [`MOST_JOINTS`].
    pub fn at_joint(joint: usize, torque_nm: f64) -> Load {
        let mut load = Load::default();
        if let Some(part) = load.torque_nm.get_mut(joint) {
            *part = torque_nm;
        }
        load
    }

    /// The load of these parts, in the order of [`LOADS`](crate::structure::LOADS).
    pub fn from_parts(parts: &[f64; Load::PARTS]) -> Load {
        let [torque_nm @ .., x_n, y_n, z_n] = *parts;
        Load { torque_nm: torque_nm.into(), force_n: Vector3::new(x_n, y_n, z_n) }
    }

    /// Its parts in the order of [`LOADS`](crate::structure::LOADS): torques, N·m, then forces, N.
    pub fn parts(&self) -> [f64; Load::PARTS] {
        let [t1, t2, t3, t4, t5, t6, t7, t8] = self.torque_nm.into();
        let [x_n, y_n, z_n] = self.force_n.into();
        [t1, t2, t3, t4, t5, t6, t7, t8, x_n, y_n, z_n]
    }

    /// The parts that the native protocol carries: torques at joints 1 and 2, N·m, forces along x and y, N.
    pub fn native_parts(&self) -> [f64; 4] {
        [self.torque_nm[0], self.torque_nm[1], self.force_n.x, self.force_n.y]
    }

    /// Whether it has no part but those that the native protocol carries.
    pub fn is_native(&self) -> bool {
        *self == Load::planar([self.torque_nm[0], self.torque_nm[1]], [self.force_n.x, self.force_n.y])
    }

    /// Whether it has a torque.
    pub fn has_torque(&self) -> bool {
        self.torque_nm.iter().any(|part| *part != 0.0)
    }

    /// Whether it has a force of the exciter.
    pub fn has_force(&self) -> bool {
        self.force_n.iter().any(|part| *part != 0.0)
    }

    /// The unit of a load of one kind: `N·m` if it has a torque, else `N`.
    pub fn unit(&self) -> &'static str {
        if self.has_torque() { "N·m" } else { "N" }
    }

    /// The load times a factor (dimensionless).
    #[inline]
    pub fn scaled(&self, factor: f64) -> Load {
        Load { torque_nm: self.torque_nm * factor, force_n: self.force_n * factor }
    }
}

/// Its parts that are not 0, by [`Load::NAMES`], as `exciter_x = 3 N, exciter_y = 4 N`; else `0`.
impl fmt::Display for Load {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut is_first = true;
        for (place, part) in self.parts().into_iter().enumerate().filter(|(_, part)| *part != 0.0) {
            let unit = if place < MOST_JOINTS { "N·m" } else { "N" };
            write!(f, "{}{} = {} {unit}", if is_first { "" } else { ", " }, Load::NAMES[place], short(&part))?;
            is_first = false;
        }
        if is_first { f.write_str("0") } else { Ok(()) }
    }
}

impl Add for Load {
    type Output = Load;

    #[inline]
    fn add(self, other: Load) -> Load {
        Load { torque_nm: self.torque_nm + other.torque_nm, force_n: self.force_n + other.force_n }
    }
}

impl Sub for Load {
    type Output = Load;

    #[inline]
    fn sub(self, other: Load) -> Load {
        Load { torque_nm: self.torque_nm - other.torque_nm, force_n: self.force_n - other.force_n }
    }
}

impl Serialize for Load {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(Load::NAMES.into_iter().zip(self.parts()).filter(|(_, part)| *part != 0.0))
    }
}

/// The place of a part among [`Load::NAMES`].
struct Place(usize);

impl<'de> Deserialize<'de> for Place {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Place, D::Error> {
        let name = Cow::<str>::deserialize(deserializer)?;
        let place = Load::NAMES.iter().position(|known| *known == name);
        place.map(Place).ok_or_else(|| Error::unknown_field(&name, &Load::NAMES))
    }
}

/// Reads the table of a load; each part may be named once.
struct Table;

impl<'de> Visitor<'de> for Table {
    type Value = Load;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table of loads, as { joint1 = 20.0 }")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Load, A::Error> {
        let mut parts = [None; Load::PARTS];
        while let Some(Place(place)) = map.next_key()? {
            if parts[place].replace(map.next_value()?).is_some() {
                return Err(Error::duplicate_field(Load::NAMES[place]));
            }
        }
        Ok(Load::from_parts(&parts.map(|part: Option<f64>| part.unwrap_or(0.0))))
    }
}

impl<'de> Deserialize<'de> for Load {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Load, D::Error> {
        deserializer.deserialize_map(Table)
    }
}
