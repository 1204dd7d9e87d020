//! A chain of N links as a system for the integrators, with smooth elements: [`Chain`] solved for q̈, for one motion or
//! the four stages of a step.
//!
//! In the turns φ of the links H(θ) φ̈ = r with H_ij = l_i p_j cos(θ_i − θ_j) for i < j, p_j = m_j lc_j + l_j Σ_{k>j}
//! m_k. The centrifugal terms are sums from both ends,
//!
//! ```text
//! Σ_j c_ij sin(θ_i − θ_j) φ̇_j² = s_i X_i − c_i Y_i
//! X_i = l_i Σ_{j>i} p_j c_j φ̇_j² + p_i Σ_{j<i} l_j c_j φ̇_j²        Y_i the same with s_j for c_j
//! ```
//!
//! with the sines s and cosines c of θ, beside p those of θ + δ (see [`Chain`]), and H = L D Lᵀ is factored without roots.
//! q̈_i = φ̈_i − φ̈_{i−1}. The armature of a shaker, [`SmoothMass`], adds m wwᵀ to H; its spring and damper are an element.
//!
//! Arrays are filled by loops: the closures of `array::from_fn` are compiled anew for each N, and the crate a tenth
//! longer.

use alloc::vec::Vec;
use core::array;

use super::angle::{Angle, Turn, within_reach};
use super::armature::Armature;
use super::assembly::Assembly;
use super::chain::{Chain, LinearisedLinks, Moving};
use super::dof::{At, Dof};
use super::limits::MOST_LINKS;
use super::modes::modes;
use super::position::Kinematics;
use super::smooth::{MovingMass, SmoothElement, SmoothMass, SmoothPlace, SmoothPolynomial};
use super::spec::{Axis, Law};
use crate::integrate::{Dynamics, Jacobian, Motion, Rates, SolveStages, StageEquation, StageLoads, Wide};
use crate::real::Real;
use resonarm_numeric::registers::{Task, four_wide};

/// A chain of N links with smooth elements.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Links<const N: usize> {
    chain: Chain,
    kernel: Kernel<f64, N>,
    /// The same in every lane.
    lanes: Kernel<Wide, N>,
    smooth: Smooth<N>,
    fastest_rad_s: f64,
}

/// Devices that move with the links: smooth elements, and the armature of a shaker, a mass and an element.
#[derive(Clone, Debug, PartialEq)]
struct Smooth<const N: usize> {
    elements: Vec<SmoothElement<N>>,
    polynomials: Vec<SmoothPolynomial<N>>,
    armature: Option<SmoothMass<N>>,
}

/// The loads that are held over a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LinksLoad<T, const N: usize> {
    /// Torques at the joints, N·m.
    pub torque_nm: [T; N],
    /// Forces along x and y at the end of each link and beyond, N.
    pub force_n: [[T; 2]; N],
}

impl<T: Real, const N: usize> LinksLoad<T, N> {
    /// One in each lane.
    #[inline(always)]
    fn gather<'a>(of: impl Fn(usize) -> &'a LinksLoad<f64, N>) -> LinksLoad<T, N> {
        let mut lanes = LinksLoad { torque_nm: [T::splat(0.0); N], force_n: [[T::splat(0.0); 2]; N] };
        for i in 0..N {
            lanes.torque_nm[i] = T::gather(|lane| of(lane).torque_nm[i]);
            for axis in [0, 1] {
                lanes.force_n[i][axis] = T::gather(|lane| of(lane).force_n[i][axis]);
            }
        }
        lanes
    }
}

impl<const N: usize> LinksLoad<f64, N> {
    /// The same in every lane.
    #[inline(always)]
    pub fn splat<T: Real>(&self) -> LinksLoad<T, N> {
        LinksLoad::gather(|_lane| self)
    }

    /// The load multiplied by a factor.
    #[inline(always)]
    pub fn times(&self, factor: f64) -> LinksLoad<f64, N> {
        let mut load = *self;
        load.torque_nm.iter_mut().chain(load.force_n.as_flattened_mut()).for_each(|of| *of *= factor);
        load
    }
}

/// The constants of [`Chain`], one number or one a lane.
#[derive(Clone, Debug, PartialEq)]
struct Kernel<T, const N: usize> {
    length_m: [T; N],
    moment_kg_m: [T; N],
    inertia: [T; N],
    stiffness: [T; N],
    damping: [T; N],
    weight_nm: [T; N],
    rest: [Angle<T>; N],
    /// Angles at rest of the moments, and whether these are the same angles.
    moment_rest: [Angle<T>; N],
    is_straight: bool,
}

