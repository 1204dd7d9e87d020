//! Gauss–Legendre collocation as a [`Collocation`]: J. C. Butcher, "Implicit Runge–Kutta Processes", Math. Comp. 18
//! (1964).
//!
//! Applied to x' = v, v' = a with the stage accelerations as slopes,
//!
//! ```text
//! vᵢ = v + h Σⱼ aᵢⱼ Aⱼ     xᵢ = x + cᵢ h v + h² Σⱼ (a²)ᵢⱼ Aⱼ     v⁺ = v + h Σ bⱼ Aⱼ     x⁺ = x + h v + h² Σ (bᵀa)ⱼ Aⱼ
//! ```

use alloc::vec::Vec;
use core::array;

use super::collocation::{Collocation, LEVELS, Matrix, Step, least_level};
use super::double_double::DoubleDouble;
use crate::arm::Arm;

/// A Gauss–Legendre method of S stages; its coefficients are p + q √n with rational p and q.
pub(super) struct Tableau<const S: usize> {
    n: f64,
    a: [[Coefficient; S]; S],
    b: [Coefficient; S],
    c: [Coefficient; S],
    /// The largest ωh of a part in small vibration, rad; see [`Collocation::least_level`].
    phase_at_rest_rad: f64,
}

/// p and q, each as numerator and denominator.
type Coefficient = [[f64; 2]; 2];

const fn rational(numerator: f64, denominator: f64) -> Coefficient {
    [[numerator, denominator], [0.0, 1.0]]
}

/// Two stages, order 4.
pub(super) const GL4: Tableau<2> = Tableau {
    n: 3.0,
    a: [[rational(1.0, 4.0), [[1.0, 4.0], [-1.0, 6.0]]], [[[1.0, 4.0], [1.0, 6.0]], rational(1.0, 4.0)]],
    b: [rational(1.0, 2.0), rational(1.0, 2.0)],
    c: [[[1.0, 2.0], [-1.0, 6.0]], [[1.0, 2.0], [1.0, 6.0]]],
    phase_at_rest_rad: 0.5,
};

/// Three stages, order 6.
pub(super) const GL6: Tableau<3> = Tableau {
    n: 15.0,
    a: [
        [rational(5.0, 36.0), [[2.0, 9.0], [-1.0, 15.0]], [[5.0, 36.0], [-1.0, 30.0]]],
        [[[5.0, 36.0], [1.0, 24.0]], rational(2.0, 9.0), [[5.0, 36.0], [-1.0, 24.0]]],
        [[[5.0, 36.0], [1.0, 30.0]], [[2.0, 9.0], [1.0, 15.0]], rational(5.0, 36.0)],
    ],
    b: [rational(5.0, 18.0), rational(4.0, 9.0), rational(5.0, 18.0)],
    c: [[[1.0, 2.0], [-1.0, 10.0]], rational(1.0, 2.0), [[1.0, 2.0], [1.0, 10.0]]],
    phase_at_rest_rad: 1.0,
};

/// Beyond ωh of about 2 the method, though stable for a linear arm, gains energy from the nonlinearity or finds no
/// stages.
const PHASE_PER_PART_RAD: f64 = 1.5;

impl<const S: usize> Tableau<S> {
    /// The method for steps of `h_s` of `arm`, and their parts.
    pub fn collocation(&self, arm: &Arm, h_s: f64) -> Collocation<S> {
        let levels: Vec<Step<S>> = (0..LEVELS).map(|level| self.step(h_s / f64::from(1_u32 << level))).collect();
        let least_level = least_level(arm, &levels, self.phase_at_rest_rad);
        Collocation { linear: [[0.0; 4]; 2], levels, least_level, phase_per_part_rad: PHASE_PER_PART_RAD }
    }

    /// The weights.
    pub fn b(&self) -> [DoubleDouble; S] {
        self.b.map(|coefficient| self.value(coefficient))
    }

    /// The nodes.
    pub fn c(&self) -> [DoubleDouble; S] {
        self.c.map(|coefficient| self.value(coefficient))
    }

    fn value(&self, [p, q]: Coefficient) -> DoubleDouble {
        let ratio = |[numerator, denominator]: [f64; 2]| DoubleDouble::new(numerator) / DoubleDouble::new(denominator);
        ratio(p) + ratio(q) * DoubleDouble::sqrt(self.n)
    }

    fn step(&self, h_s: f64) -> Step<S> {
        let a = self.a.map(|row| row.map(|coefficient| self.value(coefficient)));
        let (b, c) = (self.b(), self.c());
        let h = DoubleDouble::new(h_s);
        let sum = |term: &dyn Fn(usize) -> DoubleDouble| (0..S).map(term).fold(DoubleDouble::default(), |s, x| s + x);
        let stage = |i: usize, j: usize| slope(h * h * sum(&|k| a[i][k] * a[k][j]), h * a[i][j]);
        Step {
            h_s,
            c: c.map(|node| node.high),
            b: b.map(|weight| weight.high),
            start: c.map(|node| drift(node * h)),
            stage: array::from_fn(|i| array::from_fn(|j| stage(i, j))),
            end: drift(h),
            weights: array::from_fn(|j| slope(h * h * sum(&|i| b[i] * a[i][j]), h * b[j])),
        }
    }
}

/// What time changes of a motion without acceleration: x by t v.
fn drift(t: DoubleDouble) -> Matrix<4> {
    Matrix::new(|row, column| if column == row + 2 { t } else { DoubleDouble::default() })
}

/// What a slope adds: `x` times it to the angles, `v` times it to the velocities.
fn slope(x: DoubleDouble, v: DoubleDouble) -> Matrix<2> {
    let factor = |row: usize| if row < 2 { x } else { v };
    Matrix::new(|row, column| if row % 2 == column { factor(row) } else { DoubleDouble::default() })
}
