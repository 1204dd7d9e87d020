//! Specification of a structure, as a scenario has it; [`Assembly::new`](super::Assembly::new) checks it.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use serde::{Deserialize, Serialize};

use super::parameter::Parameter;

/// A link of a planar chain and the joint at its start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Link {
    /// Length l from its joint to the next, or to the tip, m, positive.
    pub length_m: f64,
    /// Mass m, kg, positive.
    pub mass_kg: f64,
    /// Distance lc of the centre of mass from its joint along the link, m; negative behind the joint.
    pub centre_of_mass_m: f64,
    /// Distance of the centre of mass from the line from the joint to the link's end, e, m, to the left as seen along
    /// it.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub centre_of_mass_off_m: f64,
    /// Moment of inertia I about the centre of mass, kg·m², positive.
    pub inertia_kg_m2: f64,
    /// Angle β against the link before, of the first link against the x axis, with the spring relaxed, degrees, −360 to
    /// 360.
    pub angle_deg: f64,
    /// Stiffness k of its joint, N·m/rad, positive.
    pub stiffness_nm_rad: f64,
    /// Viscous damping d of its joint, N·m·s/rad, not negative.
    pub damping_nm_s_rad: f64,
}

fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

/// A planar chain of links, from the base out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChainSpec {
    /// The links, 1 to [`MOST_LINKS`](super::MOST_LINKS).
    pub links: Vec<Link>,
    /// Acceleration of gravity along −y, m/s², not negative; 0 is none. The coordinates count from the equilibrium
    /// under the weight.
    #[serde(default)]
    pub gravity_m_s2: f64,
    /// Values of links that the source of the chain does not state, because they only count with gravity, or where the
    /// centre of mass of their link is away from its joint. Such a chain is refused as long as one of them is in this
    /// list; [`Assembly::with_all`](super::Assembly::with_all) gives them.
    #[serde(skip)]
    pub unstated: Vec<Parameter>,
}

impl ChainSpec {
    /// The same chain with its links at other angles, degrees, from the first link on.
    #[must_use]
    pub fn at_angles_deg(mut self, angles_deg: &[f64]) -> ChainSpec {
        for (link, angle_deg) in self.links.iter_mut().zip(angles_deg) {
            link.angle_deg = *angle_deg;
        }
        self
    }
}

/// A vibration mode of a modal structure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeSpec {
    /// Undamped natural frequency, Hz, not negative; 0 is a rigid mode.
    pub frequency_hz: f64,
    /// Damping ratio, dimensionless, not negative; from 1 on the mode doesn't oscillate. That of a rigid mode says
    /// nothing.
    pub damping_ratio: f64,
}

/// A direction of the base frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Along the x axis.
    X,
    /// Along the y axis.
    Y,
    /// Along the z axis, which a planar chain does not have.
    Z,
}

impl Axis {
    /// All axes, x first.
    pub const ALL: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

    /// Returns the name of the axis: `x`, `y`, `z`.
    pub const fn name(self) -> &'static str {
        match self {
            Axis::X => "x",
            Axis::Y => "y",
            Axis::Z => "z",
        }
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The point of modal structures that is their base, which may move along an axis: see [`ShapeSpec`].
pub const BASE: &str = "base";

/// Mode shape of a point: how far every mode moves it along an axis.
///
/// Of the point [`BASE`] it is how the modes are excited by a motion of the base, which all other points share: the
/// displacements of the structure count from the base.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapeSpec {
    /// Name of the point, without a dot, such as `tip`.
    pub point: String,
    /// Axis along which it moves.
    pub axis: Axis,
    /// φ of each mode, mass-normalised, 1/√kg: the displacement is Σ φ q. Of the base the participation factor Γ = φᵀMr, √kg,
    /// with the displacements r of all masses as the base moves by 1.
    pub by_mode: Vec<f64>,
}

/// A structure known by its modes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModalSpec {
    /// The modes, 1 to [`MOST_MODES`](super::MOST_MODES).
    pub modes: Vec<ModeSpec>,
    /// The points that forces act on and that are read, at least one.
    pub shapes: Vec<ShapeSpec>,
}

/// Body that vibrates: a chain of links, or modes.
#[derive(Clone, Debug, PartialEq)]
pub enum BodySpec {
    /// A planar chain of links with compliant joints.
    Chain(ChainSpec),
    /// Vibration modes with their shapes.
    Modal(ModalSpec),
}

