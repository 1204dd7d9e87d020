//! The forces from outside under one load, as they follow the links: u + JᵀF − (G(q) − G(q at rest)).
//!
//! A link of length l with the weight's moment w, whose angle at rest has the sine h and the cosine t, is after a turn
//! with S and V at the sine h (1 + V) + t S and the cosine t (1 + V) − h S. There F and the weight load its joint by
//!
//! ```text
//! m = l (F_y cosine − F_x sine) − w (cosine − t) = P + (P − w t) V − (Q − w h) S
//! P = l (F_y t − F_x h)        Q = l (F_y h + F_x t)
//! ```
//!
//! and together they are (u1 + m1 + m2, u2 + m2): JᵀF of Eq. (28), and G as [`Gravity`](super::Gravity) has it.

use super::Load;
use super::angle::{Angle, Turn};
use super::coefficients::Coefficients;
use crate::real::Real;

/// The forces from outside under one load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct External<T> {
    /// At α = 0, N·m.
    pub at_rest: [T; 2],
    /// The coefficients of S and V of each link's turn in the torque on the joints before it, N·m.
    links: [[T; 2]; 2],
    /// Whether the directions of the links matter in any lane, because of a force or weight.
    pub follows_links: bool,
}

impl External<f64> {
    /// The forces on the arm alone.
    #[inline(always)]
    pub fn new(c: &Coefficients<f64>, load: &Load) -> External<f64> {
        let ([u1, u2], [fx, fy]): ([f64; 2], [f64; 2]) = (load.torque_nm.into(), load.force_n.into());
        let follows_links = c.heavy | (fx != 0.0) | (fy != 0.0);
        if !follows_links {
            return External { at_rest: [u1, u2], links: [[0.0; 2]; 2], follows_links };
        }
        let link = |length_m: f64, weight_nm: f64, Angle { sine: h, cosine: t }: Angle<f64>| {
            let (p, q) = (length_m * (fy * t - fx * h), length_m * (fy * h + fx * t));
            (p, [weight_nm * h - q, p - weight_nm * t])
        };
        let (first_nm, first) = link(c.l[0], c.weight[0], c.link1);
        let (second_nm, second) = link(c.l[1], c.weight[1], c.link2);
        External { at_rest: [u1 + (first_nm + second_nm), u2 + second_nm], links: [first, second], follows_links }
    }

    /// At any angles of the joints, rad, N·m.
    pub fn at_angles(&self, alpha_rad: [f64; 2]) -> [f64; 2] {
        let [link1, joint2] = alpha_rad.map(Turn::new::<true>);
        self.at(link1, link1.and(joint2))
    }
}

impl<T: Real> External<T> {
    /// The same for `T::WIDTH` arms side by side.
    #[inline(always)]
    pub fn gather(of: impl Fn(usize) -> External<f64>) -> External<T> {
        External {
            at_rest: [0, 1].map(|n| T::gather(|i| of(i).at_rest[n])),
            links: [0, 1].map(|link| [0, 1].map(|n| T::gather(|i| of(i).links[link][n]))),
            follows_links: (0..T::WIDTH).any(|i| of(i).follows_links),
        }
    }

    /// At the turns of link 1 and link 2, N·m.
    #[inline(always)]
    pub fn at(&self, link1: Turn<T>, link2: Turn<T>) -> [T; 2] {
        let [[p1, q1], [p2, q2]] = self.links;
        let second = link2.weighed(p2, q2);
        [self.at_rest[0] + (link1.weighed(p1, q1) + second), self.at_rest[1] + second]
    }
}