/// Sums from the first entry on.
#[inline(always)]
fn summed<T: Real, const N: usize>(of: &[T; N]) -> [T; N] {
    let mut sums = *of;
    for i in 1..N {
        sums[i] = sums[i - 1] + of[i];
    }
    sums
}

impl<T: Real, const N: usize> Kernel<T, N> {
    #[inline(always)]
    fn moving<const FAR: bool>(&self, motion: &Motion<T, N>) -> Moving<T, N> {
        let angle = summed(&motion.x);
        let mut turn = [Turn::new::<FAR>(angle[0]); N];
        let mut sine = [T::splat(0.0); N];
        let mut cosine = [T::splat(0.0); N];
        // In one loop: with the turns in a loop of their own, a step takes a third longer.
        for i in 0..N {
            if i > 0 {
                turn[i] = Turn::new::<FAR>(angle[i]);
            }
            (sine[i], cosine[i]) = self.rest[i].turned(turn[i]);
        }
        let mut moment_sine = sine;
        let mut moment_cosine = cosine;
        if !self.is_straight {
            for i in 0..N {
                (moment_sine[i], moment_cosine[i]) = self.moment_rest[i].turned(turn[i]);
            }
        }
        Moving { turn, sine, cosine, moment_sine, moment_cosine, rate: summed(&motion.v) }
    }

    /// The forces on each turn φ but those of joints, with the power of those from outside.
    #[inline(always)]
    fn outer(&self, at: &Moving<T, N>, load: &LinksLoad<T, N>) -> ([T; N], T) {
        let mut force = [T::splat(0.0); N];
        let mut power = T::splat(0.0);
        for (i, (force, [x, y])) in force.iter_mut().zip(load.force_n).enumerate() {
            let tip = self.length_m[i] * (y * at.cosine[i] - x * at.sine[i]);
            *force = tip - self.weight_nm[i] * self.moment_rest[i].cosine_change(at.turn[i]);
            power = power + *force * at.rate[i];
        }
        // X_i and Y_i in two passes: from the base out for the links before i, from the tip in for those behind it.
        let mut x = T::splat(0.0);
        let mut y = T::splat(0.0);
        let mut squares = at.rate;
        for i in 0..N {
            squares[i] = at.rate[i] * at.rate[i];
            force[i] = force[i] - self.moment_kg_m[i] * (at.moment_sine[i] * x - at.moment_cosine[i] * y);
            let pull = self.length_m[i] * squares[i];
            x = x + pull * at.cosine[i];
            y = y + pull * at.sine[i];
        }
        x = T::splat(0.0);
        y = T::splat(0.0);
        for i in (0..N).rev() {
            force[i] = force[i] - self.length_m[i] * (at.sine[i] * x - at.cosine[i] * y);
            let pull = self.moment_kg_m[i] * squares[i];
            x = x + pull * at.moment_cosine[i];
            y = y + pull * at.moment_sine[i];
        }
        (force, power)
    }

    /// L by rows and the inverse of D of H = L D Lᵀ, with m wwᵀ of an armature added to H.
    #[inline(always)]
    fn factored(&self, at: &Moving<T, N>, armature: Option<&MovingMass<T, N>>) -> ([[T; N]; N], [T; N]) {
        let zero = T::splat(0.0);
        let mut lower = [[zero; N]; N];
        let mut inverse = [zero; N];
        for i in 0..N {
            let mut diagonal = self.inertia[i];
            if let Some(armature) = armature {
                diagonal = diagonal + armature.between(i, i);
            }
            for j in 0..i {
                // H_ij less what is known is L_ij D_j; the row keeps it until it is done, rows above have L.
                let cosine = at.moment_cosine[i] * at.cosine[j] + at.moment_sine[i] * at.sine[j];
                let mut scaled = self.length_m[j] * self.moment_kg_m[i] * cosine;
                if let Some(armature) = armature {
                    scaled = scaled + armature.between(i, j);
                }
                let own = lower[i];
                let above = lower[j];
                for (own, above) in own.iter().zip(&above).take(j) {
                    scaled = scaled - *own * *above;
                }
                lower[i][j] = scaled;
            }
            for j in 0..i {
                let scaled = lower[i][j];
                lower[i][j] = scaled * inverse[j];
                diagonal = diagonal - scaled * lower[i][j];
            }
            inverse[i] = T::splat(1.0) / diagonal;
        }
        (lower, inverse)
    }

