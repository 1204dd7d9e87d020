//! A planar chain of links with compliant joints: the equation of motion of any number of links.
//!
//! With the turns φ = Tq of the links from rest, T lower triangular of ones, their angles θ = θ₀ + φ, masses m, lengths
//! l, centres of mass lc and inertias I,
//!
//! ```text
//! c_ii = I_i + m_i lc_i² + l_i² Σ_{k>i} m_k        c_ij = l_i (m_j lc_j + l_j Σ_{k>j} m_k) for i < j
//! Tᵀ [Σ_j c_ij cos(θ_i − θ_j) φ̈_j + Σ_j c_ij sin(θ_i − θ_j) φ̇_j² + w_i (cos θ_i − cos θ₀_i)] + D q̇ + K q = p
//! w_i = g (m_i lc_i + l_i Σ_{k>i} m_k)
//! ```
//!
//! A centre of mass that is e off the line, to the left, is at lc + ie along the link in complex numbers. So the moment
//! m_j (lc_j + ie_j) + l_j Σ_{k>j} m_k = p_j e^{iδ_j} points along θ_j + δ_j: in c_ij = l_i p_j and in w_j = g p_j it takes the place
//! of the moment on the line, θ_j + δ_j that of θ_j in cos(θ_i − θ_j), sin(θ_i − θ_j) for i < j and in cos θ_j beside w_j, and lc_j² + e_j²
//! that of lc_j² in c_jj.
//!
//! All this is by Lagrange's equations from the kinetic energy ½ Σ c_ij cos(θ_i − θ_j) φ̇_i φ̇_j. Two links are Eq. (3) of the arm.
//! Tᵀ sums a row from each joint outwards, TᵀAT does so over rows and columns.

use alloc::format;
use alloc::string::ToString;
use alloc::vec::Vec;
use core::cmp::Ordering;

use super::angle::{Angle, Turn};
use super::check::Range::{Finite, NotNegative, Positive};
use super::error::StructureError;
use super::limits::MOST_LINKS;
use super::linear::Linearised;
use super::parameter::{Parameter, Part};
use super::spec::{Axis, ChainSpec, Link};

/// One number a link.
pub(super) type PerLink<T = f64> = [T; MOST_LINKS];

/// Newton's limit for the equilibrium under the weight.
const MAX_ITERATIONS: usize = 50;
/// A correction below this, rad, is the last one.
const CORRECTION_LIMIT_RAD: f64 = 1e-9;

/// The constants of a chain; entries beyond its n links are zero.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chain {
    pub n: usize,
    /// c_ij of the kinetic energy, kg·m², symmetric.
    pub inertia: PerLink<PerLink>,
    /// l, m, and p_j = m_j lc_j + l_j Σ_{k>j} m_k, kg·m.
    pub length_m: PerLink,
    pub moment_kg_m: PerLink,
    /// δ, rad, and whether it is 0 for all links.
    pub moment_turn_rad: PerLink,
    pub is_straight: bool,
    /// w of the weight, N·m.
    pub weight_nm: PerLink,
    /// k, N·m/rad, and d, N·m·s/rad.
    pub stiffness: PerLink,
    pub damping: PerLink,
    /// θ₀, and θ₀ + δ.
    pub rest: PerLink<Angle<f64>>,
    pub moment_rest: PerLink<Angle<f64>>,
    /// Sag of the joints under the weight, rad.
    pub sag_rad: PerLink,
}

/// The unbalance of N links and its derivatives, by row and column.
pub(super) struct LinearisedLinks<const N: usize> {
    unbalance: [f64; N],
    pub by_position: [[f64; N]; N],
    pub by_velocity: [[f64; N]; N],
    by_acceleration: [[f64; N]; N],
}

/// The links in a position: what is needed of it many times; entries beyond the links are those of no turn.
#[derive(Clone, Debug)]
pub(super) struct Turned {
    turn: PerLink<Turn<f64>>,
    sine: PerLink,
    cosine: PerLink,
    /// Sine and cosine of θ + δ.
    moment_sine: PerLink,
    moment_cosine: PerLink,
}

