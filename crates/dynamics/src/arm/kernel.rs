//! The equation of motion solved for α̈, for one arm or eight.

use super::angle::{Turn, within_reach};
use super::coefficients::Coefficients;
use super::external::External;
use crate::integrate::{Motion, Rates};
use crate::real::Real;

impl<T: Real> Coefficients<T> {
    /// M⁻¹ r by Cramer's rule: t = a2 cos(β2+α2), M = [[a1 + 2t, a3 + t], [a3 + t, a3]], det M = a3 (a1 − a3) − t² > 0.
    #[inline(always)]
    pub fn solve_mass(&self, t: T, r: [T; 2]) -> [T; 2] {
        let inverse = T::splat(1.0) / (self.a3_a1_less_a3 - t * t);
        let (m11, m12) = (self.a1 + (t + t), self.a3 + t);
        [(self.a3 * r[0] - m12 * r[1]) * inverse, (m11 * r[1] - m12 * r[0]) * inverse]
    }

    /// ½ α̇ᵀMα̇ + ½ αᵀKα, J: the energy of motion and springs.
    #[inline(always)]
    pub fn energy_j<const FAR: bool>(&self, motion: &Motion<T>) -> T {
        let ([x1, x2], [v1, v2]) = (motion.x, motion.v);
        let (_, t) = self.coupling::<FAR>(x2);
        let (m11, m12) = (self.a1 + (t + t), self.a3 + t);
        let kinetic = (m11 * v1 + (m12 + m12) * v2) * v1 + self.a3 * (v2 * v2);
        T::splat(0.5) * (kinetic + (self.k[0] * (x1 * x1) + self.k[1] * (x2 * x2)))
    }

    /// The rate at which a force and the dampers change that energy, W: α̇ᵀ(force − Dα̇).
    #[inline(always)]
    pub fn power_w(&self, v: [T; 2], force: [T; 2]) -> T {
        (force[0] - self.d[0] * v[0]) * v[0] + (force[1] - self.d[1] * v[1]) * v[1]
    }

    /// force − Kα − Dα̇ − Cα̇, N·m, with h = a2 sin(β2+α2): Cα̇ = h (−2 α̇1 α̇2 − α̇2², α̇1²).
    #[inline(always)]
    pub fn torques(&self, motion: &Motion<T>, h: T, force: [T; 2]) -> [T; 2] {
        let ([x1, x2], [v1, v2]) = (motion.x, motion.v);
        [
            ((force[0] - self.k[0] * x1) - self.d[0] * v1) + h * (v2 * (v1 + v1 + v2)),
            ((force[1] - self.k[1] * x2) - self.d[1] * v2) - h * (v1 * v1),
        ]
    }

    /// a2 sin(β2+α2) and a2 cos(β2+α2), kg·m².
    #[inline(always)]
    pub fn coupling<const FAR: bool>(&self, alpha2_rad: T) -> (T, T) {
        self.elbow.turned(Turn::new::<FAR>(alpha2_rad))
    }

    /// α̈ from Eq. (3), rad/s². With `FAR` it holds at every angle; without it only where
    /// [`Coefficients::within_reach`] is true, with the same bits and without a branch or a call. Without `LINKS` it
    /// ignores the directions of the links, and holds where [`External::follows_links`] is false.
    #[inline(always)]
    pub fn acceleration<const FAR: bool, const LINKS: bool>(
        &self,
        motion: &Motion<T>,
        external: &External<T>,
    ) -> [T; 2] {
        self.rates::<FAR, LINKS>(motion, external).acceleration
    }

    /// The same with the power.
    #[inline(always)]
    fn rates<const FAR: bool, const LINKS: bool>(&self, motion: &Motion<T>, external: &External<T>) -> Rates<T> {
        let [x1, x2] = motion.x;
        let joint2 = Turn::new::<FAR>(x2);
        let (h, t) = self.elbow.turned(joint2);
        let force = if LINKS {
            let link1 = Turn::new::<FAR>(x1);
            external.at(link1, link1.and(joint2))
        } else {
            external.at_rest
        };
        let acceleration = self.solve_mass(t, self.torques(motion, h, force));
        Rates { acceleration, power_w: self.power_w(motion.v, force) }
    }

    /// The same at every angle, and fast at small ones.
    #[inline(always)]
    pub fn rates_anywhere<const LINKS: bool>(&self, motion: &Motion<T>, external: &External<T>) -> Rates<T> {
        if self.within_reach::<LINKS>(motion.x) {
            self.rates::<false, LINKS>(motion, external)
        } else {
            self.far_rates::<LINKS>(motion, external)
        }
    }

    #[cold]
    #[inline(never)]
    fn far_rates<const LINKS: bool>(&self, motion: &Motion<T>, external: &External<T>) -> Rates<T> {
        self.rates::<true, LINKS>(motion, external)
    }

    /// Whether every angle that the acceleration asks for is a small one.
    #[inline(always)]
    pub fn within_reach<const LINKS: bool>(&self, x: [T; 2]) -> bool {
        within_reach(x[1]) & (!LINKS || within_reach(x[0]))
    }
}
