//! Polynomials over several displacements: conservative forces with a common potential.
//!
//! The potential and its derivatives are sums over terms,
//!
//! ```text
//! V = Σ c Π xᵢ^pᵢ        fᵢ = ∂V/∂xᵢ = Σ c pᵢ xᵢ^(pᵢ−1) Π_{j≠i} xⱼ^pⱼ
//! ```
//!
//! with 3 to 5 as the sum of the powers of a term: constant and linear terms would be loads, and those of degree 2 are
//! springs. Geometric nonlinearity of beams, arches and shells has this form with degrees 3 and 4 (M. P. Mignolet, A.
//! Przekop, S. A. Rizzi, S. M. Spottswood, "A Review of Indirect/Non-intrusive Reduced Order Modeling of Nonlinear
//! Geometric Structures", J. Sound Vib. 332 (2013)).
//!
//! Powers are products, one factor after the other, so that every processor computes the same bits.

use alloc::vec::Vec;

use super::check::Range::Finite;
use super::dof::Dof;
use super::error::StructureError;
use super::limits::MOST_ELEMENTS;
use super::position::Position;
use super::spec::{Place, Term};
use crate::real::Real;

/// The most displacements of a polynomial.
pub const MOST_DISPLACEMENTS: usize = 8;
/// The most terms of a polynomial.
pub const MOST_TERMS: usize = 1000;
/// The smallest and largest sum of the powers of a term.
pub const LEAST_DEGREE: usize = 3;
/// Highest degree of a term; see [`LEAST_DEGREE`].
pub const MOST_DEGREE: usize = 5;
/// The most displacements of all polynomials of a structure.
pub(super) const MOST_ALL_DISPLACEMENTS: usize = MOST_ELEMENTS * MOST_DISPLACEMENTS;

/// x^power of one displacement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Factor {
    displacement: usize,
    power: usize,
}

/// A term with the factors whose power is not 0.
#[derive(Clone, Debug, PartialEq)]
struct Monomial {
    energy: f64,
    factors: Vec<Factor>,
}

/// 1, x, … x⁵ of each displacement.
type Powers<T> = [[T; MOST_DEGREE + 1]; MOST_DISPLACEMENTS];

/// A polynomial element of an [`Assembly`](super::Assembly): its potential over displacements x of some places against
/// the ground. It acts on the structure as −∂V/∂x.
#[derive(Clone, Debug, PartialEq)]
pub struct Polynomial {
    number: usize,
    at: Vec<Dof>,
    terms: Vec<Monomial>,
}

impl Polynomial {
    /// A checked polynomial, element `number` of its structure, counted from 1.
    pub(super) fn new(
        number: usize,
        places: &[Place],
        at: Vec<Dof>,
        terms: &[Term],
    ) -> Result<Polynomial, StructureError> {
        let counts = [("displacements", at.len(), MOST_DISPLACEMENTS), ("terms", terms.len(), MOST_TERMS)];
        for (what, got, most) in counts {
            if !(1..=most).contains(&got) {
                let part = alloc::format!("element {number}, polynomial,");
                return Err(StructureError::Count { part, what, got, least: 1, most });
            }
        }
        for (k, place) in places.iter().enumerate() {
            if places[..k].contains(place) {
                return Err(StructureError::RepeatedPlace { element: number, place: place.name() });
            }
            if at[k].is_angle() != at[0].is_angle() {
                let at = places[0].name();
                let to = place.name();
                return Err(StructureError::MixedPlaces { element: number, at, to });
            }
        }
        let terms = terms.iter().zip(1..).map(|(term, k)| Monomial::new(number, k, term, at.len()));
        Ok(Polynomial { number, terms: terms.collect::<Result<_, _>>()?, at })
    }

    /// The number of the element in the structure, from 1.
    pub fn number(&self) -> usize {
        self.number
    }

    /// The degrees of freedom of its displacements, in the order of the specification.
    pub fn at(&self) -> &[Dof] {
        &self.at
    }

    /// The largest sum of the powers of a term.
    pub fn degree(&self) -> usize {
        let degree = |term: &Monomial| term.factors.iter().map(|factor| factor.power).sum();
        self.terms.iter().map(degree).max().unwrap_or(0)
    }

    /// The potential V at displacements from rest, J; zero at rest.
    pub fn energy_j(&self, x: &[f64]) -> f64 {
        let powers = powers(x);
        self.terms.iter().map(|term| term.without(&powers, [usize::MAX; 2])).sum()
    }

    /// Writes the forces ∂V/∂x, N or N·m, one for each displacement.
    pub fn forces(&self, x: &[f64], forces: &mut [f64]) {
        self.add_forces(&powers(x), forces);
    }

    /// The same in every lane.
    // One function for all callers: it is the same in every kernel, and its time is that of the terms.
    #[inline(never)]
    pub(super) fn forces_in<T: Real>(&self, x: &[T; MOST_DISPLACEMENTS]) -> [T; MOST_DISPLACEMENTS] {
        let mut forces = [T::splat(0.0); MOST_DISPLACEMENTS];
        self.add_forces(&powers(&x[..self.at.len()]), &mut forces);
        forces
    }

    fn add_forces<T: Real>(&self, powers: &Powers<T>, forces: &mut [T]) {
        forces.iter_mut().for_each(|force| *force = T::splat(0.0));
        for term in &self.terms {
            for (k, &Factor { displacement, power }) in term.factors.iter().enumerate() {
                let slope = T::splat(power as f64) * powers[displacement][power - 1];
                forces[displacement] = forces[displacement] + slope * term.without(powers, [k, usize::MAX]);
            }
        }
    }

