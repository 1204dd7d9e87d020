//! A valid structure: its places, its equation of motion, its elements.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;

use super::body::Body;
use super::chain::Chain;
use super::check::{check_ends, check_overlap, check_values};
use super::dof::{At, Dof};
use super::element::Element;
use super::error::StructureError;
use super::limits::MOST_ELEMENTS;
use super::linear::{Linear, Linearised};
use super::modal::{Modal, shape_name};
use super::modes::{StructureMode, free_modes, modes};
use super::polynomial::Polynomial;
use super::position::Position;
use super::spec::{Axis, BASE, BodySpec, ElementSpec, Place, StructureSpec};

/// The unit of the coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CoordinateUnit {
    /// rad: deflections of joints.
    Radian,
    /// m·√kg, of modal coordinates.
    MetreRootKilogram,
}

impl CoordinateUnit {
    /// The unit as text.
    pub const fn name(self) -> &'static str {
        match self {
            CoordinateUnit::Radian => "rad",
            CoordinateUnit::MetreRootKilogram => "m·√kg",
        }
    }
}

/// A valid structure at rest.
///
/// Positions and velocities are slices of n numbers, generalised forces too. A [`Dof`] must be one of this assembly.
#[derive(Clone, Debug, PartialEq)]
pub struct Assembly {
    spec: StructureSpec,
    pub(super) body: Body,
    elements: Vec<Element>,
    polynomials: Vec<Polynomial>,
    element_states: usize,
    modes: Vec<StructureMode>,
}

impl Assembly {
    /// Checks a specification and computes the constants.
    ///
    /// # Errors
    /// [`StructureError`] names the first value, name or pair of elements that is impossible, or says that the joints
    /// can't hold the weight, or that the values, possible one by one, don't make a structure that can be computed.
    pub fn new(spec: &StructureSpec) -> Result<Assembly, StructureError> {
        let body = match &spec.body {
            BodySpec::Chain(chain) => Body::Chain(Box::new(Chain::new(chain)?)),
            BodySpec::Modal(modal) => Body::Modal(Modal::new(modal)?),
        };
        // Made in stages: elements look up their places in the assembly, and its modes need the elements.
        let mut assembly = Assembly {
            spec: spec.clone(),
            body,
            elements: Vec::new(),
            polynomials: Vec::new(),
            element_states: 0,
            modes: Vec::new(),
        };
        (assembly.elements, assembly.polynomials) = assembly.placed(&spec.elements)?;
        assembly.element_states = assembly.elements.iter().filter(|element| element.state.is_some()).count();
        let is_free = matches!(&assembly.body, Body::Modal(modal) if modal.is_free());
        // The modes of a held structure are found from the factors of K, which has none where a rigid mode makes it
        // singular.
        let found = if is_free { free_modes(&assembly.linear()) } else { modes(&assembly.linear()) };
        let is_possible = |hz: f64| hz.is_finite() && (hz > 0.0 || is_free);
        assembly.modes = found
            .filter(|modes| modes.iter().all(|mode| is_possible(mode.frequency_hz)))
            .ok_or_else(|| assembly.impossible_frequencies())?;
        Ok(assembly)
    }

    /// The elements of a specification at their places.
    fn placed(&self, specs: &[ElementSpec]) -> Result<(Vec<Element>, Vec<Polynomial>), StructureError> {
        if specs.len() > MOST_ELEMENTS {
            return Err(StructureError::structure_count("elements", specs.len(), 0, MOST_ELEMENTS));
        }
        let mut elements = Vec::with_capacity(specs.len());
        let mut polynomials = Vec::new();
        let mut states = 0;
        for (i, spec) in specs.iter().enumerate() {
            let number = i + 1;
            match spec {
                ElementSpec::Point { at: at_place, to: to_place, law } => {
                    check_values(number, law)?;
                    let at = self.moving_place(number, at_place)?;
                    let to = to_place.as_ref().map(|to| self.moving_place(number, to)).transpose()?;
                    if let (Some(other), Some(place)) = (to, to_place) {
                        check_ends(number, [at_place, place], at.is_angle() != other.is_angle(), at == other)?;
                    }
                    let state = law.has_state().then_some(states);
                    states += usize::from(state.is_some());
                    elements.push(Element { number, law: *law, at, to, state });
                    check_overlap(specs, i)?;
                }
                ElementSpec::Polynomial { at: places, terms } => {
                    let at = places.iter().map(|place| self.moving_place(number, place)).collect::<Result<_, _>>()?;
                    polynomials.push(Polynomial::new(number, places, at, terms)?);
                }
            }
        }
        Ok((elements, polynomials))
    }

    /// The degree of freedom of a place of an element, which must be able to move.
    fn moving_place(&self, element: usize, place: &Place) -> Result<Dof, StructureError> {
        let dof = self.place(place)?;
        if self.is_fixed(dof) { Err(StructureError::Fixed { element, place: place.name() }) } else { Ok(dof) }
    }

