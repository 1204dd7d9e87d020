//! Gauss–Legendre collocation, solved by Newton's method.
//!
//! With the stage accelerations Aᵢ as unknowns, the stages of the second-order system are
//!
//! ```text
//! vᵢ = v + h Σⱼ aᵢⱼ Aⱼ        xᵢ = x + cᵢ h v + h² Σⱼ (A²)ᵢⱼ Aⱼ        Gᵢ = Aᵢ − α̈(tᵢ, xᵢ, vᵢ) = 0
//! ```
//!
//! and Newton's matrix has the blocks δᵢⱼ I − h² (A²)ᵢⱼ ∂α̈/∂α − h aᵢⱼ ∂α̈/∂α̇. Then v⁺ = v + h Σ bᵢ Aᵢ and
//! x⁺ = x + h v + h² Σ b̄ᵢ Aᵢ with b̄ = bᵀA. Newton takes the stiff linear part exactly, so it converges where fixed-point
//! iteration, which needs ωh < 1, does not. Tableaux: J. C. Butcher, "Implicit Runge–Kutta Processes", Math. Comp. 18 (1964).

use nalgebra::{Const, DimMin, SMatrix, SVector, ToTypenum, Vector2};

use super::{Excitation, IntegrateError};
use crate::arm::{Arm, State};

/// Newton's limit: where it converges it needs two to five iterations.
const MAX_ITERATIONS: usize = 8;
/// A relative correction below this is the last one: the next would be its square, below rounding.
const CORRECTION_LIMIT: f64 = 1e-9;

/// A Gauss–Legendre method of S stages.
pub(super) struct Tableau<const S: usize> {
    a: [[f64; S]; S],
    b: [f64; S],
    c: [f64; S],
}

const SQRT_3: f64 = 1.732_050_807_568_877_2;
const SQRT_15: f64 = 3.872_983_346_207_417;

/// Two stages, order 4.
pub(super) const GL4: Tableau<2> = Tableau {
    a: [[0.25, 0.25 - SQRT_3 / 6.0], [0.25 + SQRT_3 / 6.0, 0.25]],
    b: [0.5, 0.5],
    c: [0.5 - SQRT_3 / 6.0, 0.5 + SQRT_3 / 6.0],
};

/// Three stages, order 6.
pub(super) const GL6: Tableau<3> = Tableau {
    a: [
        [5.0 / 36.0, 2.0 / 9.0 - SQRT_15 / 15.0, 5.0 / 36.0 - SQRT_15 / 30.0],
        [5.0 / 36.0 + SQRT_15 / 24.0, 2.0 / 9.0, 5.0 / 36.0 - SQRT_15 / 24.0],
        [5.0 / 36.0 + SQRT_15 / 30.0, 2.0 / 9.0 + SQRT_15 / 15.0, 5.0 / 36.0],
    ],
    b: [5.0 / 18.0, 4.0 / 9.0, 5.0 / 18.0],
    c: [0.5 - SQRT_15 / 10.0, 0.5, 0.5 + SQRT_15 / 10.0],
};

impl<const S: usize> Tableau<S> {
    /// (A²)ᵢⱼ.
    fn a_squared(&self, i: usize, j: usize) -> f64 {
        (0..S).map(|k| self.a[i][k] * self.a[k][j]).sum()
    }

    /// b̄ⱼ = Σᵢ bᵢ aᵢⱼ.
    fn b_bar(&self, j: usize) -> f64 {
        (0..S).map(|i| self.b[i] * self.a[i][j]).sum()
    }

    /// The state at stage i, for stage accelerations `slopes`.
    fn stage(&self, i: usize, h: f64, state: &State, slopes: &[Vector2<f64>; S]) -> State {
        let mut alpha_rad = state.alpha_rad + state.alpha_dot_rad_s * (self.c[i] * h);
        let mut alpha_dot_rad_s = state.alpha_dot_rad_s;
        for (j, slope) in slopes.iter().enumerate() {
            alpha_rad += slope * (h * h * self.a_squared(i, j));
            alpha_dot_rad_s += slope * (h * self.a[i][j]);
        }
        State { alpha_rad, alpha_dot_rad_s }
    }
}

/// The largest ωh of a part of a step, rad; ω at the deflection where the step starts.
const PHASE_PER_PART_RAD: f64 = 1.5;
/// A step is divided into at most this many parts.
const MAX_PARTS: u32 = 256;