impl<const N: usize> LinearisedLinks<N> {
    fn write(&self, to: &mut Linearised) {
        to.unbalance[..N].copy_from_slice(&self.unbalance);
        to.by_position[..N * N].copy_from_slice(self.by_position.as_flattened());
        to.by_velocity[..N * N].copy_from_slice(self.by_velocity.as_flattened());
        to.by_acceleration[..N * N].copy_from_slice(self.by_acceleration.as_flattened());
    }
}

impl Turned {
    /// sin(θ_i − θ_j) and cos(θ_i − θ_j), with the moment of the outer of two links in place of its line.
    fn between(&self, i: usize, j: usize) -> (f64, f64) {
        let line = |link: usize| [self.sine[link], self.cosine[link]];
        let moment = |link: usize| [self.moment_sine[link], self.moment_cosine[link]];
        let ([si, ci], [sj, cj]) = match i.cmp(&j) {
            Ordering::Less => (line(i), moment(j)),
            Ordering::Equal => (line(i), line(j)),
            Ordering::Greater => (moment(i), line(j)),
        };
        (si * cj - ci * sj, ci * cj + si * sj)
    }
}

/// N links in motion: turns from rest, sines and cosines of the angles, rates of turn.
pub(super) struct Moving<T, const N: usize> {
    pub turn: [Turn<T>; N],
    pub sine: [T; N],
    pub cosine: [T; N],
    /// Sine and cosine of the moments' angles, θ + δ.
    pub moment_sine: [T; N],
    pub moment_cosine: [T; N],
    pub rate: [T; N],
}

/// φ = T q of the first n.
#[inline(always)]
fn summed(q: &[f64]) -> PerLink {
    let mut sums = [0.0; MOST_LINKS];
    let mut sum = 0.0;
    for (entry, q) in sums.iter_mut().zip(q) {
        sum += q;
        *entry = sum;
    }
    sums
}

/// Tᵀ of a vector, in place.
#[inline(always)]
fn sum_outwards(of: &mut [f64]) {
    for i in (1..of.len()).rev() {
        of[i - 1] += of[i];
    }
}

/// TᵀAT of an n × n matrix by rows, in place.
#[inline(always)]
fn sum_both_outwards(n: usize, matrix: &mut [f64]) {
    for row in matrix.chunks_exact_mut(n) {
        sum_outwards(row);
    }
    // By rows of n: each entry is added to the one above it, from the last row upwards.
    for i in (n..n * n).rev() {
        matrix[i - n] += matrix[i];
    }
}

impl Chain {
    /// A chain at rest.
    pub fn new(spec: &ChainSpec) -> Result<Chain, StructureError> {
        let n = spec.links.len();
        if !(1..=MOST_LINKS).contains(&n) {
            return Err(StructureError::structure_count("links", n, 1, MOST_LINKS));
        }
        for (i, link) in spec.links.iter().enumerate() {
            check(i, link)?;
        }
        let gravity_m_s2 = spec.gravity_m_s2;
        NotNegative.check(|| "chain".into(), "gravity_m_s2", gravity_m_s2)?;
        check_stated(spec)?;
        let mut chain = Chain::relaxed(&spec.links, gravity_m_s2);
        let relaxed = summed(&per_link(&spec.links, |link| link.angle_deg.to_radians()));
        chain.sag_rad = chain.equilibrium(&relaxed).ok_or(StructureError::Collapse { gravity_m_s2 })?;
        // Rest is the sagged position: q counts from the equilibrium in which the springs carry the weight.
        let sagged = summed(&chain.sag_rad);
        for i in 0..n {
            chain.rest[i] = Angle::new(relaxed[i] + sagged[i]);
            chain.moment_rest[i] = Angle::new(relaxed[i] + sagged[i] + chain.moment_turn_rad[i]);
        }
        Ok(chain)
    }