    /// Makes the error of impossible frequencies from the smallest and largest ratio of the diagonals of K and M, since
    /// the modes are not known.
    fn impossible_frequencies(&self) -> StructureError {
        let linear = self.linear();
        let n = self.coordinates();
        let hz = |i: usize| libm::sqrt(linear.stiffness[i * n + i] / linear.mass[i * n + i]) / core::f64::consts::TAU;
        let range = |pick: fn(f64, f64) -> f64| (0..n).map(hz).reduce(pick).unwrap_or(f64::NAN);
        StructureError::Frequencies { lowest_hz: range(f64::min), highest_hz: range(f64::max) }
    }

    /// The specification that it was made of.
    pub fn spec(&self) -> &StructureSpec {
        &self.spec
    }

    /// The number n of coordinates.
    pub fn coordinates(&self) -> usize {
        match &self.body {
            Body::Chain(chain) => chain.n,
            Body::Modal(modal) => modal.omega_rad_s.len(),
        }
    }

    /// The number of states of elements: one for each with a [state](super::Law::has_state), in the order of the
    /// elements.
    pub fn element_states(&self) -> usize {
        self.element_states
    }

    /// The unit of the coordinates.
    pub fn coordinate_unit(&self) -> CoordinateUnit {
        match self.body {
            Body::Chain(_) => CoordinateUnit::Radian,
            Body::Modal(_) => CoordinateUnit::MetreRootKilogram,
        }
    }

    /// The names of the points: of a chain `joint1`, which is fixed, to the joint of its last link, and `tip`; of
    /// modes those of the shapes.
    pub fn points(&self) -> Vec<String> {
        match &self.body {
            Body::Chain(chain) => (0..=chain.n).map(|links| chain_point(chain.n, links)).collect(),
            Body::Modal(modal) => modal.points(),
        }
    }

    /// Returns how far the joints of a chain under gravity sag under its weight, from the relaxed springs to rest, rad;
    /// `None` of a chain without gravity, and of modes.
    pub fn sag_rad(&self) -> Option<&[f64]> {
        match (&self.body, &self.spec.body) {
            (Body::Chain(chain), BodySpec::Chain(spec)) if spec.gravity_m_s2 != 0.0 => Some(&chain.sag_rad[..chain.n]),
            _ => None,
        }
    }

    /// Returns the positions of the points of a chain at rest, under its weight, along x and y of the base frame, m; in
    /// the order of [`Assembly::points`]. `None` of modes, which say nothing of places.
    pub fn rest_m(&self) -> Option<Vec<[f64; 2]>> {
        match &self.body {
            Body::Chain(chain) => Some((0..=chain.n).map(|links| chain.rest_m(links)).collect()),
            Body::Modal(_) => None,
        }
    }

    /// The names of all degrees of freedom: `point.axis` and, of a chain, the joints.
    pub fn dof_names(&self) -> Vec<String> {
        match &self.body {
            Body::Chain(chain) => {
                let points = (1..=chain.n).map(|links| chain_point(chain.n, links));
                let along = points.flat_map(|point| ["x", "y"].map(|axis| format!("{point}.{axis}")));
                along.chain((0..chain.n).map(|joint| chain_point(chain.n, joint))).collect()
            }
            Body::Modal(modal) => modal.shapes.iter().map(shape_name).collect(),
        }
    }

    /// The degree of freedom of a name: `tip.x`, `joint2.y`; in a chain `joint2` is the deflection of joint 2.
    ///
    /// # Errors
    /// [`StructureError::UnknownPlace`] lists the names.
    pub fn dof(&self, name: &str) -> Result<Dof, StructureError> {
        // `joint2` alone is the deflection of joint 2, and `joint2.x` the place of joint 2 along x.
        let found = match &self.body {
            Body::Chain(chain) => chain_dof(chain.n, name),
            Body::Modal(modal) => modal
                .shapes
                .iter()
                .position(|shape| shape_name(shape) == name)
                .map(|at| if modal.shapes[at].point == BASE { At::Base(at) } else { At::Shape(at) }),
        };
        let unknown =
            || StructureError::UnknownPlace { got: name.to_string(), known: self.dof_names().as_slice().join(", ") };
        found.map(Dof).ok_or_else(unknown)
    }

    /// The degree of freedom of a place.
    ///
    /// # Errors
    /// [`StructureError::UnknownPlace`], [`StructureError::UnknownJoint`], [`StructureError::NoJoints`].
    pub fn place(&self, place: &Place) -> Result<Dof, StructureError> {
        let &Place::Joint(got) = place else { return self.dof(&place.name()) };
        match &self.body {
            Body::Chain(chain) if (1..=chain.n).contains(&got) => Ok(Dof(At::Joint(got - 1))),
            Body::Chain(chain) => Err(StructureError::UnknownJoint { got, most: chain.n }),
            Body::Modal(_) => Err(StructureError::NoJoints { got }),
        }
    }