/// Side along its axis on which a contact is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Contact towards positive displacements.
    #[default]
    Positive,
    /// Contact towards negative displacements.
    Negative,
}

impl Side {
    /// 1 for positive displacements, −1 for negative ones.
    pub const fn sign(self) -> f64 {
        match self {
            Side::Positive => 1.0,
            Side::Negative => -1.0,
        }
    }
}

/// Law by which the force f of an element follows from its displacement x from rest, its velocity v and its state z.
///
/// Units are N and m of an element along an axis, N·m and rad of one at a joint. f opposes the motion: it acts on the
/// structure as −f.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// f = k3 x³ + k5 x⁵: a spring that hardens, or softens.
    Cubic {
        /// Cubic stiffness k3, N/m³.
        stiffness3: f64,
        /// Quintic stiffness k5, N/m⁵.
        stiffness5: f64,
    },
    /// f = k (max(y − g, 0) + min(y + g, 0)) − F: backlash, or a stop on both sides. Without a preload F, y is x; with
    /// one, y = x ± (g + |F|/k), so that the element is pressed by F at rest: on the positive side for F > 0.
    Gap {
        /// Stiffness k beyond the gap, N/m, positive.
        stiffness: f64,
        /// Gap g on either side of the middle, m, not negative.
        gap: f64,
        /// Preload F, N, of either sign; 0 is none.
        preload: f64,
    },
    /// Contact on one side, f = max(0, k δ + c δ̇) − F for δ = x − g > 0 (W. Voigt, 1892): it never pulls. With a preload
    /// F, δ = x + F/k: at rest it is pressed by F, which the structure balances, and where it lets go f is −F.
    KelvinVoigt {
        /// Contact stiffness k, N/m, positive.
        stiffness: f64,
        /// Contact damping c, N·s/m, not negative.
        damping: f64,
        /// Displacement g at which it touches, m, not negative; 0 with a preload.
        gap: f64,
        /// Side on which the contact is.
        side: Side,
        /// Preload F, N, not negative; 0 is none.
        preload: f64,
    },
    /// Contact on one side, f = k δ^1.5 max(0, 1 + λ δ̇) − F for δ = x − g > 0 (K. H. Hunt, F. R. E. Crossley,
    /// "Coefficient of Restitution Interpreted as Damping in Vibroimpact", J. Appl. Mech. 42 (1975)): it never pulls. With
    /// a preload F, δ = x + (F/k)^(2/3).
    HuntCrossley {
        /// Contact stiffness k, N/m^1.5, positive.
        stiffness: f64,
        /// Dissipation λ, s/m, not negative.
        damping: f64,
        /// Displacement g at which it touches, m, not negative; 0 with a preload.
        gap: f64,
        /// Side on which the contact is.
        side: Side,
        /// Preload F, N, not negative; 0 is none.
        preload: f64,
    },
    /// Elastic Coulomb friction, f = k z with ż = v while |k z| < R, else k z = ±R (G. M. Jenkins, "Analysis of the
    /// Stress-Strain Relationships in Reactor Grade Graphite", Br. J. Appl. Phys. 13 (1962)).
    Friction {
        /// Stiffness k while it sticks, N/m, positive.
        stiffness: f64,
        /// Slip force R, N, positive.
        slip: f64,
    },
    /// f = σ0 z + σ1 ż + σ2 v with ż = v − σ0 |v| z / g(v) and g = Fc + (Fs − Fc) exp(−(v/vs)²) (C. Canudas de Wit, H.
    /// Olsson, K. J. Åström, P. Lischinsky, "A New Model for Control of Systems with Friction", IEEE Trans. Automatic
    /// Control 40 (1995)).
    Lugre {
        /// Bristle stiffness σ0, N/m, positive.
        bristle_stiffness: f64,
        /// Bristle damping σ1, N·s/m, not negative.
        bristle_damping: f64,
        /// Viscous damping σ2, N·s/m, not negative.
        viscous: f64,
        /// Fc, N, positive: the force of slow sliding.
        coulomb: f64,
        /// Fs, N, at least Fc: the force of breaking away.
        breakaway: f64,
        /// vs, m/s, positive: the velocity of G. Stribeck.
        stribeck: f64,
    },
    /// f = k x + c v: a spring, a damper, or both.
    Linear {
        /// Stiffness k, N/m, not negative.
        stiffness: f64,
        /// Damping c, N·s/m, not negative; not zero where `stiffness` is.
        damping: f64,
    },
    /// f = R tanh(v/v0): Coulomb friction, smoothed.
    Tanh {
        /// Force R of fast sliding, N, positive.
        slip: f64,
        /// Velocity v0 within which it is smoothed, m/s, positive.
        velocity: f64,
    },
}