    /// ẍ from torques at the joints and forces on the turns.
    #[inline(always)]
    fn solved(
        &self,
        at: &Moving<T, N>,
        armature: Option<&MovingMass<T, N>>,
        torque: &[T; N],
        mut force: [T; N],
    ) -> [T; N] {
        // The torque of joint i turns link i, and link i − 1 the other way.
        for i in 0..N {
            force[i] = force[i] + torque[i];
            if i + 1 < N {
                force[i] = force[i] - torque[i + 1];
            }
        }
        let (lower, inverse) = self.factored(at, armature);
        for i in 0..N {
            for j in 0..i {
                force[i] = force[i] - lower[i][j] * force[j];
            }
        }
        for i in (0..N).rev() {
            force[i] = force[i] * inverse[i];
            // The entry that is known last comes last.
            for k in (i + 1..N).rev() {
                force[i] = force[i] - lower[k][i] * force[k];
            }
        }
        // From the tip in, so that the entry before is still φ̈.
        for i in (1..N).rev() {
            force[i] = force[i] - force[i - 1];
        }
        force
    }

    #[inline(always)]
    fn rates<const FAR: bool>(&self, motion: &Motion<T, N>, load: &LinksLoad<T, N>, smooth: &Smooth<N>) -> Rates<T, N> {
        self.rates_at(&self.moving::<FAR>(motion), motion, load, smooth)
    }

    #[inline(always)]
    fn rates_at(
        &self,
        at: &Moving<T, N>,
        motion: &Motion<T, N>,
        load: &LinksLoad<T, N>,
        smooth: &Smooth<N>,
    ) -> Rates<T, N> {
        let (mut force, mut power_w) = self.outer(at, load);
        let mut torque = load.torque_nm;
        for element in &smooth.elements {
            power_w = power_w - element.act(motion, at, &self.rest, &mut torque, &mut force);
        }
        for polynomial in &smooth.polynomials {
            power_w = power_w - polynomial.act(motion, at, &self.rest, &mut torque, &mut force);
        }
        for (i, torque) in torque.iter_mut().enumerate() {
            let damped = load.torque_nm[i] - self.damping[i] * motion.v[i];
            power_w = power_w + damped * motion.v[i];
            *torque = (*torque - self.stiffness[i] * motion.x[i]) - self.damping[i] * motion.v[i];
        }
        let Some(armature) = &smooth.armature else {
            return Rates { acceleration: self.solved(at, None, &torque, force), power_w };
        };
        let armature = armature.at(at);
        let drift_n = armature.mass_kg * armature.drift(at);
        for (force, direction) in force.iter_mut().zip(armature.direction) {
            *force = *force - direction * drift_n;
        }
        Rates { acceleration: self.solved(at, Some(&armature), &torque, force), power_w }
    }

    /// The same at every angle, and fast at small ones.
    #[inline(always)]
    fn rates_anywhere(&self, motion: &Motion<T, N>, load: &LinksLoad<T, N>, smooth: &Smooth<N>) -> Rates<T, N> {
        // Without a short cut, so that there is one branch.
        if summed(&motion.x).iter().fold(true, |all, turn| all & within_reach(*turn)) {
            self.rates::<false>(motion, load, smooth)
        } else {
            self.far_rates(motion, load, smooth)
        }
    }

    #[cold]
    #[inline(never)]
    fn far_rates(&self, motion: &Motion<T, N>, load: &LinksLoad<T, N>, smooth: &Smooth<N>) -> Rates<T, N> {
        self.rates::<true>(motion, load, smooth)
    }

    #[inline(always)]
    fn gather(of: &Kernel<f64, N>) -> Kernel<T, N> {
        let lanes = |numbers: &[f64; N]| {
            let mut lanes = [T::splat(0.0); N];
            for i in 0..N {
                lanes[i] = T::splat(numbers[i]);
            }
            lanes
        };
        Kernel {
            length_m: lanes(&of.length_m),
            moment_kg_m: lanes(&of.moment_kg_m),
            inertia: lanes(&of.inertia),
            stiffness: lanes(&of.stiffness),
            damping: lanes(&of.damping),
            weight_nm: lanes(&of.weight_nm),
            rest: array::from_fn(|i| Angle::gather(|_lane| &of.rest[i])),
            moment_rest: array::from_fn(|i| Angle::gather(|_lane| &of.moment_rest[i])),
            is_straight: of.is_straight,
        }
    }
}