    /// The constants but for the angles.
    fn relaxed(links: &[Link], gravity_m_s2: f64) -> Chain {
        let n = links.len();
        let mut inertia = [[0.0; MOST_LINKS]; MOST_LINKS];
        let mut outside_kg = 0.0;
        let mut weight_nm = [0.0; MOST_LINKS];
        let mut moment_kg_m = [0.0; MOST_LINKS];
        let mut moment_turn_rad = [0.0; MOST_LINKS];
        // From the tip inwards, so that `outside_kg` is the mass of the links beyond the jth.
        for j in (0..n).rev() {
            let Link { length_m, mass_kg, centre_of_mass_m, centre_of_mass_off_m, inertia_kg_m2, .. } = links[j];
            let along = mass_kg * centre_of_mass_m + length_m * outside_kg;
            let across = mass_kg * centre_of_mass_off_m;
            // On the line the moment keeps its sign.
            let (moment, turn_rad) = match across == 0.0 {
                true => (along, 0.0),
                false => (libm::hypot(along, across), libm::atan2(across, along)),
            };
            moment_kg_m[j] = moment;
            weight_nm[j] = gravity_m_s2 * moment;
            moment_turn_rad[j] = turn_rad;
            let off_m2 = centre_of_mass_off_m * centre_of_mass_off_m;
            // The parallel-axis theorem (Steiner) moves the inertia to the joint. The links outside act like a point
            // mass at the end of this one, since their own turning is in their own rows.
            let about_joint = mass_kg * (centre_of_mass_m * centre_of_mass_m + off_m2);
            inertia[j][j] = inertia_kg_m2 + about_joint + length_m * length_m * outside_kg;
            for i in 0..j {
                inertia[i][j] = links[i].length_m * moment;
                inertia[j][i] = inertia[i][j];
            }
            outside_kg += mass_kg;
        }
        Chain {
            n,
            inertia,
            length_m: per_link(links, |link| link.length_m),
            moment_kg_m,
            moment_turn_rad,
            is_straight: moment_turn_rad == [0.0; MOST_LINKS],
            weight_nm,
            stiffness: per_link(links, |link| link.stiffness_nm_rad),
            damping: per_link(links, |link| link.damping_nm_s_rad),
            rest: [Angle { sine: 0.0, cosine: 0.0 }; MOST_LINKS],
            moment_rest: [Angle { sine: 0.0, cosine: 0.0 }; MOST_LINKS],
            sag_rad: [0.0; MOST_LINKS],
        }
    }

    /// The sag s with K s + Tᵀ[w cos(θ + δ + Ts)] = 0 from relaxed springs, by Newton's method; `None` if no equilibrium is
    /// found, or the one found is not stable.
    fn equilibrium(&self, relaxed_rad: &PerLink) -> Option<PerLink> {
        let n = self.n;
        let mut sag = [0.0; MOST_LINKS];
        // Without weight the springs stay relaxed, and zero is the exact solution.
        if self.weight_nm == [0.0; MOST_LINKS] {
            return Some(sag);
        }
        for _ in 0..MAX_ITERATIONS {
            let sagged = summed(&sag[..n]);
            // The residual is the gradient of the potential energy of springs and weight, and the tangent its second
            // derivative, which is positive definite where the equilibrium is stable.
            let mut residual = [0.0; MOST_LINKS];
            let mut tangent = [0.0; MOST_LINKS * MOST_LINKS];
            for i in 0..n {
                let (sine, cosine) = libm::sincos(relaxed_rad[i] + sagged[i] + self.moment_turn_rad[i]);
                residual[i] = self.weight_nm[i] * cosine;
                tangent[i * n + i] = -self.weight_nm[i] * sine;
            }
            sum_outwards(&mut residual[..n]);
            sum_both_outwards(n, &mut tangent[..n * n]);
            for i in 0..n {
                residual[i] += self.stiffness[i] * sag[i];
                tangent[i * n + i] += self.stiffness[i];
            }
            // Where the tangent is not positive definite, the weight turns the links further than the springs hold, and
            // the chain is said to collapse.
            super::modes::cholesky(n, &mut tangent[..n * n])?;
            super::modes::solve_cholesky(n, &tangent[..n * n], &mut residual[..n]);
            let largest = residual.iter().fold(0.0_f64, |largest, change| largest.max(change.abs()));
            sag.iter_mut().zip(&residual).for_each(|(sag, change)| *sag -= change);
            if largest < CORRECTION_LIMIT_RAD {
                return Some(sag);
            }
        }
        None
    }