    /// Writes the stiffness ∂²V/∂x², N/m or N·m/rad, by rows.
    pub fn stiffness(&self, x: &[f64], stiffness: &mut [f64]) {
        self.add_stiffness(x, false, stiffness);
    }

    /// Writes a bound of the magnitude of each entry of the stiffness for displacements of at most these magnitudes.
    pub(super) fn most_stiffness(&self, reach: &[f64], stiffness: &mut [f64]) {
        self.add_stiffness(reach, true, stiffness);
    }

    fn add_stiffness(&self, x: &[f64], is_bound: bool, stiffness: &mut [f64]) {
        let powers = powers(x);
        let size = self.at.len();
        stiffness[..size * size].fill(0.0);
        for term in &self.terms {
            // With magnitudes in place of displacements every term counts as positive, so that terms of opposite signs
            // can't cancel in a bound.
            let sign = if is_bound && term.energy < 0.0 { -1.0 } else { 1.0 };
            for (k, row) in term.factors.iter().enumerate() {
                for (l, column) in term.factors.iter().enumerate() {
                    let slope = |of: &Factor, times: usize| -> f64 {
                        // The first derivative p x^(p−1), the second p (p − 1) x^(p−2).
                        let falling: usize = (0..times).map(|step| of.power - step).product();
                        if falling == 0 { 0.0 } else { falling as f64 * powers[of.displacement][of.power - times] }
                    };
                    let own = if k == l { slope(row, 2) } else { slope(row, 1) * slope(column, 1) };
                    stiffness[row.displacement * size + column.displacement] +=
                        sign * (own * term.without(&powers, [k, l]));
                }
            }
        }
    }

    /// The displacements where a structure is.
    pub(super) fn displacements(&self, at: &Position<'_>) -> [f64; MOST_DISPLACEMENTS] {
        let mut x = [0.0; MOST_DISPLACEMENTS];
        x.iter_mut().zip(&self.at).for_each(|(x, dof)| *x = at.displacement(*dof));
        x
    }
}

impl Monomial {
    /// A checked term `number` of element `element`, over this many displacements.
    fn new(element: usize, number: usize, term: &Term, displacements: usize) -> Result<Monomial, StructureError> {
        let got = term.powers.len();
        if got != displacements {
            let part = alloc::format!("element {element}, term {number}: `powers`");
            return Err(StructureError::Numbers { part, got, expected: displacements, of: "displacements" });
        }
        let got = term.powers.iter().map(|power| usize::from(*power)).sum();
        if !(LEAST_DEGREE..=MOST_DEGREE).contains(&got) {
            return Err(StructureError::Degree { element, term: number, got });
        }
        Finite.check(|| alloc::format!("element {element}, term {number}"), "energy", term.energy)?;
        let factors = term.powers.iter().map(|power| usize::from(*power)).enumerate();
        let factors = factors.map(|(displacement, power)| Factor { displacement, power });
        Ok(Monomial { energy: term.energy, factors: factors.filter(|factor| factor.power > 0).collect() })
    }

    /// The term without two of its factors, by their places; those of other places are all there.
    fn without<T: Real>(&self, powers: &Powers<T>, factors: [usize; 2]) -> T {
        let mut product = T::splat(self.energy);
        for (k, &Factor { displacement, power }) in self.factors.iter().enumerate() {
            if !factors.contains(&k) {
                product = product * powers[displacement][power];
            }
        }
        product
    }
}

/// 1, x, … x⁵ of some displacements, one factor after the other.
fn powers<T: Real>(x: &[T]) -> Powers<T> {
    let mut powers = [[T::splat(1.0); MOST_DEGREE + 1]; MOST_DISPLACEMENTS];
    for (powers, x) in powers.iter_mut().zip(x) {
        for k in 1..=MOST_DEGREE {
            powers[k] = powers[k - 1] * *x;
        }
    }
    powers
}

/// Returns a direction of the displacements, of −1, 0 and 1, along which the potential of some terms falls without bound;
/// `None` if none of these does, or there are more displacements than a polynomial can have.
///
/// Far along a direction the terms of the highest degree whose sum is not zero there count. If that degree is odd, the
/// potential falls in the direction or against it.
pub fn falls_along(terms: &[Term]) -> Option<Vec<i8>> {
    let size = terms.iter().map(|term| term.powers.len()).max()?;
    if size > MOST_DISPLACEMENTS {
        return None;
    }
    let direction = |number: usize| -> Vec<i8> {
        // The digits of the number in base 3 are the components: all 3⁸ − 1 directions but zero are few enough to try.
        (0..size as u32).map(|digit| [0, 1, -1][number / 3_usize.pow(digit) % 3]).collect()
    };
    let along = |direction: &[i8], term: &Term| {
        let factors = term.powers.iter().zip(direction).filter(|(power, _)| **power > 0);
        // xᵖ of −1, 0 or 1 is x² for an even power and x for an odd one.
        let sign: i8 = factors.map(|(power, x)| if power % 2 == 0 { x * x } else { *x }).product();
        f64::from(sign) * term.energy
    };
    (1..3_usize.pow(size as u32)).map(direction).find(|direction| {
        let of_degree = |degree: usize| -> f64 {
            let own = |term: &&Term| term.powers.iter().map(|power| usize::from(*power)).sum::<usize>() == degree;
            terms.iter().filter(own).map(|term| along(direction, term)).sum()
        };
        (LEAST_DEGREE..=MOST_DEGREE).rev().map(of_degree).find(|sum| *sum != 0.0).is_some_and(|sum| sum < 0.0)
    })
}
