//! The parameters of a structure, by name.
//!
//! A parameter has the name of its part, with the part's number from 1, and the key of its value in a scenario:
//! `link2.angle_deg`, `mode3.damping_ratio`, `element1.gap_m`, and `gravity_m_s2` of a chain. The energies of a
//! polynomial's terms are numbered: `element2.energy3`.

use core::fmt;

/// A parameter of a structure; [`Assembly::parameter`](super::assembly::Assembly::parameter) finds it by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter {
    pub(super) part: Part,
    /// Key of the value in a scenario; of the terms of a polynomial without their number.
    pub(super) key: &'static str,
    pub(super) unit: &'static str,
}

/// Part of a structure that a parameter belongs to; numbers count from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// The chain as a whole.
    Chain,
    Link(u8),
    Mode(u8),
    Element(u8),
    /// A term of a polynomial element.
    Term {
        element: u8,
        term: u16,
    },
}

impl Parameter {
    /// The acceleration of gravity on a chain.
    pub const GRAVITY: Parameter = Parameter { part: Part::Chain, key: "gravity_m_s2", unit: "m/s²" };

    /// The unit of its value; empty if it has none.
    pub const fn unit(self) -> &'static str {
        self.unit
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let key = self.key;
        match self.part {
            Part::Chain => f.write_str(key),
            Part::Link(number) => write!(f, "link{number}.{key}"),
            Part::Mode(number) => write!(f, "mode{number}.{key}"),
            Part::Element(number) => write!(f, "element{number}.{key}"),
            Part::Term { element, term } => write!(f, "element{element}.{key}{term}"),
        }
    }
}