    /// Whether it never moves: the start of a chain's first link, and the base of modes, relative to itself.
    pub(super) fn is_fixed(&self, dof: Dof) -> bool {
        matches!(dof.0, At::Point { links: 0, .. } | At::Base(_))
    }

    /// Returns how far the base carries a degree of freedom when it moves by 1: 1 along its axis, else 0. The absolute
    /// acceleration is the relative one and so many times the base's.
    pub fn carried(&self, dof: Dof, base: Dof) -> f64 {
        let axis = |shape: usize| match &self.body {
            Body::Modal(modal) => modal.shapes.get(shape).map(|shape| shape.axis),
            Body::Chain(_) => None,
        };
        match (dof.0, base.0) {
            (At::Shape(at) | At::Base(at), At::Base(base)) if axis(at) == axis(base) => 1.0,
            _ => 0.0,
        }
    }

    /// The elements with one displacement, in the order of the specification.
    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// The polynomial elements, in the order of the specification.
    pub fn polynomials(&self) -> &[Polynomial] {
        &self.polynomials
    }

    /// Whether there is an element of any kind.
    pub fn has_elements(&self) -> bool {
        !self.spec.elements.is_empty()
    }

    /// Whether all elements are smooth, so that no step meets a switch.
    pub fn is_smooth(&self) -> bool {
        self.elements.iter().all(|element| element.law.is_smooth())
    }

    /// The structure at q, n numbers: what is read there more than once is read from this.
    #[inline]
    pub fn at<'a>(&'a self, q: &'a [f64]) -> Position<'a> {
        Position::new(&self.body, q)
    }

    /// Returns ∂x/∂q of a degree of freedom at rest; see [`Position::direction`].
    pub fn direction_at_rest(&self, dof: Dof) -> Vec<f64> {
        let rest = vec![0.0; self.coordinates()];
        let mut direction = vec![0.0; self.coordinates()];
        self.at(&rest).direction(dof, &mut direction);
        direction
    }

    /// The displacement from rest, m or rad.
    pub fn displacement(&self, dof: Dof, q: &[f64]) -> f64 {
        match dof.0 {
            // The coordinate itself: no sines and cosines are needed.
            At::Joint(joint) => q[joint],
            _ => self.at(q).displacement(dof),
        }
    }

    /// The linear part at rest, with that of elements: the slopes of smooth ones, and the viscous part of LuGre's.
    /// Friction and the bristles of LuGre's are left out, as if they slipped, and so are contacts and gaps.
    pub fn linear(&self) -> Linear {
        let n = self.coordinates();
        let rest = vec![0.0; n];
        let mut at = Linearised::new(n);
        let position = self.at(&rest);
        // At rest and without a load the derivatives of the unbalance are K, D and M themselves.
        position.linearise(&rest, &rest, &rest, &mut at);
        let mut direction = vec![0.0; n];
        for element in &self.elements {
            let reaction = element.law.at_rest();
            position.element_direction(element, &mut direction);
            for k in 0..n * n {
                let pair = direction[k / n] * direction[k % n];
                at.by_position[k] += reaction.by_position * pair;
                at.by_velocity[k] += reaction.by_velocity * pair;
            }
        }
        Linear { coordinates: n, mass: at.by_acceleration, damping: at.by_velocity, stiffness: at.by_position }
    }

    /// The natural modes at rest, of [`Assembly::linear`], by frequency.
    pub fn modes(&self) -> &[StructureMode] {
        &self.modes
    }

    /// The energy of motion, springs and weight, zero at rest, without the elements, J.
    pub fn energy_j(&self, q: &[f64], v: &[f64]) -> f64 {
        match &self.body {
            Body::Chain(chain) => chain.energy_j(q, v),
            Body::Modal(modal) => modal.energy_j(q, v),
        }
    }

    /// The energy stored in the elements at their states, J.
    pub fn element_energy_j(&self, q: &[f64], states: &[f64]) -> f64 {
        let at = self.at(q);
        let energy = |element: &Element| element.law.energy_j(at.element_displacement(element), element.own(states));
        let potential = |of: &Polynomial| of.energy_j(&of.displacements(&at)[..of.at().len()]);
        self.elements.iter().map(energy).sum::<f64>() + self.polynomials.iter().map(potential).sum::<f64>()
    }
}

/// The name of the point at the end of the first `links` links.
fn chain_point(n: usize, links: usize) -> String {
    if links == n { "tip".to_string() } else { format!("joint{}", links + 1) }
}

fn chain_dof(n: usize, name: &str) -> Option<At> {
    let point = |name: &str| (0..=n).find(|&links| chain_point(n, links) == name);
    match name.split_once('.') {
        None => point(name).filter(|&joint| joint < n).map(At::Joint),
        Some((start, axis)) => {
            let axis = [Axis::X, Axis::Y].into_iter().find(|known| known.name() == axis)?;
            point(start).map(|links| At::Point { links, axis })
        }
    }
}
