//! The constants of the equation of motion, of one arm or eight.

use core::array;

use super::angle::Angle;
use super::parameters::Inertia;
use super::{Gravity, Parameters};
use crate::real::Real;

/// Constants of the equation of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Coefficients<T> {
    /// a1, a2, a3 of Eq. (26), kg·m².
    pub a1: T,
    pub a2: T,
    pub a3: T,
    /// a3 (a1 − a3), kg²·m⁴.
    pub a3_a1_less_a3: T,
    /// Stiffness, N·m/rad, and damping, N·m·s/rad.
    pub k: [T; 2],
    pub d: [T; 2],
    /// l1, l2, m.
    pub l: [T; 2],
    /// Angle of link 1, angle of link 2 against link 1 with the length a2, angle of link 2, at rest.
    pub link1: Angle<T>,
    pub elbow: Angle<T>,
    pub link2: Angle<T>,
    /// Moments of weight g (m1 lc1 + m2 l1) and g m2 lc2, N·m.
    pub weight: [T; 2],
    /// Whether there is weight, in any lane.
    pub heavy: bool,
}

impl Coefficients<f64> {
    /// The constants at rest angles of the links, rad.
    pub fn new(p: &Parameters, beta_rad: [f64; 2]) -> Coefficients<f64> {
        let Inertia { a1, a2, a3 } = Inertia::of(p);
        let weight = p.gravity.map_or([0.0; 2], |gravity: Gravity| gravity.moments_nm(p));
        Coefficients {
            a1,
            a2,
            a3,
            a3_a1_less_a3: a3 * (a1 - a3),
            k: [p.stiffness1_nm_rad, p.stiffness2_nm_rad],
            d: [p.damping1_nm_s_rad, p.damping2_nm_s_rad],
            l: [p.length1_m, p.length2_m],
            link1: Angle::new(beta_rad[0]),
            elbow: Angle::new(beta_rad[1]).times(a2),
            link2: Angle::new(beta_rad[0] + beta_rad[1]),
            weight,
            heavy: weight != [0.0; 2],
        }
    }
}

impl<T: Real> Coefficients<T> {
    /// The constants of `T::WIDTH` arms side by side.
    pub fn gather<'a>(of: impl Fn(usize) -> &'a Coefficients<f64>) -> Coefficients<T> {
        let number = |pick: fn(&Coefficients<f64>) -> f64| T::gather(|i| pick(of(i)));
        let pair = |pick: fn(&Coefficients<f64>) -> [f64; 2]| array::from_fn(|n| T::gather(|i| pick(of(i))[n]));
        Coefficients {
            a1: number(|c| c.a1),
            a2: number(|c| c.a2),
            a3: number(|c| c.a3),
            a3_a1_less_a3: number(|c| c.a3_a1_less_a3),
            k: pair(|c| c.k),
            d: pair(|c| c.d),
            l: pair(|c| c.l),
            link1: Angle::gather(|i| &of(i).link1),
            elbow: Angle::gather(|i| &of(i).elbow),
            link2: Angle::gather(|i| &of(i).link2),
            weight: pair(|c| c.weight),
            heavy: (0..T::WIDTH).any(|i| of(i).heavy),
        }
    }
}
