//! Gauss–Legendre collocation as a [`Collocation`]: J. C. Butcher, "Implicit Runge–Kutta Processes", Math. Comp. 18 (1964).
//!
//! Applied to x' = v, v' = a with the stage accelerations as slopes,
//!
//! ```text
//! vᵢ = v + h Σⱼ aᵢⱼ Aⱼ      xᵢ = x + cᵢ h v + h² Σⱼ (a²)ᵢⱼ Aⱼ      v⁺ = v + h Σ bⱼ Aⱼ      x⁺ = x + h v + h² Σ (bᵀa)ⱼ Aⱼ
//! ```

use super::collocation::{Collocation, LEVELS, Step};

/// A Gauss–Legendre method of S stages.
pub(super) struct Tableau<const S: usize> {
    pub a: [[f64; S]; S],
    pub b: [f64; S],
    pub c: [f64; S],
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

/// Beyond ωh of about 2 the method, though stable for a linear arm, gains energy from the nonlinearity or finds no stages.
const PHASE_PER_PART_RAD: f64 = 1.5;

impl<const S: usize> Tableau<S> {
    /// The method for steps of `h_s` and their parts.
    pub fn collocation(&self, h_s: f64) -> Collocation<S> {
        let levels = (0..LEVELS).map(|level| self.step(h_s / f64::from(1_u32 << level))).collect();
        Collocation { linear: [[0.0; 4]; 2], levels, phase_per_part_rad: PHASE_PER_PART_RAD }
    }

    fn step(&self, h: f64) -> Step<S> {
        let squared = |i: usize, j: usize| (0..S).map(|k| self.a[i][k] * self.a[k][j]).sum::<f64>();
        let b_bar = |j: usize| (0..S).map(|i| self.b[i] * self.a[i][j]).sum::<f64>();
        let drift = |t: f64| [[0.0, 0.0, t, 0.0], [0.0, 0.0, 0.0, t], [0.0; 4], [0.0; 4]];
        let mut start = self.c.map(|c| drift(c * h));
        for matrix in &mut start {
            (0..4).for_each(|n| matrix[n][n] = 1.0);
        }
        let slope = |x: f64, v: f64| [[x, 0.0], [0.0, x], [v, 0.0], [0.0, v]];
        Step {
            h_s: h,
            c: self.c,
            b: self.b,
            start,
            stage: core::array::from_fn(|i| core::array::from_fn(|j| slope(h * h * squared(i, j), h * self.a[i][j]))),
            end: drift(h),
            end_low: [[0.0; 4]; 4],
            weights: core::array::from_fn(|j| slope(h * h * b_bar(j), h * self.b[j])),
        }
    }
}