    /// The links at q.
    pub fn turned(&self, q: &[f64]) -> Turned {
        let none = [0.0; MOST_LINKS];
        let turn = [Turn::none(); MOST_LINKS];
        let mut turned = Turned { turn, sine: none, cosine: none, moment_sine: none, moment_cosine: none };
        // One running sum gives the turn of every link, as the deflections add up from the base out.
        let mut angle_rad = 0.0;
        for (i, q) in q[..self.n].iter().enumerate() {
            angle_rad += q;
            turned.turn[i] = Turn::new::<true>(angle_rad);
            (turned.sine[i], turned.cosine[i]) = self.rest[i].turned(turned.turn[i]);
        }
        turned.moment_sine = turned.sine;
        turned.moment_cosine = turned.cosine;
        if !self.is_straight {
            for i in 0..self.n {
                (turned.moment_sine[i], turned.moment_cosine[i]) = self.moment_rest[i].turned(turned.turn[i]);
            }
        }
        turned
    }

    /// The unbalance under generalised forces.
    pub fn unbalance(&self, links: &Turned, [q, v, a]: [&[f64]; 3], force: &[f64], out: &mut [f64]) {
        let n = self.n;
        let rate = summed(&v[..self.n]);
        let acceleration = summed(&a[..self.n]);
        for (i, out) in out[..n].iter_mut().enumerate() {
            // Only the change of the weight's moment since rest: the preload of the springs balances the moment at
            // rest.
            *out = self.weight_nm[i] * self.cosine_change(links, i);
            for j in 0..n {
                let (sine, cosine) = links.between(i, j);
                *out += self.inertia[i][j] * (cosine * acceleration[j] + sine * (rate[j] * rate[j]));
            }
        }
        sum_outwards(&mut out[..n]);
        for i in 0..n {
            out[i] += self.damping[i] * v[i] + self.stiffness[i] * q[i] - force[i];
        }
    }

    /// Writes q̈ under generalised forces: M, or M + m wwᵀ with m and w of `added`, from its Cholesky factors.
    pub fn acceleration(
        &self,
        links: &Turned,
        [q, v]: [&[f64]; 2],
        force: &[f64],
        added: Option<(f64, &[f64])>,
        out: &mut [f64],
    ) {
        let n = self.n;
        let mut mass = [0.0; MOST_LINKS * MOST_LINKS];
        let mass = &mut mass[..n * n];
        for (k, entry) in mass.iter_mut().enumerate() {
            let i = k / n;
            let j = k % n;
            // cos 0 is 1, which the sum of rounded squares need not be.
            *entry = self.inertia[i][j] * if i == j { 1.0 } else { links.between(i, j).1 };
        }
        sum_both_outwards(n, mass);
        if let Some((mass_kg, w)) = added {
            mass.iter_mut().enumerate().for_each(|(k, entry)| *entry += mass_kg * w[k / n] * w[k % n]);
        }
        // At q̈ = 0 the unbalance is everything but M q̈, so that M q̈ is its negative.
        self.unbalance(links, [q, v, &[0.0; MOST_LINKS]], force, out);
        out[..n].iter_mut().for_each(|entry| *entry = -*entry);
        if super::modes::cholesky(n, mass).is_some() {
            super::modes::solve_cholesky(n, mass, out);
        } else {
            // There is no acceleration without a positive definite mass. The step reports a state that is not finite.
            out[..n].fill(f64::NAN);
        }
    }

    /// cos(θ_i + δ_i) − cos(θ₀_i + δ_i).
    fn cosine_change(&self, links: &Turned, i: usize) -> f64 {
        links.turn[i].weighed(-self.moment_rest[i].sine, self.moment_rest[i].cosine)
    }

