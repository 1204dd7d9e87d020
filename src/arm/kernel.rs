//! The equation of motion solved for α̈, for one arm or eight: what every step computes.

use core::array;

use super::angle::{Angle, within_reach};
use super::parameters::Inertia;
use super::real::Real;
use super::{Gravity, Load, Parameters};

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

/// α and α̇.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Motion<T> {
    pub x: [T; 2],
    pub v: [T; 2],
}

/// How a motion goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rates<T> {
    /// α̈, rad/s².
    pub acceleration_rad_s2: [T; 2],
    /// The rate at which forces from outside, the weight's among them, and dampers change the energy of motion and
    /// springs, W.
    pub power_w: T,
}

/// u and F.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Loads<T> {
    pub u: [T; 2],
    pub f: [T; 2],
    /// Whether F is anything but zero, in any lane.
    pub pulls: bool,
}

impl From<&Load> for Loads<f64> {
    #[inline(always)]
    fn from(load: &Load) -> Loads<f64> {
        let f: [f64; 2] = load.force_n.into();
        Loads { u: load.torque_nm.into(), f, pulls: f[0] != 0.0 || f[1] != 0.0 }
    }
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

impl<T: Real> Motion<T> {
    /// The motions of `T::WIDTH` arms side by side.
    #[inline(always)]
    pub fn gather(of: impl Fn(usize) -> Motion<f64>) -> Motion<T> {
        Motion {
            x: [T::gather(|i| of(i).x[0]), T::gather(|i| of(i).x[1])],
            v: [T::gather(|i| of(i).v[0]), T::gather(|i| of(i).v[1])],
        }
    }

    /// The motion of the ith of them.
    #[inline(always)]
    pub fn lane(&self, i: usize) -> Motion<f64> {
        Motion { x: [self.x[0].lane(i), self.x[1].lane(i)], v: [self.v[0].lane(i), self.v[1].lane(i)] }
    }
}

impl<T: Real> Loads<T> {
    /// The loads of `T::WIDTH` arms side by side.
    #[inline(always)]
    pub fn gather(of: impl Fn(usize) -> Load) -> Loads<T> {
        let f = [T::gather(|i| of(i).force_n.x), T::gather(|i| of(i).force_n.y)];
        Loads {
            u: [T::gather(|i| of(i).torque_nm.x), T::gather(|i| of(i).torque_nm.y)],
            f,
            pulls: !(f[0].all_zero() && f[1].all_zero()),
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

    /// M⁻¹ r by Cramer's rule, with t = a2 cos(β2+α2): M = [[a1 + 2t, a3 + t], [a3 + t, a3]], det M = a3 (a1 − a3) − t²
    /// > 0.
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

    /// u + JᵀF − (G(q) − G(q at rest)), N·m: all forces from outside. Without `LINKS` it is u alone, to the same bits
    /// where [`Coefficients::needs_links`] says that neither force nor weight acts; with it, lanes without them keep u
    /// as it is.
    #[inline(always)]
    pub fn external_force<const FAR: bool, const LINKS: bool>(&self, x: [T; 2], load: &Loads<T>) -> [T; 2] {
        let [mut r1, mut r2] = load.u;
        if !LINKS {
            return [r1, r2];
        }
        let (s1, c1) = self.link1.sincos::<FAR>(x[0]);
        let (s12, c12) = self.link2.sincos::<FAR>(x[0] + x[1]);
        // JᵀF, Eq. (28): F crossed with the arm's vectors from the joints to the tip.
        let [fx, fy] = load.f;
        let second = self.l[1] * (fy * c12 - fx * s12);
        let first = self.l[0] * (fy * c1 - fx * s1) + second;
        let pulled = |with: T, without: T| T::where_nonzero(fx, with, T::where_nonzero(fy, with, without));
        r1 = pulled(r1 + first, r1);
        r2 = pulled(r2 + second, r2);
        // G = (w1 c1 + w2 c12, w2 c12): the torques by which the weights load the joints.
        let [w1, w2] = self.weight;
        let lower = w2 * (c12 - self.link2.cosine);
        let upper = w1 * (c1 - self.link1.cosine) + lower;
        let heavy = w1 + w2;
        [T::where_nonzero(heavy, r1 - upper, r1), T::where_nonzero(heavy, r2 - lower, r2)]
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
        self.elbow.sincos::<FAR>(alpha2_rad)
    }

    /// Whether a force at the tip or weight acts on any of the arms, so that it matters where the links point.
    #[inline(always)]
    pub fn needs_links(&self, load: &Loads<T>) -> bool {
        self.heavy | load.pulls
    }

    /// α̈ from Eq. (3), rad/s². With `FAR` at every angle; without it only where [`Coefficients::within_reach`] holds,
    /// to the same bits, and without a branch or a call on the way. `LINKS` as [`Coefficients::external_force`] has it.
    #[inline(always)]
    pub fn acceleration<const FAR: bool, const LINKS: bool>(&self, motion: &Motion<T>, load: &Loads<T>) -> [T; 2] {
        self.rates::<FAR, LINKS>(motion, load).acceleration_rad_s2
    }

    /// The same with the power.
    #[inline(always)]
    fn rates<const FAR: bool, const LINKS: bool>(&self, motion: &Motion<T>, load: &Loads<T>) -> Rates<T> {
        let (h, t) = self.coupling::<FAR>(motion.x[1]);
        let force = self.external_force::<FAR, LINKS>(motion.x, load);
        let acceleration_rad_s2 = self.solve_mass(t, self.torques(motion, h, force));
        Rates { acceleration_rad_s2, power_w: self.power_w(motion.v, force) }
    }

    /// The same at every angle, and fast at small ones.
    #[inline(always)]
    pub fn rates_anywhere<const LINKS: bool>(&self, motion: &Motion<T>, load: &Loads<T>) -> Rates<T> {
        if self.within_reach::<LINKS>(motion.x) {
            self.rates::<false, LINKS>(motion, load)
        } else {
            self.far_rates::<LINKS>(motion, load)
        }
    }

    #[cold]
    #[inline(never)]
    fn far_rates<const LINKS: bool>(&self, motion: &Motion<T>, load: &Loads<T>) -> Rates<T> {
        self.rates::<true, LINKS>(motion, load)
    }

    /// Whether every angle that the acceleration asks for is a small one.
    #[inline(always)]
    pub fn within_reach<const LINKS: bool>(&self, x: [T; 2]) -> bool {
        within_reach(x[1]) & (!LINKS || (within_reach(x[0]) & within_reach(x[0] + x[1])))
    }
}