/// One step of a method of S stages, N = 2 S unknowns.
///
/// Far from the pose the arm can be several times as stiff as in it, and beyond ωh of about 2 the scheme, though stable for
/// a linear arm, gains energy from the nonlinearity or finds no stages at all. So a step with ωh > 1.5 where it starts is
/// made in equal parts below that, and in twice as many as long as Newton's method does not converge.
pub(super) fn step<const S: usize, const N: usize>(
    tableau: &Tableau<S>,
    arm: &Arm,
    t_s: f64,
    h: f64,
    state: &State,
    excitation: &impl Excitation,
) -> Result<State, IntegrateError>
where
    Tableau<S>: Unknowns<N>,
    Const<N>: ToTypenum + DimMin<Const<N>, Output = Const<N>>,
{
    let phase_rad = h * arm.angular_frequency_bound_rad_s(&state.alpha_rad);
    // A phase that is no number makes one part, and that part says what is wrong.
    let mut parts = libm::ceil(phase_rad / PHASE_PER_PART_RAD).max(1.0) as u32;
    loop {
        let part_s = h / f64::from(parts);
        let result = (0..parts).try_fold(*state, |state, k| {
            undivided_step(tableau, arm, t_s + f64::from(k) * part_s, part_s, &state, excitation)
        });
        if result.is_ok() || 2 * parts > MAX_PARTS {
            return result;
        }
        parts *= 2;
    }
}

fn undivided_step<const S: usize, const N: usize>(
    tableau: &Tableau<S>,
    arm: &Arm,
    t_s: f64,
    h: f64,
    state: &State,
    excitation: &impl Excitation,
) -> Result<State, IntegrateError>
where
    Tableau<S>: Unknowns<N>,
    Const<N>: ToTypenum + DimMin<Const<N>, Output = Const<N>>,
{
    let loads: [_; S] = core::array::from_fn(|i| excitation.load(t_s + tableau.c[i] * h));
    let mut slopes = [arm.acceleration(state, &excitation.load(t_s)); S];
    let mut correction = f64::INFINITY;
    for _ in 0..MAX_ITERATIONS {
        let mut residual = SVector::<f64, N>::zeros();
        let mut matrix = SMatrix::<f64, N, N>::identity();
        for i in 0..S {
            let stage = tableau.stage(i, h, state, &slopes);
            let jacobian = arm.acceleration_jacobian(&stage, &loads[i]);
            residual.fixed_rows_mut::<2>(2 * i).copy_from(&(slopes[i] - jacobian.acceleration_rad_s2));
            for j in 0..S {
                let block = jacobian.by_alpha * (h * h * tableau.a_squared(i, j))
                    + jacobian.by_alpha_dot * (h * tableau.a[i][j]);
                let mut target = matrix.fixed_view_mut::<2, 2>(2 * i, 2 * j);
                target -= block;
            }
        }
        if !matrix.lu().solve_mut(&mut residual) {
            break;
        }
        for (i, slope) in slopes.iter_mut().enumerate() {
            *slope -= residual.fixed_rows::<2>(2 * i);
        }
        let size = slopes.iter().fold(f64::MIN_POSITIVE, |size, slope| size.max(slope.amax()));
        correction = residual.amax() / size;
        if correction < CORRECTION_LIMIT {
            return Ok(finish(tableau, h, state, &slopes));
        }
    }
    Err(IntegrateError::NoConvergence { t_s, iterations: MAX_ITERATIONS, correction })
}

/// The state at the end of the step from the solved stage accelerations.
fn finish<const S: usize>(tableau: &Tableau<S>, h: f64, state: &State, slopes: &[Vector2<f64>; S]) -> State {
    let mut alpha_rad = state.alpha_rad + state.alpha_dot_rad_s * h;
    let mut alpha_dot_rad_s = state.alpha_dot_rad_s;
    for (j, slope) in slopes.iter().enumerate() {
        alpha_rad += slope * (h * h * tableau.b_bar(j));
        alpha_dot_rad_s += slope * (h * tableau.b[j]);
    }
    State { alpha_rad, alpha_dot_rad_s }
}

/// Ties the number of unknowns to the number of stages.
pub(super) trait Unknowns<const N: usize> {}
impl Unknowns<4> for Tableau<2> {}
impl Unknowns<6> for Tableau<3> {}