    /// The unbalance and its derivatives. With r_i the bracket above, s and c of θ_i − θ_j,
    ///
    /// ```text
    /// ∂r_i/∂φ_j = c_ij (s φ̈_j − c φ̇_j²) for j ≠ i     ∂r_i/∂φ_i = −Σ_{j≠i} of these − w_i sin θ_i
    /// ∂r_i/∂φ̇_j = 2 c_ij s φ̇_j                        ∂r_i/∂φ̈_j = c_ij c
    /// ```
    ///
    /// Matrices are n × n, by rows, with nothing beside.
    pub fn linearise(&self, links: &Turned, motion: [&[f64]; 3], force: &[f64], at: &mut Linearised) {
        match self.n {
            1 => self.linearise_links::<1>(links, motion, force).write(at),
            2 => self.linearise_links::<2>(links, motion, force).write(at),
            3 => self.linearise_links::<3>(links, motion, force).write(at),
            4 => self.linearise_links::<4>(links, motion, force).write(at),
            5 => self.linearise_links::<5>(links, motion, force).write(at),
            6 => self.linearise_links::<6>(links, motion, force).write(at),
            7 => self.linearise_links::<7>(links, motion, force).write(at),
            _ => self.linearise_links::<8>(links, motion, force).write(at),
        }
    }

    /// The same for N links: loops of a known length take half the time.
    pub fn linearise_links<const N: usize>(
        &self,
        links: &Turned,
        [q, v, a]: [&[f64]; 3],
        force: &[f64],
    ) -> LinearisedLinks<N> {
        let rate = summed(&v[..N]);
        let acceleration = summed(&a[..N]);
        let mut unbalance = [0.0; N];
        let [mut by_position, mut by_velocity, mut by_acceleration] = [[[0.0; N]; N]; 3];
        for i in 0..N {
            unbalance[i] = self.weight_nm[i] * self.cosine_change(links, i);
            by_position[i][i] = -self.weight_nm[i] * links.moment_sine[i];
            let mut others = 0.0;
            for j in 0..N {
                let (sine, cosine) = links.between(i, j);
                let inertia = self.inertia[i][j];
                let square = rate[j] * rate[j];
                unbalance[i] += inertia * (cosine * acceleration[j] + sine * square);
                // sin 0 = 0: of the diagonal the inertia is left, and the derivative by its own angle comes from the
                // others.
                if i == j {
                    by_acceleration[i][i] = inertia;
                    continue;
                }
                by_velocity[i][j] = 2.0 * inertia * sine * rate[j];
                by_acceleration[i][j] = inertia * cosine;
                by_position[i][j] = inertia * (sine * acceleration[j] - cosine * square);
                others += by_position[i][j];
            }
            by_position[i][i] -= others;
        }
        sum_outwards(&mut unbalance);
        for matrix in [&mut by_position, &mut by_velocity, &mut by_acceleration] {
            sum_both_outwards(N, matrix.as_flattened_mut());
        }
        for i in 0..N {
            unbalance[i] += self.damping[i] * v[i] + self.stiffness[i] * q[i] - force[i];
            by_position[i][i] += self.stiffness[i];
            by_velocity[i][i] += self.damping[i];
        }
        LinearisedLinks { unbalance, by_position, by_velocity, by_acceleration }
    }

    /// The energy of motion, of springs, and of the weight less its value and slope at rest, J.
    pub fn energy_j(&self, q: &[f64], v: &[f64]) -> f64 {
        let n = self.n;
        let links = self.turned(q);
        let rate = summed(&v[..self.n]);
        let turned_rad = summed(&q[..n]);
        let mut kinetic = 0.0;
        let mut springs = 0.0;
        let mut weight_j = 0.0;
        for i in 0..n {
            for j in 0..n {
                kinetic += self.inertia[i][j] * links.between(i, j).1 * (rate[i] * rate[j]);
            }
            springs += self.stiffness[i] * (q[i] * q[i]);
            // sin θ − sin θ₀ − cos θ₀ φ, of the moment.
            let Angle { sine, cosine } = self.moment_rest[i];
            weight_j += self.weight_nm[i] * (links.turn[i].weighed(cosine, sine) - cosine * turned_rad[i]);
        }
        0.5 * (kinetic + springs) + weight_j
    }

    /// Returns the position at rest of the end of the first `links` links: Σ l (cos θ₀, sin θ₀), m.
    pub fn rest_m(&self, links: usize) -> [f64; 2] {
        let ends = self.length_m.iter().zip(&self.rest).take(links);
        ends.fold([0.0; 2], |[x, y], (length, Angle { sine, cosine })| [x + length * cosine, y + length * sine])
    }

