//! The degrees of freedom of a structure: where forces act on it and where it is read.

use super::spec::Axis;

/// A degree of freedom that forces act on and that is read: a place of one [`Assembly`](super::Assembly), which makes
/// it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dof(pub(super) At);

/// Kind of a [`Dof`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum At {
    /// The end of the first `links` links of a chain, along an axis.
    Point { links: usize, axis: Axis },
    /// A joint of a chain, from 0.
    Joint(usize),
    /// A shape of a modal structure.
    Shape(usize),
    /// The shape of a modal structure that is its base.
    Base(usize),
}

impl Dof {
    /// Whether it is an angle, rad, and a torque acts on it, N·m; else it is a displacement, m, with a force, N, but for
    /// the base.
    pub fn is_angle(self) -> bool {
        matches!(self.0, At::Joint(_))
    }

    /// Whether it is the base of a modal structure: its load is its acceleration, m/s², and it does not move relative to
    /// itself.
    pub fn is_base(self) -> bool {
        matches!(self.0, At::Base(_))
    }

    /// The unit of its load: N·m, N, or of the base m/s².
    pub fn load_unit(self) -> &'static str {
        match self.0 {
            At::Joint(_) => "N·m",
            At::Point { .. } | At::Shape(_) => "N",
            At::Base(_) => "m/s²",
        }
    }
}
