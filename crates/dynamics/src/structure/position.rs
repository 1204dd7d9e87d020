//! A structure in a position: the motion of its places, its equation of motion and their derivatives there.

use super::body::Body;
use super::chain::{Chain, Turned};
use super::dof::{At, Dof};
use super::element::Element;
use super::limits::{MOST_COORDINATES, MOST_LINKS};
use super::linear::Linearised;
use super::modal::Modal;
use super::spec::Axis;

/// Kinematics of a degree of freedom at an instant: displacement from rest, velocity, acceleration; m and s, or rad and
/// s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Kinematics {
    /// x, m or rad.
    pub displacement: f64,
    /// v, m/s or rad/s.
    pub velocity: f64,
    /// a, m/s² or rad/s².
    pub acceleration: f64,
}

/// A structure in a position q.
///
/// What is costly to compute from q is computed once, when it is made: the sines and cosines of a chain's links. Then
/// every place is read in a few operations a link. Velocities v and accelerations a are slices of n numbers; a
/// [`Dof`] must be one of the structure.
#[derive(Clone, Debug)]
pub struct Position<'a> {
    q: &'a [f64],
    body: BodyIn<'a>,
}

/// The body in the position.
// A position lives on the stack while it is read; a box would be an allocation in the real-time loop.
#[expect(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
enum BodyIn<'a> {
    Chain(&'a Chain, Turned),
    Modal(&'a Modal),
}

impl<'a> Position<'a> {
    /// The structure at q, n numbers.
    #[inline]
    pub(super) fn new(body: &'a Body, q: &'a [f64]) -> Position<'a> {
        let body = match body {
            Body::Chain(chain) => BodyIn::Chain(chain, chain.turned(q)),
            Body::Modal(modal) => BodyIn::Modal(modal),
        };
        Position { q, body }
    }

    /// Writes ∂x/∂q of a degree of freedom, n numbers: m or rad over the coordinates' unit.
    pub fn direction(&self, dof: Dof, out: &mut [f64]) {
        match (dof.0, &self.body) {
            (At::Point { links, axis }, BodyIn::Chain(chain, turned)) => chain.direction_m(turned, links, axis, out),
            (At::Joint(joint), _) => {
                out[..self.q.len()].fill(0.0);
                out[joint] = 1.0;
            }
            (At::Shape(shape), BodyIn::Modal(modal)) => {
                let by_mode = &modal.shapes[shape].by_mode;
                out[..by_mode.len()].copy_from_slice(by_mode);
            }
            (At::Base(_), _) => out[..self.q.len()].fill(0.0),
            // A degree of freedom of another structure: NaN shows the mistake, and a loop that runs does not panic.
            _ => out[..self.q.len()].fill(f64::NAN),
        }
    }

    /// Writes the generalised forces of a unit load at a degree of freedom, n numbers: ∂x/∂q, or of the base −Γ.
    pub fn load_direction(&self, dof: Dof, out: &mut [f64]) {
        match (dof.0, &self.body) {
            (At::Base(shape), BodyIn::Modal(modal)) => {
                out.iter_mut().zip(&modal.shapes[shape].by_mode).for_each(|(out, factor)| *out = -factor);
            }
            _ => self.direction(dof, out),
        }
    }

    /// Adds `factor` ∂²x/∂q² of a degree of freedom to an n × n matrix by rows; zero but for points of a chain.
    pub fn add_curvature(&self, dof: Dof, factor: f64, matrix: &mut [f64]) {
        if let (At::Point { links, axis }, BodyIn::Chain(chain, turned)) = (dof.0, &self.body) {
            let outer = chain.curvature_m(turned, links, axis);
            for (i, row) in matrix.chunks_exact_mut(chain.n).take(chain.n).enumerate() {
                for (j, entry) in row.iter_mut().enumerate() {
                    // Two joints turn together what is beyond the outer one of them.
                    *entry += factor * outer[i.max(j)];
                }
            }
        }
    }

    /// The displacement from rest, m or rad.
    pub fn displacement(&self, dof: Dof) -> f64 {
        match (dof.0, &self.body) {
            (At::Point { links, axis }, BodyIn::Chain(chain, turned)) => chain.displacement_m(turned, links, axis),
            (At::Joint(joint), _) => self.q[joint],
            (At::Shape(shape), BodyIn::Modal(modal)) => dot(&modal.shapes[shape].by_mode, self.q),
            (At::Base(_), _) => 0.0,
            _ => f64::NAN,
        }
    }

    /// The velocity, m/s or rad/s.
    pub fn velocity(&self, dof: Dof, v: &[f64]) -> f64 {
        match (dof.0, &self.body) {
            (At::Point { links, axis }, BodyIn::Chain(chain, turned)) => along(chain, turned, (links, axis), v),
            (At::Joint(joint), _) => v[joint],
            (At::Shape(shape), BodyIn::Modal(modal)) => dot(&modal.shapes[shape].by_mode, v),
            (At::Base(_), _) => 0.0,
            _ => f64::NAN,
        }
    }

    /// The acceleration, m/s² or rad/s²: of a point of a chain with the centripetal one; of modes relative to the base
    /// (see [`Assembly::carried`](super::assembly::Assembly::carried)).
    pub fn acceleration(&self, dof: Dof, v: &[f64], a: &[f64]) -> f64 {
        self.velocity(dof, a) + self.drift(dof, v)
    }

    /// The part of the acceleration that is due to the velocity, vᵀ ∂²x/∂q² v: zero but for points of a chain.
    pub(super) fn drift(&self, dof: Dof, v: &[f64]) -> f64 {
        let (At::Point { links, axis }, BodyIn::Chain(chain, turned)) = (dof.0, &self.body) else { return 0.0 };
        // The sum from joint k out is the same for all pairs up to k.
        let outer = chain.curvature_m(turned, links, axis);
        let mut sum = 0.0;
        let mut before = 0.0;
        // vᵀ ∂²x/∂q² v = Σ_ij c_max(i,j) v_i v_j = Σ_k c_k (s_k² − s_{k−1}²), s_k being the sum of the first k rates.
        for (curvature, v) in outer.iter().zip(v) {
            let turning = before + v;
            sum += curvature * (turning * turning - before * before);
            before = turning;
        }
        sum
    }

    /// All three of a degree of freedom.
    pub fn kinematics(&self, dof: Dof, v: &[f64], a: &[f64]) -> Kinematics {
        Kinematics {
            displacement: self.displacement(dof),
            velocity: self.velocity(dof, v),
            acceleration: self.acceleration(dof, v, a),
        }
    }

    /// The displacement of an element: of one end less that of the other.
    pub fn element_displacement(&self, element: &Element) -> f64 {
        let at = self.displacement(element.at);
        element.to.map_or(at, |to| at - self.displacement(to))
    }

    /// The velocity of an element.
    pub fn element_velocity(&self, element: &Element, v: &[f64]) -> f64 {
        let at = self.velocity(element.at, v);
        element.to.map_or(at, |to| at - self.velocity(to, v))
    }

    /// Writes ∂x/∂q of an element.
    pub fn element_direction(&self, element: &Element, out: &mut [f64]) {
        self.direction(element.at, out);
        if let Some(to) = element.to {
            let mut other = [0.0; MOST_COORDINATES];
            self.direction(to, &mut other);
            out.iter_mut().zip(&other[..self.q.len()]).for_each(|(entry, other)| *entry -= other);
        }
    }

    /// Writes the unbalance of a motion under generalised forces, without the elements: N·m of a chain, N/√kg of modes.
    pub fn unbalance(&self, v: &[f64], a: &[f64], force: &[f64], out: &mut [f64]) {
        match &self.body {
            BodyIn::Chain(chain, turned) => chain.unbalance(turned, [self.q, v, a], force, out),
            BodyIn::Modal(modal) => modal.unbalance([self.q, v, a], force, out),
        }
    }

    /// Writes q̈ of a motion under generalised forces, without the elements; with M + m wwᵀ in place of M, if m and w
    /// are `added`.
    pub(super) fn accelerate_with(&self, v: &[f64], force: &[f64], added: Option<(f64, &[f64])>, out: &mut [f64]) {
        match &self.body {
            BodyIn::Chain(chain, turned) => chain.acceleration(turned, [self.q, v], force, added, out),
            BodyIn::Modal(modal) => modal.acceleration([self.q, v], force, added, out),
        }
    }

    /// Writes [`Position::unbalance`] with its derivatives, exact.
    pub fn linearise(&self, v: &[f64], a: &[f64], force: &[f64], at: &mut Linearised) {
        match &self.body {
            BodyIn::Chain(chain, turned) => chain.linearise(turned, [self.q, v, a], force, at),
            BodyIn::Modal(modal) => modal.linearise([self.q, v, a], force, at),
        }
    }
}

/// wᵀv of a point of a chain.
fn along(chain: &Chain, turned: &Turned, (links, axis): (usize, Axis), v: &[f64]) -> f64 {
    let mut direction = [0.0; MOST_LINKS];
    chain.direction_m(turned, links, axis, &mut direction);
    dot(&direction, v)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