    /// Returns the displacement from rest of the point at the end of the first `links` links, m.
    pub fn displacement_m(&self, turned: &Turned, links: usize, axis: Axis) -> f64 {
        let along = |i: usize| {
            let Angle { sine, cosine } = self.rest[i];
            // cos(θ₀ + φ) − cos θ₀ = −sin θ₀ sin φ + cos θ₀ (cos φ − 1), and likewise the sine: no difference of nearly
            // equal numbers, so that a small vibration keeps its digits.
            let (p, q) = if axis == Axis::X { (-sine, cosine) } else { (cosine, sine) };
            self.length_m[i] * turned.turn[i].weighed(p, q)
        };
        (0..links).map(along).sum()
    }

    /// Writes the derivative of this displacement by each coordinate: Σ over the links from the joint out of l (−sin θ,
    /// cos θ), m.
    pub fn direction_m(&self, turned: &Turned, links: usize, axis: Axis, out: &mut [f64]) {
        for (i, entry) in out[..self.n].iter_mut().enumerate() {
            let turn = if axis == Axis::X { -turned.sine[i] } else { turned.cosine[i] };
            *entry = if i < links { self.length_m[i] * turn } else { 0.0 };
        }
        sum_outwards(&mut out[..self.n]);
    }

    /// The second derivative: of each pair of coordinates the sum from the outer joint out of −l (cos θ, sin θ), m.
    pub fn curvature_m(&self, turned: &Turned, links: usize, axis: Axis) -> PerLink {
        let mut sums = [0.0; MOST_LINKS];
        for (i, entry) in sums[..links].iter_mut().enumerate() {
            *entry = -self.length_m[i] * if axis == Axis::X { turned.cosine[i] } else { turned.sine[i] };
        }
        sum_outwards(&mut sums[..self.n]);
        sums
    }
}

fn per_link(links: &[Link], of: impl Fn(&Link) -> f64) -> PerLink {
    let mut numbers = [0.0; MOST_LINKS];
    numbers.iter_mut().zip(links).for_each(|(number, link)| *number = of(link));
    numbers
}

/// Refuses a chain in which values count that its source does not state.
fn check_stated(spec: &ChainSpec) -> Result<(), StructureError> {
    for (i, link) in (1..).zip(&spec.links) {
        // Without gravity, and with the centre of mass at the joint, the values that a source may leave out do not
        // count.
        let is_at_joint = link.centre_of_mass_m == 0.0 && link.centre_of_mass_off_m == 0.0;
        let missing = spec.unstated.iter().filter(|parameter| parameter.part == Part::Link(i));
        let missing: Vec<&Parameter> = missing.collect();
        if missing.is_empty() || (spec.gravity_m_s2 == 0.0 && is_at_joint) {
            continue;
        }
        let needs_inertia = missing.iter().any(|parameter| parameter.key == "inertia_kg_m2");
        return Err(StructureError::Unstated {
            link: i,
            missing: missing.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
            about_joint_kg_m2: needs_inertia.then_some(link.inertia_kg_m2),
        });
    }
    Ok(())
}

/// Checks that such a link can exist.
fn check(index: usize, link: &Link) -> Result<(), StructureError> {
    let part = || format!("link {}", index + 1);
    for (name, got, range) in [
        ("length_m", link.length_m, Positive),
        ("mass_kg", link.mass_kg, Positive),
        ("inertia_kg_m2", link.inertia_kg_m2, Positive),
        ("stiffness_nm_rad", link.stiffness_nm_rad, Positive),
        ("centre_of_mass_m", link.centre_of_mass_m, Finite),
        ("centre_of_mass_off_m", link.centre_of_mass_off_m, Finite),
        ("damping_nm_s_rad", link.damping_nm_s_rad, NotNegative),
    ] {
        range.check(part, name, got)?;
    }
    if !(-360.0..=360.0).contains(&link.angle_deg) {
        let expected = "a number from -360 to 360 degrees";
        return Err(StructureError::Value { part: part(), name: "angle_deg", got: link.angle_deg, expected });
    }
    Ok(())
}