impl Law {
    /// Returns the name of the law: `cubic`, `gap`, `kelvin-voigt`, `hunt-crossley`, `friction`, `lugre`, `linear`,
    /// `tanh`.
    pub const fn name(&self) -> &'static str {
        match self {
            Law::Cubic { .. } => "cubic",
            Law::Gap { .. } => "gap",
            Law::KelvinVoigt { .. } => "kelvin-voigt",
            Law::HuntCrossley { .. } => "hunt-crossley",
            Law::Friction { .. } => "friction",
            Law::Lugre { .. } => "lugre",
            Law::Linear { .. } => "linear",
            Law::Tanh { .. } => "tanh",
        }
    }

    /// Whether the force is analytic in displacement and velocity, without branches and without a state.
    pub const fn is_smooth(&self) -> bool {
        matches!(self, Law::Cubic { .. } | Law::Linear { .. } | Law::Tanh { .. })
    }

    /// Whether there is a state z.
    pub const fn has_state(&self) -> bool {
        matches!(self, Law::Friction { .. } | Law::Lugre { .. })
    }
}

/// Place at which an element acts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// The element acts at a point, along an axis.
    Dof {
        /// Name of the point, one of [`Assembly::points`](super::Assembly::points).
        point: String,
        /// Axis along which it acts.
        axis: Axis,
    },
    /// The element acts at a joint of a chain, about it; joint 1 is at the base.
    Joint(usize),
}

impl Place {
    /// Returns the name of the place in words: `tip.x`, `joint 2`.
    pub(super) fn name(&self) -> String {
        match self {
            Place::Dof { point, axis } => format!("{point}.{axis}"),
            Place::Joint(joint) => format!("joint {joint}"),
        }
    }
}

/// A term of a polynomial potential, energy · Π xᵢ^powerᵢ of the displacements x.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Term {
    /// The power of each displacement; they add up to 3 to 5.
    pub powers: Vec<u8>,
    /// Energy at displacements of 1, J/m³, J/m⁴ or J/m⁵ by the sum of the powers, at joints J/rad³ and so on.
    pub energy: f64,
}

/// An element: a force law of one displacement, or forces with a polynomial potential over several.
#[derive(Clone, Debug, PartialEq)]
pub enum ElementSpec {
    /// A force law between two places, or between a place and the ground.
    Point {
        /// Place where the element acts; its displacement is that of this place less that of the other.
        at: Place,
        /// Place of the other end, of the same kind; `None` is the ground.
        to: Option<Place>,
        /// Law of its force.
        law: Law,
    },
    /// Forces −∂V/∂x of a polynomial potential V = Σ energy · Π xᵢ^powerᵢ over the displacements x of places, all of
    /// the same kind, against the ground.
    Polynomial {
        /// Places, 1 to [`MOST_DISPLACEMENTS`](super::MOST_DISPLACEMENTS), each once.
        at: Vec<Place>,
        /// Terms of the potential, 1 to [`MOST_TERMS`](super::MOST_TERMS).
        terms: Vec<Term>,
    },
}

impl ElementSpec {
    /// Returns the name of the element's law, as [`Law::name`] or `polynomial`.
    pub const fn name(&self) -> &'static str {
        match self {
            ElementSpec::Point { law, .. } => law.name(),
            ElementSpec::Polynomial { .. } => "polynomial",
        }
    }

    /// Whether the element acts at joints of a chain, so that its displacements are angles.
    pub fn is_at_joint(&self) -> bool {
        match self {
            ElementSpec::Point { at, .. } => matches!(at, Place::Joint(_)),
            ElementSpec::Polynomial { at, .. } => matches!(at.first(), Some(Place::Joint(_))),
        }
    }
}

/// Specification of a structure: its body and its elements.
#[derive(Clone, Debug, PartialEq)]
pub struct StructureSpec {
    /// Body that the elements act on.
    pub body: BodySpec,
    /// The elements, at most [`MOST_ELEMENTS`](super::MOST_ELEMENTS).
    pub elements: Vec<ElementSpec>,
}