impl<const N: usize> Links<N> {
    /// The chain of an assembly of N links whose elements are smooth, others are left out; with a shaker's armature, if
    /// it has one, but not the coil.
    pub fn new(chain: &Chain, assembly: &Assembly, armature: Option<&Armature>) -> Links<N> {
        let first = |of: &[f64]| {
            let mut numbers = [0.0; N];
            numbers.copy_from_slice(&of[..N]);
            numbers
        };
        let kernel = Kernel {
            length_m: first(&chain.length_m),
            moment_kg_m: first(&chain.moment_kg_m),
            inertia: array::from_fn(|i| chain.inertia[i][i]),
            stiffness: first(&chain.stiffness),
            damping: first(&chain.damping),
            weight_nm: first(&chain.weight_nm),
            rest: array::from_fn(|i| chain.rest[i]),
            moment_rest: array::from_fn(|i| chain.moment_rest[i]),
            is_straight: chain.is_straight,
        };
        let smooth = assembly.elements().iter().filter(|element| element.law.is_smooth());
        let mut elements: Vec<_> = smooth.map(|element| SmoothElement::new(element, chain)).collect();
        let mut fastest_hz = assembly.modes().last().map_or(f64::NAN, |mode| mode.frequency_hz);
        let armature = armature.map(|armature| {
            let modes = modes(&armature.linear(assembly));
            fastest_hz = modes.and_then(|modes| modes.last().map(|mode| mode.frequency_hz)).unwrap_or(f64::NAN);
            let law = Law::Linear { stiffness: armature.stiffness_n_m, damping: armature.damping_n_s_m };
            let along = SmoothPlace::along(armature.dofs(), chain);
            // Spring and damper of the armature act as an element does; its mass is added to H.
            elements.push(SmoothElement::at(law, along.clone()));
            SmoothMass::new(armature.mass_kg, along)
        });
        let polynomials = assembly.polynomials().iter().map(|of| SmoothPolynomial::new(of, chain)).collect();
        let lanes = Kernel::gather(&kernel);
        let smooth = Smooth { elements, polynomials, armature };
        Links { chain: chain.clone(), kernel, lanes, smooth, fastest_rad_s: core::f64::consts::TAU * fastest_hz }
    }

    /// The equation of several motions side by side.
    #[inline(always)]
    pub fn side_by_side<T: Real>(&self) -> SideBySide<'_, T, N> {
        SideBySide { kernel: Kernel::gather(&self.kernel), smooth: &self.smooth }
    }

    /// M⁻¹ of one column, in place.
    fn solve_mass(&self, at: &Moving<f64, N>, torque: [f64; N]) -> [f64; N] {
        let armature = self.smooth.armature.as_ref().map(|armature| armature.at(at));
        self.kernel.solved(at, armature.as_ref(), &torque, [0.0; N])
    }

    /// Reads the kinematics of degrees of freedom at a motion under a load.
    pub fn read(&self, motion: &Motion<f64, N>, load: &LinksLoad<f64, N>, dofs: &[Dof], out: &mut [Kinematics]) {
        let at = self.kernel.moving::<true>(motion);
        let kernel = &self.kernel;
        let acceleration = kernel.rates_at(&at, motion, load, &self.smooth).acceleration;
        let turned = summed(&acceleration);
        for (dof, out) in dofs.iter().zip(out) {
            *out = match dof.0 {
                At::Joint(joint) => {
                    let [displacement, velocity] = [motion.x[joint], motion.v[joint]];
                    Kinematics { displacement, velocity, acceleration: acceleration[joint] }
                }
                At::Point { links, axis } => {
                    let mut sum = Kinematics::default();
                    for (i, turned) in turned.iter().enumerate().take(links) {
                        let l = kernel.length_m[i];
                        let Angle { sine, cosine } = kernel.rest[i];
                        // Along x the derivatives of cos θ, along y those of sin θ.
                        let (moved, slope, curvature) = match axis {
                            Axis::X => (at.turn[i].weighed(-sine, cosine), -at.sine[i], -at.cosine[i]),
                            Axis::Y => (at.turn[i].weighed(cosine, sine), at.cosine[i], -at.sine[i]),
                            Axis::Z => (f64::NAN, f64::NAN, f64::NAN),
                        };
                        sum.displacement += l * moved;
                        sum.velocity += l * (slope * at.rate[i]);
                        sum.acceleration += l * (slope * turned + curvature * (at.rate[i] * at.rate[i]));
                    }
                    sum
                }
                At::Shape(_) | At::Base(_) => {
                    Kinematics { displacement: f64::NAN, velocity: f64::NAN, acceleration: f64::NAN }
                }
            };
        }
    }

    /// s, m, ṡ, m/s, and s̈, m/s², of the armature at a motion under a load; zeros without one.
    pub fn armature(&self, motion: &Motion<f64, N>, load: &LinksLoad<f64, N>) -> Kinematics {
        let Some(armature) = &self.smooth.armature else { return Kinematics::default() };
        let at = self.kernel.moving::<true>(motion);
        let acceleration = self.kernel.rates_at(&at, motion, load, &self.smooth).acceleration;
        let own = armature.at(&at);
        Kinematics {
            displacement: armature.displacement_m(motion, &at, &self.kernel.rest),
            velocity: own.along(&at.rate),
            acceleration: own.along(&summed(&acceleration)) + own.drift(&at),
        }
    }
}

/// A chain in several motions side by side, one in each lane.
pub(super) struct SideBySide<'a, T, const N: usize> {
    kernel: Kernel<T, N>,
    smooth: &'a Smooth<N>,
}

impl<T: Real, const N: usize> SideBySide<'_, T, N> {
    /// ẍ, at every angle.
    #[inline(always)]
    pub fn acceleration(&self, motion: &Motion<T, N>, load: &LinksLoad<T, N>) -> [T; N] {
        self.kernel.rates::<true>(motion, load, self.smooth).acceleration
    }
}

/// The stages of a step of a chain.
struct Stages<'a, const N: usize> {
    kernel: &'a Kernel<Wide, N>,
    load: LinksLoad<Wide, N>,
    smooth: &'a Smooth<N>,
}

impl<const N: usize> StageEquation<N> for Stages<'_, N> {
    // Compiled once for all numbers of stages.
    #[inline(never)]
    fn rates(&self, motion: &Motion<Wide, N>) -> Rates<Wide, N> {
        four_wide(StageRates { stages: self, motion })
    }
}

/// The rates at the stages, for any registers.
struct StageRates<'a, const N: usize> {
    stages: &'a Stages<'a, N>,
    motion: &'a Motion<Wide, N>,
}

impl<const N: usize> Task for StageRates<'_, N> {
    type Output = Rates<Wide, N>;

    #[inline(always)]
    fn run(self) -> Rates<Wide, N> {
        let StageRates { stages, motion } = self;
        stages.kernel.rates_anywhere(motion, &stages.load, stages.smooth)
    }
}

impl<const N: usize> Dynamics<N> for Links<N> {
    type Load = LinksLoad<f64, N>;

    #[inline(never)]
    fn rates(&self, motion: &Motion<f64, N>, load: &LinksLoad<f64, N>) -> Rates<f64, N> {
        self.kernel.rates_anywhere(motion, load, &self.smooth)
    }

    /// Computes the Jacobian from the unbalance r(q, q̇, q̈) = 0: ∂q̈/∂x = −M⁻¹ ∂r/∂x. A force along x and y at the
    /// ends of the links adds l (F_x cos θ + F_y sin θ) to ∂r/∂φ; an element f ∂w/∂q + w f_x wᵀ to ∂r/∂q and w f_v wᵀ
    /// to ∂r/∂q̇.
    fn jacobian(&self, motion: &Motion<f64, N>, load: &LinksLoad<f64, N>) -> Jacobian<N> {
        let acceleration = Dynamics::rates(self, motion, load).acceleration;
        let turned = self.chain.turned(&motion.x);
        let LinearisedLinks { mut by_position, mut by_velocity, .. } =
            self.chain.linearise_links::<N>(&turned, [&motion.x, &motion.v, &acceleration], &[0.0; N]);
        let [by_x, by_v] = [by_position.as_flattened_mut(), by_velocity.as_flattened_mut()];
        let at = self.kernel.moving::<true>(motion);
        let mut turning = self.kernel.length_m;
        for (i, [x, y]) in load.force_n.into_iter().enumerate() {
            turning[i] *= x * at.cosine[i] + y * at.sine[i];
        }
        for element in &self.smooth.elements {
            element.linearise(motion, &at, &self.kernel.rest, [by_x, by_v], &mut turning);
        }
        for polynomial in &self.smooth.polynomials {
            polynomial.linearise(motion, &at, &self.kernel.rest, by_x, &mut turning);
        }
        if let Some(armature) = &self.smooth.armature {
            armature.linearise(&acceleration, &at, [by_x, by_v], &mut turning);
        }
        for i in (1..N).rev() {
            turning[i - 1] += turning[i];
        }
        let rows = |matrix: &[[f64; N]; N], turning: &[f64; N]| {
            let mut rows = [[0.0; N]; N];
            for n in 0..N {
                let mut column = [0.0; N];
                // A load on turn i counts in row and column of every joint up to i: their entry sums it from the
                // outer joint out.
                for (row, entry) in column.iter_mut().enumerate() {
                    *entry = -(matrix[row][n] + turning[row.max(n)]);
                }
                for (row, entry) in self.solve_mass(&at, column).into_iter().enumerate() {
                    rows[row][n] = entry;
                }
            }
            rows
        };
        // The levers of forces change with the position of the links and not with their velocity, so the second matrix
        // has no share of `turning`.
        Jacobian { acceleration, by_position: rows(&by_position, &turning), by_velocity: rows(&by_velocity, &[0.0; N]) }
    }

    fn linear_part(&self) -> Jacobian<N> {
        self.jacobian(&Motion { x: [0.0; N], v: [0.0; N] }, &LinksLoad { torque_nm: [0.0; N], force_n: [[0.0; 2]; N] })
    }

    fn fastest_rad_s(&self) -> f64 {
        self.fastest_rad_s
    }

    /// The root of tr(M⁻¹K), with the elements' stiffness there: the sum of the squares of the frequencies.
    fn frequency_bound_rad_s(&self, position: &[f64; N]) -> f64 {
        let motion = Motion { x: *position, v: [0.0; N] };
        let at = self.kernel.moving::<true>(&motion);
        let [mut stiffness, mut damping] = [[0.0; MOST_LINKS * MOST_LINKS]; 2];
        for element in &self.smooth.elements {
            element.linearise(&motion, &at, &self.kernel.rest, [&mut stiffness, &mut damping], &mut [0.0; N]);
        }
        for polynomial in &self.smooth.polynomials {
            polynomial.linearise(&motion, &at, &self.kernel.rest, &mut stiffness, &mut [0.0; N]);
        }
        let share = |n: usize| {
            let mut column = [0.0; N];
            for (row, entry) in column.iter_mut().enumerate() {
                *entry = stiffness[row * N + n] + if row == n { self.kernel.stiffness[n] } else { 0.0 };
            }
            self.solve_mass(&at, column)[n]
        };
        libm::sqrt((0..N).map(share).sum())
    }

    /// Without the weight's and the elements', which act as loads: ½ Σ c_ii φ̇_i² + Σ_j p_j φ̇_j (c_j Σ_{i<j} l_i c_i
    /// φ̇_i + s_j Σ_{i<j} l_i s_i φ̇_i) + ½ Σ k q², and ½ m ṡ² of an armature.
    fn energy_j(&self, motion: &Motion<f64, N>) -> f64 {
        let at = self.kernel.moving::<true>(motion);
        let kernel = &self.kernel;
        let mut twice = 0.0;
        let mut cross = 0.0;
        let mut x = 0.0;
        let mut y = 0.0;
        for i in 0..N {
            let rate = at.rate[i];
            twice += kernel.inertia[i] * (rate * rate) + kernel.stiffness[i] * (motion.x[i] * motion.x[i]);
            cross += kernel.moment_kg_m[i] * rate * (at.moment_cosine[i] * x + at.moment_sine[i] * y);
            x += kernel.length_m[i] * rate * at.cosine[i];
            y += kernel.length_m[i] * rate * at.sine[i];
        }
        if let Some(armature) = &self.smooth.armature {
            let armature = armature.at(&at);
            let velocity_m_s = armature.along(&at.rate);
            twice += armature.mass_kg * (velocity_m_s * velocity_m_s);
        }
        0.5 * twice + cross
    }

    #[inline(always)]
    fn solve_stages<const S: usize, V: SolveStages<N>>(
        &self,
        loads: &StageLoads<LinksLoad<f64, N>, S>,
        solve: V,
    ) -> V::Solution {
        // A held load is the same in all lanes, and is spread over them without gathering.
        let load = if loads.held { loads.at(0).splat() } else { LinksLoad::gather(|lane| loads.at(lane)) };
        solve.solve(&Stages { kernel: &self.lanes, load, smooth: &self.smooth })
    }
}
